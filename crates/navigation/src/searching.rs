//! Driving about while the robot does not know where it is: to places that tell candidates apart,
//! else wandering; steering there, looking around.

use crate::disambiguation::{Ambiguity, DisambiguationConfig, DisambiguationCourse, Surroundings};
use crate::local_map::LocalMap;
use crate::steering::{Steering, SteeringConfig, Steersman};
use crate::wandering::{Wanderer, WanderingConfig};
use fht_perception::frame::{LaserScan, Twist};
use fht_perception::pose::{Point2, Pose2};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Turning shows more of the surroundings, and often that the way is free after all.
pub const LOOK_AROUND: Twist = Twist { linear_mps: 0.0, angular_radps: 0.6 };
/// A place to wander to counts as reached within this distance, metres.
const REACH_M: f64 = 0.4;

/// Moves a robot about so that it sees more.
pub struct Searcher {
    course: DisambiguationCourse,
    wanderer: Wanderer,
    steersman: Steersman,
    rng: ChaCha8Rng,
    /// Where it goes, odometry frame.
    target: Option<Point2>,
}

impl Searcher {
    /// Has been nowhere. `seed` decides where to go when nothing tells places apart.
    #[must_use]
    pub fn new(
        disambiguation: DisambiguationConfig,
        wandering: WanderingConfig,
        steering: SteeringConfig,
        seed: u64,
    ) -> Self {
        Self {
            course: DisambiguationCourse::new(disambiguation),
            wanderer: Wanderer::new(wandering),
            steersman: Steersman::new(steering),
            rng: ChaCha8Rng::seed_from_u64(seed),
            target: None,
        }
    }

    /// The search is over for now, as when the place is known. Where the robot has been is
    /// remembered.
    pub fn end(&mut self) {
        self.course.end();
        self.target = None;
    }

    /// How to move until the next frame. Where the robot may be at several places, it drives to
    /// what tells them apart.
    pub fn step(
        &mut self,
        ambiguity: Option<&Ambiguity<'_>>,
        map: &LocalMap,
        odom_from_base: &Pose2,
        scan: &LaserScan,
    ) -> Twist {
        let here = Point2::from(odom_from_base.translation.vector);
        self.wanderer.visit(here);
        let around = Surroundings { live: map.grid(), odom_from_base, range_m: scan.range_max_m };
        if let Some(point) = self.course.next(ambiguity, &around) {
            self.target = None;
            return match self.steersman.steer(map, odom_from_base, scan, point) {
                Steering::Drive(command) => command,
                Steering::AtEnd { .. } | Steering::NoWay => {
                    self.course.give_up();
                    LOOK_AROUND
                }
            };
        }
        if self.target.is_some_and(|target| (target - here).norm() < REACH_M) {
            self.target = None;
        }
        if self.target.is_none() {
            self.steersman.reset();
            let way = self.wanderer.next(map.grid(), odom_from_base, &mut self.rng);
            self.target = way.and_then(|path| path.last().copied());
        }
        // Nothing to go to: look around.
        let Some(target) = self.target else { return LOOK_AROUND };
        match self.steersman.steer(map, odom_from_base, scan, target) {
            Steering::Drive(command) => command,
            Steering::AtEnd { .. } | Steering::NoWay => {
                self.wanderer.give_up(target);
                self.target = None;
                LOOK_AROUND
            }
        }
    }
}
