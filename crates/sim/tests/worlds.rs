//! The built-in worlds have the properties that they promise.

#![allow(clippy::unwrap_used, reason = "helpers of tests, where a panic is the failure")]

use fht_perception::pose::{Point2, pose};
use fht_sim::{FloorPlan, SimConfig, Simulator, World, load, path_length_m};
use std::sync::Arc;

fn world(name: &str, seed: u64) -> World {
    load(name, None, seed).unwrap()
}

fn start(world: &World) -> Point2 {
    Point2::from(world.start().translation.vector)
}

fn extent(plan: &FloorPlan) -> (f64, f64) {
    (plan.width() as f64 * plan.resolution_m(), plan.height() as f64 * plan.resolution_m())
}

#[test]
fn areas_are_as_promised_for_all_seeds() {
    for seed in 1..=5 {
        let museum = world("museum", seed);
        let free = museum.plan().free_area_m2();
        assert!((300.0..=350.0).contains(&free), "museum {seed}: {free}");
        let (width, height) = extent(museum.plan());
        assert!((22.0..26.0).contains(&width) && (18.0..22.0).contains(&height), "{width} x {height}");

        let office = world("office", seed);
        let free = office.plan().free_area_m2();
        assert!((1250.0..=1380.0).contains(&free), "office {seed}: {free}");
        let (width, height) = extent(office.plan());
        assert!((78.0..83.0).contains(&width) && (37.0..41.0).contains(&height), "{width} x {height}");
    }
}

#[test]
fn free_floor_hangs_together_and_passages_are_wide() {
    for (name, seed) in (1..=5).flat_map(|seed| [("museum", seed), ("office", seed)]) {
        let world = world(name, seed);
        let plan = world.plan();
        let free = plan.free_area_m2();
        assert!(plan.clearance_m(start(&world)) > 0.5, "{name} {seed}: start too near a wall");
        let robot = plan.area_m2(&plan.reachable_free(start(&world), 0.2));
        assert!(robot > 0.985 * free, "{name} {seed}: {robot} of {free} m2 at 0.2 m clearance");
        // A robot that needs 0.9 m can go nearly everywhere too: only slits next to things are
        // narrower.
        let wide = plan.area_m2(&plan.reachable_free(start(&world), 0.45));
        assert!(wide > 0.95 * free, "{name} {seed}: {wide} of {free} m2 through passages of 0.9 m");
    }
}

#[test]
fn goals_near_the_museums_start_can_be_reached() {
    let museum = world("museum", 1);
    for goal in [(5.0, 3.0), (8.0, -3.0)] {
        let path = museum.plan().shortest_path(start(&museum), Point2::new(goal.0, goal.1), 0.15);
        assert!(path.is_some(), "{goal:?}");
    }
}

#[test]
fn no_corridor_is_bare_over_a_lidars_range() {
    for seed in 1..=5 {
        let office = world("office", seed);
        let plan = office.plan();
        // Along the long corridor: where each wall stands, as seen across.
        let across = |x: f64, sign: f64| {
            (0..60).map(|step| f64::from(step) * 0.05).find(|&y| plan.is_occupied(x, sign * y)).unwrap_or(3.0)
        };
        let profile: Vec<(f64, f64)> =
            (0..1400).map(|step| f64::from(step) * 0.05 - 4.0).map(|x| (across(x, 1.0), across(x, -1.0))).collect();
        for window in profile.windows(200) {
            let spread = |side: fn(&(f64, f64)) -> f64| {
                let values = || window.iter().map(side);
                values().fold(0.0, f64::max) - values().fold(9.0, f64::min)
            };
            assert!(spread(|p| p.0).max(spread(|p| p.1)) > 0.15, "seed {seed}: 10 m without anything");
        }
    }
}

#[test]
fn random_poses_are_free_repeatable_and_spread() {
    let museum = world("museum", 1);
    let mut quadrants = [0; 4];
    for seed in 0..200 {
        let drawn = museum.random_free_pose(seed, 0.3);
        assert_eq!(drawn, museum.random_free_pose(seed, 0.3));
        let place = Point2::from(drawn.translation.vector);
        assert!(museum.plan().clearance_m(place) >= 0.3);
        assert!(museum.plan().shortest_path(start(&museum), place, 0.2).is_some());
        quadrants[usize::from(place.x > 6.6) + 2 * usize::from(place.y > 1.5)] += 1;
    }
    assert!(quadrants.iter().all(|&count| count > 20), "{quadrants:?}");
}

