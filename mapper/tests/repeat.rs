//! The same seeds give the same map, with the camera and refinement threads at work.

use fht_descriptor::DescriptorNet;
use fht_proto::{AuthorId, Digest};
use fht_sim::{SimConfig, Simulator, load};
use mapper::{Mapper, MapperConfig, MapperStep};
use std::sync::Arc;

/// Digest and nodes of a map after a minute of simulated time.
fn explore(seed: u64) -> (Digest, usize) {
    let world = Arc::new(load("museum", None, 1).expect("a built-in world"));
    let start = world.start();
    let mut simulator = Simulator::new(world, SimConfig::default(), start, seed);
    let net = DescriptorNet::load(None).expect("the built-in network");
    let mut mapper = Mapper::new(MapperConfig::default(), AuthorId(1), Some(net)).expect("threads");
    let mut frame = simulator.sense_first();
    for _ in 0..300 {
        let Ok(MapperStep::Drive(twist)) = mapper.step(&frame) else { break };
        frame = simulator.step(twist);
    }
    mapper.finish();
    assert_eq!(mapper.check(), Ok(()));
    (mapper.map().digest(), mapper.map().counts().main_nodes)
}

#[test]
fn two_runs_with_cameras_give_one_digest() {
    let (one, nodes) = explore(1);
    assert!(nodes >= 3, "{nodes}");
    assert_eq!(explore(1).0, one);
    assert_ne!(explore(2).0, one, "another seed is another run");
}
