//! Answers of `compute_route`: ways over the nodes and edges of the fleet's map, planned on the own
//! copy of it, with its rules and closures.

use super::dense::path_message;
use super::numbers::Numbers;
use crate::program::graph_frames::{GraphFrames, UnknownFrame};
use fht_client::LiveReplica;
use fht_map::{FreeSpace, MapState, NodeRoute, NodeRouteConfig, PlanError, Rules};
use fht_perception::pose::{Point2, fixed_point};
use fht_proto::api::reply::ErrorCode;
use fht_proto::{EdgeKey, FixedPoint, Footprint, NodeId};
use fht_ros_messages::msg::{PathMsg, Vector3};
use fht_ros_messages::nav2::{ComputeRouteGoal, ComputeRouteResult, RouteEdgeMsg, RouteMsg, RouteNodeMsg};
use std::sync::{Arc, Mutex, PoisonError};

/// What `ComputeRoute.Result` calls an error, in Jazzy and Kilted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u16)]
enum RouteServerError {
    Transform = 401,
    NoValidGraph = 402,
    IndeterminateNodes = 403,
    NoValidRoute = 405,
}

/// Why there is no route.
#[derive(Debug)]
struct NoRoute {
    error: RouteServerError,
    message: String,
}

impl From<UnknownFrame> for NoRoute {
    fn from(error: UnknownFrame) -> Self {
        Self { error: RouteServerError::Transform, message: error.to_string() }
    }
}

impl From<PlanError> for NoRoute {
    fn from(error: PlanError) -> Self {
        let is_off_the_map = error.code() == ErrorCode::OutOfMap;
        let kind = if is_off_the_map { RouteServerError::IndeterminateNodes } else { RouteServerError::NoValidRoute };
        Self { error: kind, message: error.to_string() }
    }
}

/// Free space, and what it is of.
struct Made {
    changes: u64,
    rules: Arc<Rules>,
    space: Arc<FreeSpace>,
}

/// Answers with routes over the fleet's map.
pub(super) struct RoutePlanner {
    replica: LiveReplica,
    footprint: Footprint,
    base_frame: String,
    frames: Arc<GraphFrames>,
    numbers: Mutex<Numbers>,
    made: Mutex<Option<Made>>,
}

impl RoutePlanner {
    pub(super) fn new(
        replica: LiveReplica,
        footprint: Footprint,
        base_frame: String,
        frames: Arc<GraphFrames>,
    ) -> Self {
        Self { replica, footprint, base_frame, frames, numbers: Mutex::default(), made: Mutex::default() }
    }

    /// The answer, or the refusal.
    pub(super) fn answer(&self, question: &ComputeRouteGoal) -> Result<ComputeRouteResult, Box<ComputeRouteResult>> {
        match self.plan(question) {
            Ok((path, route)) => Ok(ComputeRouteResult { path, route, ..Default::default() }),
            Err(NoRoute { error, message }) => {
                tracing::info!("no route: {message}");
                Err(Box::new(ComputeRouteResult { error_code: error as u16, error_msg: message, ..Default::default() }))
            }
        }
    }

    fn plan(&self, question: &ComputeRouteGoal) -> Result<(PathMsg, RouteMsg), NoRoute> {
        let (changes, rules) = (self.replica.changes(), self.replica.rules());
        let map = self.replica.running();
        let no_graph = |message: String| NoRoute { error: RouteServerError::NoValidGraph, message };
        let mut numbers = self.numbers.lock().unwrap_or_else(PoisonError::into_inner);
        numbers.learn(&map).map_err(|error| no_graph(error.to_string()))?;
        if numbers.count() == 0 {
            return Err(no_graph("the map has no nodes yet".to_owned()));
        }
        let space = self.space(&map, changes, &rules);
        let (route, goal_yaw) = if question.use_poses {
            let goal = self.frames.in_map(&question.goal)?;
            let start = match question.use_start {
                true => self.frames.in_map(&question.start)?,
                false => self.frames.map_from(&self.base_frame)?,
            };
            let place = |x: f64, y: f64| fixed_point(Point2::new(x, y));
            let from = place(start.translation.x, start.translation.y);
            let to = place(goal.translation.x, goal.translation.y);
            let route = rules.plan_over_nodes(&*map, &space, from, to, &NodeRouteConfig::default())?;
            (route, Some(goal.rotation.angle()))
        } else {
            let ends = [node_of(&numbers, &map, question.start_id)?, node_of(&numbers, &map, question.goal_id)?];
            (rules.plan_between_nodes(&*map, &space, ends)?, None)
        };
        let points: Vec<Point2> = route.waypoints.iter().map(|at| Point2::new(at.point.x(), at.point.y())).collect();
        let path = path_message(&points, goal_yaw);
        let route = route_message(&route, &map, &numbers, &path);
        Ok((path, route))
    }

    /// The free space of the map under the rules, made anew when either has changed: what is closed
    /// for edges, too.
    fn space(&self, map: &MapState, changes: u64, rules: &Arc<Rules>) -> Arc<FreeSpace> {
        let mut made = self.made.lock().unwrap_or_else(PoisonError::into_inner);
        match &*made {
            Some(made) if made.changes == changes && made.rules.closes_the_same(rules) => Arc::clone(&made.space),
            _ => {
                let space = Arc::new(FreeSpace::of(map, &rules.space_config_for(&self.footprint)));
                *made = Some(Made { changes, rules: Arc::clone(rules), space: Arc::clone(&space) });
                space
            }
        }
    }
}

/// The node with a number.
fn node_of(numbers: &Numbers, map: &MapState, number: u16) -> Result<NodeId, NoRoute> {
    numbers.id(number).filter(|id| map.node(*id).is_some()).ok_or_else(|| NoRoute {
        error: RouteServerError::IndeterminateNodes,
        message: format!("the map has no node {number}: its nodes are 0 to {}", numbers.count().saturating_sub(1)),
    })
}

fn vector(at: FixedPoint) -> Vector3 {
    Vector3 { x: at.x(), y: at.y(), z: 0.0 }
}

/// The nodes of a route, and the edges between them.
fn route_message(route: &NodeRoute, map: &MapState, numbers: &Numbers, path: &PathMsg) -> RouteMsg {
    let nodes: Vec<(NodeId, FixedPoint)> = route
        .waypoints
        .iter()
        .filter_map(|at| Some((at.node?, at.point)))
        .filter(|(id, _)| map.node(*id).is_some())
        .collect();
    let edge = |pair: &[(NodeId, FixedPoint)]| {
        let [(a, start), (b, end)] = pair else { return None };
        let edgeid = numbers.edge(EdgeKey::new(*a, *b))?;
        Some(RouteEdgeMsg { edgeid, start: vector(*start), end: vector(*end) })
    };
    RouteMsg {
        header: path.header.clone(),
        route_cost: route.length_m as f32,
        edges: nodes.windows(2).filter_map(edge).collect(),
        nodes: nodes
            .iter()
            .filter_map(|(id, at)| Some(RouteNodeMsg { nodeid: numbers.node(*id)?, position: vector(*at) }))
            .collect(),
    }
}
