//! Using the map (paper, Algorithm 2): move until the place is known, ask for a path, drive along it, plan anew when a better
//! estimate or a blocked way turns up. No Zenoh and no simulator in here: frames come in, commands go out.

use crate::blockages::{BlockageConfig, Blockages};
use crate::landmarks::Landmarks;
use crate::local_map::{LocalMap, LocalMapConfig};
use crate::localize::{Localization, LocalizeConfig, Localizer};
use crate::route::{PlannedPath, Route, RouteConfig, Target};
use crate::steering::{Steering, SteeringConfig, Steersman};
use crate::wander::{WanderConfig, Wanderer};
use fht_proto::query::{ErrorCode, ErrorReply};
use fht_proto::{Descriptor, FixedPoint};
use fht_robot::frame::{SensorFrame, Twist};
use fht_robot::motion::speed_limit_ahead;
use fht_robot::pose::{Point2, Pose2};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeSet;

/// How a robot uses the map.
#[derive(Clone, Debug)]
pub struct PilotConfig {
    /// Finding and keeping the place.
    pub localize: LocalizeConfig,
    /// The live grid.
    pub local_map: LocalMapConfig,
    /// Moving about.
    pub wander: WanderConfig,
    /// Following a path of the map.
    pub route: RouteConfig,
    /// Driving.
    pub steering: SteeringConfig,
    /// Frames in a row without a way to the next point before what is in the way counts as blocked. Default 10 (2 s).
    pub blocked_after: usize,
    /// What is done about blocked places.
    pub blockages: BlockageConfig,
    /// A goal that cannot be entered counts as reached this near to it, metres. Default 0.3.
    pub goal_slack_m: f64,
    /// Greatest distance driven without knowing the place, metres. Default 150.
    pub max_search_m: f64,
    /// Greatest time altogether, seconds of the sensors' clock. Default 1500.
    pub max_time_s: f64,
    /// Seed of the wandering.
    pub seed: u64,
}

impl Default for PilotConfig {
    fn default() -> Self {
        Self {
            localize: LocalizeConfig::default(),
            local_map: LocalMapConfig::default(),
            wander: WanderConfig::default(),
            route: RouteConfig::default(),
            steering: SteeringConfig::default(),
            blocked_after: 10,
            blockages: BlockageConfig::default(),
            goal_slack_m: 0.3,
            max_search_m: 150.0,
            max_time_s: 1500.0,
            seed: 0,
        }
    }
}

/// What the robot is to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Task {
    /// Find out where it is.
    Relocalize,
    /// Then drive to a point of the map frame, metres.
    GoTo(Point2),
}

/// Why a task failed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Failure {
    /// The place was not found on the way allowed.
    #[error("not localized after {driven_m:.0} m")]
    NotLocalized {
        /// Distance driven while searching, metres.
        driven_m: f64,
    },
    /// The planner refused.
    #[error("no path: {0}")]
    NoPath(ErrorReply),
    /// Something stands on the goal.
    #[error("the goal is blocked; {left_m:.2} m are left")]
    GoalBlocked {
        /// Distance to the goal, metres.
        left_m: f64,
    },
    /// The time is up.
    #[error("out of time after {seconds:.0} s")]
    Timeout {
        /// Time since the start, seconds.
        seconds: f64,
    },
}

/// How a task ended.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// The place is known (the end of [`Task::Relocalize`]).
    Localized,
    /// The goal is reached.
    Arrived,
    /// It failed.
    Failed(Failure),
}

/// Where paths come from.
pub trait PathSource {
    /// A path between two points of the map frame that leads around the places in `blocked`.
    ///
    /// # Errors
    /// Why there is none, with the server's code.
    fn plan(&mut self, from: Point2, to: Point2, blocked: &BTreeSet<FixedPoint>) -> Result<PlannedPath, ErrorReply>;

    /// Whether a better answer to the last question may still come.
    fn is_pending(&self) -> bool {
        false
    }

    /// Whether something has been closed or opened since the last question, by operators or by other robots.
    fn is_outdated(&self) -> bool {
        false
    }

    /// How fast the robot may drive at a place of the map frame, metres per second; none if nothing limits it.
    fn speed_limit_mps(&self, _place: Point2) -> Option<f64> {
        None
    }

