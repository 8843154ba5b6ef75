//! `client-robot relocalize --ros` and `client-robot go --ros`: a robot that speaks ROS 2, with a
//! task on a map of a real server. Nobody knows the truth about it: the figures are the robot's
//! own.

use super::arguments::RobotArgs;
use super::connection::{connect_graph, runtime};
use super::display::Display;
use super::error::CliError;
use super::floor::{MapTurns, known_floor};
use super::initial_pose::InitialPose;
use super::mission::{UntilAsked, called_random, describing, descriptor_net, require};
use super::nav2_driving::{ClientDriver, Nav2Guide, Nav2Paths};
use super::on_map::OnMap;
use super::pose_publisher::PosePublisher;
use super::recording::Recording;
use super::report::tell;
use super::ros_report::{RosMissionReport, RosMissionScore, print_report};
use super::settings::{ClientFile, ClientSection};
use crate::mission::{MissionConfig, MissionError, MissionGoal, MissionObserver, Services, run};
use crate::pilot::{Pilot, PilotStep};
use fht_client::{LiveReplica, ServerPaths};
use fht_perception::frame::{Panorama, SensorFrame};
use fht_perception::pose::Pose2;
use fht_program::{Stop, Waiting};
use fht_ros::{RosError, RosNode};
use fht_ros_robot::{
    DrivenByNav2, Nav2Driver, OutputRole, PlaceNow, RosOutputs, RosRobot, RosRobotConfig, live_silence,
};
use fht_session::check_owner;
use fht_worker::Taking;
use std::ops::ControlFlow;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Instant;
use tokio::runtime::Runtime;

