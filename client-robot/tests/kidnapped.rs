//! A robot that is carried off notices it, says that it is lost, and finds out where it is again;
//! so does one without cameras.

mod fixture;

use fht_localization::landmarks::Landmarks;
use fht_localization::localizer::{Localizer, LocalizerConfig};
use fht_perception::frame::{SensorFrame, Twist};
use fht_perception::pose::Pose2;
use fht_proto::api::fleet::LocalizationState;
use fht_sim::{SimConfig, Simulator, World};
use fixture::{FixtureConfig, colour_descriptor, map_of};
use std::sync::Arc;

fn museum() -> Arc<World> {
    Arc::new(fht_sim::load("museum", None, 0).expect("a built-in world"))
}

/// Forwards, turning a little, so that it goes round in what room there is.
const ROUND: Twist = Twist { linear_mps: 0.4, angular_radps: 0.35 };

/// A robot that is driven, and sometimes carried.
struct Carried {
    world: Arc<World>,
    sim: SimConfig,
    simulator: Simulator,
    /// What its wheels said when it was last put down.
    odom_from_put: Pose2,
    time_us: u64,
}

impl Carried {
    fn new(world: &Arc<World>, seed: u64, camera_every: u64) -> Self {
        let sim = SimConfig { light_seed: 77, camera_every, ..SimConfig::default() };
        let simulator = Simulator::new(Arc::clone(world), sim.clone(), world.random_free_pose(seed, 0.9), seed);
        Self { world: Arc::clone(world), sim, simulator, odom_from_put: Pose2::identity(), time_us: 0 }
    }

    /// Puts it down elsewhere. The wheels do not notice.
    fn carry(&mut self, seed: u64) {
        let standing = self.simulator.step(Twist::default());
        self.odom_from_put *= standing.odom_from_base;
        let start = self.world.random_free_pose(seed, 0.9);
        self.simulator = Simulator::new(Arc::clone(&self.world), self.sim.clone(), start, seed);
    }

    fn step(&mut self) -> SensorFrame {
        let frame = self.simulator.step(ROUND);
        self.time_us += 200_000;
        SensorFrame { time_us: self.time_us, odom_from_base: self.odom_from_put * frame.odom_from_base, ..frame }
    }

    fn map_from_base(&self) -> Pose2 {
        self.world.start().inverse() * self.simulator.truth()
    }
}

fn error_m(robot: &Carried, estimate: &Pose2) -> f64 {
    (robot.map_from_base().translation.vector - estimate.translation.vector).norm()
}

/// Drives until the robot says that it knows where it is; the states on the way and the distance.
fn drive_until_known(
    robot: &mut Carried,
    localizer: &mut Localizer,
    landmarks: &Landmarks,
) -> (Vec<LocalizationState>, f64) {
    let begin = robot.simulator.driven_m();
    let mut states = Vec::new();
    for _ in 0..400 {
        let frame = robot.step();
        let now = localizer.update(landmarks, &frame, || frame.panorama.as_ref().map(colour_descriptor));
        states.push(now.state);
        let was_unknown = states.iter().any(|state| *state != LocalizationState::Localized);
        if let Some(estimate) = now.map_from_base()
            && was_unknown
        {
            let error = error_m(robot, &estimate);
            assert!(error < 0.1, "declared {error} m off");
            assert!(now.confidence > 0.98, "{}", now.confidence);
            return (states, robot.simulator.driven_m() - begin);
        }
    }
    panic!("not found again: {:?}", states.last());
}

fn is_carried_off_and_finds_itself(camera_every: u64) {
    let world = museum();
    let map = map_of(&world, &FixtureConfig::default(), &mut |panorama| Some(colour_descriptor(panorama)));
    let mut landmarks = Landmarks::default();
    landmarks.refresh(&map);
    for seed in 1..=4 {
        let mut robot = Carried::new(&world, seed, camera_every);
        let mut localizer = Localizer::new(LocalizerConfig::default());
        drive_until_known(&mut robot, &mut localizer, &landmarks);
        for _ in 0..20 {
            let frame = robot.step();
            let now = localizer.update(&landmarks, &frame, || None);
            let estimate = now.map_from_base().unwrap_or_else(|| panic!("seed {seed}: lost without a cause"));
            assert!(error_m(&robot, &estimate) < 0.1, "seed {seed}");
        }
        robot.carry(100 + seed);
        let (states, driven_m) = drive_until_known(&mut robot, &mut localizer, &landmarks);
        assert_eq!(localizer.current().lost, None, "seed {seed}: it knows again");
        assert!(states.contains(&LocalizationState::Lost), "seed {seed}: {states:?}");
        assert!(driven_m < 15.0, "seed {seed}: {driven_m} m");
    }
}

#[test]
fn a_robot_that_is_carried_off_finds_itself() {
    is_carried_off_and_finds_itself(5);
}

#[test]
fn so_does_one_without_cameras() {
    is_carried_off_and_finds_itself(0);
}

#[test]
fn without_a_map_it_knows_nothing() {
    let mut robot = Carried::new(&museum(), 1, 0);
    let mut localizer = Localizer::new(LocalizerConfig::default());
    let landmarks = Landmarks::default();
    for _ in 0..20 {
        let frame = robot.step();
        let now = localizer.update(&landmarks, &frame, || None);
        assert_eq!(now.state, LocalizationState::NotLocalized);
        assert!(now.map_from_base().is_none() && localizer.candidates().is_empty());
    }
}
