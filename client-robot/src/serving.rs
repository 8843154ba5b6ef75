//! A robot that stays at work: it finds its place, then drives to one goal after another, as it is
//! sent. The loop is that of a [mission](crate::mission).

use crate::goals::{GoalPath, GoalQueue};
use crate::mission::{
    Director, MapSource, MissionConfig, MissionError, MissionGoal, MissionObserver, Services, check_on_map, direct,
    place_of,
};
use crate::pilot::{DriveGoal, Failure, Pilot, PilotStep, Task, TaskOutcome};
use fht_perception::pose::{Point2, pose};
use fht_perception::robot::{Robot, Supervised};
use fht_proto::api::goal::GoalOrder;
use fht_proto::api::reply::{ErrorReply, PlaceRef};
use std::ops::ControlFlow;

/// Where goals come from, and who is told what becomes of them.
pub trait GoalDesk {
    /// Once a frame, before it is worked on, now and then while none comes, and at the end: passes
    /// on what has come to `goals`, and tells what is new there. Never waits.
    fn exchange(&mut self, goals: &mut GoalQueue, map: &dyn MapSource);
}

/// Both bring goals.
impl<A: GoalDesk, B: GoalDesk> GoalDesk for (A, B) {
    fn exchange(&mut self, goals: &mut GoalQueue, map: &dyn MapSource) {
        self.0.exchange(goals, map);
        self.1.exchange(goals, map);
    }
}

/// Somebody or nobody brings goals.
impl<D: GoalDesk> GoalDesk for Option<D> {
    fn exchange(&mut self, goals: &mut GoalQueue, map: &dyn MapSource) {
        if let Some(desk) = self {
            desk.exchange(goals, map);
        }
    }
}

/// Why a robot no longer takes goals.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// It is lost.
    #[error("the robot does not find its place: {0}")]
    Lost(Failure),
    /// It cannot be sensed with or driven, or the observer has ended it.
    #[error(transparent)]
    Mission(#[from] MissionError),
}

/// Drives to the goals that `desk` brings, until the observer ends it. The robot stands between
/// goals and at the end; what has not ended then is cancelled.
///
/// # Errors
/// [`ServeError`]; [`MissionError::Interrupted`] when the observer has ended it. A goal that fails
/// is told at the desk.
pub async fn serve<R: Robot>(
    robot: R,
    config: MissionConfig,
    name: &str,
    desk: &mut impl GoalDesk,
    services: &mut Services<'_>,
    observer: &mut impl MissionObserver,
) -> Result<(), ServeError> {
    let mut robot = Supervised::new(robot, config.silence);
    let mut pilot = Pilot::new(config.pilot, Task::Relocalize);
    let mut serving = Serving { goals: GoalQueue::new(name), desk };
    let ended = direct(&mut robot, &mut pilot, config.walls, &mut serving, services, observer).await;
    robot.stop().await;
    let ended = match ended {
        Ok(TaskOutcome::Failed(failure)) => Err(ServeError::Lost(failure)),
        Ok(TaskOutcome::Localized | TaskOutcome::Arrived) => Ok(()),
        Err(error) => Err(error.into()),
    };
    let reason = match &ended {
        Ok(()) | Err(ServeError::Mission(MissionError::Interrupted)) => "the robot takes no more goals".to_owned(),
        Err(error) => error.to_string(),
    };
    serving.goals.close(&reason);
    serving.desk.exchange(&mut serving.goals, services.map);
    ended
}

/// Has the pilot do what the queue says.
struct Serving<'a, D> {
    goals: GoalQueue,
    desk: &'a mut D,
}

impl<D: GoalDesk> Director for Serving<'_, D> {
    fn map_replaced(&mut self) -> Option<TaskOutcome> {
        self.goals.map_replaced();
        None
    }

    fn meanwhile(&mut self, map: &dyn MapSource) {
        self.desk.exchange(&mut self.goals, map);
    }

    fn before(&mut self, map: &dyn MapSource) -> Option<Task> {
        self.desk.exchange(&mut self.goals, map);
        self.goals.next_task()
    }

    fn after(&mut self, step: &PilotStep, pilot: &Pilot, _: &dyn MapSource) -> ControlFlow<TaskOutcome, Option<Task>> {
        // Nobody is told by the end of a goal.
        if let Some(failed @ TaskOutcome::Failed(_)) = &step.outcome
            && !self.goals.is_driving()
        {
            return ControlFlow::Break(failed.clone());
        }
        let left_m = pilot.left_m(&step.localization);
        let path = left_m.zip(pilot.path()).map(|(left_m, path)| GoalPath { left_m, goal_moved_m: path.goal_moved_m });
        self.goals.observe(step, path);
        ControlFlow::Continue(None)
    }
}

/// Where a goal is on the map. A goal that waits for its turn is not planned yet: what no path
/// could lead to is refused all the same, before it takes another one's place.
///
/// # Errors
/// `UNKNOWN_PLACE`, `UNKNOWN_NODE` or `OUT_OF_MAP`.
pub fn locate(order: &GoalOrder, map: &dyn MapSource) -> Result<DriveGoal, ErrorReply> {
    let goal = match &order.to {
        PlaceRef::Point(point) => match order.yaw {
            Some(yaw) => MissionGoal::Pose(pose(point.x(), point.y(), yaw)),
            None => MissionGoal::Point(Point2::new(point.x(), point.y())),
        },
        PlaceRef::Node(id) => MissionGoal::Node(*id),
        PlaceRef::Named(name) => MissionGoal::Named(name.clone()),
    };
    let goal = DriveGoal { to_nearest: order.to_nearest, ..place_of(&goal, map)? };
    check_on_map(&goal, map)?;
    Ok(goal)
}
