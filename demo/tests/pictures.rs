//! `mapper explore --picture` and `mapper replay --picture` draw the map that they made, under a
//! name that says what it is of.
#![allow(clippy::unwrap_used)] // tests may panic

use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output};

/// Runs the mapper in a folder.
fn mapper(folder: &Path, args: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_handoff"));
    command.current_dir(folder).args(["role", "mapper", "--"]).args(args).output().unwrap()
}

/// Width and height of a PNG file.
fn size(file: &Path) -> (u32, u32) {
    let bytes = std::fs::read(file).unwrap();
    assert!(bytes.starts_with(b"\x89PNG\r\n\x1a\n"), "{}", file.display());
    let number = |at: usize| u32::from_be_bytes(bytes[at..at + 4].try_into().unwrap());
    (number(16), number(20))
}

#[test]
fn pictures_are_made_where_they_are_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let short = ["explore", "--offline", "--no-cameras", "--quiet", "--max-sim", "20"];
    let explored = mapper(path, &[&short[..], &["--seed", "3", "--record", "run.mcap", "--picture"]].concat());
    let said = String::from_utf8(explored.stdout).unwrap();
    assert!(said.contains("picture     explore-museum-3.png"), "{said}");
    let (width, height) = size(&path.join("explore-museum-3.png"));
    assert!(width > 1200 || height > 1200, "{width} × {height}");

    let report = mapper(path, &["replay", "run.mcap", "--offline", "--no-cameras", "--quiet", "--json", "--picture"]);
    let report: Value = serde_json::from_slice(&report.stdout).unwrap();
    assert_eq!(report["picture"], "replay-run.png", "{report}");
    // It is the same map, but for its title.
    assert_eq!(size(&path.join("replay-run.png")), (width, height));

    mapper(path, &[&short[..], &["--picture", "mine.png"]].concat());
    assert!(size(&path.join("mine.png")).0 > 500);
    let without = mapper(path, &[&short[..], &["--json"]].concat());
    let without: Value = serde_json::from_slice(&without.stdout).unwrap();
    assert!(without.get("picture").is_none(), "{without}");
    let pictures = std::fs::read_dir(path)
        .unwrap()
        .filter(|file| file.as_ref().unwrap().path().extension().is_some_and(|ending| ending == "png"));
    assert_eq!(pictures.count(), 3);
}

#[test]
fn what_cannot_become_a_picture_is_refused_before_the_robot_drives() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("run.mcap"), "precious").unwrap();
    let cases = [
        ("run.mcap", "ends in .png"),
        ("gone/map.png", "there is no folder gone"),
        ("/proc/map.png", "cannot be written"),
    ];
    for (name, reason) in cases {
        for args in [&["explore", "--offline", "--picture", name][..], &["replay", "run.mcap", "--picture", name]] {
            let output = mapper(folder.path(), args);
            let said = String::from_utf8(output.stderr).unwrap();
            assert!(output.status.code() == Some(2) && said.contains(reason), "{args:?}: {said}");
        }
    }
    assert_eq!(std::fs::read_to_string(folder.path().join("run.mcap")).unwrap(), "precious");
}

#[test]
fn a_full_disk_at_the_end_leaves_the_figures() {
    let folder = tempfile::tempdir().unwrap();
    let full = folder.path().join("full.png");
    std::os::unix::fs::symlink("/dev/full", &full).unwrap();
    let short = ["explore", "--offline", "--no-cameras", "--quiet", "--max-sim", "5"];
    for more in [["--picture", "full.png"], ["--report", "/dev/full"]] {
        let output = mapper(folder.path(), &[&short[..], &more].concat());
        let (figures, said) = (String::from_utf8(output.stdout).unwrap(), String::from_utf8(output.stderr).unwrap());
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(figures.contains("explored    ") && !figures.contains("picture     "), "{more:?}: {figures}");
        assert!(said.contains("cannot be written: No space left on device"), "{more:?}: {said}");
    }
    assert!(Path::new("/dev/full").exists() && full.is_symlink());
}
