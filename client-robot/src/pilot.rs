//! Using the map (paper, Algorithm 2): move until the place is known, ask for a path, drive along
//! it, plan anew when a better estimate or a blocked way turns up. No Zenoh and no simulator in
//! here: frames come in, commands go out.

mod config;
mod final_turn;
mod people;
mod progress;
mod situation;
mod task;

pub use config::PilotConfig;
pub use final_turn::FinalTurnConfig;
pub use progress::ProgressConfig;
pub use task::{DriveGoal, Failure, PilotStep, Task, TaskOutcome};

use self::final_turn::{FinalTurn, Turn};
use self::people::GivingWay;
use self::progress::ProgressWatch;
use self::situation::Situation;

use crate::blockages::Blockages;
use crate::path_following::{FollowedPath, Target};
use fht_client::{PathSource, PlannedPath};
use fht_localization::landmarks::Landmarks;
use fht_localization::localizer::{Localization, Localizer};
use fht_navigation::disambiguation::Ambiguity;
use fht_navigation::local_map::LocalMap;
use fht_navigation::motion::speed_limit_ahead;
use fht_navigation::searching::{LOOK_AROUND, Searcher};
use fht_navigation::steering::{Steering, Steersman};
use fht_perception::frame::{SensorFrame, Twist};
use fht_perception::pose::{Point2, Pose2};
use fht_proto::api::reply::{ErrorCode, ErrorReply};
use fht_proto::{Descriptor, FixedPoint};

/// Distance of the places on the way that are looked at for what stands there, metres.
const OBSTACLE_STEP_M: f64 = 0.1;

/// A command as fast as it may be where the robot is, and a little ahead.
fn slowed(command: Twist, map_from_base: &Pose2, paths: &dyn PathSource) -> Twist {
    let limit_mps = speed_limit_ahead(map_from_base, |place| paths.speed_limit_mps(place));
    limit_mps.map_or(command, |limit_mps| command.limited(limit_mps))
}

fn searcher(config: &PilotConfig) -> Searcher {
    Searcher::new(config.disambiguate.clone(), config.wander.clone(), config.steering.clone(), config.seed)
}

fn went_back() -> String {
    "it is older than the one before".to_owned()
}

/// Carries out one task.
pub struct Pilot {
    config: PilotConfig,
    task: Task,
    /// Whether nothing was done for the task yet.
    is_new_task: bool,
    localizer: Localizer,
    local_map: LocalMap,
    people: GivingWay,
    searcher: Searcher,
    steersman: Steersman,
    route: Option<FollowedPath>,
    blockages: Blockages,
    /// The refusal of a path, while a better answer may still come.
    refusal: Option<ErrorReply>,
    no_way: usize,
    progress: ProgressWatch,
    final_turn: FinalTurn,
    plans: usize,
    started_us: Option<u64>,
    /// Time of the last frame taken in.
    last_us: Option<u64>,
    search_began_m: f64,
    /// Another map has come to the name, and nothing of it has been seen yet.
    is_map_new: bool,
}

impl Pilot {
    /// Before the first frame.
    #[must_use]
    pub fn new(config: PilotConfig, task: Task) -> Self {
        Self {
            task,
            is_new_task: true,
            localizer: Localizer::new(config.localize.clone()),
            local_map: LocalMap::new(config.local_map.clone()),
            people: GivingWay::new(&config),
            searcher: searcher(&config),
            steersman: Steersman::new(config.steering.clone()),
            route: None,
            blockages: Blockages::default(),
            refusal: None,
            no_way: 0,
            progress: ProgressWatch::default(),
            final_turn: FinalTurn::default(),
            plans: 0,
            started_us: None,
            last_us: None,
            search_began_m: 0.0,
            is_map_new: false,
            config,
        }
    }

    /// Gives the robot another task, as once it knows where it is. Its time begins anew, unless it
    /// goes on from [`Task::Relocalize`].
    pub fn set_task(&mut self, task: Task) {
        if self.task != Task::Relocalize {
            self.started_us = None;
            self.blockages.forget_waits();
        }
        self.task = task;
        self.is_new_task = true;
        self.route = None;
        self.refusal = None;
        self.no_way = 0;
        self.progress = ProgressWatch::default();
        self.final_turn.end();
    }

    /// The landmarks from here on are those of another map: the place and the path are void.
    pub fn replace_map(&mut self) {
        self.localizer.replace_map();
        self.is_map_new = true;
        self.route = None;
        self.refusal = None;
        self.no_way = 0;
        self.blockages = Blockages::default();
        self.progress = ProgressWatch::default();
        self.final_turn.end();
    }

