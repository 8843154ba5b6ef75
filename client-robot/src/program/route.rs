//! `client-robot route`: the actions `compute_path_to_pose` and `compute_route` on a robot's graph,
//! answered with the paths of the fleet's map. It stands in the place of Nav2's planner and route
//! servers.
//!
//! | module | idea |
//! | --- | --- |
//! | `path_planner` | `compute_path_to_pose`: the server's paths |
//! | `route_planner` | `compute_route`: over nodes and edges, on a copy of the map |
//! | `numbers` | numbers for nodes and edges |
//! | `dense` | ways as messages |

mod dense;
mod numbers;
mod path_planner;
mod route_planner;

use self::path_planner::PathPlanner;
use self::route_planner::RoutePlanner;
use super::arguments::RouteArgs;
use super::connection::{TIMEOUT, connect, connect_graph, runtime, wait_for_map};
use super::error::CliError;
use super::graph_frames::GraphFrames;
use super::other_servers::other_server;
use super::settings::ClientFile;
use fht_client::LiveReplica;
use fht_program::{Stop, Waiting, print_line};
use fht_ros::{ActiveGoal, GoalRequest, RosNode};
use fht_ros_messages::RosAction;
use fht_ros_messages::msg::Time;
use fht_ros_messages::nav2::{ComputePathToPose, ComputePathToPoseResult, ComputeRoute, ComputeRouteResult};
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Instant;

/// The actions' names.
const PATHS: &str = "compute_path_to_pose";
const ROUTES: &str = "compute_route";
/// Its copy of the map obeys what every robot reports: no robot has this name.
const NOBODY: &str = "";

/// Serves until the program is asked to end.
pub(super) fn route(file: &ClientFile, args: &RouteArgs, waiting: &Waiting, stop: &Stop) -> Result<ExitCode, CliError> {
    let map = file.map();
    let runtime = runtime()?;
    let graph = runtime.block_on(connect_graph(&args.ros, waiting, stop))?;
    let session = connect(&file.connect, waiting, stop)?;
    let head = wait_for_map(&session, &map, waiting, stop)?;
    let replica = LiveReplica::start(&session, &map, NOBODY, file.client.replica.clone())?;
    if !replica.wait_for(&head.vector, TIMEOUT) {
        tracing::warn!("the copy of the map is not complete yet");
    }
    let _order = stop.in_order();
    runtime.block_on(async {
        let node = RosNode::join(graph, args.node.node("client_robot_route")).await?;
        let frames = GraphFrames::listen(&node, &file.ros.tf, &file.ros.tf_static).await?;
        let footprint = file.client.paths.footprint.clone();
        let base_frame = args.base_frame.clone().unwrap_or_else(|| "base_link".to_owned());
        let routing = RoutePlanner::new(replica, footprint.clone(), base_frame.clone(), Arc::clone(&frames));
        let routing = Arc::new(routing);
        let planning = Arc::new(PathPlanner { session, map: map.clone(), footprint, base_frame, frames });
        for action in [PATHS, ROUTES] {
            if let Some(other) = other_server(&node, action).await? {
                let action = node.resolve(action)?;
                tracing::warn!("{other} serves {action} already (Nav2?): questions may come to either; end one of the two");
            }
        }
        let paths = node.action_server::<ComputePathToPose>(PATHS).await?;
        let routes = node.action_server::<ComputeRoute>(ROUTES).await?;
        print_line!("{} and {} are served on map {map}", node.resolve(PATHS)?, node.resolve(ROUTES)?);
        loop {
            tokio::select! {
                request = paths.next() => {
                    let planner = Arc::clone(&planning);
                    tokio::spawn(answer(request, move |question, began| match planner.answer(&question) {
                        Ok(path) => Ok(ComputePathToPoseResult { planning_time: since(began), ..path }),
                        Err(refusal) => Err(Box::new(ComputePathToPoseResult { planning_time: since(began), ..*refusal })),
                    }));
                }
                request = routes.next() => {
                    let planner = Arc::clone(&routing);
                    tokio::spawn(answer(request, move |question, began| match planner.answer(&question) {
                        Ok(route) => Ok(ComputeRouteResult { planning_time: since(began), ..route }),
                        Err(refusal) => Err(Box::new(ComputeRouteResult { planning_time: since(began), ..*refusal })),
                    }));
                }
                () = stop.requested() => return Ok(ExitCode::SUCCESS),
            }
        }
    })
}

fn since(began: Instant) -> Time {
    Time::from_us(u64::try_from(began.elapsed().as_micros()).unwrap_or(u64::MAX))
}

/// Takes a goal, plans in a thread beside, and ends the goal with what comes of it.
async fn answer<A>(
    request: GoalRequest<A>,
    plan: impl FnOnce(A::Goal, Instant) -> Result<A::Result, Box<A::Result>> + Send + 'static,
) where
    A: RosAction,
    A::Goal: Clone + 'static,
    A::Result: 'static,
    A::Feedback: Default,
{
    let question = request.goal.clone();
    let goal: ActiveGoal<A> = match request.accept() {
        Ok(goal) => goal,
        Err(error) => return tracing::debug!("{error}"),
    };
    // It has no fields: it says that planning has begun.
    if let Err(error) = goal.feedback(A::Feedback::default()) {
        tracing::debug!("{error}");
    }
    let began = Instant::now();
    let planning = tokio::task::spawn_blocking(move || plan(question, began));
    let planned = tokio::select! {
        planned = planning => planned,
        () = goal.canceling() => return goal.canceled(A::Result::default()),
    };
    match planned {
        Ok(Ok(found)) => goal.succeed(found),
        Ok(Err(refusal)) => goal.abort(*refusal),
        // The task is not aborted, and does not panic.
        Err(error) => tracing::error!("{error}"),
    }
}
