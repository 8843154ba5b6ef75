//! Driving a robot to a place of the map.

use crate::map::Map;
use crate::place::{Place, locate};
use client_robot::mission::{MissionConfig, MissionError, MissionGoal, MissionObserver, Services, run};
use client_robot::pilot::{DriveGoal, Failure, Pilot, PilotConfig, PilotStep, TaskOutcome};
use fht_client::{ServerPaths, ServerPathsConfig};
#[cfg(feature = "descriptor")]
use fht_descriptor::DescriptorNet;
use fht_perception::frame::{Panorama, SensorFrame};
use fht_perception::pose::{Point2, Pose2, pose};
use fht_perception::robot::{Robot, RobotError};
use fht_proto::Descriptor;
use fht_proto::api::reply::{ErrorReply, PlaceRef};
use fht_worker::Taking;
use std::future::{Future, IntoFuture};
use std::ops::ControlFlow;
use std::pin::Pin;

impl Map {
    /// Drives `robot` to a place: finds out where it is if need be, asks for a path, follows it,
    /// drives around what is in the way. At a named place, and at a pose, it turns to the heading
    /// there. It has arrived within 0.1 m of the goal, or within 0.3 m of one on which something
    /// stands ([`PilotConfig::goal_slack_m`]). It gives up a search after 150 m and the whole after
    /// 1500 s ([`PilotConfig::max_search_m`], [`PilotConfig::max_time_s`]). Await what this
    /// returns, or spawn it:
    ///
    /// ```no_run
    /// # use fht::{Map, Robot};
    /// # type Outcome = Result<(), Box<dyn std::error::Error>>;
    /// # async fn go(map: Map, mut robot: impl Robot + Send + 'static) -> Outcome {
    /// let arrived = map.go(&mut robot, "dock").await?;
    /// println!("at ({:.2}, {:.2})", arrived.pose.translation.x, arrived.pose.translation.y);
    ///
    /// let driving = tokio::spawn(async move { map.go(&mut robot, (0.0, 0.0)).await });
    /// # driving.await??;
    /// # Ok(())
    /// # }
    /// ```
    pub fn go<'a, R: Robot + Send>(&'a self, robot: &'a mut R, to: impl Into<Place>) -> Drive<'a, R> {
        Drive {
            map: self,
            robot,
            goal: to.into(),
            config: MissionConfig {
                pilot: PilotConfig::of(&self.inner.footprint),
                walls: Taking::WhenThere,
                ..MissionConfig::default()
            },
            watcher: None,
            #[cfg(feature = "descriptor")]
            cameras: None,
        }
    }
}

/// Why the robot did not arrive.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DriveError {
    /// Others must know who drives.
    #[error("only a robot with a name drives: connect with Map::connect(…).robot(name)")]
    NotARobot,
    /// There is no such node or place: the robot was not moved. Whether it can reach coordinates is
    /// known only once it knows where it is: then [`DriveError::Failed`].
    #[error("{0}")]
    Goal(ErrorReply),
    /// It was tried, and failed.
    #[error(transparent)]
    Failed(Failure),
    /// The robot cannot be sensed with or driven.
    #[error(transparent)]
    Robot(RobotError),
    /// The watcher has ended it.
    #[error("the drive was interrupted")]
    Interrupted,
    /// The system gives no thread.
    #[error("no thread: {0}")]
    Thread(#[source] std::io::Error),
}

/// The robot is at its goal.
#[derive(Clone, Debug, PartialEq)]
pub struct Arrived {
    /// Where it thinks it is, map frame.
    pub pose: Pose2,
    /// Where the goal is, map frame, metres.
    pub goal: Point2,
    /// The heading there that the robot has turned to, map frame, radians; `None`: it has none.
    pub goal_yaw: Option<f64>,
    /// How often a path was asked for.
    pub plans: usize,
}

/// Told of each frame and what it led to.
type Watcher<'a> = Box<dyn FnMut(&SensorFrame, &PilotStep) -> ControlFlow<()> + Send + 'a>;

/// A robot on its way to a place; made by [`Map::go`]. Await it to drive.
///
/// Each frame is worked on inside of this future, in some milliseconds. The robot is told to stop
/// at the end, however that comes, and while its sensors are silent. A future that is dropped sends
/// no command: end a drive by its [watcher](Drive::watch) instead.
#[must_use = "nothing happens before it is awaited"]
pub struct Drive<'a, R> {
    map: &'a Map,
    robot: &'a mut R,
    goal: Place,
    config: MissionConfig,
    watcher: Option<Watcher<'a>>,
    #[cfg(feature = "descriptor")]
    cameras: Option<&'a mut DescriptorNet>,
}

impl<'a, R: Robot + Send> Drive<'a, R> {
    /// How the robot finds its place, plans and drives.
    pub fn config(mut self, pilot: PilotConfig) -> Self {
        self.config.pilot = pilot;
        self
    }

