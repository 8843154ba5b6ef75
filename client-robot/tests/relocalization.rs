//! Robots dropped into the built-in worlds find their place and their goal, or say that they do not
//! know.

mod fixture;
#[path = "fixture/scored.rs"]
mod scored;

use client_robot::mission::{MissionConfig, MissionGoal, Services};
use client_robot::pilot::PilotConfig;
use client_robot::program::MissionReport;
use fht_map::MapState;
use fht_perception::frame::Panorama;
use fht_sim::{SimConfig, Simulator, World};
use fixture::{FixtureConfig, OwnPaths, colour_descriptor, map_of};
use scored::scored;
use std::sync::Arc;

fn world(name: &str) -> Arc<World> {
    Arc::new(fht_sim::load(name, None, 0).expect("a built-in world"))
}

fn describe(panorama: &Panorama) -> Option<fht_proto::Descriptor> {
    Some(colour_descriptor(panorama))
}

fn mission(world: &Arc<World>, map: &MapState, seed: u64, goal: MissionGoal, max_search_m: f64) -> MissionReport {
    let sim = SimConfig { light_seed: 1000 + seed, ..SimConfig::default() };
    let start = world.random_free_pose(seed, 0.4);
    let simulator = Simulator::new(Arc::clone(world), sim, start, seed);
    let pilot = PilotConfig { seed, max_search_m, ..PilotConfig::default() };
    let config = MissionConfig { pilot, ..MissionConfig::default() };
    let mut services = Services { map, paths: &mut OwnPaths(map), describe: &mut describe };
    scored(simulator, config, &goal, &world.start(), &mut services)
}

fn assert_is_right(report: &MissionReport, seed: u64) {
    let error = report.relocalization_error_m.unwrap_or(f64::INFINITY);
    let turn = report.relocalization_error_deg.unwrap_or(f64::INFINITY);
    assert!(error < 0.3 && turn < 3.0, "seed {seed}: {error} m, {turn} degrees");
    let worst = report.worst_error_m.unwrap_or(f64::INFINITY);
    assert!(worst < 0.4, "seed {seed}: worst error {worst} m");
}

#[test]
fn robots_in_the_museum_find_their_place_and_their_goal() {
    let museum = world("museum");
    let fixture = FixtureConfig { spacing_m: 4.0, node_sigma_m: 0.04, node_sigma_rad: 0.004, light_seed: 1 };
    let map = map_of(&museum, &fixture, &mut describe);
    for seed in 1..=3 {
        let report = mission(&museum, &map, seed, MissionGoal::FarNode(seed), 100.0);
        assert_is_right(&report, seed);
        assert!(report.arrived, "seed {seed}: {:?}", report.failure);
        assert!(report.goal_distance_m.is_some_and(|metres| metres < 0.3), "seed {seed}: {:?}", report.goal_distance_m);
        assert_eq!(report.collisions, 0, "seed {seed}");
    }
}

#[test]
fn robots_in_the_office_find_their_place() {
    let office = world("office");
    let fixture = FixtureConfig { node_sigma_m: 0.04, node_sigma_rad: 0.004, ..FixtureConfig::default() };
    let map = map_of(&office, &fixture, &mut describe);
    for seed in 1..=3 {
        assert_is_right(&mission(&office, &map, seed, MissionGoal::None, 100.0), seed);
    }
}

#[test]
fn a_robot_in_another_building_says_that_it_does_not_know() {
    let map = map_of(&world("museum"), &FixtureConfig::default(), &mut describe);
    let office = world("office");
    for seed in 1..=2 {
        let report = mission(&office, &map, seed, MissionGoal::None, 12.0);
        assert!(!report.localized, "seed {seed}: a place in a building that is not on the map");
        assert!(report.failure.is_some());
    }
}

#[test]
fn the_same_seed_gives_the_same_run() {
    let museum = world("museum");
    let map = map_of(&museum, &FixtureConfig::default(), &mut describe);
    let [a, b] = [0, 1].map(|_| mission(&museum, &map, 5, MissionGoal::FarNode(5), 100.0));
    assert_eq!(a.true_trajectory, b.true_trajectory);
    assert_eq!(a.trajectory, b.trajectory);
}
