//! The robot and its sensors.

#![allow(clippy::unwrap_used, reason = "helpers of tests, where a panic is the failure")]

use fht_perception::frame::{SensorFrame, Twist};
use fht_perception::grid::{CellState, GridConfig, OccupancyGrid};
use fht_perception::pose::{Point2, Pose2, pose, wrap_angle};
use fht_sim::{SimConfig, Simulator, World, load};
use image::RgbImage;
use std::sync::{Arc, LazyLock};

static MUSEUM: LazyLock<Arc<World>> = LazyLock::new(|| Arc::new(load("museum", None, 1).unwrap()));

fn museum() -> Arc<World> {
    Arc::clone(&MUSEUM)
}

fn commands(count: usize) -> Vec<Twist> {
    let command = |step: usize| Twist { linear_mps: 0.4, angular_radps: 0.8 * (step as f64 / 7.0).sin() };
    (0..count).map(command).collect()
}

/// Everything that a run reported, as bytes.
fn record(config: SimConfig, seed: u64, steps: usize) -> Vec<u8> {
    let world = museum();
    let start = world.start();
    let mut simulator = Simulator::new(world, config, start, seed);
    let mut bytes = bytes_of(&simulator.sense_first());
    for command in commands(steps) {
        bytes.extend(bytes_of(&simulator.step(command)));
    }
    bytes
}

fn bytes_of(frame: &SensorFrame) -> Vec<u8> {
    let mut bytes = frame.time_us.to_le_bytes().to_vec();
    let odometry = frame.odom_from_base;
    for value in [odometry.translation.x, odometry.translation.y, odometry.rotation.angle()] {
        bytes.extend(value.to_le_bytes());
    }
    bytes.extend(frame.scan.ranges_m.iter().flat_map(|range| range.to_le_bytes()));
    for view in frame.panorama.iter().flat_map(|panorama| &panorama.views) {
        bytes.extend(view.as_raw());
    }
    bytes
}

#[test]
fn a_run_repeats_bit_for_bit() {
    let config = SimConfig { view_pixels: 40, ..SimConfig::default() };
    let one = record(config.clone(), 3, 30);
    assert_eq!(one, record(config.clone(), 3, 30));
    assert_ne!(one, record(config, 4, 30));
}

#[test]
fn sensors_draw_from_streams_of_their_own() {
    let run = |config: SimConfig| {
        let world = museum();
        let start = world.start();
        let mut simulator = Simulator::new(world, config, start, 5);
        let frames: Vec<SensorFrame> = commands(20).into_iter().map(|command| simulator.step(command)).collect();
        let scans: Vec<Vec<f32>> = frames.iter().map(|frame| frame.scan.ranges_m.clone()).collect();
        (scans, frames.last().map(|frame| frame.odom_from_base))
    };
    let with_cameras = run(SimConfig { view_pixels: 16, ..SimConfig::default() });
    let without = run(SimConfig { camera_every: 0, ..SimConfig::default() });
    assert_eq!(with_cameras, without);
    let quiet = run(SimConfig { camera_every: 0, lidar_noise_m: 0.0, ..SimConfig::default() });
    assert_eq!(quiet.1, without.1);
}

#[test]
fn frames_come_at_the_lidars_pace_and_pictures_at_theirs() {
    let config = SimConfig { view_pixels: 8, camera_every: 3, ..SimConfig::default() };
    let world = museum();
    let start = world.start();
    let mut simulator = Simulator::new(world, config, start, 1);
    let first = simulator.sense_first();
    assert_eq!((first.time_us, first.panorama.is_some()), (0, true));
    assert_eq!(first.odom_from_base, Pose2::identity());
    for step in 1..=7_u64 {
        let frame = simulator.step(Twist::default());
        assert_eq!(frame.time_us, step * 200_000);
        assert_eq!(frame.panorama.is_some(), step % 3 == 0);
        assert_eq!(frame.scan.ranges_m.len(), 360);
    }
}

