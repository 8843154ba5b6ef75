//! `client-robot serve`: a robot that drives wherever it is sent.

use super::arguments::{RobotArgs, ServeArgs};
use super::connection::runtime;
use super::display::Display;
use super::error::CliError;
use super::mission::{UntilAsked, describing, descriptor_net, patience, robot};
use super::nav2_driving::{ClientDriver, Nav2Guide, Nav2Paths};
use super::navigate::{NavigateDesk, WhereNow};
use super::on_map::OnMap;
use super::pose_publisher::PosePublisher;
use super::recording::Recording;
use super::ros_mission::{OnGraph, PlaceOutputs, nav2_driver};
use super::settings::{ClientFile, ClientSection};
use crate::goal_service::GoalService;
use crate::mission::{MissionConfig, MissionError, MissionObserver, Services};
use crate::pilot::{Pilot, PilotStep};
use crate::serving::{ServeError, serve};
use fht_client::{LiveReplica, ServerPaths};
use fht_descriptor::DescriptorNet;
use fht_perception::frame::{Panorama, SensorFrame};
use fht_perception::robot::{Paced, Robot};
use fht_program::{Stop, Waiting, print_line};
use fht_proto::api::goal::{GoalState, GoalStatus};
use fht_ros_robot::{DrivenByNav2, Nav2Driver, live_silence};
use fht_session::{check_owner, check_serving};
use fht_worker::Taking;
use serde::Serialize;
use std::ops::ControlFlow;
use std::process::ExitCode;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;
use tokio::runtime::Runtime;

/// What became of the goals of a run.
#[derive(Clone, Debug, Default, Serialize)]
struct ServeReport {
    /// The robot's name.
    robot: String,
    /// The map used.
    map: String,
    /// Goals that it arrived at.
    arrived: usize,
    /// Goals that it could not get to, or did not take.
    failed: usize,
    /// Goals that were taken back or replaced.
    cancelled: usize,
    /// Time on the clock, seconds.
    wall_s: f64,
}

impl ServeReport {
    fn count(&mut self, state: GoalState) {
        match state {
            GoalState::Arrived => self.arrived += 1,
            GoalState::Failed => self.failed += 1,
            GoalState::Cancelled => self.cancelled += 1,
            GoalState::Idle | GoalState::Waiting | GoalState::Driving => {}
        }
    }
}

/// Serves until the program is asked to end, with the robot of the simulator or the one that
/// `--ros` names.
pub(super) fn serving(
    mut file: ClientFile,
    args: &ServeArgs,
    waiting: &Waiting,
    stop: &Stop,
) -> Result<ExitCode, CliError> {
    // Nothing waits for work beside the loop: the robot is one among others.
    (file.client.walls, file.client.paths.taking) = (Taking::WhenThere, Taking::WhenThere);
    check_owner(&file.connect, "client", file.name())?;
    check_serving(&file.connect)?;
    let service = Service { args: &args.robot, waiting, stop, began: Instant::now() };
    let Some(endpoint) = &args.robot.ros else {
        let net = descriptor_net(&mut file)?;
        let (simulator, _) = robot(&args.robot.setup, &file)?;
        file.client.silence = patience(&args.robot.setup, file.client.silence);
        let robot = Paced::new(simulator, Some(args.rate.unwrap_or(1.0)));
        return service.run(&runtime()?, file, Some(net), robot, |_, _, _| Ok(None));
    };
    file.client.silence = live_silence(file.client.silence);
    let OnGraph { runtime, node, robot } = OnGraph::join(&file, &args.robot, endpoint, waiting, stop)?;
    file.robot.cameras &= robot.has_cameras();
    let net = file.robot.cameras.then(|| descriptor_net(&mut file)).transpose()?;
    let (ros, drive) = (file.ros.clone(), args.robot.drive);
    let nav2 = runtime.block_on(nav2_driver(drive, &node))?;
    let robot = DrivenByNav2::new(robot, nav2.clone());
    service.run(&runtime, file, net, robot, |runtime, robot, replica| {
        runtime.block_on(async {
            let outputs = PlaceOutputs::start(&node, robot.robot(), replica).await?;
            let navigation = match drive {
                ClientDriver::Client => NavigateDesk::open(&node, &ros).await?,
                // Who drives takes goals, too.
                ClientDriver::Nav2 => None,
            };
            Ok::<_, CliError>(Some(GraphSide { outputs, navigation, nav2 }))
        })
    })
}

/// What a robot's own graph gets, and what it asks.
struct GraphSide<'r> {
    outputs: PlaceOutputs<'r>,
    navigation: Option<(NavigateDesk, WhereNow)>,
    nav2: Option<Arc<Nav2Driver>>,
}

/// What all serving needs.
struct Service<'a> {
    args: &'a RobotArgs,
    waiting: &'a Waiting,
    stop: &'a Stop,
    began: Instant,
}

