//! A small fleet for a moment. The figures: `cargo run --release --bin fleet`.

use fht_tests::fleet::{FleetTrialConfig, run};
use fht_tests::maps::hall;

#[test]
fn all_questions_of_a_small_fleet_are_answered() {
    let folder = tempfile::tempdir().unwrap();
    let config = FleetTrialConfig {
        executable: env!("CARGO_BIN_EXE_fleet").into(),
        data: folder.path().join("data"),
        map: "hall".parse().unwrap(),
        clients: 20,
        head_every_s: 2.0,
        rate_hz: 20.0,
        seconds: 2.0,
        turn_s: 1.0,
        warm_up_s: 0.2,
        alone: 50,
        increments_hz: 2.0,
        seed: 1,
    };
    let report = run(&config, &hall(10, 10)).unwrap();
    assert_eq!((report.path.asked, report.bare.asked, report.failures()), (800, 800, 0), "{report:?}");
    assert_eq!((report.path.latencies.count(), report.bare.latencies.count()), (800, 800), "{report:?}");
    assert_eq!((report.path_alone.count(), report.bare_alone.count()), (50, 50));
    assert_eq!(report.copies_agree, 20, "{report:?}");
    assert!(report.versions > 5 && report.warm_bytes > 0, "{report:?}");
}
