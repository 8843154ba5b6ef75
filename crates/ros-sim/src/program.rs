//! `sim robot`: a simulated robot for whoever speaks ROS 2 over Zenoh; `sim play`: a recorded one;
//! `sim router`: a router for its graph.

use crate::config::{CommandType, PictureKind, SimRobotConfig};
use crate::robot::{LiveError, SimRobot, SimRobotReport, live, play};
use clap::{Args, Parser, Subcommand};
use fht_bag::{BagError, BagReport, FrameConfig, Frames, TopicConfig};
use fht_perception::pose::pose;
use fht_perception::robot::{Paced, RobotError, Sensors};
use fht_program::flags::{CompletionsArgs, ReportArgs, missing_command, number, parse_args, seconds};
use fht_program::{Order, ProgramFailure, Stop, logging, print_line, tell_line};
use fht_proto::RobotName;
use fht_ros::{RosError, RosNode};
use fht_ros_robot::NodeArgs;
use fht_session::{ConfigurationError, SessionConfig, SessionError, WAIT_BEFORE_DROP, in_words, set, set_endpoints};
use fht_shared_world::{JoinError, seat};
use fht_sim::{SimConfig, SimSetup, Simulator, StartError, WorldError};
use std::ffi::OsString;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// The program's name.
const NAME: &str = "sim";
/// Room that a start has around it that is drawn by lot, metres.
const START_CLEARANCE_M: f64 = 0.4;
/// Between two looks for who listens.
const LISTENER_EVERY: Duration = Duration::from_millis(20);
/// How long time waits for a command with `--in-step`, seconds: as long as a scan takes.
const STEP_PATIENCE_S: &str = "0.2";

/// A simulated robot that speaks ROS 2, and a router for its graph.
#[derive(Debug, Parser)]
#[command(
    name = NAME,
    version,
    max_term_width = 100,
    arg_required_else_help = true,
    after_help = "Examples:
  sim router --listen tcp/127.0.0.1:7460              what rmw_zenohd is on a robot
  sim robot --ros tcp/127.0.0.1:7460 --world office   … and a robot at it
  mapper explore --ros tcp/127.0.0.1:7460 --offline   … which makes a map"
)]
struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// A robot like a TurtleBot: scan, odom, tf, tf_static and ground_truth out, and pictures if it
    /// has cameras, cmd_vel in, until it is asked to end.
    #[command(after_help = "Examples:
  sim robot --ros tcp/127.0.0.1:7460
  sim robot --ros tcp/127.0.0.1:7460 --world office --namespace r1 --start 3,2,90
  sim robot --ros tcp/127.0.0.1:7460 --rate 5        five times as fast, by /clock
  sim robot --ros tcp/127.0.0.1:7460 --cameras jpeg  with four cameras
  sim robot --ros tcp/127.0.0.1:7460 --in-step       as fast as whoever drives it, by /clock

Exit code 0: it was asked to end, by Ctrl-C or SIGTERM; 1: it failed; 2: wrong usage or bad input.")]
    Robot(Box<RobotArgs>),
    /// Plays a bag as a live robot, as `ros2 bag play` does: scan, odom, tf and tf_static out.
    #[command(after_help = "Examples:
  sim play run.mcap --ros tcp/127.0.0.1:7460
  sim play run.mcap --ros tcp/127.0.0.1:7460 --rate 5 --wait-for-listener
  mapper explore --ros tcp/127.0.0.1:7460 --drive others --end-after 5    maps what it hears

Exit code 0: it was played, or asked to end; 1: it failed; 2: wrong usage or bad input.")]
    Play(Box<PlayArgs>),
    /// A Zenoh router without storages, until it is asked to end.
    #[command(after_help = "Examples:
  sim router --listen tcp/127.0.0.1:7460
  sim router --listen tcp/0.0.0.0:7447")]
    Router {
        /// Where it listens.
        #[arg(long, value_name = "ENDPOINT", default_value = "tcp/127.0.0.1:7447")]
        listen: String,
    },
    /// Writes completions for a shell to standard output.
    Completions(CompletionsArgs),
}

