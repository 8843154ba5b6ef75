//! `client-robot route`: the action `compute_path_to_pose` on a robot's graph, answered with the
//! paths of the fleet's map. It stands in the place of Nav2's planner server.

use super::arguments::RouteArgs;
use super::connection::{TIMEOUT, connect, connect_graph, runtime, wait_for_map};
use super::error::CliError;
use super::graph_frames::{GraphFrames, UnknownFrame};
use super::settings::ClientFile;
use fht_client::{AskError, PathPoint, PathQuestion, ask_path, planned};
use fht_perception::pose::{Pose2, pose};
use fht_program::{Stop, Waiting, print_line};
use fht_proto::api::reply::ErrorCode;
use fht_proto::{Footprint, MapName};
use fht_ros::{ActiveGoal, GoalRequest, RosNode};
use fht_ros_frames::{header_message, pose_message};
use fht_ros_messages::msg::{PathMsg, PoseStamped, Time};
use fht_ros_messages::nav2::{ComputePathToPose, ComputePathToPoseGoal, ComputePathToPoseResult};
use std::process::ExitCode;
use std::sync::Arc;
use std::time::{Instant, SystemTime, UNIX_EPOCH};
use zenoh::Session;

/// The action's name.
const ACTION: &str = "compute_path_to_pose";
/// Distance between a path's poses, metres: controllers look for a dense path.
const STEP_M: f64 = 0.05;

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

/// Serves until the program is asked to end.
pub(super) fn route(file: &ClientFile, args: &RouteArgs, waiting: &Waiting, stop: &Stop) -> Result<ExitCode, CliError> {
    let map = file.map();
    let runtime = runtime()?;
    let graph = runtime.block_on(connect_graph(&args.ros, waiting, stop))?;
    let session = connect(&file.connect, waiting, stop)?;
    wait_for_map(&session, &map, waiting, stop)?;
    let _order = stop.in_order();
    runtime.block_on(async {
        let node = RosNode::join(graph, args.node.node("client_robot_route")).await?;
        let planner = Arc::new(Planner {
            session,
            map: map.clone(),
            footprint: file.client.paths.footprint.clone(),
            base_frame: args.base_frame.clone().unwrap_or_else(|| "base_link".to_owned()),
            frames: GraphFrames::listen(&node, &file.ros.tf, &file.ros.tf_static).await?,
        });
        let server = node.action_server::<ComputePathToPose>(ACTION).await?;
        print_line!("{} is served on map {map}", node.resolve(ACTION)?);
        loop {
            tokio::select! {
                request = server.next() => {
                    tokio::spawn(answer(request, Arc::clone(&planner)));
                }
                () = stop.requested() => return Ok(ExitCode::SUCCESS),
            }
        }
    })
}

async fn answer(request: GoalRequest<ComputePathToPose>, planner: Arc<Planner>) {
    let question = request.goal.clone();
    let goal: ActiveGoal<ComputePathToPose> = match request.accept() {
        Ok(goal) => goal,
        Err(error) => return tracing::debug!("{error}"),
    };
    let began = Instant::now();
    let planning = tokio::task::spawn_blocking(move || planner.plan(&question));
    let planned = tokio::select! {
        planned = planning => planned,
        () = goal.canceling() => return goal.canceled(ComputePathToPoseResult::default()),
    };
    let planning_time = Time::from_us(u64::try_from(began.elapsed().as_micros()).unwrap_or(u64::MAX));
    match planned {
        Ok(Ok(path)) => goal.succeed(ComputePathToPoseResult { path, planning_time, ..Default::default() }),
        Ok(Err(NoPath { error, message })) => {
            tracing::info!("no path: {message}");
            let (error_code, error_msg) = (error as u16, message);
            goal.abort(ComputePathToPoseResult { planning_time, error_code, error_msg, ..Default::default() });
        }
        // The task is not aborted, and does not panic.
        Err(error) => tracing::error!("{error}"),
    }
}

