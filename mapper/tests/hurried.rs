//! A run that is told to end has no time to finish its map: what is left out leaves it whole.

#![allow(clippy::unwrap_used, reason = "helpers of tests, where a panic is the failure")]

use fht_map::MapState;
use fht_map::graph::dijkstra::distances_from;
use fht_proto::AuthorId;
use fht_sim::{SimConfig, Simulator};
use mapper::{Haste, Mapper, MapperConfig, MapperStep};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

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
    // How often it is asked whether there is time, and then time for all but the last of it.
    let asked = Arc::new(AtomicUsize::new(0));
    let time_for = |times: usize| {
        asked.store(0, Ordering::Relaxed);
        let asked = Arc::clone(&asked);
        Haste::while_there_is(move || asked.fetch_add(1, Ordering::Relaxed) < times)
    };
    let whole = explored(|mapper| mapper.finish_while(&time_for(usize::MAX)));
    let often = asked.load(Ordering::Relaxed);
    let at_once = explored(|mapper| mapper.finish_while(&Haste::while_there_is(|| false)));
    let some = explored(|mapper| mapper.finish_while(&time_for(often - often / 4)));
    let nodes = [&at_once, &some, &whole].map(|map| map.nodes().count());
    assert!(nodes[0] > 3 && nodes[0] < nodes[1] && nodes[1] < nodes[2], "{nodes:?}, asked {often} times");
    for map in [&at_once, &some] {
        let first = map.nodes().next().unwrap().id;
        assert_eq!(distances_from(map, first).len(), map.nodes().count(), "every node can be reached");
    }
}