/// Where the robot's graph is.
#[derive(Debug, Args)]
struct GraphArgs {
    /// The robot's router, such as tcp/127.0.0.1:7460.
    #[arg(long, value_name = "ENDPOINT", default_value = "tcp/127.0.0.1:7447")]
    ros: String,
    /// How long to wait for the router, seconds [default: for ever].
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    wait: Option<f64>,
    #[command(flatten)]
    node: NodeArgs,
}

impl GraphArgs {
    async fn join(&self, stop: &Stop) -> Result<RosNode, SimError> {
        let link = SessionConfig::from_options(vec![self.ros.clone()], None);
        stop.doing(format!("waiting for the robot's router at {}", link.places()));
        let patience = self.wait.map(|wait| Duration::try_from_secs_f64(wait).unwrap_or(Duration::MAX));
        let session = fht_session::open_within(&link, patience).await?;
        Ok(RosNode::join(session, self.node.node("sim_robot")).await?)
    }
}

#[derive(Debug, Args)]
struct PlayArgs {
    /// The bag: a rosbag2 folder, an MCAP file, or a folder of MCAP files.
    bag: PathBuf,
    #[command(flatten)]
    graph: GraphArgs,
    /// Recorded seconds a second; other than 1, /clock says what time it is.
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, value_parser = |text: &str| number(text, 1e-3..=1e3))]
    rate: f64,
    /// Send the pictures of its four cameras, too.
    #[arg(long, value_name = "KIND")]
    cameras: Option<PictureKind>,
    /// Begin when somebody listens to the scans.
    #[arg(long)]
    wait_for_listener: bool,
}

#[derive(Debug, Args)]
struct RobotArgs {
    #[command(flatten)]
    setup: SimSetup,
    #[command(flatten)]
    graph: GraphArgs,
    /// Begin anywhere free, by the seed, in place of the world's own start.
    #[arg(long, conflicts_with = "start")]
    anywhere: bool,
    /// The robot's name in a shared world.
    #[arg(long, value_name = "NAME", default_value = "robot")]
    robot: RobotName,
    /// Simulated seconds a second, 1 unless --in-step is given; other than 1, /clock says what time
    /// it is.
    #[arg(long, value_name = "FACTOR", value_parser = |text: &str| number(text, 1e-3..=1e3))]
    rate: Option<f64>,
    /// Let time wait after each scan for a command, so long at most (0.2 s unless SECONDS are
    /// given), and go on with it at once, or when --rate lets it; /clock says what time it is.
    #[arg(long, value_name = "SECONDS", num_args = 0..=1, require_equals = true,
        default_missing_value = STEP_PATIENCE_S, value_parser = |text: &str| number(text, 0.0..=3600.0))]
    in_step: Option<f64>,
    /// Take velocity commands without a stamp (geometry_msgs/Twist).
    #[arg(long)]
    plain_twist: bool,
    /// Have four cameras that look all round: camera_front/image and camera_front/camera_info, and
    /// so on with left, back, right; png and jpeg: camera_front/image/compressed.
    #[arg(long, value_name = "KIND")]
    cameras: Option<PictureKind>,
    /// Seed of the light in the building and of the cameras' gain: another day.
    #[arg(long, value_name = "NUMBER", default_value_t = 0)]
    light_seed: u64,
    /// By how much more the wheels drift than usual.
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, value_parser = |text: &str| number(text, 0.0..=100.0))]
    drift: f64,
    #[command(flatten)]
    report: ReportArgs,
    /// Say nothing at the end.
    #[arg(long, short)]
    quiet: bool,
}

