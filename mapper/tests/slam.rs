//! SLAM on the simulator, whose truth is known: maps that stay true while the wheels drift, and a
//! robot that is carried away.
#![allow(clippy::unwrap_used)] // tests may panic

use fht_perception::frame::SensorFrame;
use fht_perception::pose::Pose2;
use fht_proto::AuthorId;
use fht_sim::scoring::trajectory_error;
use fht_sim::{SimConfig, Simulator, load};
use fht_worker::Pace;
use mapper::program::main_node_errors;
use mapper::slam::{Anchored, Slam, SlamConfig, SlamUpdate, Tracking};
use mapper::{Mapper, MapperConfig, MapperStep};
use std::sync::Arc;

/// A whole exploration without cameras: the mapper, the frames, and where the robot truly was (in
/// the map frame's start).
struct Run {
    mapper: Mapper,
    frames: Vec<SensorFrame>,
    truth: Vec<Pose2>,
    anchored: Vec<Anchored>,
}

fn explore(world: &str, drift_factor: f64, seed: u64) -> Run {
    let world = Arc::new(load(world, None, 1).unwrap());
    let start = world.start();
    let config = SimConfig { camera_every: 0, drift_factor, ..SimConfig::default() };
    let mut simulator = Simulator::new(world, config, start, seed);
    let mut mapper = Mapper::new(MapperConfig::default(), AuthorId(1), None).unwrap();
    let (mut frames, mut truth, mut anchored) = (Vec::new(), Vec::new(), Vec::new());
    let mut frame = simulator.sense_first();
    loop {
        truth.push(start.inverse() * simulator.truth());
        let step = mapper.step(&frame).unwrap();
        anchored.push(mapper.latest().unwrap().anchored);
        let MapperStep::Drive(twist) = step else { break };
        frames.push(std::mem::replace(&mut frame, simulator.step(twist)));
    }
    mapper.finish();
    Run { mapper, frames, truth, anchored }
}

#[test]
fn a_map_made_with_drifting_wheels_is_true() {
    for (drift, seed) in [(1.0, 1), (2.0, 2)] {
        let run = explore("museum", drift, seed);
        let corrected: Vec<Pose2> = run.anchored.iter().map(|anchored| run.mapper.locate(anchored)).collect();
        let error = trajectory_error(&corrected, &run.truth, &Pose2::identity());
        assert!(error.mean_m < 0.05 && error.mean_deg < 0.5, "drift {drift}, seed {seed}: {error:?}");
        let nodes = main_node_errors(run.mapper.map(), &run.mapper, &run.truth, &Pose2::identity());
        let far = nodes.iter().filter(|error_m| **error_m > 0.05).count();
        assert!(nodes.len() > 15 && far * 20 <= nodes.len(), "drift {drift}, seed {seed}: {nodes:?}");
        // The wheels alone would have been far off.
        let wheels = |frame: &SensorFrame| frames_pose(&run.frames[0], frame);
        let by_wheels: Vec<Pose2> = run.frames.iter().map(wheels).collect();
        assert!(trajectory_error(&by_wheels, &run.truth, &Pose2::identity()).mean_m > 0.2);
    }
}

fn frames_pose(first: &SensorFrame, frame: &SensorFrame) -> Pose2 {
    first.odom_from_base.inverse() * frame.odom_from_base
}

fn off(update: &SlamUpdate, truth: &Pose2) -> (f64, f64) {
    let error = truth.inverse() * update.map_from_base;
    (error.translation.vector.norm(), error.rotation.angle().abs().to_degrees())
}

#[test]
fn a_robot_that_is_carried_to_another_room_knows_that_it_is_lost_and_is_found_again() {
    let run = explore("museum", 1.0, 3);
    let mut slam = Slam::new(SlamConfig::default(), Pace::Repeatable).unwrap();
    for (frame, truth) in run.frames.iter().zip(&run.truth) {
        let update = slam.update(frame);
        assert_ne!(update.tracking, Tracking::Lost);
        assert!(off(&update, truth).0 < 0.15, "{:?}", off(&update, truth));
    }
    // Lifted and put down where it was long ago; the wheels turn on from where they were.
    let end = run.frames[run.frames.len() - 1].odom_from_base;
    let end_us = run.frames[run.frames.len() - 1].time_us;
    let apart = |index: usize| {
        let last = run.truth[run.frames.len() - 1];
        (run.truth[index].translation.vector - last.translation.vector).norm()
    };
    let there = (300..run.frames.len() - 600).max_by(|a, b| apart(*a).total_cmp(&apart(*b))).unwrap();
    assert!(apart(there) > 8.0);
    let begin = run.frames[there].odom_from_base;
    let (mut lost, mut found_at, mut worst) = (0, None, (0.0_f64, 0.0_f64));
    for step in 0..500 {
        let frame = &run.frames[there + step];
        let carried = SensorFrame {
            time_us: end_us + frame.time_us - run.frames[there].time_us + 100_000,
            odom_from_base: end * (begin.inverse() * frame.odom_from_base),
            ..frame.clone()
        };
        let update = slam.update(&carried);
        lost += usize::from(update.tracking == Tracking::Lost);
        let error = off(&update, &run.truth[there + step]);
        if found_at.is_none() && lost > 0 && update.tracking == Tracking::Matched {
            found_at = Some(step);
        }
        if found_at.is_some_and(|found| step > found + 50) {
            worst = (worst.0.max(error.0), worst.1.max(error.1));
        }
    }
    assert!(lost > 0, "it noticed nothing");
    let found_at = found_at.expect("it was not found");
    println!("lost for {lost} frames, found again {found_at} frames after it was carried away, then off by {worst:?}");
    assert!(found_at < 300 && worst.0 < 0.15 && worst.1 < 1.0, "{found_at} {worst:?}");
    // Frames are 0.2 s apart: the search's answer comes within 4 s.
    assert!(lost <= 20, "lost for {lost} frames");
    // What was mapped before is where it was.
    slam.finish();
    let error = run.truth[there].inverse() * slam.locate(&run.anchored[there]);
    assert!(error.translation.vector.norm() < 0.1, "{error}");
}