#[test]
fn what_is_too_near_for_the_scanner_is_told_from_what_is_too_far() {
    let world = museum();
    let start = world.start();
    let scan_with = |lidar_range_min_m: f64| {
        let config = SimConfig { camera_every: 0, lidar_range_min_m, lidar_noise_m: 0.0, ..SimConfig::default() };
        Simulator::new(Arc::clone(&world), config, start, 1).sense_first().scan
    };
    // A scanner that sees nothing nearer than 3 m stands in for a robot next to a wall.
    let (full, blind) = (scan_with(0.12), scan_with(3.0));
    assert!(full.ranges_m.iter().any(|&range| range < 3.0), "the start is near some wall");
    for (&truth, &range) in full.ranges_m.iter().zip(&blind.ranges_m) {
        let expected = if truth < 3.0 { f32::NEG_INFINITY } else { truth };
        assert!(range.total_cmp(&expected).is_eq(), "{truth} m read as {range}");
    }
    let (mut known, pose) = (OccupancyGrid::new(GridConfig::default()), Pose2::identity());
    (0..3).for_each(|_| known.integrate(&pose, &full));
    let walls = |grid: &OccupancyGrid| {
        let near = full.points_in_base().into_iter().filter(|end| end.coords.norm() < 2.9);
        near.filter(|&end| grid.state_at(end) == CellState::Occupied).count()
    };
    let before = walls(&known);
    (0..50).for_each(|_| known.integrate(&pose, &blind));
    // Beams to farther targets graze some cells.
    assert!(before > 20 && walls(&known) * 10 >= before * 9, "of {before} cells of wall {} are left", walls(&known));
}

#[test]
fn scans_agree_with_the_plan() {
    let world = museum();
    for seed in 0..20 {
        let truth = world.random_free_pose(seed, 0.3);
        let config = SimConfig { camera_every: 0, lidar_noise_m: 0.0, ..SimConfig::default() };
        let mut simulator = Simulator::new(museum(), config, truth, 1);
        let scan = simulator.sense_first().scan;
        for point in scan.points_in_base() {
            // There is an obstacle just behind a hit and none just before it, within a cell's
            // diagonal.
            let hit = truth * point;
            let sensor = truth * Point2::new(-0.032, 0.0);
            let beam = (hit - sensor).normalize();
            let solid = (1..=4).any(|step| {
                let behind = hit + beam * (f64::from(step) * 0.03);
                world.plan().is_occupied(behind.x, behind.y) || world.plan().clearance_m(behind) < 0.05
            });
            assert!(solid, "a hit at {hit} in free floor");
            let before = hit - beam * 0.1;
            let inside = world.plan().is_occupied(before.x, before.y);
            assert!(!inside || world.plan().clearance_m(hit - beam * 0.2) < 0.15, "a hit at {hit} inside a wall");
        }
    }
}

#[test]
fn the_four_views_join_without_a_seam() {
    let config = SimConfig { view_pixels: 160, camera_noise_levels: 0.0, ..SimConfig::default() };
    let column = |view: &RgbImage, x: u32| -> Vec<f64> {
        (0..view.height()).flat_map(|y| view.get_pixel(x, y).0.map(f64::from)).collect()
    };
    let difference = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum::<f64>() / a.len() as f64;
    let (mut seams, mut neighbours) = (0.0, 0.0);
    for seed in 0..60 {
        let start = museum().random_free_pose(seed, 0.5);
        let views = Simulator::new(museum(), config.clone(), start, 1).sense_first().panorama.unwrap().views;
        for left in 0..4 {
            // The view before each one lies to its right: ahead is to the right of left.
            let right = &views[(left + 3) % 4];
            seams += difference(&column(&views[left], 159), &column(right, 0));
            neighbours += difference(&column(&views[left], 158), &column(&views[left], 159));
        }
    }
    assert!(seams < 1.2 * neighbours, "across seams {seams}, within views {neighbours}");
}

