//! SLAM on real logs, against the figures of the field's benchmark. The logs are not part of the
//! project (see `../shared/data`); without them the tests say that they skip.

#![allow(clippy::unwrap_used)] // a test: what goes wrong ends it

use serde_json::Value;
use std::path::Path;
use std::process::Command;

/// Translation, metres, and rotation, degrees, of the relations of a log; both means of absolute
/// errors.
fn errors(log: &str) -> Option<(f64, f64)> {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/lidar");
    let relations = data.join(format!("{log}.relations"));
    if !relations.exists() {
        println!("skipped: {} is not there", relations.display());
        return None;
    }
    let folder = tempfile::tempdir().unwrap();
    let json = folder.path().join("figures.json");
    let status = Command::new(env!("CARGO_BIN_EXE_evaluate"))
        .args(["slam".as_ref(), data.join(log).as_os_str(), relations.as_os_str()])
        .args(["--quiet".as_ref(), "--json".as_ref(), json.as_os_str()])
        .args(["--picture".as_ref(), folder.path().join("map.png").as_os_str()])
        .status()
        .unwrap();
    assert!(status.success());
    let figures: Value = serde_json::from_str(&std::fs::read_to_string(&json).unwrap()).unwrap();
    assert_eq!(figures["relations_missing"], 0);
    Some((figures["translation_mean_m"].as_f64().unwrap(), figures["rotation_mean_deg"].as_f64().unwrap()))
}

#[test]
fn the_intel_research_lab_and_aces_are_mapped_as_well_as_we_say() {
    for (log, most_m, most_deg) in [("intel", 0.03, 0.6), ("aces", 0.045, 0.5)] {
        let Some((metres, degrees)) = errors(log) else { return };
        assert!(metres <= most_m && degrees <= most_deg, "{log}: {metres} m, {degrees}°");
    }
}
