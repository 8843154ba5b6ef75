//! Answers of `compute_path_to_pose`: the server's paths, the shortest through all free space.

use super::dense::path_message;
use crate::program::connection::TIMEOUT;
use crate::program::graph_frames::{GraphFrames, UnknownFrame};
use fht_client::{AskError, PathQuestion, ask_path, planned};
use fht_perception::pose::{Point2, Pose2, fixed_point};
use fht_proto::api::reply::ErrorCode;
use fht_proto::{Footprint, MapName};
use fht_ros_messages::msg::PathMsg;
use fht_ros_messages::nav2::{ComputePathToPoseGoal, ComputePathToPoseResult};
use std::sync::Arc;
use zenoh::Session;

/// What `ComputePathToPose.Result` calls an error, in Jazzy and Kilted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u16)]
enum PlannerError {
    Unknown = 200,
    Transform = 202,
    StartOutsideMap = 203,
    GoalOutsideMap = 204,
    Timeout = 207,
    NoValidPath = 208,
}

/// Why there is no path.
#[derive(Debug)]
struct NoPath {
    error: PlannerError,
    message: String,
}

impl From<UnknownFrame> for NoPath {
    fn from(error: UnknownFrame) -> Self {
        Self { error: PlannerError::Transform, message: error.to_string() }
    }
}

/// Answers with paths of the fleet's map.
pub(super) struct PathPlanner {
    pub(super) session: Session,
    pub(super) map: MapName,
    pub(super) footprint: Footprint,
    pub(super) base_frame: String,
    pub(super) frames: Arc<GraphFrames>,
}

impl PathPlanner {
    /// The answer, or the refusal.
    pub(super) fn answer(
        &self,
        question: &ComputePathToPoseGoal,
    ) -> Result<ComputePathToPoseResult, Box<ComputePathToPoseResult>> {
        match self.plan(question) {
            Ok(path) => Ok(ComputePathToPoseResult { path, ..Default::default() }),
            Err(NoPath { error, message }) => {
                tracing::info!("no path: {message}");
                let refusal =
                    ComputePathToPoseResult { error_code: error as u16, error_msg: message, ..Default::default() };
                Err(Box::new(refusal))
            }
        }
    }

    fn plan(&self, question: &ComputePathToPoseGoal) -> Result<PathMsg, NoPath> {
        let goal = self.frames.in_map(&question.goal)?;
        let start = match question.use_start {
            true => self.frames.in_map(&question.start)?,
            false => self.frames.map_from(&self.base_frame)?,
        };
        let place = |at: &Pose2| format!("{},{}", at.translation.x, at.translation.y);
        let (from, to) = (place(&start), place(&goal));
        let question =
            PathQuestion { from: &from, to: &to, footprint: &self.footprint, release: None, to_nearest: false };
        let reply = ask_path(&self.session, &self.map, &question, TIMEOUT).map_err(|error| no_path(&error, &start))?;
        let path =
            planned(reply).map_err(|error| NoPath { error: PlannerError::Unknown, message: error.to_string() })?;
        let points: Vec<Point2> = path.points.iter().map(|point| point.position).collect();
        Ok(path_message(&points, Some(goal.rotation.angle())))
    }
}

fn no_path(error: &AskError, start: &Pose2) -> NoPath {
    // The sentence begins with the place that it is about.
    let at = fixed_point(start.translation.vector.into());
    let is_start = |message: &str| message.starts_with(&format!("({:.2}, {:.2})", at.x(), at.y()));
    let kind = match error {
        AskError::Refused(reply) => match reply.code {
            ErrorCode::NoPath | ErrorCode::KeepOut | ErrorCode::Blocked => PlannerError::NoValidPath,
            ErrorCode::OutOfMap if is_start(&reply.message) => PlannerError::StartOutsideMap,
            ErrorCode::OutOfMap => PlannerError::GoalOutsideMap,
            ErrorCode::Busy | ErrorCode::Timeout => PlannerError::Timeout,
            _ => PlannerError::Unknown,
        },
        AskError::Silent => PlannerError::Timeout,
        AskError::Zenoh(_) | AskError::Unreadable(_) => PlannerError::Unknown,
    };
    NoPath { error: kind, message: error.to_string() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_map::RouteError;
    use fht_perception::pose::pose;
    use fht_proto::FixedPoint;
    use fht_proto::api::reply::ErrorReply;

    #[test]
    fn which_end_is_off_the_map_is_told_by_its_code() {
        let refused = |x: f64, y: f64, is_goal: bool| {
            let point = FixedPoint::from_metres(x, y);
            let error = RouteError::OutOfMap { point, nearest_m: Some(9.0), max_detour_m: 2.0, is_goal };
            let reply = ErrorReply::new(ErrorCode::OutOfMap, &error.to_string());
            no_path(&AskError::Refused(reply), &pose(500.0, 3.126, 1.0)).error
        };
        assert_eq!(refused(500.0, 3.126, false), PlannerError::StartOutsideMap);
        assert_eq!(refused(-30.0, 3.0, true), PlannerError::GoalOutsideMap);
    }
}