    /// Asked once per frame: the better answer to the last question, when it has come; a refusal, if there is no path after all.
    fn revised(&mut self) -> Option<Result<PlannedPath, ErrorReply>> {
        None
    }
}

/// What one frame led to.
#[derive(Clone, Debug)]
pub struct Step {
    /// The command until the next frame.
    pub command: Twist,
    /// Where the robot is, as far as it knows.
    pub localization: Localization,
    /// Where it may be while it does not know, map frame, likeliest first.
    pub candidates: Vec<Pose2>,
    /// Set once the task has ended.
    pub outcome: Option<Outcome>,
}

/// Distance of the places on the way that are looked at for what stands there, metres.
const OBSTACLE_STEP_M: f64 = 0.1;
/// Turning shows more of the surroundings, and often that the way is free after all.
const LOOK_AROUND: Twist = Twist { linear_mps: 0.0, angular_radps: 0.6 };

/// A command as fast as it may be where the robot is, and a little ahead.
fn slowed(command: Twist, map_from_base: &Pose2, paths: &dyn PathSource) -> Twist {
    let limit_mps = speed_limit_ahead(map_from_base, |place| paths.speed_limit_mps(place));
    limit_mps.map_or(command, |limit_mps| command.limited(limit_mps))
}

fn went_back() -> String {
    "it is older than the one before".to_owned()
}

/// Carries out one task.
pub struct Pilot {
    config: PilotConfig,
    task: Task,
    localizer: Localizer,
    local_map: LocalMap,
    wanderer: Wanderer,
    steersman: Steersman,
    rng: ChaCha8Rng,
    wander_target: Option<Point2>,
    route: Option<Route>,
    blockages: Blockages,
    /// The refusal of a path, while a better answer may still come.
    refusal: Option<ErrorReply>,
    no_way: usize,
    plans: usize,
    started_us: Option<u64>,
    /// Time of the last frame taken in.
    last_us: Option<u64>,
    search_began_m: f64,
}

impl Pilot {
    /// Before the first frame.
    #[must_use]
    pub fn new(config: PilotConfig, task: Task) -> Self {
        Self {
            task,
            localizer: Localizer::new(config.localize.clone()),
            local_map: LocalMap::new(config.local_map.clone()),
            wanderer: Wanderer::new(config.wander.clone()),
            steersman: Steersman::new(config.steering.clone()),
            rng: ChaCha8Rng::seed_from_u64(config.seed),
            wander_target: None,
            route: None,
            blockages: Blockages::default(),
            refusal: None,
            no_way: 0,
            plans: 0,
            started_us: None,
            last_us: None,
            search_began_m: 0.0,
            config,
        }
    }

    /// Gives the robot another task, as once it knows where it is.
    pub fn set_task(&mut self, task: Task) {
        self.task = task;
        self.route = None;
        self.refusal = None;
        self.no_way = 0;
    }

    /// The path being driven.
    #[must_use]
    pub fn path(&self) -> Option<&PlannedPath> {
        self.route.as_ref().map(Route::path)
    }

    /// How often a path was asked for.
    #[must_use]
    pub fn plans(&self) -> usize {
        self.plans
    }

    /// The localizer, for people to look at.
    #[must_use]
    pub fn localizer(&self) -> &Localizer {
        &self.localizer
    }

    /// Takes in a frame and says what to do. A frame of which nothing can be made, or from before the last one, is left out,
    /// and the robot stands until the next. `describe` makes the descriptor of the frame's panorama when it is needed.
    pub fn step(
        &mut self,
        landmarks: &Landmarks,
        frame: &SensorFrame,
        describe: impl FnOnce() -> Option<Descriptor>,
        paths: &mut dyn PathSource,
    ) -> Step {
        let is_late = self.last_us.is_some_and(|last| frame.time_us < last);
        if let Some(reason) = frame.check().err().map(|error| error.to_string()).or(is_late.then(went_back)) {
            tracing::warn!(reason, "frame left out");
            return Step {
                command: Twist::default(),
                localization: self.localizer.current(),
                candidates: Vec::new(),
                outcome: None,
            };
        }
        self.last_us = Some(frame.time_us);
        let localization = self.localizer.update(landmarks, frame, describe);
        self.local_map.integrate(&localization.odometry, &frame.scan);
        let started = *self.started_us.get_or_insert(frame.time_us);
        let seconds = frame.time_us.saturating_sub(started) as f64 / 1e6;
        let (command, outcome) = if seconds > self.config.max_time_s {
            (Twist::default(), Some(Outcome::Failed(Failure::Timeout { seconds })))
        } else {
            match localization.map_from_odom {
                None => self.search(frame, &localization),
                Some(map_from_odom) => {
                    self.search_began_m = localization.odometry.odometer_m;
                    self.wander_target = None;
                    match self.task {
                        Task::Relocalize => (Twist::default(), Some(Outcome::Localized)),
                        Task::GoTo(goal) => {
                            let (command, outcome) = self.drive(frame, &localization, &map_from_odom, goal, paths);
                            (slowed(command, &(map_from_odom * localization.odometry.odom_from_base), paths), outcome)
                        }
                    }
                }
            }
        };
        let candidates = if localization.map_from_odom.is_none() { self.localizer.candidates() } else { Vec::new() };
        Step { command, localization, candidates, outcome }
    }

