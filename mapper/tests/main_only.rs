//! The ablation without support nodes.

#![allow(clippy::unwrap_used, reason = "helpers of tests, where a panic is the failure")]

use fht_map::MapState;
use fht_map::graph::dijkstra::distances_from;
use fht_proto::AuthorId;
use fht_sim::{SimConfig, Simulator};
use mapper::{Mapper, MapperConfig, MapperStep};
use std::sync::Arc;

/// The map after some minutes in the museum, without cameras.
fn explored(config: MapperConfig) -> MapState {
    let world = Arc::new(fht_sim::load("museum", None, 1).unwrap());
    let sim = SimConfig { camera_every: 0, ..SimConfig::default() };
    let start = world.start();
    let mut simulator = Simulator::new(world, sim, start, 1);
    let mut mapper = Mapper::new(config, AuthorId(1), None).unwrap();
    let mut frame = simulator.sense_first();
    for _ in 0..1200 {
        match mapper.step(&frame).unwrap() {
            MapperStep::Drive(twist) => frame = simulator.step(twist),
            MapperStep::Done(_) => break,
        }
    }
    mapper.finish();
    mapper.map().clone()
}

#[test]
fn all_nodes_are_main_nodes_and_they_hang_together() {
    let (both, main_only) = (explored(MapperConfig::default()), explored(MapperConfig::main_only()));
    assert!(both.nodes().count() > both.counts().main_nodes, "the hierarchy has support nodes");
    let count = main_only.nodes().count();
    assert!(count >= 4 && count == main_only.counts().main_nodes, "{count}");
    let first = main_only.nodes().next().unwrap().id;
    assert_eq!(distances_from(&main_only, first).len(), count, "every node can be reached");
}
