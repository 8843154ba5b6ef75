//! A run that is told to end has no time to finish its map: what is left out leaves it whole.

#![allow(clippy::unwrap_used, reason = "helpers of tests, where a panic is the failure")]

use fht_map::MapState;
use fht_map::graph::dijkstra::distances_from;
use fht_proto::AuthorId;
use fht_sim::{SimConfig, Simulator};
use mapper::{Haste, Mapper, MapperConfig, MapperStep};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// So often there is time.
const ENOUGH: usize = 150;

/// The map after two minutes in the museum, finished in some way.
fn explored(finish: impl FnOnce(&mut Mapper)) -> MapState {
    let world = Arc::new(fht_sim::load("museum", None, 1).unwrap());
    let sim = SimConfig { camera_every: 0, ..SimConfig::default() };
    let start = world.start();
    let mut simulator = Simulator::new(world, sim, start, 1);
    let mut mapper = Mapper::new(MapperConfig::default(), AuthorId(1), None).unwrap();
    let mut frame = simulator.sense_first();
    for _ in 0..600 {
        let MapperStep::Drive(twist) = mapper.step(&frame).unwrap() else { break };
        frame = simulator.step(twist);
    }
    finish(&mut mapper);
    mapper.map().clone()
}

#[test]
fn a_map_that_is_finished_in_a_hurry_hangs_together_and_lacks_only_the_last_touches() {
    let whole = explored(Mapper::finish);
    let at_once = explored(|mapper| mapper.finish_while(&Haste::while_there_is(|| false)));
    let some = explored(|mapper| {
        // Enough for SLAM, not for all free space.
        let asked = AtomicUsize::new(0);
        mapper.finish_while(&Haste::while_there_is(move || asked.fetch_add(1, Ordering::Relaxed) < ENOUGH));
    });
    let nodes = [&at_once, &some, &whole].map(|map| map.nodes().count());
    assert!(nodes[0] > 3 && nodes[0] < nodes[1] && nodes[1] < nodes[2], "{nodes:?}");
    for map in [&at_once, &some] {
        let first = map.nodes().next().unwrap().id;
        assert_eq!(distances_from(map, first).len(), map.nodes().count(), "every node can be reached");
    }
}