    /// The path being driven.
    #[must_use]
    pub fn path(&self) -> Option<&PlannedPath> {
        self.route.as_ref().map(FollowedPath::path)
    }

    /// What is left of the path being driven, metres, where the robot is as `localization` says.
    #[must_use]
    pub fn left_m(&self, localization: &Localization) -> Option<f64> {
        let map_from_odom = localization.map_from_odom?;
        let here = Point2::from(localization.odometry.odom_from_base.translation.vector);
        Some(self.route.as_ref()?.left_m(&map_from_odom, here))
    }

    /// How often a path was asked for.
    #[must_use]
    pub fn plans(&self) -> usize {
        self.plans
    }

    /// Somebody says that the robot is about here, map frame, rightly or not: it looks there, and
    /// what it sees decides.
    pub fn point_at(&mut self, map_from_base: Pose2) {
        self.localizer.point_at(map_from_base);
    }

    /// The localizer, for people to look at.
    #[must_use]
    pub fn localizer(&self) -> &Localizer {
        &self.localizer
    }

    /// Takes in a frame and says what to do. A frame of which nothing can be made, or from before
    /// the last one, is left out, and the robot stands until the next. `describe` makes the
    /// descriptor of the frame's panorama when it is needed.
    pub fn step(
        &mut self,
        landmarks: &Landmarks,
        frame: &SensorFrame,
        describe: impl FnOnce() -> Option<Descriptor>,
        paths: &mut dyn PathSource,
    ) -> PilotStep {
        let is_late = self.last_us.is_some_and(|last| frame.time_us < last);
        if let Some(reason) = frame.check().err().map(|error| error.to_string()).or(is_late.then(went_back)) {
            tracing::warn!(reason, "frame left out");
            return PilotStep {
                command: Twist::default(),
                localization: self.localizer.current(),
                candidates: Vec::new(),
                outcome: None,
            };
        }
        self.last_us = Some(frame.time_us);
        let lasting = self.people.hide(frame);
        self.localizer.expect_people(self.people.walkers());
        let localization = self.localizer.update(landmarks, &lasting, describe);
        self.local_map.integrate(&localization.odometry, &lasting.scan);
        let started = *self.started_us.get_or_insert(frame.time_us);
        let seconds = frame.time_us.saturating_sub(started) as f64 / 1e6;
        let (command, outcome) = if seconds > self.config.max_time_s {
            (Twist::default(), Some(TaskOutcome::Failed(Failure::Timeout { seconds })))
        } else {
            match localization.map_from_odom {
                None => self.search(landmarks, frame, &localization),
                Some(map_from_odom) => {
                    self.search_began_m = localization.odometry.odometer_m;
                    self.searcher.end();
                    match self.task {
                        Task::Relocalize => (Twist::default(), Some(TaskOutcome::Localized)),
                        Task::Stay => {
                            self.started_us = None;
                            (Twist::default(), None)
                        }
                        Task::GoTo(goal) => {
                            let odom_from_base = localization.odometry.odom_from_base;
                            let end = self.path_end(&goal);
                            let now = Situation { map_from_odom, odom_from_base, now_us: frame.time_us, goal, end };
                            let (command, outcome) = self.drive(frame, localization.is_new_fix, &now, paths);
                            (slowed(command, &now.map_from_base(), paths), outcome)
                        }
                    }
                }
            }
        };
        let (command, is_held) = self.people.keep_distance(command, frame.time_us);
        if is_held {
            self.progress.restart();
        }
        let candidates = if localization.map_from_odom.is_none() { self.localizer.candidates() } else { Vec::new() };
        PilotStep { command, localization, candidates, outcome }
    }

    /// Where the path to a goal ends, map frame.
    fn path_end(&self, goal: &DriveGoal) -> Point2 {
        let moved = self.path().filter(|path| path.goal_moved_m > 0.0);
        moved.and_then(|path| path.points.last()).map_or(goal.position, |last| last.position)
    }