/// Why the program ended early.
#[derive(Debug, thiserror::Error)]
enum SimError {
    #[error(transparent)]
    World(#[from] WorldError),
    #[error(transparent)]
    Bag(#[from] BagError),
    #[error(transparent)]
    Start(#[from] StartError),
    #[error(transparent)]
    SharedWorld(#[from] JoinError),
    #[error("the robot's router: {0}")]
    Session(#[from] SessionError),
    #[error(transparent)]
    Graph(#[from] RosError),
    #[error(transparent)]
    Live(#[from] LiveError),
    #[error(transparent)]
    Configuration(#[from] ConfigurationError),
    #[error("no router: {}", in_words(.0))]
    Router(zenoh::Error),
    #[error("the robot's router is gone: of the {played} frames played, nobody heard the last ones")]
    Unheard { played: u64 },
    #[error("the bag gave no frame to play\n{0}")]
    NoFrames(Box<BagReport>),
    #[error("played {played} frames; then the bag is broken: {broken}")]
    Broken { played: u64, broken: String },
}

impl SimError {
    /// Whether what was given is wrong.
    fn is_input(&self) -> bool {
        match self {
            Self::World(_)
            | Self::Bag(_)
            | Self::NoFrames(_)
            | Self::Start(_)
            | Self::Configuration(_)
            | Self::Graph(RosError::Name(_)) => true,
            Self::SharedWorld(error) => error.is_input(),
            Self::Session(error) => error.is_input(),
            Self::Graph(_) | Self::Live(_) | Self::Router(_) | Self::Unheard { .. } | Self::Broken { .. } => false,
        }
    }
}

/// The command line, for whoever documents it.
#[must_use]
pub fn command() -> clap::Command {
    <Cli as clap::CommandFactory>::command()
}

/// Runs the program with `args` (the first is its name).
pub fn main_with_args(args: Vec<OsString>) -> ExitCode {
    let cli: Cli = match parse_args(args) {
        Ok(cli) => cli,
        Err(code) => return code,
    };
    let stop = match Stop::on_signal(NAME) {
        Ok(stop) => stop,
        Err(error) => return ProgramFailure::of_run(format!("signals cannot be handled: {error}")).tell(NAME),
    };
    logging::init(logging::ROBOT);
    let runtime = match fht_program::runtime(2) {
        Ok(runtime) => runtime,
        Err(error) => {
            return ProgramFailure::of_run(format!("the async runtime cannot be started: {error}")).tell(NAME);
        }
    };
    let outcome = match cli.command {
        Some(Command::Robot(args)) => match runtime.block_on(robot(&args, &stop)) {
            Ok((report, _order)) => match args.report.give(&report, |report| print_report(&args, report)) {
                Ok(()) => Ok(()),
                Err(failure) => Err(ProgramFailure::of_run(failure)),
            },
            Err(error) => Err(ProgramFailure::of(error.is_input(), error)),
        },
        Some(Command::Play(args)) => match runtime.block_on(play_bag(&args, &stop)) {
            Ok(frames) => {
                print_line!("played {frames} frames");
                Ok(())
            }
            Err(error) => Err(ProgramFailure::of(error.is_input(), error)),
        },
        Some(Command::Router { listen }) => {
            let outcome = runtime.block_on(router(&listen, &stop));
            outcome.map_err(|error| ProgramFailure::of(error.is_input(), error))
        }
        Some(Command::Completions(shell)) => {
            shell.print::<Cli>();
            Ok(())
        }
        None => return missing_command::<Cli>(),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => failure.tell(NAME),
    }
}

async fn robot(args: &RobotArgs, stop: &Stop) -> Result<(SimRobotReport, Order), SimError> {
    let world = Arc::new(args.setup.load()?);
    let usual = SimConfig::default();
    let camera_every = if args.cameras.is_some() { usual.camera_every } else { 0 };
    let sim = SimConfig { camera_every, light_seed: args.light_seed, drift_factor: args.drift, ..usual };
    let usual = || match args.anywhere {
        true => world.random_free_pose(args.setup.seed, START_CLEARANCE_M),
        false => world.start(),
    };
    let start = args.setup.start_in(&world, sim.radius_m)?.unwrap_or_else(usual);
    let simulator = Simulator::new(world, sim.clone(), start, args.setup.seed);
    let (simulator, _exit) = seat(simulator, &args.setup, args.robot.as_str())?;
    let node = args.graph.join(stop).await?;
    let in_step = args.in_step.map(Duration::from_secs_f64);
    // Who drives says how fast time goes, in place of the wall's clock.
    let rate = args.rate.or(in_step.is_none().then_some(1.0));
    let has_clock = in_step.is_some() || rate != Some(1.0);
    let config = SimRobotConfig {
        command_type: if args.plain_twist { CommandType::Plain } else { CommandType::Stamped },
        has_clock,
        pictures: args.cameras,
        camera_height_m: sim.camera_height_m,
        // A live robot's clock is everybody's.
        begin_us: if has_clock { SimRobotConfig::default().begin_us } else { wall_us() },
        ..SimRobotConfig::default()
    };
    let [x, y, up_m] = sim.lidar_mount_m;
    let topics = SimRobot::join(&node, config, &pose(x, y, 0.0), up_m).await?;
    let truth = simulator.watch_truth();
    if !args.quiet {
        tell_line!(
            "{NAME}: the robot is there, at ({:.2}, {:.2}) in the world",
            start.translation.x,
            start.translation.y
        );
    }
    // Its figures are told before the program ends.
    let order = stop.in_order();
    let report = live(topics, Paced::new(simulator, rate), &truth, in_step, stop.requested()).await?;
    Ok((report, order))
}

/// Plays a bag; returns how many frames it had.
async fn play_bag(args: &PlayArgs, stop: &Stop) -> Result<u64, SimError> {
    let usual = TopicConfig::default();
    // Pictures that are not sent need not be read.
    let topics = TopicConfig { cameras: usual.cameras.clone().filter(|_| args.cameras.is_some()), ..usual };
    let mut frames = Frames::open(&args.bag, FrameConfig { topics, ..FrameConfig::default() })?;
    let first = match frames.sense().await {
        Err(RobotError::Ended) => return Err(SimError::NoFrames(Box::new(frames.report()))),
        first => first.map_err(LiveError::from)?,
    };
    // A bag's frames have the times that were recorded. To ROS, 0 is no time.
    let begin_us = if first.time_us == 0 { SimRobotConfig::default().begin_us } else { 0 };
    if begin_us > 0 {
        let begin_s = begin_us / 1_000_000;
        tell_line!("{NAME}: the bag begins at 0, which to ROS is no time: it is played from {begin_s} s on");
    }
    let node = args.graph.join(stop).await?;
    let _order = stop.in_order();
    let pictures = args.cameras.filter(|_| frames.has_cameras());
    if args.cameras.is_some() && pictures.is_none() {
        tell_line!("{NAME}: the bag has no pictures of four cameras; it is played without");
    }
    let config = SimRobotConfig { has_clock: args.rate != 1.0, begin_us, pictures, ..SimRobotConfig::default() };
    let mut topics = SimRobot::join(&node, config, &first.scan.base_from_sensor, 0.0).await?;
    while args.wait_for_listener && !stop.is_set() && !topics.is_heard().await? {
        tokio::time::sleep(LISTENER_EVERY).await;
    }
    topics.publish(&first, None)?;
    let mut paced = Paced::new(frames, Some(args.rate));
    let played = play(&mut topics, &mut paced, stop.requested()).await?;
    if !node.is_connected().await {
        return Err(SimError::Unheard { played });
    }
    let broken: Vec<String> = paced.into_inner().report().broken.iter().map(ToString::to_string).collect();
    if broken.is_empty() { Ok(played) } else { Err(SimError::Broken { played, broken: broken.join("; ") }) }
}

/// Microseconds since the epoch.
fn wall_us() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    u64::try_from(since.as_micros()).unwrap_or(u64::MAX)
}

async fn router(listen: &str, stop: &Stop) -> Result<(), SimError> {
    let mut config = zenoh::Config::default();
    set(&mut config, "mode", "\"router\"")?;
    set(&mut config, "scouting/multicast/enabled", "false")?;
    set(&mut config, WAIT_BEFORE_DROP.0, WAIT_BEFORE_DROP.1)?;
    set_endpoints(&mut config, "listen/endpoints", &[listen.to_owned()])?;
    let _order = stop.in_order();
    let session = zenoh::open(config).await.map_err(SimError::Router)?;
    print_line!("a router listens on {listen}");
    stop.requested().await;
    // It ends with the program anyway.
    let _ = session.close().await;
    Ok(())
}

fn print_report(args: &RobotArgs, report: &SimRobotReport) {
    if args.quiet {
        return;
    }
    print_line!(
        "robot       {:.0} s of its time, {} frames, {} commands",
        report.sim_s,
        report.frames,
        report.commands
    );
    print_line!(
        "driven      {:.1} m, {} collisions, stopped {} times for want of a command",
        report.driven_m,
        report.collisions,
        report.watchdog_stops
    );
    let [x, y, yaw] = report.world_from_base;
    print_line!("truly at    ({x:.2}, {y:.2}), {:.0} degrees, in the world", yaw.to_degrees());
}
