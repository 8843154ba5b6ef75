//! Order and loss: two hundred fleets on bad networks. For a longer run: `cargo run --release --bin
//! simulate -- --seeds 2000`, also with `--servers 3`.

use fht_tests::simulation::{SimulationConfig, SimulationOutcome, run};

fn two_hundred(config: &SimulationConfig) -> SimulationOutcome {
    let mut sum = SimulationOutcome::default();
    for seed in 1..=200 {
        sum += run(seed, config).unwrap_or_else(|violation| panic!("seed {seed}: {violation}"));
    }
    // Otherwise the runs were too kind.
    assert!(sum.partitions > 200 && sum.returns > 100, "{sum:?}");
    sum
}

#[test]
fn all_copies_are_one_nothing_acknowledged_is_lost_no_release_changes() {
    let sum = two_hundred(&SimulationConfig::default());
    // Otherwise the runs were too kind.
    assert!(sum.crashes > 200 && sum.lost > 10_000 && sum.compactions > 200 && sum.releases > 200, "{sum:?}");
}

#[test]
fn the_same_holds_of_several_servers_on_replicated_storages() {
    let sum = two_hundred(&SimulationConfig { servers: 3, ..SimulationConfig::default() });
    assert!(sum.crashes > 200 && sum.lost > 10_000 && sum.releases > 200, "{sum:?}");
}
