//! `client-robot relocalize` and `client-robot go`: a robot in a simulated world, with a task on a
//! map of a real server.

use super::arguments::RobotArgs;
use super::connection::{ASK_AGAIN, runtime};
use super::display::Display;
use super::error::CliError;
use super::on_map::OnMap;
use super::pose_publisher::PosePublisher;
use super::recording::Recording;
use super::report::{MissionReport, print_report, tell};
use super::scoring::MissionScore;
use super::settings::{ClientFile, ClientSection};
use crate::mission::{
    MapSource, MissionConfig, MissionError, MissionGoal, MissionObserver, Services, check_on_map, place_of, run,
};
use crate::pilot::{DriveGoal, Pilot, PilotStep};
use fht_client::{LiveReplica, ServerPaths};
use fht_descriptor::{DescriptorError, DescriptorNet, Fetching};
use fht_perception::frame::{Panorama, SensorFrame};
use fht_perception::pose::Pose2;
use fht_perception::robot::SilenceConfig;
use fht_program::{Stop, Waiting};
use fht_proto::api::reply::known_names;
use fht_proto::{Descriptor, MapName};
use fht_session::check_owner;
use fht_shared_world::seat;
use fht_sim::{SimSetup, Simulator};
use std::ops::ControlFlow;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Instant;

/// What is said for a node far off.
pub(super) const RANDOM: &str = "random";
/// Room that a random start has around it, metres.
const START_CLEARANCE_M: f64 = 0.4;