impl Service<'_> {
    /// Serves with `robot`; `graph` makes what its own graph gets and asks, if it has one.
    fn run<R: Robot>(
        &self,
        runtime: &Runtime,
        file: ClientFile,
        mut net: Option<DescriptorNet>,
        robot: R,
        graph: impl for<'r> FnOnce(&Runtime, &R, &'r LiveReplica) -> Result<Option<GraphSide<'r>>, CliError>,
    ) -> Result<ExitCode, CliError> {
        let Self { args, waiting, stop, began } = self;
        let (map, name) = (file.map(), file.name().to_owned());
        let OnMap { session, presence, alive: _alive, replica } = OnMap::join(&file, net.as_ref(), waiting, stop)?;
        let mut paths =
            ServerPaths::new(&session, map.clone(), &name, &replica, &file.client.paths).map_err(CliError::Thread)?;
        let mut describe = net.as_mut().map(describing);
        let mut describe = |panorama: &Panorama| describe.as_mut()?(panorama);
        let report = ServeReport { robot: name.clone(), map: map.to_string(), ..Default::default() };
        let report = Arc::new(Mutex::new(report));
        let display = Display::new(args, &name);
        let (counted, says) = (Arc::clone(&report), !args.quiet && !args.report.json);
        let fleet = GoalService::start(&session, &map, &name, move |news| {
            counted.lock().unwrap_or_else(PoisonError::into_inner).count(news.state);
            if says {
                print_line!("{}", in_words(news));
            }
        })?;
        let (outputs, navigation, nav2) = match graph(runtime, &robot, &replica)? {
            Some(GraphSide { outputs, navigation, nav2 }) => (Some(outputs), navigation, nav2),
            None => (None, None, None),
        };
        let guide = nav2.clone().map(Nav2Guide::new);
        let (navigation, place) = navigation.unzip();
        // The robot's own graph first: what the fleet's desk tells of it is then new.
        let mut desk = (navigation, fleet);
        // The robot stands, all is said and the bag is whole before the program ends.
        let _order = stop.in_order();
        let recording = Recording::start(args.record.as_deref(), &replica)?;
        let publisher = PosePublisher::new(presence, &replica);
        let ready = Ready(says.then(|| (name.clone(), map.to_string())));
        let until_asked = UntilAsked((*stop).clone());
        let mut observer = (recording, (until_asked, ((publisher, (outputs, (place, guide))), (display, ready))));
        let ClientSection { pilot, silence, walls, .. } = file.client;
        let config = MissionConfig { pilot, silence, walls, ..MissionConfig::default() };
        let mut driven = Nav2Paths::new(&mut paths, nav2);
        let mut services = Services { map: &replica, paths: &mut driven, describe: &mut describe };
        let ended = runtime.block_on(serve(robot, config, &name, &mut desk, &mut services, &mut observer));
        let (recording, (_, ((publisher, (outputs, _)), (display, _)))) = observer;
        publisher.finish();
        let (navigation, fleet) = desk;
        if let Some(navigation) = navigation {
            runtime.block_on(navigation.close());
        }
        drop((fleet, outputs));
        display.finish();
        let recorded = recording.finish();
        let mut report = report.lock().unwrap_or_else(PoisonError::into_inner).clone();
        report.wall_s = began.elapsed().as_secs_f64();
        give(args, &report)?;
        recorded?;
        match ended {
            Ok(()) => Ok(ExitCode::SUCCESS),
            Err(ServeError::Mission(MissionError::Interrupted)) => {
                fht_program::tell_line!("client-robot: the robot stands and takes no more goals");
                Ok(ExitCode::SUCCESS)
            }
            Err(lost @ ServeError::Lost(_)) => {
                fht_program::tell_line!("client-robot: {lost}");
                Ok(ExitCode::from(1))
            }
            Err(ServeError::Mission(error)) => Err(error.into()),
        }
    }
}

fn give(args: &RobotArgs, report: &ServeReport) -> Result<(), CliError> {
    let in_words = |report: &ServeReport| {
        if !args.quiet {
            print_line!("{} arrived, {} failed, {} cancelled", report.arrived, report.failed, report.cancelled);
        }
    };
    args.report.give(report, in_words).map_err(CliError::Report)
}

/// Says once that the robot, of this name and on this map, knows its place: from then on it takes
/// goals.
struct Ready(Option<(String, String)>);

impl MissionObserver for Ready {
    fn on_frame(&mut self, _: &SensorFrame, step: &PilotStep, _: &Pilot) -> ControlFlow<()> {
        if let Some(at) = step.localization.map_from_base()
            && let Some((robot, map)) = self.0.take()
        {
            let at = at.translation;
            print_line!("{robot} is at ({:.2}, {:.2}) on map {map} and takes goals", at.x, at.y);
        }
        ControlFlow::Continue(())
    }
}

fn in_words(news: &GoalStatus) -> String {
    let id = news.id.as_deref().unwrap_or_default();
    let to = news.goal.map(|[x, y]| format!(" ({x:.2}, {y:.2})")).unwrap_or_default();
    let far = news.to_go_m.map(|metres| format!(", {metres:.1} m to go")).unwrap_or_default();
    let why = news.reason.as_deref().map(|reason| format!(": {reason}")).unwrap_or_default();
    format!("goal {id}{to}: {}{far}{why}", news.state)
}
