//! Order and loss: two hundred fleets on bad networks. A longer run: `cargo run --release --bin simulate -- --seeds 2000`.

use fht_tests::simulation::{SimulationConfig, run};

#[test]
fn all_copies_are_one_nothing_acknowledged_is_lost_no_release_changes() {
    let config = SimulationConfig::default();
    let (mut crashes, mut lost, mut folded, mut releases) = (0, 0, 0, 0);
    for seed in 1..=200 {
        let outcome = run(seed, &config).unwrap_or_else(|violation| panic!("seed {seed}: {violation}"));
        crashes += outcome.crashes;
        lost += outcome.lost;
        folded += outcome.folded;
        releases += outcome.releases;
    }
    // Otherwise the runs were too kind.
    assert!(crashes > 200 && lost > 10_000 && folded > 200 && releases > 200, "{crashes} {lost} {folded} {releases}");
}