/// Answers with paths of the fleet's map.
struct Planner {
    session: Session,
    map: MapName,
    footprint: Footprint,
    base_frame: String,
    frames: Arc<GraphFrames>,
}

impl Planner {
    fn plan(&self, question: &ComputePathToPoseGoal) -> Result<PathMsg, NoPath> {
        let goal = self.frames.in_map(&question.goal)?;
        let start = if question.use_start { self.frames.in_map(&question.start)? } else { self.robot()? };
        let place = |at: &Pose2| format!("{},{}", at.translation.x, at.translation.y);
        let (from, to) = (place(&start), place(&goal));
        let question =
            PathQuestion { from: &from, to: &to, footprint: &self.footprint, release: None, to_nearest: false };
        let reply = ask_path(&self.session, &self.map, &question, TIMEOUT).map_err(|error| no_path(&error, &from))?;
        let path =
            planned(reply).map_err(|error| NoPath { error: PlannerError::Unknown, message: error.to_string() })?;
        let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let now_us = u64::try_from(since.as_micros()).unwrap_or(u64::MAX);
        let header = header_message(now_us, "map");
        let stamped = |at: Pose2| PoseStamped { header: header.clone(), pose: pose_message(&at) };
        let poses = dense(&path.points, goal.rotation.angle()).into_iter().map(stamped).collect();
        Ok(PathMsg { header, poses })
    }

    fn robot(&self) -> Result<Pose2, NoPath> {
        Ok(self.frames.map_from(&self.base_frame)?)
    }
}

fn no_path(error: &AskError, from: &str) -> NoPath {
    let kind = match error {
        AskError::Refused(reply) => match reply.code {
            ErrorCode::NoPath | ErrorCode::KeepOut | ErrorCode::Blocked => PlannerError::NoValidPath,
            ErrorCode::OutOfMap if reply.message.contains(from) => PlannerError::StartOutsideMap,
            ErrorCode::OutOfMap => PlannerError::GoalOutsideMap,
            ErrorCode::Busy | ErrorCode::Timeout => PlannerError::Timeout,
            _ => PlannerError::Unknown,
        },
        AskError::Silent => PlannerError::Timeout,
        AskError::Zenoh(_) | AskError::Unreadable(_) => PlannerError::Unknown,
    };
    NoPath { error: kind, message: error.to_string() }
}

/// A pose every [`STEP_M`], each heading for the next; the last has the goal's heading.
fn dense(points: &[PathPoint], goal_yaw: f64) -> Vec<Pose2> {
    let mut poses = Vec::new();
    for pair in points.windows(2) {
        let (from, way) = (pair[0].position, pair[1].position - pair[0].position);
        let steps = (way.norm() / STEP_M).ceil().max(1.0) as usize;
        let yaw = way.y.atan2(way.x);
        poses.extend((0..steps).map(|step| {
            let at = from + way * (step as f64 / steps as f64);
            pose(at.x, at.y, yaw)
        }));
    }
    poses.extend(points.last().map(|last| pose(last.position.x, last.position.y, goal_yaw)));
    poses
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_perception::pose::Point2;

    #[test]
    fn a_path_is_dense_and_ends_with_the_goals_heading() {
        let point = |x: f64, y: f64| PathPoint { position: Point2::new(x, y), node: None };
        let poses = dense(&[point(0.0, 0.0), point(1.0, 0.0), point(1.0, 0.5)], 3.0);
        assert_eq!(poses.len(), 31);
        let steps = poses.windows(2).map(|pair| (pair[1].translation.vector - pair[0].translation.vector).norm());
        assert!(steps.into_iter().all(|step| step < STEP_M + 1e-9));
        assert!((poses[25].rotation.angle() - std::f64::consts::FRAC_PI_2).abs() < 1e-9);
        assert!((poses[30].rotation.angle() - 3.0).abs() < 1e-9);
        assert_eq!(dense(&[], 1.0), []);
    }
}
