//! A robot in a room that the map does not have never says that it knows where it is.

#![allow(clippy::unwrap_used)] // tests may panic

use fht_descriptor::DescriptorNet;
use fht_eval::systems::ours::Ours;
use fht_eval::{Member, RecordedDrive, Sight, TeamTask, TrialOutcome, explore_as_team, run_trial};
use fht_localization::landmarks::Landmarks;
use fht_perception::pose::{Pose2, pose};
use fht_sim::{World, load};
use mapper::MapperConfig;
use std::f64::consts::TAU;
use std::path::Path;
use std::sync::Arc;

/// The first room, which is mapped: 20 m × 10 m, its corner at (1, 1).
const MAPPED: [f64; 2] = [20.0, 10.0];
/// Where the second room begins, metres.
const SECOND_M: f64 = 26.0;
/// How far a robot drives before it may give up, metres.
const DRIVE_M: f64 = 40.0;

/// Draws two closed rooms side by side as a Nav2 map: the mapped one, and one of `second` metres.
fn two_rooms(dir: &Path, second: [f64; 2]) -> Arc<World> {
    const CELL_M: f64 = 0.05;
    const WALL_M: f64 = 0.2;
    let (width, height) = (960, 260);
    let inside = |x: f64, y: f64, left: f64, size: [f64; 2], by: f64| {
        x > left - by && x < left + size[0] + by && y > 1.0 - by && y < 1.0 + size[1] + by
    };
    let mut picture = format!("P5\n{width} {height}\n255\n").into_bytes();
    for row in (0..height).rev() {
        for column in 0..width {
            let (x, y) = ((f64::from(column) + 0.5) * CELL_M, (f64::from(row) + 0.5) * CELL_M);
            let is_in = |by: f64| inside(x, y, 1.0, MAPPED, by) || inside(x, y, SECOND_M, second, by);
            let shade = if is_in(0.0) {
                254
            } else if is_in(WALL_M) {
                0
            } else {
                205
            };
            picture.push(shade);
        }
    }
    std::fs::write(dir.join("rooms.pgm"), picture).unwrap();
    let map = "image: rooms.pgm\nresolution: 0.05\norigin: [0.0, 0.0, 0.0]\nnegate: 0\noccupied_thresh: 0.65\n\
               free_thresh: 0.196\n";
    let file = dir.join("rooms.yaml");
    std::fs::write(&file, map).unwrap();
    Arc::new(load(file.to_str().unwrap(), None, 1).unwrap())
}

/// A start somewhere in a room, by the seed.
fn start(seed: u32, left: f64, size: [f64; 2]) -> Pose2 {
    let draw = |step: f64| (f64::from(seed) * step).fract();
    let along = |size_m: f64, share: f64| 0.7 + (size_m - 1.4) * share;
    pose(left + along(size[0], draw(0.618_034)), 1.0 + along(size[1], draw(0.754_878)), TAU * draw(0.569_840))
}

/// As many starts in each room as `FHT_STARTS` says, or a few.
fn starts() -> u32 {
    std::env::var("FHT_STARTS").ok().and_then(|text| text.parse().ok()).unwrap_or(3)
}

/// What comes of each start, on all cores.
fn of_all_seeds(try_seed: impl Fn(u32) -> TrialOutcome + Sync) -> Vec<(u32, TrialOutcome)> {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let share = |thread: usize| (1..=starts()).skip(thread).step_by(threads);
    let of_share = |thread| share(thread).map(|seed| (seed, try_seed(seed))).collect::<Vec<_>>();
    let of_share = &of_share;
    std::thread::scope(|scope| {
        let running: Vec<_> = (0..threads).map(|thread| scope.spawn(move || of_share(thread))).collect();
        running.into_iter().flat_map(|thread| thread.join().unwrap()).collect()
    })
}

/// A world of two rooms, of which the first is mapped.
struct Rooms {
    world: Arc<World>,
    world_from_map: Pose2,
    landmarks: Landmarks,
    cameras: bool,
}

impl Rooms {
    fn explored(second: [f64; 2], cameras: bool) -> Self {
        let dir = tempfile::tempdir().unwrap();
        let world = two_rooms(dir.path(), second);
        let members = vec![Member::at(pose(5.0, 6.0, 0.0))];
        let task = TeamTask { members, seed: 1, cameras, mapper: MapperConfig::default(), most_s: 600.0 };
        let explored = explore_as_team(&world, &task, |_, _| {}).unwrap();
        let mut landmarks = Landmarks::default();
        landmarks.refresh(&explored.map);
        Self { world, world_from_map: explored.world_from_map, landmarks, cameras }
    }

    /// How often a robot that is set down in a room declares a wrong place, and whether the right
    /// one.
    fn tried(&self, seed: u32, left: f64, size: [f64; 2]) -> TrialOutcome {
        let drive = RecordedDrive::record(&self.world, start(seed, left, size), u64::from(seed), DRIVE_M);
        let mut net = DescriptorNet::load(None).unwrap();
        let mut sight = Sight::new(&drive, &mut net);
        run_trial(&mut Ours::new(&self.landmarks, self.cameras), &mut sight, &self.world_from_map)
    }
}

fn no_wrong_place_is_declared(cameras: bool) {
    let mut wrong = Vec::new();
    for second in [MAPPED, [18.0, 9.0]] {
        let rooms = Rooms::explored(second, cameras);
        for (room, left, size) in [("another room", SECOND_M, second), ("the mapped room", 1.0, MAPPED)] {
            let outcomes = of_all_seeds(|seed| rooms.tried(seed, left, size));
            let right = outcomes.iter().filter(|(_, outcome)| outcome.right.is_some()).count();
            let false_fixes = outcomes.iter().filter(|(_, outcome)| outcome.false_fixes > 0);
            let seeds: Vec<u32> = false_fixes.map(|(seed, _)| *seed).collect();
            // A rectangle fits in two ways, and plain walls look alike: it may not know in either.
            let (wrong_count, of) = (seeds.len(), starts());
            println!("{room} beside one of {second:?} m: wrong in {wrong_count}, right in {right} of {of}");
            wrong.extend(seeds.into_iter().map(|seed| (room, second, seed)));
        }
    }
    assert!(wrong.is_empty(), "wrong places were declared: {wrong:?}");
}

#[test]
fn a_room_that_fits_in_two_ways_is_not_told_by_a_rival_that_slid_along_its_wall() {
    // With this seed the robot follows a long wall. What it sees last does not say how far along it
    // the robot is, so that the room turned by half a turn fitted only 0.4 m beside its place, and
    // seemed to explain less.
    let outcome = Rooms::explored([18.0, 9.0], true).tried(9, 1.0, MAPPED);
    assert_eq!(outcome.false_fixes, 0);
    // Here the robot leaves a corner for the middle of a room like the mapped one. Held to a wall
    // each, its views of the room turned by half a turn were 0.2 m from where they fit.
    let outcome = Rooms::explored(MAPPED, true).tried(43, SECOND_M, MAPPED);
    assert_eq!(outcome.false_fixes, 0);
}

#[test]
fn a_robot_in_a_room_that_is_not_on_the_map_does_not_know_where_it_is_by_its_scanner() {
    no_wrong_place_is_declared(false);
}

#[test]
#[ignore = "takes minutes; with FHT_STARTS=100 it is the measure of how often a wrong place is declared"]
fn a_robot_in_a_room_that_is_not_on_the_map_does_not_know_where_it_is_with_cameras() {
    no_wrong_place_is_declared(true);
}
