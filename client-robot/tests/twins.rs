//! Robots set down in a building of two wings that are alike drive to what tells the wings apart,
//! and are never wrong.

#[path = "fixture/drawing.rs"]
mod drawing;
mod fixture;
#[path = "fixture/scored.rs"]
mod scored;

use client_robot::mission::{MissionConfig, MissionGoal, Services};
use client_robot::pilot::PilotConfig;
use client_robot::program::MissionReport;
use drawing::{Area, draw};
use fht_map::MapState;
use fht_sim::{SimConfig, Simulator, World};
use fixture::{FixtureConfig, OwnPaths, map_of};
use scored::scored;
use std::sync::Arc;

/// How far a robot may drive, metres.
const DRIVE_M: f64 = 40.0;

/// A corridor of 14 m with three rooms on each side: rooms, doors and things.
fn wing(x: f64) -> (Vec<Area>, Vec<Area>, Vec<Area>) {
    let mut rooms = vec![[x, 5.0, x + 14.0, 7.0]];
    let (mut doors, mut things) = (Vec::new(), Vec::new());
    let mut left = x;
    for (number, width) in [4.0, 5.4, 4.3].into_iter().enumerate() {
        let by = 0.4 * number as f64;
        rooms.push([left, 1.0, left + width, 4.7]);
        rooms.push([left, 7.3, left + width, 10.5 + by]);
        doors.push([left + 1.0, 4.6, left + 2.0, 5.1]);
        doors.push([left + 0.6 + by, 6.9, left + 1.6 + by, 7.4]);
        things.push([left + 0.3, 1.2, left + 1.5 + by, 1.9]);
        things.push([left + width - 0.9, 9.0, left + width - 0.2, 10.0]);
        left += width + 0.15;
    }
    (rooms, doors, things)
}

/// Two of them, and a lobby between.
fn twins() -> Arc<World> {
    let ((mut rooms, mut doors, mut things), (more_rooms, more_doors, more_things)) = (wing(1.0), wing(20.3));
    rooms.extend(more_rooms);
    rooms.push([15.3, 3.0, 20.0, 9.0]);
    doors.extend(more_doors);
    doors.extend([[14.9, 5.3, 15.4, 6.7], [19.9, 5.3, 20.4, 6.7]]);
    things.extend(more_things);
    things.push([16.5, 3.4, 18.0, 4.0]);
    let dir = tempfile::tempdir().expect("a folder");
    draw(dir.path(), (35.5, 13.0), &rooms, &doors, &things)
}

/// A robot without cameras that knows its place or has driven far enough.
fn search(world: &Arc<World>, map: &MapState, seed: u64, after_m: f64) -> MissionReport {
    let sim = SimConfig { camera_every: 0, ..SimConfig::default() };
    let simulator = Simulator::new(Arc::clone(world), sim, world.random_free_pose(seed, 0.25), seed);
    let mut pilot = PilotConfig { seed, max_search_m: DRIVE_M, ..PilotConfig::default() };
    pilot.disambiguate.after_m = after_m;
    let config = MissionConfig { pilot, ..MissionConfig::default() };
    let mut services = Services { map, paths: &mut OwnPaths(map), describe: &mut |_| None };
    scored(simulator, config, &MissionGoal::None, &world.start(), &mut services)
}

fn is_right(report: &MissionReport) -> bool {
    let (metres, degrees) = (report.relocalization_error_m, report.relocalization_error_deg);
    metres.is_some_and(|metres| metres < 0.5) && degrees.is_some_and(|degrees| degrees < 3.0)
}

#[test]
fn robots_in_twin_wings_find_out_which_and_sooner_than_by_wandering() {
    let world = twins();
    let fixture = FixtureConfig { spacing_m: 2.5, node_sigma_m: 0.02, node_sigma_rad: 0.002, light_seed: 1 };
    let map = map_of(&world, &fixture, &mut |_| None);
    let (mut right, mut driven_m, mut right_wandering, mut wandered_m) = (0, 0.0, 0, 0.0);
    let seeds = 1..=8;
    let all = seeds.clone().count();
    for seed in seeds {
        let (led, wandering) = (search(&world, &map, seed, 2.0), search(&world, &map, seed, f64::INFINITY));
        for report in [&led, &wandering] {
            assert!(!report.localized || is_right(report), "seed {seed}: {:?} m off", report.relocalization_error_m);
            assert_eq!(report.collisions, 0, "seed {seed}");
        }
        right += usize::from(is_right(&led));
        driven_m += led.relocalization_distance_m.unwrap_or(DRIVE_M);
        right_wandering += usize::from(is_right(&wandering));
        wandered_m += wandering.relocalization_distance_m.unwrap_or(DRIVE_M);
    }
    println!(
        "led: {right} of {all} after {driven_m:.1} m together; wandering: {right_wandering} after {wandered_m:.1} m"
    );
    assert_eq!(right, all, "wandering {right_wandering}");
    assert!(driven_m < 0.8 * wandered_m, "{driven_m} m, by wandering {wandered_m} m");
}
