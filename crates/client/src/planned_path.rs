//! A planned path, and where paths come from.

use fht_perception::pose::Point2;
use fht_proto::api::reply::ErrorReply;
use fht_proto::{FixedPoint, NodeId};
use std::collections::BTreeSet;

/// A point of a planned path.
#[derive(Clone, Debug, PartialEq)]
pub struct PathPoint {
    /// Where, map frame, metres.
    pub position: Point2,
    /// The node there; none at start and goal.
    pub node: Option<NodeId>,
}

/// Who planned a path.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Planner {
    /// The map-server.
    Server,
    /// The robot itself, on its replica.
    Replica,
}

/// A planned path.
#[derive(Clone, Debug, PartialEq)]
pub struct PlannedPath {
    /// From start to goal.
    pub points: Vec<PathPoint>,
    /// Its length, metres.
    pub length_m: f64,
    /// Who planned it.
    pub planner: Planner,
    /// How far its last point is from the goal that was asked for, metres; 0 unless the path may
    /// end at the nearest point that can be reached.
    pub goal_moved_m: f64,
    /// How much of it leads over ground that the map knows nothing of, metres.
    pub unmapped_m: f64,
}

/// Where paths come from.
pub trait PathSource {
    /// The robot begins to drive to another goal: what was asked before does not count any more.
    /// From here on paths may end at the nearest point that can be reached, if `to_nearest` and the
    /// goal cannot.
    fn begin(&mut self, _to_nearest: bool) {}

    /// A path between two points of the map frame that leads around the places in `blocked`.
    ///
    /// # Errors
    /// Why there is none, with the server's code.
    fn plan(&mut self, from: Point2, to: Point2, blocked: &BTreeSet<FixedPoint>) -> Result<PlannedPath, ErrorReply>;

    /// Whether a better answer to the last question may still come.
    fn is_pending(&self) -> bool {
        false
    }

    /// Whether something has been closed or opened since the last question, by operators or by
    /// other robots.
    fn is_outdated(&self) -> bool {
        false
    }

    /// How fast the robot may drive at a place of the map frame, metres per second; none if nothing
    /// limits it.
    fn speed_limit_mps(&self, _place: Point2) -> Option<f64> {
        None
    }

    /// Asked once per frame: the better answer to the last question, when it has come; a refusal,
    /// if there is no path after all.
    fn revised(&mut self) -> Option<Result<PlannedPath, ErrorReply>> {
        None
    }
}
