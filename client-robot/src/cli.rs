//! The command line.

use crate::landmarks::check_usable;
use crate::mission::{Goal, Services, run};
use crate::paths::{ServerPaths, ServerPathsConfig, UnusablePath, ask_path, planned};
use crate::pilot::{PilotConfig, Step};
use crate::recording::Recording;
use crate::replica::{AskError, LiveReplica, ReplicaConfig, ReplicaError, ask_head};
use crate::report::Report;
use crate::route::{PlannedPath, Planner};
use clap::{Args, Parser, Subcommand};
use fht_link::{LinkConfig, LinkError, open};
use fht_proto::fleet::{LocalizationState, RobotPose, RobotRole, RobotStatus};
use fht_proto::keys::{Key, RobotTopic};
use fht_proto::query::Place;
use fht_proto::{Descriptor, MapName};
use fht_robot::descriptor::DescriptorNet;
use fht_robot::frame::{Panorama, SensorFrame};
use fht_robot::pose::{self, Point2, Pose2};
use fht_sim::{SimConfig, Simulator, WorldError};
use indicatif::{ProgressBar, ProgressStyle};
use std::ffi::OsString;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::{Duration, Instant};
use zenoh::{Session, Wait};

/// How long questions to the server may take.
const TIMEOUT: Duration = Duration::from_secs(5);
/// Room that a random start has around it, metres.
const START_CLEARANCE_M: f64 = 0.4;
/// Frames between published poses: 1 s.
const POSE_EVERY: u64 = 5;

/// A robot that finds its place on a map and drives there.
#[derive(Debug, Parser)]
#[command(name = "client-robot", version)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Move about until the robot knows where it is.
    Relocalize {
        #[command(flatten)]
        link: LinkArgs,
        #[command(flatten)]
        robot: RobotArgs,
    },
    /// Ask for a path between two places of the map.
    Path {
        #[command(flatten)]
        link: LinkArgs,
        /// From where: x,y in metres, a node id or the name of a place.
        #[arg(long, allow_hyphen_values = true)]
        from: String,
        /// Where to: x,y in metres, a node id or the name of a place.
        #[arg(long, allow_hyphen_values = true)]
        to: String,
        /// Print JSON.
        #[arg(long)]
        json: bool,
    },
    /// Find the place, then drive to a goal.
    Go {
        #[command(flatten)]
        link: LinkArgs,
        #[command(flatten)]
        robot: RobotArgs,
        /// Where to: x,y in metres (map frame), a node id, the name of a place, or 'random'.
        #[arg(long, allow_hyphen_values = true)]
        to: String,
    },
}

#[derive(Debug, Args)]
struct LinkArgs {
    /// Where the map-server or a router listens (repeatable) [default: tcp/127.0.0.1:7447, unless --zenoh-config is given].
    #[arg(long, value_name = "ENDPOINT")]
    connect: Vec<String>,
    /// A Zenoh configuration file (JSON5): endpoints, TLS, credentials. --connect goes before what it says.
    #[arg(long, value_name = "FILE")]
    zenoh_config: Option<PathBuf>,
    /// The map.
    #[arg(long, default_value = "museum")]
    map: MapName,
}

#[derive(Debug, Args)]
struct RobotArgs {
    /// The world that the simulated robot is in: museum, office, or the path of a Nav2 map.yaml or a Gazebo .world.
    #[arg(long, default_value = "museum")]
    world: String,
    /// Pictures for the walls of a map.yaml.
    #[arg(long)]
    textures: Option<PathBuf>,
    /// Seed of the building's drawing.
    #[arg(long, default_value_t = 1)]
    world_seed: u64,
    /// Where the robot starts: x,y,yaw in the world frame, metres and radians. Default: anywhere free, by the seed.
    #[arg(long, value_parser = pose::parse, allow_hyphen_values = true)]
    start: Option<Pose2>,
    /// Where the map's frame truly is: x,y,yaw in the world frame. For scoring only. Default: the world's start, where
    /// explorers start.
    #[arg(long, value_parser = pose::parse, allow_hyphen_values = true)]
    map_origin: Option<Pose2>,
    /// Seed of start, noise and wandering.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Seed of light and camera gain: another day than the mapping.
    #[arg(long, default_value_t = 1)]
    light_seed: u64,
    /// The robot's name.
    #[arg(long, default_value = "client")]
    robot: String,
    /// A descriptor model to use in place of the built-in one: an ONNX file with its description beside it, the one that the
    /// map was made with.
    #[arg(long)]
    model: Option<PathBuf>,
    /// Drive without cameras, as in the dark: the place is found by the scanner alone.
    #[arg(long)]
    no_camera: bool,
    /// Give up after this many seconds of simulated time.
    #[arg(long, default_value_t = 1500.0, value_parser = parse_seconds)]
    max_time_s: f64,
    /// Write the run as a bag for ROS 2 and Foxglove: a file (FILE.mcap) or a rosbag2 folder.
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// Write the figures to this file, as JSON.
    #[arg(long)]
    report: Option<PathBuf>,
    /// Print the figures as JSON.
    #[arg(long)]
    json: bool,
    /// Print nothing but errors.
    #[arg(long)]
    quiet: bool,
}