#[test]
fn turning_by_a_quarter_swaps_the_views() {
    let config = SimConfig { view_pixels: 64, camera_noise_levels: 0.0, ..SimConfig::default() };
    let views = |yaw: f64| {
        Simulator::new(museum(), config.clone(), pose(0.0, 0.0, yaw), 1).sense_first().panorama.unwrap().views
    };
    let (before, after) = (views(0.0), views(std::f64::consts::FRAC_PI_2));
    for (ahead, left) in after.iter().zip(before.iter().cycle().skip(1)) {
        let changed = ahead.as_raw().iter().zip(left.as_raw()).filter(|(a, b)| a.abs_diff(**b) > 12).count();
        assert!(changed * 100 < ahead.as_raw().len(), "{changed} values differ");
    }
}

/// Drives 50 m along a wide circle and returns the odometry's error in distance per metre and its
/// heading error, radians.
fn drift(seed: u64, drift_factor: f64) -> (f64, f64) {
    let config = SimConfig { camera_every: 0, lidar_beams: 1, drift_factor, ..SimConfig::default() };
    let start = pose(-1.3, 0.0, std::f64::consts::FRAC_PI_2);
    let mut simulator = Simulator::new(museum(), config, start, seed);
    let mut odometry = simulator.sense_first().odom_from_base;
    let (mut counted, mut turned) = (0.0, 0.0);
    for step in 0..500 {
        // Back and forth, turning a little: stays near the start.
        let sign = if step % 10 < 5 { 1.0 } else { -1.0 };
        let next = simulator.step(Twist { linear_mps: 0.5 * sign, angular_radps: 0.0 }).odom_from_base;
        counted += (next.translation.vector - odometry.translation.vector).norm();
        turned += wrap_angle(next.rotation.angle() - odometry.rotation.angle());
        odometry = next;
    }
    assert_eq!(simulator.collisions(), 0);
    assert!((simulator.driven_m() - 50.0).abs() < 0.01, "{}", simulator.driven_m());
    (counted / 50.0 - 1.0, turned)
}

#[test]
fn wheels_drift_as_much_as_configured() {
    let runs: Vec<(f64, f64)> = (0..60).map(|seed| drift(seed, 1.0)).collect();
    let sigma = |values: Vec<f64>| (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt();
    let scale = sigma(runs.iter().map(|run| run.0).collect());
    let heading = sigma(runs.iter().map(|run| run.1).collect());
    assert!((0.014..0.026).contains(&scale), "distance scale sigma {scale}");
    let expected = 0.5_f64.to_radians() * 50.0_f64.sqrt();
    assert!((0.7 * expected..1.3 * expected).contains(&heading), "heading sigma {heading} against {expected}");
    let perfect = drift(1, 0.0);
    assert!(perfect.0.abs() < 1e-9 && perfect.1.abs() < 1e-9);
}

#[test]
fn the_robot_stops_at_walls_and_slides_along_them() {
    let config = SimConfig { camera_every: 0, lidar_beams: 1, ..SimConfig::default() };
    let world = museum();
    for seed in 0..40 {
        let start = world.random_free_pose(seed, 0.2);
        let mut simulator = Simulator::new(museum(), config.clone(), start, seed);
        for _ in 0..150 {
            simulator.step(Twist { linear_mps: 9.0, angular_radps: 0.02 });
            let place = Point2::from(simulator.truth().translation.vector);
            // A plan cell's centre may lie up to 4 cm from the point itself.
            assert!(world.plan().clearance_m(place) > 0.105 - 0.05, "in a wall at {place}");
        }
        assert!(simulator.collisions() > 0, "seed {seed} met no wall in 15 m");
        assert!(simulator.driven_m() <= 15.0 + 1e-6);
    }
}

#[test]
fn nonsense_commands_are_a_stop() {
    let config = SimConfig { camera_every: 0, lidar_beams: 1, ..SimConfig::default() };
    let start = museum().start();
    let mut simulator = Simulator::new(museum(), config, start, 1);
    simulator.step(Twist { linear_mps: f64::NAN, angular_radps: f64::INFINITY });
    assert_eq!(simulator.truth(), start);
}