    /// Moves about to see more.
    fn search(&mut self, frame: &SensorFrame, localization: &Localization) -> (Twist, Option<Outcome>) {
        self.route = None;
        self.refusal = None;
        let odom_from_base = localization.odometry.odom_from_base;
        let here = Point2::from(odom_from_base.translation.vector);
        self.wanderer.visit(here);
        let driven_m = localization.odometry.odometer_m - self.search_began_m;
        if driven_m > self.config.max_search_m {
            return (Twist::default(), Some(Outcome::Failed(Failure::NotLocalized { driven_m })));
        }
        if self.wander_target.is_some_and(|target| (target - here).norm() < 0.4) {
            self.wander_target = None;
        }
        if self.wander_target.is_none() {
            self.steersman.reset();
            let way = self.wanderer.next(self.local_map.grid(), &odom_from_base, &mut self.rng);
            self.wander_target = way.and_then(|path| path.last().copied());
            tracing::debug!(here = ?(here.x, here.y), target = ?self.wander_target, "wandering");
        }
        // Nothing to go to: look around.
        let Some(target) = self.wander_target else { return (LOOK_AROUND, None) };
        match self.steersman.steer(&self.local_map, &odom_from_base, &frame.scan, target) {
            Steering::Drive(command) => (command, None),
            steering @ (Steering::AtEnd { .. } | Steering::NoWay) => {
                tracing::debug!(?steering, x = target.x, y = target.y, "wandering elsewhere");
                self.wanderer.give_up(target);
                self.wander_target = None;
                (LOOK_AROUND, None)
            }
        }
    }

    /// Drives along the path to the goal.
    fn drive(
        &mut self,
        frame: &SensorFrame,
        localization: &Localization,
        map_from_odom: &Pose2,
        goal: Point2,
        paths: &mut dyn PathSource,
    ) -> (Twist, Option<Outcome>) {
        let odom_from_base = localization.odometry.odom_from_base;
        let here = Point2::from(odom_from_base.translation.vector);
        let now_us = frame.time_us;
        if self.blockages.is_waiting(now_us) {
            return (LOOK_AROUND, None);
        }
        let revised = paths.revised();
        if let Some(Err(refusal)) = revised {
            self.refusal = Some(refusal);
        } else if let Some(Ok(path)) = revised {
            tracing::info!(length_m = path.length_m, points = path.points.len(), planner = ?path.planner, "path revised");
            self.refusal = None;
            self.route = Some(Route::new(self.config.route.clone(), path, *map_from_odom));
        }
        if let Some(refusal) = self.refusal.take() {
            return self.refused(refusal, now_us, paths);
        }
        let is_outdated =
            self.route.as_ref().is_none_or(|route| route.is_outdated(map_from_odom, here)) || paths.is_outdated();
        if (localization.is_new_fix || is_outdated)
            && let Err(refusal) = self.plan(map_from_odom, here, goal, now_us, paths)
        {
            return self.refused(refusal, now_us, paths);
        }
        let Some(route) = &mut self.route else { return (Twist::default(), None) };
        let Some(target) = route.target(map_from_odom, &odom_from_base, self.local_map.grid()) else {
            return (Twist::default(), Some(Outcome::Arrived));
        };
        match self.steersman.steer(&self.local_map, &odom_from_base, &frame.scan, target.in_odom) {
            Steering::Drive(command) => {
                self.no_way = 0;
                (command, None)
            }
            Steering::AtEnd { left_m } if target.is_goal && left_m <= self.config.goal_slack_m => {
                (Twist::default(), Some(Outcome::Arrived))
            }
            Steering::AtEnd { left_m } if target.is_goal => {
                (Twist::default(), Some(Outcome::Failed(Failure::GoalBlocked { left_m })))
            }
            Steering::AtEnd { .. } => {
                route.skip();
                (Twist::default(), None)
            }
            Steering::NoWay => self.no_way(map_from_odom, here, goal, &target, now_us, paths),
        }
    }