fn parse_seconds(text: &str) -> Result<f64, String> {
    let value = text.parse::<f64>().ok().filter(|value| (0.0..=1e7).contains(value));
    value.ok_or_else(|| format!("'{text}' is not a number of seconds from 0 to 10000000"))
}

/// Why the program ends early.
#[derive(Debug, thiserror::Error)]
enum CliError {
    #[error(transparent)]
    Link(#[from] LinkError),
    #[error(transparent)]
    Replica(#[from] ReplicaError),
    #[error("{0}")]
    Ask(#[from] AskError),
    #[error("{0}")]
    Refused(#[from] fht_proto::query::ErrorReply),
    #[error(transparent)]
    World(#[from] WorldError),
    #[error("the descriptor network cannot be loaded: {0}")]
    Descriptor(#[from] fht_robot::descriptor::DescriptorError),
    #[error("the server's answer cannot be used: {0}")]
    Path(#[from] UnusablePath),
    #[error("robot name '{0}' is not 1 to 64 letters, digits, '_' or '-'")]
    RobotName(String),
    #[error("the map '{0}' has no main nodes yet; nothing to relocalize at")]
    EmptyMap(MapName),
    #[error("{path}: {source}", path = path.display())]
    Write { path: PathBuf, source: std::io::Error },
    #[error("a thread cannot be started: {0}")]
    Thread(#[source] std::io::Error),
    #[error("no runtime: {0}")]
    Runtime(#[source] std::io::Error),
    #[error("zenoh: {0}")]
    Zenoh(#[from] zenoh::Error),
    #[error("the recording failed: {0}")]
    Record(#[from] fht_robot::bag::WriteError),
    #[error("the report cannot be written as JSON: {0}")]
    Json(#[from] serde_json::Error),
}

/// Runs the program. Exit code 0: the task is done; 1: it failed, and the robot said why; 2: it could not be tried.
pub fn main_with_args(args: impl IntoIterator<Item = OsString>) -> ExitCode {
    let cli = match Cli::try_parse_from(args) {
        Ok(cli) => cli,
        Err(error) => {
            // Printing usage can only fail with the output closed, and then nobody reads.
            let _ = error.print();
            return if error.use_stderr() { ExitCode::from(2) } else { ExitCode::SUCCESS };
        }
    };
    let filter = tracing_subscriber::EnvFilter::try_from_default_env()
        .unwrap_or_else(|_| tracing_subscriber::EnvFilter::new("error,fht_link=warn"));
    // Another program may have set a logger in this process already.
    let _ = tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr).try_init();
    let outcome = match cli.command {
        Command::Path { link, from, to, json } => path(&link, &from, &to, json),
        Command::Relocalize { link, robot } => mission(&link, &robot, Goal::None),
        Command::Go { link, robot, to } => match parse_goal(&to, robot.seed) {
            Ok(goal) => mission(&link, &robot, goal),
            Err(refusal) => Err(refusal.into()),
        },
    };
    outcome.unwrap_or_else(|error| {
        eprintln!("client-robot: {error}");
        ExitCode::from(2)
    })
}

fn parse_goal(text: &str, seed: u64) -> Result<Goal, fht_proto::query::ErrorReply> {
    if text == "random" {
        return Ok(Goal::FarNode(seed));
    }
    Ok(match text.parse::<Place>()? {
        Place::Point(point) => Goal::Point(Point2::new(point.x(), point.y())),
        Place::Node(id) => Goal::Node(id),
        Place::Named(name) => Goal::Named(name),
    })
}

fn connect(link: &LinkArgs) -> Result<Session, CliError> {
    // Zenoh brings its own threads but wants to be opened from a multi-threaded runtime.
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(1)
        .enable_all()
        .build()
        .map_err(CliError::Runtime)?;
    Ok(runtime.block_on(open(&LinkConfig::from_options(link.connect.clone(), link.zenoh_config.clone())))?)
}

fn path(link: &LinkArgs, from: &str, to: &str, json: bool) -> Result<ExitCode, CliError> {
    from.parse::<Place>()?;
    to.parse::<Place>()?;
    let session = connect(link)?;
    wait_for_server(&session, &link.map)?;
    let path = match ask_path(&session, &link.map, from, to, TIMEOUT) {
        Ok(reply) if json => {
            println!("{}", serde_json::to_string_pretty(&reply)?);
            return Ok(ExitCode::SUCCESS);
        }
        Ok(reply) => planned(reply)?,
        Err(AskError::Refused(refusal)) => {
            eprintln!("client-robot: {:?}: {}", refusal.code, refusal.message);
            return Ok(ExitCode::from(1));
        }
        Err(error) => return Err(error.into()),
    };
    print_path(&path);
    Ok(ExitCode::SUCCESS)
}

fn print_path(path: &PlannedPath) {
    println!("{:.2} m, {} points", path.length_m, path.points.len());
    for point in &path.points {
        let node = point.node.map(|id| id.to_string()).unwrap_or_default();
        println!("{:9.3} {:9.3}  {node}", point.position.x, point.position.y);
    }
}

/// A client session connects in the background: asks until the server answers, for as long as a question may take.
fn wait_for_server(session: &Session, map: &MapName) -> Result<fht_proto::query::Head, AskError> {
    let deadline = Instant::now() + TIMEOUT;
    loop {
        match ask_head(session, map, Duration::from_secs(1)) {
            Err(AskError::Silent) if Instant::now() < deadline => std::thread::sleep(Duration::from_millis(100)),
            outcome => return outcome,
        }
    }
}

fn mission(link: &LinkArgs, args: &RobotArgs, goal: Goal) -> Result<ExitCode, CliError> {
    let began = Instant::now();
    let robot_key = Key::Robot { map: link.map.clone(), robot: args.robot.clone() }.to_string();
    if robot_key.parse::<Key>().is_err() {
        return Err(CliError::RobotName(args.robot.clone()));
    }
    let mut net = DescriptorNet::load(args.model.as_deref())?;
    let world = Arc::new(fht_sim::load(&args.world, args.textures.as_deref(), args.world_seed)?);
    let start = args.start.unwrap_or_else(|| world.random_free_pose(args.seed, START_CLEARANCE_M));
    let world_from_map = args.map_origin.unwrap_or_else(|| world.start());

    let session = connect(link)?;
    let _alive = session.liveliness().declare_token(robot_key).wait()?;
    let replica = LiveReplica::start(&session, &link.map, &args.robot, ReplicaConfig::default())?;
    let head = wait_for_server(&session, &link.map)?;
    if !replica.wait_for(&head.vector, TIMEOUT) {
        tracing::warn!("the copy of the map is not complete yet");
    }
    if replica.running().counts().main_nodes == 0 {
        return Err(CliError::EmptyMap(link.map.clone()));
    }
    if args.no_camera {
        tracing::info!("without cameras: the place is found by the scanner alone");
    } else if let Err(reason) = check_usable(&replica.running(), net.model()) {
        tracing::warn!(%reason, "pictures are of no use on this map: the place is found by the scanner alone");
    }

    let camera_every = if args.no_camera { 0 } else { SimConfig::default().camera_every };
    let sim = SimConfig { light_seed: args.light_seed, camera_every, ..SimConfig::default() };
    let mut simulator = Simulator::new(world, sim, start, args.seed);
    let config = PilotConfig { seed: args.seed, max_time_s: args.max_time_s, ..PilotConfig::default() };
    let asking = ServerPathsConfig { timeout: TIMEOUT, ..ServerPathsConfig::default() };
    let mut paths =
        ServerPaths::new(&session, link.map.clone(), &args.robot, &replica, &asking).map_err(CliError::Thread)?;
    let bar = progress(args);
    let pose_key = Key::robot(&link.map, &args.robot, RobotTopic::Pose).to_string();
    let status_key = Key::robot(&link.map, &args.robot, RobotTopic::Status).to_string();
    let model = net.model().id;
    let mut describe = |panorama: &Panorama| match net.describe(panorama) {
        Ok(components) => Some(Descriptor::quantise(model, &components)),
        Err(error) => {
            tracing::warn!(%error, "no descriptor of this panorama");
            None
        }
    };
    let mut frames = 0_u64;
    let mut recording = args.record.as_deref().map(Recording::start).transpose()?;
    let mut on_frame = |frame: &SensorFrame, step: &Step| {
        if let Some(recording) = &mut recording {
            recording.record(frame, step);
        }
        if frames.is_multiple_of(POSE_EVERY) {
            publish(&session, &pose_key, &pose_of(&args.robot, step));
            publish(&session, &status_key, &status_of(&link.map, &args.robot, &replica, step));
            show(&bar, frame, step);
        }
        frames += 1;
    };
    let mut services = Services { map: &replica, paths: &mut paths, describe: &mut describe, on_frame: &mut on_frame };
    let mut report = run(&mut simulator, config, goal.clone(), &world_from_map, &mut services);
    bar.finish_and_clear();
    if let Some(recording) = recording {
        recording.finish()?;
    }
    report.fallbacks = paths.fallbacks();
    report.robot.clone_from(&args.robot);
    report.map = link.map.to_string();
    report.wall_s = began.elapsed().as_secs_f64();
    write_report(args, &report)?;
    let is_done = if goal == Goal::None { report.localized_at_end } else { report.arrived };
    Ok(if is_done { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

fn progress(args: &RobotArgs) -> ProgressBar {
    if args.quiet || args.json {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new_spinner();
    if let Ok(style) = ProgressStyle::with_template("{spinner} {prefix} {msg}") {
        bar.set_style(style);
    }
    bar.set_prefix(args.robot.clone());
    bar
}

fn show(bar: &ProgressBar, frame: &SensorFrame, step: &Step) {
    let place = step.localization.map_from_base().map_or_else(
        || match step.localization.state {
            LocalizationState::Candidates => format!("CANDIDATES ({:.0} %)", 100.0 * step.localization.confidence),
            state => state.to_string(),
        },
        |at| format!("at ({:.2}, {:.2})", at.translation.x, at.translation.y),
    );
    let seconds = frame.time_us / 1_000_000;
    bar.set_message(format!("{place}, {:.1} m driven, {seconds} s", step.localization.odometry.odometer_m));
    bar.tick();
}

fn pose_of(robot: &str, step: &Step) -> RobotPose {
    let at = step.localization.map_from_base();
    RobotPose {
        robot: robot.to_owned(),
        localized: at.is_some(),
        state: step.localization.state,
        confidence: step.localization.confidence,
        candidates: step
            .candidates
            .iter()
            .map(|at| [at.translation.x, at.translation.y, at.rotation.angle()])
            .collect(),
        map_from_base: at.map(|at| [at.translation.x, at.translation.y, at.rotation.angle()]),
    }
}

fn status_of(map: &MapName, robot: &str, replica: &LiveReplica, step: &Step) -> RobotStatus {
    let at = step.localization.map_from_base();
    let vector = replica.read().vector().clone();
    RobotStatus {
        robot: robot.to_owned(),
        role: RobotRole::Client,
        map: map.clone(),
        version: vector.version(),
        vector,
        release: replica.release().map(|release| release.to_string()),
        state: step.localization.state,
        map_from_base: at.map(|at| [at.translation.x, at.translation.y, at.rotation.angle()]),
    }
}

/// Lost ones do no harm: the next is soon there.
fn publish<T: serde::Serialize>(session: &Session, key: &str, message: &T) {
    let Ok(json) = serde_json::to_vec(message) else { return };
    if let Err(error) = session.put(key, json).encoding(zenoh::bytes::Encoding::APPLICATION_JSON).wait() {
        tracing::debug!(%error, key, "not published");
    }
}

fn write_report(args: &RobotArgs, report: &Report) -> Result<(), CliError> {
    let json = serde_json::to_string_pretty(report)?;
    if let Some(path) = &args.report {
        std::fs::write(path, &json).map_err(|source| CliError::Write { path: path.clone(), source })?;
    }
    if args.json {
        println!("{json}");
    } else if !args.quiet {
        print_report(report);
    }
    Ok(())
}

fn print_report(report: &Report) {
    match (report.relocalization_distance_m, report.relocalization_error_m, report.relocalization_error_deg) {
        (Some(driven), Some(metres), Some(degrees)) => {
            println!("localized after {driven:.1} m, error {metres:.3} m and {degrees:.2} degrees");
        }
        _ => println!("not localized"),
    }
    if report.arrived
        && let (Some(driven), Some(left)) = (report.path_length_m, report.goal_distance_m)
    {
        let shortest = report.shortest_length_m.map(|m| format!(" (shortest {m:.1} m)")).unwrap_or_default();
        println!("arrived after {driven:.1} m{shortest}, {left:.2} m from the goal");
    }
    if let Some(failure) = &report.failure {
        println!("failed: {failure}");
    }
    if report.planner == Some(Planner::Replica) {
        println!("the server was silent: the path was planned on the robot's own copy of the map");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_that_never_comes_is_refused() {
        let parse = |value: &str| Cli::try_parse_from(["client-robot", "relocalize", "--max-time-s", value]);
        assert!(parse("60").is_ok());
        for value in ["nan", "inf", "-1", "1e300", "soon"] {
            assert!(parse(value).is_err(), "{value}");
        }
    }
}