#[test]
fn shortest_paths_are_taut() {
    // A wall with one gap: the path goes around the gap's corner.
    let (width, height) = (200, 100);
    let occupied = (0..width * height).map(|i| i % width == 100 && i / width < 80).collect();
    let plan = FloorPlan::new(0.05, Point2::origin(), width, height, occupied);
    let (from, to) = (Point2::new(2.0, 1.0), Point2::new(8.0, 1.0));
    let radius = 0.2;
    let path = plan.shortest_path(from, to, radius).unwrap();
    assert_eq!((path.first().copied(), path.last().copied()), (Some(from), Some(to)));
    // Around discs of the radius at the corners (5.0, 4.0) and (5.05, 4.0): a little more than
    // straight to the corner.
    let straight = (Point2::new(5.0, 4.0) - from).norm() + 0.05 + (to - Point2::new(5.05, 4.0)).norm();
    let length = path_length_m(&path);
    assert!(length > straight && length < 1.03 * straight + radius, "{length} against {straight}");
    assert!(path.len() < 12, "{} corners", path.len());
    let blocked = FloorPlan::new(0.05, Point2::origin(), 200, 100, (0..20_000).map(|i| i % 200 == 100).collect());
    assert!(blocked.shortest_path(from, to, radius).is_none());
}

#[test]
fn unknown_worlds_are_refused() {
    let error = load("atlantis", None, 1).err().map(|error| error.to_string()).unwrap_or_default();
    assert!(error.contains("atlantis") && error.contains("museum"), "{error}");
}

#[test]
fn seeds_change_the_pictures_but_light_only_the_light() {
    let picture = |world_seed: u64, light_seed: u64| {
        let config = SimConfig { view_pixels: 48, light_seed, camera_noise_levels: 0.0, ..SimConfig::default() };
        let world = Arc::new(world("museum", world_seed));
        let panorama = Simulator::new(world, config, pose(0.0, 0.0, 0.0), 1).sense_first().panorama;
        panorama.unwrap().views.into_iter().flat_map(image::ImageBuffer::into_raw).collect::<Vec<u8>>()
    };
    let difference =
        |a: &[u8], b: &[u8]| a.iter().zip(b).map(|(&a, &b)| f64::from(a.abs_diff(b))).sum::<f64>() / a.len() as f64;
    let (one, same, other_light, other_world) = (picture(1, 0), picture(1, 0), picture(1, 3), picture(2, 0));
    assert_eq!(one, same);
    assert!(difference(&one, &other_light) > 3.0);
    assert!(difference(&one, &other_world) > 3.0);
}

#[test]
fn a_changed_world_has_another_plan_and_another_scan_but_the_same_walls() {
    let changes = fht_sim::Changes { share: 0.1, seed: 3 };
    for name in ["museum", "office"] {
        let (then, later) = (world(name, 1), fht_sim::load_with(name, None, 1, Some(&changes)).unwrap());
        assert!(then.changes() == 0 && later.changes() >= 3, "{name}: {}", later.changes());
        let differing = then.plan().cells().iter().zip(later.plan().cells()).filter(|(a, b)| a != b).count();
        assert!(differing > 50, "{name}: {differing} cells differ");
        assert!(differing * 20 < then.plan().cells().len(), "{name}: the walls stay");
        let same = fht_sim::load_with(name, None, 1, Some(&changes)).unwrap();
        assert_eq!(same.plan().cells(), later.plan().cells(), "{name}: drawn by the seed");
    }
}

#[test]
fn a_picture_taken_on_its_own_is_the_one_that_the_robot_takes_but_for_noise() {
    let museum = Arc::new(world("museum", 1));
    let config = SimConfig { light_seed: 4, ..SimConfig::default() };
    let mut robot = Simulator::new(Arc::clone(&museum), config.clone(), museum.start(), 7);
    let taken = robot.sense_first().panorama.unwrap();
    let alone = fht_sim::Photographer::new(museum, &config, 9).panorama(&robot.truth(), &[], 0);
    let pairs = taken.views.iter().zip(&alone.views).flat_map(|(a, b)| a.as_raw().iter().zip(b.as_raw()));
    let (sum, count) = pairs.fold((0.0, 0.0), |(sum, count), (a, b)| (sum + f64::from(a.abs_diff(*b)), count + 1.0));
    assert!(sum / count < 4.0, "{} grey levels apart on average", sum / count);
}