/// Carries out the mission with a simulated robot, and writes its figures.
pub(super) fn mission(
    mut file: ClientFile,
    args: &RobotArgs,
    goal: &MissionGoal,
    waiting: &Waiting,
    stop: &Stop,
) -> Result<ExitCode, CliError> {
    let began = Instant::now();
    let (map, name) = (file.map(), file.name().to_owned());
    check_owner(&file.connect, "client", &name)?;
    tracing::info!(%map, robot = name, "looks for its place");
    let mut net = descriptor_net(&mut file)?;
    let (simulator, world_from_map) = robot(&args.setup, &file)?;

    let OnMap { session, presence, alive: _alive, replica } = OnMap::join(&file, Some(&net), waiting, stop)?;
    let goal = &called_random(goal, &replica);
    require(goal, file.client.to_nearest, &map, &replica, waiting)?;
    let mut paths =
        ServerPaths::new(&session, map.clone(), &name, &replica, &file.client.paths).map_err(CliError::Thread)?;
    let mut describe = describing(&mut net);
    let display = Display::new(args, &name);
    let publisher = PosePublisher::new(presence, &replica);
    // The robot stands and its bag is whole before the program ends.
    let _order = stop.in_order();
    let recording = Recording::start(args.record.as_deref(), &replica)?;
    let score = MissionScore::new(&simulator, &world_from_map);
    let mut observer = (recording, (UntilAsked(stop.clone()), ((publisher, display), score)));
    let ClientSection { pilot, silence, to_nearest, walls, paths: asking, .. } = file.client;
    let silence = patience(&args.setup, silence);
    let config = MissionConfig { pilot, silence, footprint: asking.footprint, to_nearest, walls };
    let mut services = Services { map: &replica, paths: &mut paths, describe: &mut describe };
    let outcome = runtime()?.block_on(run(simulator, config, goal, &mut services, &mut observer));
    let (recording, (_, ((publisher, display), score))) = observer;
    publisher.finish();
    display.finish();
    let recorded = recording.finish();
    let outcome = match outcome {
        Err(MissionError::Interrupted) => {
            recorded?;
            fht_program::tell_line!("client-robot: interrupted on the way: the robot stands");
            return Ok(stop.exit_code().unwrap_or(ExitCode::FAILURE));
        }
        outcome => outcome?,
    };
    let report = MissionReport {
        fallbacks: paths.fallbacks(),
        robot: name,
        map: map.to_string(),
        wall_s: began.elapsed().as_secs_f64(),
        ..score.finish(&outcome)
    };
    let report = report.rounded();
    tell(args, &report, print_report, report.failure.as_deref(), recorded)?;
    let is_done =
        if *goal == MissionGoal::None { report.localized_at_end && report.failure.is_none() } else { report.arrived };
    Ok(if is_done { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

/// The network that describes what the robot sees. From when on two pictures are of one place, it
/// says itself unless the configuration does: what the map says, any explorer can write.
pub(super) fn descriptor_net(file: &mut ClientFile) -> Result<DescriptorNet, DescriptorError> {
    let fetching = if file.robot.fetch { Fetching::Allowed } else { Fetching::Never };
    let net = DescriptorNet::load_with(file.robot.model.as_deref(), fetching)?;
    let threshold = f32::from(net.model().match_threshold_e3) / 1000.0;
    file.client.pilot.localize.relocalize.min_similarity.get_or_insert(threshold);
    Ok(net)
}

/// The descriptors of panoramas.
pub(super) fn describing(net: &mut DescriptorNet) -> impl FnMut(&Panorama) -> Option<Descriptor> + Send {
    let model = net.model().id;
    move |panorama| match net.describe(panorama) {
        Ok(components) => Some(Descriptor::quantise(model, &components)),
        Err(error) => {
            tracing::warn!(%error, "no descriptor of this panorama");
            None
        }
    }
}

/// Ends the mission when the program is asked to end.
pub(super) struct UntilAsked(pub(super) Stop);

impl MissionObserver for UntilAsked {
    fn on_frame(&mut self, _: &SensorFrame, _: &PilotStep, _: &Pilot) -> ControlFlow<()> {
        if self.0.is_set() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    fn is_over(&mut self) -> bool {
        self.0.is_set()
    }
}

/// How long the sensors of a simulated robot may be silent: for ever in a world that it shares,
/// where it waits for others.
pub(super) fn patience(setup: &SimSetup, usual: SilenceConfig) -> SilenceConfig {
    if setup.shared_world.is_some() { SilenceConfig::patient() } else { usual }
}

/// The simulated robot at its start, and where the map's frame truly lies.
pub(super) fn robot(setup: &SimSetup, file: &ClientFile) -> Result<(Simulator, Pose2), CliError> {
    let world = Arc::new(setup.load()?);
    let sim = &file.sim;
    let radius_m = sim.radius_m.max(file.robot.footprint.circumscribed_radius_m());
    let start =
        setup.start_in(&world, radius_m)?.unwrap_or_else(|| world.random_free_pose(setup.seed, START_CLEARANCE_M));
    let world_from_map = setup.map_origin.unwrap_or_else(|| world.start());
    let simulator = Simulator::new(world, sim.clone(), start, setup.seed);
    let (simulator, _) = seat(simulator, setup, file.name())?;
    Ok((simulator, world_from_map))
}

/// `random` is a node far off, unless a place is called so.
pub(super) fn called_random(goal: &MissionGoal, replica: &LiveReplica) -> MissionGoal {
    let is_random = matches!(goal, MissionGoal::FarNode(_));
    let name = RANDOM.parse().ok().filter(|name| is_random && MapSource::place(replica, name).is_some());
    name.map_or_else(|| goal.clone(), MissionGoal::Named)
}

/// Before the robot drives: that the map has the goal, and that a point is on it unless the robot
/// may go `to_nearest`.
pub(super) fn require(
    goal: &MissionGoal,
    to_nearest: bool,
    map: &MapName,
    replica: &LiveReplica,
    waiting: &Waiting,
) -> Result<(), CliError> {
    let mut content = waiting.for_content();
    loop {
        let unknown =
            |what: String| CliError::UnknownGoal { map: map.clone(), what, known: known_names(replica.places()) };
        let refusal = match goal {
            MissionGoal::Named(name) if MapSource::place(replica, name).is_none() => {
                unknown(format!("place called {name}"))
            }
            MissionGoal::Node(id) if replica.running().node(*id).is_none() => unknown(format!("node {id}")),
            MissionGoal::Point(_) | MissionGoal::Pose(_) => {
                let place =
                    place_of(goal, replica).and_then(|place| check_on_map(&DriveGoal { to_nearest, ..place }, replica));
                match place {
                    Ok(()) => return Ok(()),
                    Err(refused) => CliError::Refused(refused),
                }
            }
            MissionGoal::Named(_) | MissionGoal::Node(_) | MissionGoal::None | MissionGoal::FarNode(_) => return Ok(()),
        };
        if !content.goes_on(&refusal) {
            return Err(refusal);
        }
        std::thread::sleep(ASK_AGAIN);
    }
}
