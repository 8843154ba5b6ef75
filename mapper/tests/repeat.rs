//! The same seeds give the same map, with the camera and refinement threads at work, whatever time
//! the robot's clock tells.

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
fn a_clock_that_is_ahead_gives_the_same_map_with_later_stamps() {
    /// `sim play` plays a bag that begins at 0 so much later, microseconds.
    const LATER_US: u64 = 1_000_000_000;
    let world = Arc::new(load("office", None, 1).expect("a built-in world"));
    let start = world.start();
    let mut simulator = Simulator::new(world, SimConfig { camera_every: 0, ..SimConfig::default() }, start, 1);
    let mapper = || Mapper::new(MapperConfig::default(), AuthorId(1), None).expect("threads");
    let (mut usual, mut later) = (mapper(), mapper());
    let mut frame = simulator.sense_first();
    for _ in 0..300 {
        let steps = [usual.step(&frame), {
            frame.time_us += LATER_US;
            later.step(&frame)
        }];
        let [Ok(MapperStep::Drive(twist)), Ok(MapperStep::Drive(same))] = steps else { panic!("it drives") };
        assert_eq!(twist, same);
        frame = simulator.step(twist);
    }
    usual.finish();
    later.finish();
    let (increments, shifted) = (usual.take_increments(), later.take_increments());
    assert!(increments.len() > 20 && increments.len() == shifted.len());
    for (increment, shifted) in increments.iter().zip(&shifted) {
        assert!(increment.number == shifted.number && increment.ops == shifted.ops);
        // The first stamp is at 1 µs: 0 is that of the empty map.
        assert!((LATER_US - 1..=LATER_US).contains(&(shifted.hlc_us - increment.hlc_us)));
    }
    assert_ne!(usual.map().digest(), later.map().digest(), "which holds the stamps");
}

#[test]
fn two_runs_with_cameras_give_one_digest() {
    let (one, nodes) = explore(1);
    assert!(nodes >= 3, "{nodes}");
    assert_eq!(explore(1).0, one);
    assert_ne!(explore(2).0, one, "another seed is another run");
}
