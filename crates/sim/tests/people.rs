//! People in simulated buildings: they walk, they are seen, and the same seed gives the same
//! people.

use fht_perception::frame::{SensorFrame, Twist};
use fht_perception::pose::{Point2, pose};
use fht_sim::{PeopleConfig, SimConfig, Simulator, World, load};
use std::sync::Arc;

fn museum() -> Arc<World> {
    Arc::new(load("museum", None, 1).expect("a built-in world"))
}

fn robot(world: &Arc<World>, people: usize, seed: u64) -> Simulator {
    let config = SimConfig { camera_every: 0, ..SimConfig::default() };
    Simulator::new(Arc::clone(world), config, world.start(), 1).among(PeopleConfig::of(people, seed))
}

fn drive(simulator: &mut Simulator, steps: usize) -> Vec<SensorFrame> {
    (0..steps).map(|_| simulator.step(Twist { linear_mps: 0.1, angular_radps: 0.2 })).collect()
}

fn ranges(frames: &[SensorFrame]) -> Vec<u32> {
    frames.iter().flat_map(|frame| frame.scan.ranges_m.iter().map(|range| range.to_bits())).collect()
}

#[test]
fn the_same_seed_gives_the_same_people_and_another_seed_others() {
    let world = museum();
    let run = |people, seed| {
        let mut simulator = robot(&world, people, seed);
        let seen = ranges(&drive(&mut simulator, 100));
        (seen, simulator.people())
    };
    assert_eq!(run(20, 1), run(20, 1));
    assert_ne!(run(20, 1).1, run(20, 2).1);
    let config = SimConfig { camera_every: 0, ..SimConfig::default() };
    let mut alone = Simulator::new(Arc::clone(&world), config, world.start(), 1);
    assert_eq!(run(0, 1).0, ranges(&drive(&mut alone, 100)), "with nobody nothing differs");
}

#[test]
fn people_get_about_and_keep_off_walls_and_each_other() {
    let world = museum();
    let mut simulator = robot(&world, 30, 3);
    let first: Vec<Point2> = simulator.people().iter().map(|body| body.position).collect();
    assert_eq!(first.len(), 30);
    let mut farthest = vec![0.0_f64; first.len()];
    for _ in 0..600 {
        simulator.step(Twist::default());
        let people = simulator.people();
        for (number, body) in people.iter().enumerate() {
            farthest[number] = farthest[number].max((body.position - first[number]).norm());
            assert!(world.plan().clearance_m(body.position) > 0.14, "{:?} is in a wall", body.position);
            let others = people[..number].iter().map(|other| (other.position - body.position).norm());
            assert!(others.fold(f64::INFINITY, f64::min) > 0.37, "somebody is in somebody");
        }
    }
    let walkers = farthest.iter().filter(|metres| **metres > 3.0).count();
    assert!(walkers >= 20, "in two minutes only {walkers} of 30 went anywhere");
}

#[test]
fn the_scanner_sees_somebody_where_he_stands() {
    let world = museum();
    let people = PeopleConfig { start_apart_m: 0.0, ..PeopleConfig::of(30, 5) };
    let in_the_open = |simulator: &Simulator| {
        let found = simulator.people().into_iter().find(|body| world.plan().clearance_m(body.position) > 0.9);
        found.expect("somebody in the open").position
    };
    let at = in_the_open(&robot(&world, 0, 1).among(people.clone()));
    let config = SimConfig { camera_every: 0, ..SimConfig::default() };
    let here = pose(at.x - 0.8, at.y, 0.0);
    let mut simulator = Simulator::new(Arc::clone(&world), config, here, 1).among(people);
    assert_eq!(in_the_open(&simulator), at);
    let ahead_m = f64::from(simulator.sense_first().scan.ranges_m[0]);
    assert!((ahead_m - 0.632).abs() < 0.06, "{ahead_m}");
}