    /// Tells `watcher` of each frame and what it led to. [`ControlFlow::Break`] stops the robot and
    /// ends the drive.
    ///
    /// ```no_run
    /// # use fht::{DriveError, Map, Robot};
    /// # async fn go(map: Map, mut robot: impl Robot + Send) -> Result<(), DriveError> {
    /// let drive = map.go(&mut robot, "dock").watch(|frame, step| {
    ///     let localization = &step.localization;
    ///     println!("{} {} {:?}", frame.time_us, localization.state, localization.map_from_base());
    ///     std::ops::ControlFlow::Continue(())
    /// });
    /// drive.await?;
    /// # Ok(())
    /// # }
    /// ```
    pub fn watch(mut self, watcher: impl FnMut(&SensorFrame, &PilotStep) -> ControlFlow<()> + Send + 'a) -> Self {
        self.watcher = Some(Box::new(watcher));
        self
    }

    /// If the robot cannot reach the goal, it drives to the nearest point that it can reach.
    /// Default: then there is no path.
    pub fn to_nearest(mut self) -> Self {
        self.config.to_nearest = true;
        self
    }

    /// Uses the robot's cameras, too.
    #[cfg(feature = "descriptor")]
    pub fn cameras(mut self, net: &'a mut DescriptorNet) -> Self {
        self.cameras = Some(net);
        self
    }

    async fn drive(mut self) -> Result<Arrived, DriveError> {
        let inner = &self.map.inner;
        let presence = inner.presence.as_ref().ok_or(DriveError::NotARobot)?;
        let goal = self.goal.to_ref().map_err(DriveError::Goal)?;
        let now = inner.replica.read().state().clone();
        locate(&now, &inner.replica.running(), &goal).map_err(DriveError::Goal)?;
        let goal = match goal {
            PlaceRef::Point(point) => match self.goal.yaw() {
                Some(yaw) => MissionGoal::Pose(pose(point.x(), point.y(), yaw)),
                None => MissionGoal::Point(Point2::new(point.x(), point.y())),
            },
            PlaceRef::Node(id) => MissionGoal::Node(id),
            PlaceRef::Named(name) => MissionGoal::Named(name),
        };
        let asking = ServerPathsConfig {
            timeout_s: inner.timeout.as_secs_f64(),
            taking: Taking::WhenThere,
            footprint: inner.footprint.clone(),
            ..ServerPathsConfig::default()
        };
        let paths = ServerPaths::new(&inner.session, inner.name.clone(), presence.robot(), &inner.replica, &asking);
        let mut paths = paths.map_err(DriveError::Thread)?;
        #[cfg(feature = "descriptor")]
        let mut describe = |panorama: &Panorama| crate::localizer::describe(self.cameras.as_mut()?, panorama);
        #[cfg(not(feature = "descriptor"))]
        let mut describe = |_: &Panorama| None::<Descriptor>;
        let mut services = Services { map: &inner.replica, paths: &mut paths, describe: &mut describe };
        let mut observer = Observer { map: self.map, watcher: self.watcher.take(), pose: None, goal: None };
        let outcome = run(&mut *self.robot, self.config, &goal, &mut services, &mut observer).await;
        // Others learn where it ended at once, also if the program ends with the drive.
        inner.publish_pose();
        let outcome = outcome.map_err(|error| match error {
            MissionError::Robot(error) => DriveError::Robot(error),
            MissionError::Interrupted => DriveError::Interrupted,
        })?;
        match outcome.task {
            TaskOutcome::Failed(failure) => Err(DriveError::Failed(failure)),
            TaskOutcome::Arrived | TaskOutcome::Localized => Ok(Arrived {
                pose: observer.pose.unwrap_or_else(Pose2::identity),
                goal: observer.goal.map_or_else(Point2::origin, |goal| goal.position),
                goal_yaw: observer.goal.and_then(|goal| goal.yaw),
                plans: outcome.plans,
            }),
        }
    }
}

impl<'a, R: Robot + Send> IntoFuture for Drive<'a, R> {
    type Output = Result<Arrived, DriveError>;
    type IntoFuture = Pin<Box<dyn Future<Output = Self::Output> + Send + 'a>>;

    fn into_future(self) -> Self::IntoFuture {
        Box::pin(self.drive())
    }
}

/// Publishes where the robot is, and passes on what happens.
struct Observer<'a> {
    map: &'a Map,
    watcher: Option<Watcher<'a>>,
    pose: Option<Pose2>,
    goal: Option<DriveGoal>,
}

impl MissionObserver for Observer<'_> {
    fn on_frame(&mut self, frame: &SensorFrame, step: &PilotStep, _: &Pilot) -> ControlFlow<()> {
        self.pose = step.localization.map_from_base().or(self.pose);
        self.map.inner.set_pose(step.pose_report());
        self.watcher.as_mut().map_or(ControlFlow::Continue(()), |watcher| watcher(frame, step))
    }

    fn on_goal(&mut self, goal: DriveGoal) {
        self.goal = Some(goal);
    }
}