    /// Moves about to see more.
    fn search(
        &mut self,
        landmarks: &Landmarks,
        frame: &SensorFrame,
        localization: &Localization,
    ) -> (Twist, Option<TaskOutcome>) {
        self.route = None;
        self.refusal = None;
        self.progress.restart();
        self.final_turn.end();
        let odometry = &localization.odometry;
        self.is_map_new &= landmarks.is_empty();
        if self.is_map_new {
            // There is nothing yet to find a place by.
            self.search_began_m = odometry.odometer_m;
            return (Twist::default(), None);
        }
        let driven_m = odometry.odometer_m - self.search_began_m;
        if driven_m > self.config.max_search_m {
            return (Twist::default(), Some(TaskOutcome::Failed(Failure::NotLocalized { driven_m })));
        }
        let candidates = self.localizer.relocalizer().ambiguity();
        let ambiguity = landmarks.has_walls().then(|| Ambiguity { known: &landmarks.walls().known, candidates });
        (self.searcher.step(ambiguity.as_ref(), &self.local_map, &odometry.odom_from_base, &frame.scan), None)
    }

    /// Drives along the path to the goal, and turns there.
    fn drive(
        &mut self,
        frame: &SensorFrame,
        is_new_fix: bool,
        now: &Situation,
        paths: &mut dyn PathSource,
    ) -> (Twist, Option<TaskOutcome>) {
        if std::mem::take(&mut self.is_new_task) {
            paths.begin(now.goal.to_nearest);
        }
        if self.final_turn.has_begun() {
            let strayed_m = (now.map_from_odom * now.here() - now.end).norm();
            let reach_m = self.config.goal_slack_m.max(self.config.route.goal_reach_m);
            if strayed_m <= reach_m + self.config.final_turn.stray_m {
                return self.at_goal(now);
            }
            self.final_turn.end();
        }
        if self.blockages.is_waiting(now.now_us) {
            return (LOOK_AROUND, None);
        }
        let revised = paths.revised();
        if let Some(Err(refusal)) = revised {
            self.refusal = Some(refusal);
        } else if let Some(Ok(path)) = revised {
            tracing::info!(length_m = path.length_m, points = path.points.len(), planner = ?path.planner, "path revised");
            self.refusal = None;
            self.follow(path, now);
        }
        if let Some(refusal) = self.refusal.take() {
            return self.refused(refusal, now.now_us, paths);
        }
        let is_outdated = self.route.as_ref().is_none_or(|route| route.is_outdated(&now.map_from_odom, now.here()));
        if is_new_fix {
            self.progress.restart();
        }
        if (is_new_fix || is_outdated || paths.is_outdated())
            && let Err(refusal) = self.plan(now, paths)
        {
            return self.refused(refusal, now.now_us, paths);
        }
        let Some(route) = &mut self.route else { return (Twist::default(), None) };
        let Some(target) = route.target(&now.map_from_odom, &now.odom_from_base, self.local_map.grid()) else {
            return self.at_goal(now);
        };
        let left_m = route.left_m(&now.map_from_odom, now.here());
        if let Some(stall) = self.progress.observe(now.here(), left_m, now.now_us, &self.config.progress) {
            if stall.is_final {
                let failure = Failure::NoProgress { left_m: stall.left_m, seconds: stall.seconds };
                return (Twist::default(), Some(TaskOutcome::Failed(failure)));
            }
            return self.blocked(stall.at, now, &target, paths);
        }
        match self.steersman.steer(&self.local_map, &now.odom_from_base, &frame.scan, target.in_odom) {
            Steering::Drive(command) => {
                self.no_way = 0;
                (command, None)
            }
            Steering::AtEnd { left_m } if target.is_goal && left_m <= self.config.goal_slack_m => self.at_goal(now),
            Steering::AtEnd { left_m } if target.is_goal => {
                (Twist::default(), Some(TaskOutcome::Failed(Failure::GoalBlocked { left_m })))
            }
            Steering::AtEnd { .. } => {
                route.skip();
                (Twist::default(), None)
            }
            Steering::NoWay if route.skip_between(&now.map_from_odom, now.here()) => (Twist::default(), None),
            Steering::NoWay => self.no_way(now, &target, left_m, paths),
        }
    }

    /// The robot stands at its goal: it turns to the heading there, if there is one.
    fn at_goal(&mut self, now: &Situation) -> (Twist, Option<TaskOutcome>) {
        let arrived = (Twist::default(), Some(TaskOutcome::Arrived));
        let Some(wanted) = now.goal.yaw else { return arrived };
        let (follow, config) = (&self.config.steering.follow, &self.config.final_turn);
        let limits = (follow.max_angular_radps, follow.period_s);
        let heading = now.map_from_base().rotation.angle();
        match self.final_turn.step((heading, wanted), now.now_us, limits, config) {
            Turn::On(command) => (command, None),
            Turn::Done => arrived,
            Turn::Failed(left_rad) => {
                let failure = Failure::NotTurned { left_deg: left_rad.to_degrees().abs() };
                (Twist::default(), Some(TaskOutcome::Failed(failure)))
            }
        }
    }

