//! Driving to a point on the robot's own live grid: plan, follow, do not hit anything, notice when
//! there is no way.

use crate::local_map::LocalMap;
use crate::motion::{PathFollower, PathFollowerConfig, SafetyConfig, safe_command};
use crate::planning::{PlanConfig, Traversable, UnknownCells};
use fht_perception::frame::{LaserScan, Twist};
use fht_perception::pose::{Point2, Pose2};
use fht_proto::Footprint;
use serde::{Deserialize, Serialize};

/// How the robot drives.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct SteeringConfig {
    /// What may be driven over. Unknown cells may: the map says that there is a way, the robot has
    /// not seen it yet.
    pub plan: PlanConfig,
    /// Following the planned way. Its goal tolerance is 0.06 m, less than any place counts as
    /// reached.
    pub follow: PathFollowerConfig,
    /// Stopping before obstacles.
    pub safety: SafetyConfig,
    /// The way is planned anew after this many frames. Default 5 (1 s).
    pub plan_every: usize,
    /// The way may lead this far around robot and target, metres. Default 4.
    pub detour_m: f64,
    /// A target inside an obstacle is replaced by the nearest place within this distance, metres.
    /// Default 0.35.
    pub nudge_m: f64,
    /// Stuck when the robot has moved less than 5 cm and turned less than 0.3 rad in this many
    /// frames. Default 25 (5 s).
    pub stuck_after: usize,
}

impl Default for SteeringConfig {
    fn default() -> Self {
        Self::of(&Footprint::default())
    }
}

impl SteeringConfig {
    /// For a robot of a footprint.
    #[must_use]
    pub fn of(footprint: &Footprint) -> Self {
        Self {
            plan: PlanConfig { unknown: UnknownCells::Allowed, ..PlanConfig::of(footprint) },
            follow: PathFollowerConfig { goal_tolerance_m: 0.06, ..PathFollowerConfig::default() },
            safety: SafetyConfig::of(footprint),
            plan_every: 5,
            detour_m: 4.0,
            nudge_m: 0.35,
            stuck_after: 25,
        }
    }
}

/// What to do next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Steering {
    /// Drive so.
    Drive(Twist),
    /// The robot stands as near to the target as it can get; the remaining distance in metres.
    AtEnd {
        /// Metres to the target.
        left_m: f64,
    },
    /// There is no way to the target, or the robot is stuck on it.
    NoWay,
}

/// Drives to points, one after the other.
pub struct Steersman {
    config: SteeringConfig,
    follower: Option<PathFollower>,
    target: Option<Point2>,
    age: usize,
    still_since: Option<(Pose2, usize)>,
    frames: usize,
}

impl Steersman {
    /// Stands.
    #[must_use]
    pub fn new(config: SteeringConfig) -> Self {
        Self { config, follower: None, target: None, age: 0, still_since: None, frames: 0 }
    }

    /// Forgets the way, as when the target is given up.
    pub fn reset(&mut self) {
        self.follower = None;
        self.target = None;
        self.still_since = None;
    }

    /// The command that brings the robot nearer to `target` (odometry frame).
    pub fn steer(&mut self, map: &LocalMap, odom_from_base: &Pose2, scan: &LaserScan, target: Point2) -> Steering {
        self.frames += 1;
        self.age += 1;
        let here = Point2::from(odom_from_base.translation.vector);
        let is_same = self.target.is_some_and(|old| (old - target).norm() < 0.05);
        if !is_same {
            self.still_since = None;
        }
        if !is_same || self.follower.is_none() || self.age >= self.config.plan_every {
            self.target = Some(target);
            self.age = 0;
            self.follower = self.plan(map, here, target);
        }
        let Some(follower) = &mut self.follower else { return Steering::NoWay };
        let command = follower.command(odom_from_base);
        if follower.is_done() {
            return Steering::AtEnd { left_m: (target - here).norm() };
        }
        if self.is_stuck(odom_from_base) {
            self.reset();
            return Steering::NoWay;
        }
        Steering::Drive(safe_command(command, scan, &self.config.safety))
    }

    fn plan(&self, map: &LocalMap, here: Point2, target: Point2) -> Option<PathFollower> {
        let near = map.space_around(here, target, self.config.detour_m, &self.config.plan);
        // A way that leads far around is rare, and planning over all that is known costs more.
        self.plan_in(&near, here, target)
            .or_else(|| self.plan_in(&Traversable::new(map.grid(), &self.config.plan), here, target))
    }

    fn plan_in(&self, space: &Traversable, here: Point2, target: Point2) -> Option<PathFollower> {
        let cell = space.nearest_passable(target, self.config.nudge_m)?;
        let end = if cell == space.cell_of(target) { target } else { space.centre(cell) };
        let path = space.shortest_path(here, end)?;
        Some(PathFollower::new(self.config.follow.clone(), space.shorten(&path.points)))
    }

    fn is_stuck(&mut self, odom_from_base: &Pose2) -> bool {
        let frames = self.frames;
        let (at, since) = *self.still_since.get_or_insert((*odom_from_base, frames));
        let moved = at.inverse() * odom_from_base;
        if moved.translation.vector.norm() > 0.05 || moved.rotation.angle().abs() > 0.3 {
            self.still_since = Some((*odom_from_base, frames));
            return false;
        }
        frames - since >= self.config.stuck_after
    }
}