/// Carries out the mission with the robot at `endpoint`, and writes its figures.
pub(super) fn ros_mission(
    mut file: ClientFile,
    args: &RobotArgs,
    endpoint: &str,
    goal: &MissionGoal,
    waiting: &Waiting,
    stop: &Stop,
) -> Result<ExitCode, CliError> {
    let began = Instant::now();
    // The robot is live: nothing waits for work beside the loop.
    (file.client.walls, file.client.paths.taking) = (Taking::WhenThere, Taking::WhenThere);
    let (map, name) = (file.map(), file.name().to_owned());
    check_owner(&file.connect, "client", &name)?;
    tracing::info!(%map, robot = name, router = endpoint, "looks for its place");
    let OnGraph { runtime, node, robot } = OnGraph::join(&file, args, endpoint, waiting, stop)?;

    file.robot.cameras &= robot.has_cameras();
    let mut net = file.robot.cameras.then(|| descriptor_net(&mut file)).transpose()?;
    let OnMap { session, presence, alive: _alive, replica } = OnMap::join(&file, net.as_ref(), waiting, stop)?;
    let goal = &called_random(goal, &replica);
    require(goal, file.client.to_nearest, &map, &replica, waiting)?;
    let mut paths =
        ServerPaths::new(&session, map.clone(), &name, &replica, &file.client.paths).map_err(CliError::Thread)?;
    let display = Display::new(args, &name);
    let publisher = PosePublisher::new(presence, &replica);
    // The robot stands and its bag is whole before the program ends.
    let _order = stop.in_order();
    let recording = Recording::start(args.record.as_deref(), &replica)?;
    let outputs = runtime.block_on(PlaceOutputs::start(&node, &robot, &replica))?;
    let score = RosMissionScore::default();
    let nav2 = runtime.block_on(nav2_driver(args.drive, &node))?;
    let guide = nav2.clone().map(Nav2Guide::new);
    let mut robot = DrivenByNav2::new(robot, nav2.clone());
    let mut observer = (recording, (UntilAsked(stop.clone()), ((publisher, display), (outputs, (guide, score)))));
    let ClientSection { pilot, silence, to_nearest, walls, paths: asking, .. } = file.client;
    let silence = live_silence(silence);
    let config = MissionConfig { pilot, silence, footprint: asking.footprint, to_nearest, walls };
    let mut driven = Nav2Paths::new(&mut paths, nav2);
    let mut describe = net.as_mut().map(describing);
    let mut describe = |panorama: &Panorama| describe.as_mut()?(panorama);
    let mut services = Services { map: &replica, paths: &mut driven, describe: &mut describe };
    let outcome = runtime.block_on(run(&mut robot, config, goal, &mut services, &mut observer));
    let (recording, (_, ((publisher, display), (outputs, (_, score))))) = observer;
    publisher.finish();
    display.finish();
    // What the graph is to know is on its way before the program ends.
    drop(outputs);
    let recorded = recording.finish();
    let outcome = match outcome {
        Err(MissionError::Interrupted) => {
            recorded?;
            let robot = robot.robot();
            if robot.report().frames == 0 {
                let why = robot.trouble().map(|trouble| format!(": {trouble}")).unwrap_or_default();
                fht_program::tell_line!("client-robot: interrupted while waiting for the robot's first scan{why}");
            } else {
                fht_program::tell_line!("client-robot: interrupted on the way: the robot stands");
            }
            return Ok(stop.exit_code().unwrap_or(ExitCode::FAILURE));
        }
        Err(MissionError::Robot(error)) => return Err(CliError::Robot { error, trouble: robot.robot().trouble() }),
        outcome => outcome?,
    };
    let report = RosMissionReport {
        robot: name,
        map: map.to_string(),
        intake: robot.robot().report(),
        fallbacks: paths.fallbacks(),
        wall_s: began.elapsed().as_secs_f64(),
        ..score.finish(&outcome)
    };
    tell(args, &report, print_report, report.failure.as_deref(), recorded)?;
    Ok(if report.failure.is_none() { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

/// Nav2, if it is to drive.
pub(super) async fn nav2_driver(drive: ClientDriver, node: &RosNode) -> Result<Option<Arc<Nav2Driver>>, RosError> {
    match drive {
        ClientDriver::Client => Ok(None),
        ClientDriver::Nav2 => Nav2Driver::start(node).await.map(Some),
    }
}

/// A robot on its graph.
pub(super) struct OnGraph {
    pub(super) runtime: Runtime,
    pub(super) node: RosNode,
    pub(super) robot: RosRobot,
}

impl OnGraph {
    /// Waits for the robot's router at `endpoint`, and subscribes to the robot's sensors.
    pub(super) fn join(
        file: &ClientFile,
        args: &RobotArgs,
        endpoint: &str,
        waiting: &Waiting,
        stop: &Stop,
    ) -> Result<Self, CliError> {
        let runtime = runtime()?;
        let (node, robot) = runtime.block_on(async {
            let session = connect_graph(endpoint, waiting, stop).await?;
            let node = RosNode::join(session, args.graph.node.node("client_robot")).await?;
            let config = args.graph.robot(file.ros.clone());
            let config = RosRobotConfig {
                others_drive: args.drive == ClientDriver::Nav2,
                without_cameras: !file.robot.cameras,
                ..config
            };
            let robot = RosRobot::connect(&node, config).await?;
            Ok::<_, CliError>((node, robot))
        })?;
        Ok(Self { runtime, node, robot })
    }
}

/// Tells the robot's own graph where it is, and what the fleet's map says of the floor; hears where
/// people think that it is.
pub(super) struct PlaceOutputs<'a> {
    outputs: RosOutputs,
    replica: &'a LiveReplica,
    turns: MapTurns,
    pointed_at: InitialPose,
}

impl<'a> PlaceOutputs<'a> {
    /// Publishes on the graph of `robot`.
    pub(super) async fn start(node: &RosNode, robot: &RosRobot, replica: &'a LiveReplica) -> Result<Self, RosError> {
        let outputs = RosOutputs::start(node, OutputRole::Localization, robot.odom_frame()).await?;
        let pointed_at = InitialPose::listen(node).await?;
        Ok(Self { outputs, replica, turns: MapTurns::default(), pointed_at })
    }
}

impl MissionObserver for PlaceOutputs<'_> {
    fn pointed_at(&mut self) -> Option<Pose2> {
        self.pointed_at.pointed_at()
    }

    fn on_frame(&mut self, frame: &SensorFrame, step: &PilotStep, _: &Pilot) -> ControlFlow<()> {
        let report = step.pose_report();
        self.outputs.place(PlaceNow {
            time_us: frame.time_us,
            state: report.state,
            confidence: report.confidence,
            odom_from_base: frame.odom_from_base,
            map_from_base: report.map_from_base,
            candidates: report.candidates.iter().map(|place| place.map_from_base).collect(),
            lost_because: report.lost_because,
        });
        if self.turns.is_due(frame.time_us, self.replica.changes(), false) {
            let map = self.replica.running();
            self.outputs.floor(frame.time_us, move || known_floor(&map));
        }
        ControlFlow::Continue(())
    }
}