    /// The next point cannot be reached: look around a little, then ask for a path around what is
    /// in the way.
    fn no_way(
        &mut self,
        now: &Situation,
        target: &Target,
        left_m: f64,
        paths: &mut dyn PathSource,
    ) -> (Twist, Option<TaskOutcome>) {
        self.no_way += 1;
        if self.no_way < self.config.blocked_after {
            return (LOOK_AROUND, None);
        }
        self.no_way = 0;
        if let Some(ways) = self.progress.blocked(left_m, &self.config.progress) {
            return (Twist::default(), Some(TaskOutcome::Failed(Failure::WaysBlocked { ways })));
        }
        self.blocked(now.here(), now, target, paths)
    }

    /// Something is in the way from a place (odometry frame) to the next point: asks for a path
    /// around it.
    fn blocked(
        &mut self,
        from: Point2,
        now: &Situation,
        target: &Target,
        paths: &mut dyn PathSource,
    ) -> (Twist, Option<TaskOutcome>) {
        let place = now.map_from_odom * self.obstacle_on_the_way(from, target.in_odom);
        let goal_m = (place - now.end).norm();
        if target.is_goal && goal_m <= self.config.goal_slack_m {
            return self.wait_or(Failure::GoalBlocked { left_m: target.distance_m }, now.now_us);
        }
        tracing::info!(x = place.x, y = place.y, "way blocked, planning another");
        self.blockages.block(FixedPoint::from_metres(place.x, place.y), now.now_us, &self.config.blockages);
        match self.plan(now, paths) {
            Ok(()) => (LOOK_AROUND, None),
            Err(refusal) => self.refused(refusal, now.now_us, paths),
        }
    }

    /// The first place on the straight way that something stands at; the way's end if nothing is
    /// known of it. Odometry frame.
    fn obstacle_on_the_way(&self, here: Point2, end: Point2) -> Point2 {
        let way = end - here;
        let steps = (way.norm() / OBSTACLE_STEP_M).ceil().max(1.0) as usize;
        let places = (1..=steps).map(|step| here + way * (step as f64 / steps as f64));
        let grid = self.local_map.grid();
        let is_taken = |place: &Point2| !grid.is_corridor_unoccupied(*place, *place, OBSTACLE_STEP_M);
        places.into_iter().find(is_taken).unwrap_or(end)
    }

    /// The planner has no path: the robot stands until it is clear that no other answer comes.
    /// Without the places that it found blocked there may be one.
    fn refused(&mut self, refusal: ErrorReply, now_us: u64, paths: &dyn PathSource) -> (Twist, Option<TaskOutcome>) {
        self.route = None;
        if paths.is_pending() {
            self.refusal = Some(refusal);
            return (Twist::default(), None);
        }
        let may_open = refusal.code == ErrorCode::NoPath && !self.blockages.is_empty();
        let failure = Failure::NoPath(refusal);
        if may_open { self.wait_or(failure, now_us) } else { (Twist::default(), Some(TaskOutcome::Failed(failure))) }
    }

    /// Gives what is in the way some time to leave, and plans anew after it; or fails, if that was
    /// done often enough.
    fn wait_or(&mut self, failure: Failure, now_us: u64) -> (Twist, Option<TaskOutcome>) {
        if !self.blockages.wait(now_us, &self.config.blockages) {
            return (Twist::default(), Some(TaskOutcome::Failed(failure)));
        }
        tracing::info!(%failure, "waiting for the way to clear");
        self.route = None;
        (LOOK_AROUND, None)
    }

    fn plan(&mut self, now: &Situation, paths: &mut dyn PathSource) -> Result<(), ErrorReply> {
        self.plans += 1;
        self.steersman.reset();
        let from = now.map_from_odom * now.here();
        let path = paths.plan(from, now.goal.position, &self.blockages.places(now.now_us))?;
        tracing::info!(length_m = path.length_m, points = path.points.len(), planner = ?path.planner, "path planned");
        self.follow(path, now);
        Ok(())
    }

    /// Drives along this path from now on.
    fn follow(&mut self, path: PlannedPath, now: &Situation) {
        let route = FollowedPath::new(self.config.route.clone(), path, now.map_from_odom);
        let left_m = |route: &FollowedPath| route.left_m(&now.map_from_odom, now.here());
        match &self.route {
            Some(before) => self.progress.replanned(left_m(before), left_m(&route)),
            None => self.progress.restart(),
        }
        self.route = Some(route);
    }
}

#[cfg(test)]
mod tests;