    /// The next point cannot be reached: look around a little, then ask for a path around what is in the way.
    fn no_way(
        &mut self,
        map_from_odom: &Pose2,
        here: Point2,
        goal: Point2,
        target: &Target,
        now_us: u64,
        paths: &mut dyn PathSource,
    ) -> (Twist, Option<Outcome>) {
        self.no_way += 1;
        if self.no_way < self.config.blocked_after {
            return (LOOK_AROUND, None);
        }
        self.no_way = 0;
        let place = map_from_odom * self.obstacle_on_the_way(here, target.in_odom);
        let goal_m = (place - goal).norm();
        if target.is_goal && goal_m <= self.config.goal_slack_m {
            return self.wait_or(Failure::GoalBlocked { left_m: target.distance_m }, now_us);
        }
        tracing::info!(x = place.x, y = place.y, "way blocked, planning another");
        self.blockages.block(FixedPoint::from_metres(place.x, place.y), now_us, &self.config.blockages);
        match self.plan(map_from_odom, here, goal, now_us, paths) {
            Ok(()) => (LOOK_AROUND, None),
            Err(refusal) => self.refused(refusal, now_us, paths),
        }
    }

    /// The first place on the straight way that something stands at; the way's end if nothing is known of it. Odometry frame.
    fn obstacle_on_the_way(&self, here: Point2, end: Point2) -> Point2 {
        let way = end - here;
        let steps = (way.norm() / OBSTACLE_STEP_M).ceil().max(1.0) as usize;
        let places = (1..=steps).map(|step| here + way * (step as f64 / steps as f64));
        let grid = self.local_map.grid();
        let is_taken = |place: &Point2| !grid.is_corridor_unoccupied(*place, *place, OBSTACLE_STEP_M);
        places.into_iter().find(is_taken).unwrap_or(end)
    }

    /// The planner has no path: the robot stands until it is clear that no other answer comes. Without the places that it
    /// found blocked there may be one.
    fn refused(&mut self, refusal: ErrorReply, now_us: u64, paths: &dyn PathSource) -> (Twist, Option<Outcome>) {
        self.route = None;
        if paths.is_pending() {
            self.refusal = Some(refusal);
            return (Twist::default(), None);
        }
        let may_open = refusal.code == ErrorCode::NoPath && !self.blockages.is_empty();
        let failure = Failure::NoPath(refusal);
        if may_open { self.wait_or(failure, now_us) } else { (Twist::default(), Some(Outcome::Failed(failure))) }
    }

    /// Gives what is in the way some time to leave, and plans anew after it; or fails, if that was done often enough.
    fn wait_or(&mut self, failure: Failure, now_us: u64) -> (Twist, Option<Outcome>) {
        if !self.blockages.wait(now_us, &self.config.blockages) {
            return (Twist::default(), Some(Outcome::Failed(failure)));
        }
        tracing::info!(%failure, "waiting for the way to clear");
        self.route = None;
        (LOOK_AROUND, None)
    }

    fn plan(
        &mut self,
        map_from_odom: &Pose2,
        here: Point2,
        goal: Point2,
        now_us: u64,
        paths: &mut dyn PathSource,
    ) -> Result<(), ErrorReply> {
        self.plans += 1;
        self.steersman.reset();
        let path = paths.plan(map_from_odom * here, goal, &self.blockages.places(now_us))?;
        tracing::info!(length_m = path.length_m, points = path.points.len(), planner = ?path.planner, "path planned");
        self.route = Some(Route::new(self.config.route.clone(), path, *map_from_odom));
        Ok(())
    }
}

#[cfg(test)]
mod tests;
