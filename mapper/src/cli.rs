//! The command line of `mapper`.

mod replay;

use self::replay::{InfoArgs, ReplayArgs};
use crate::beside::Pace;
use crate::explore::Ending;
use crate::joining::JoinConfig;
use crate::mapping::MapperConfig;
use crate::report::ExploreReport;
use crate::run::{ExploreTask, Snapshot, explore};
use clap::{Args, Parser, Subcommand};
use fht_link::LinkConfig;
use fht_proto::MapName;
use fht_robot::pose::{self, Pose2};
use fht_robot::stop::Stop;
use fht_sim::SimConfig;
use indicatif::{ProgressBar, ProgressStyle};
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Builds maps of buildings and publishes them over Zenoh.
#[derive(Debug, Parser)]
#[command(name = "mapper", version, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Explores a simulated building until nothing reachable is unknown, building the map on the way.
    ///
    /// If the server has the map already, or another explorer is about to begin it, the robot joins: it explores, finds its place in the map
    /// without a guess, goes where no other explorer goes, and adds what the map lacks. So several explorers can be started at once, and one
    /// that failed can be followed by another.
    #[command(after_help = "Examples:
  map-server --data maps &
  mapper explore --world museum --map museum
  mapper explore --world museum --map museum --robot second --start 2,1,0   # a second robot, at the same time or later
  mapper explore --world museum --map museum --robot third --again          # after the building has changed
  mapper explore --world museum --map museum --spool /var/lib/mapper        # what is not acknowledged survives the program
  mapper explore --world floor/map.yaml --textures pictures/ --map floor --seed 3
  mapper explore --world office --offline --json        # no server: how good is the map?
  mapper explore --world museum --offline --record run.mcap   # look at it in Foxglove, or replay it

Exit code 0: the map is complete and delivered; 1: it is not, or it failed; 2: a wrong argument.
Ctrl-C ends the exploration and finishes the map as it is; a second one ends the program. Set RUST_LOG=info (or debug) for logs.")]
    Explore(Box<ExploreArgs>),
    /// Builds the map from a recorded run: a rosbag2 folder or an MCAP file with scans and odometry.
    #[command(after_help = "Examples:
  mapper replay run/ --map lab                           # a rosbag2 folder: /scan, /odom, /tf_static
  mapper replay run.mcap --offline --json                # no server: what comes of it?
  mapper replay run/ --map lab --scan-topic /front/scan --odom-topic /tf --base-frame base_footprint
  mapper replay run/ --map lab --camera-topics /cam0/image,/cam1/image,/cam2/image,/cam3/image
  mapper replay run/ --map lab --record mapped.mcap      # with /map, /path and /fht_map to look at

Needed are sensor_msgs/LaserScan and nav_msgs/Odometry (or odom → base in /tf); the scanner's place on the robot comes
from /tf_static. Four cameras ahead, left, behind and right (90° each, square pictures) give nodes their appearance;
without them the map has scans only. 'mapper info BAG' says what a bag has.

Ctrl-C ends the replay and finishes the map as it is; a second one ends the program. Set RUST_LOG=info (or debug) for
logs.")]
    Replay(Box<ReplayArgs>),
    /// Says what is in a bag: topics, types, counts, times, and whether it can be read to its end.
    Info(InfoArgs),
}

#[derive(Debug, Args)]
struct ExploreArgs {
    /// The building: museum, office, or the path of a Nav2 map.yaml or a Gazebo .world.
    #[arg(long, default_value = "museum")]
    world: String,
    /// Folder of pictures to paint the walls of a Nav2 map with.
    #[arg(long)]
    textures: Option<PathBuf>,
    /// Seed of the building's drawing.
    #[arg(long, default_value_t = 1)]
    world_seed: u64,
    /// Name of the map; by default the world's name.
    #[arg(long)]
    map: Option<MapName>,
    /// Name of this robot.
    #[arg(long, default_value = "explorer")]
    robot: String,
    #[command(flatten)]
    link: LinkArgs,
    /// Map without a server.
    #[arg(long)]
    offline: bool,
    /// Keep in this folder what the server has not acknowledged: if this run is killed, or its server stays away, the next run of this
    /// robot delivers that first. Use it on real robots. Default: it is lost with the run.
    #[arg(long, value_name = "DIR", conflicts_with = "offline")]
    spool: Option<PathBuf>,
    /// Look at the whole building again, also where the map is complete: what has changed is corrected, and nodes that are not as they were
    /// lose trust and are retired.
    #[arg(long)]
    again: bool,
    /// Where the robot begins: x,y,yaw in the world frame, metres and radians. Default: the world's own start.
    #[arg(long, value_parser = pose::parse, allow_hyphen_values = true)]
    start: Option<Pose2>,
    /// Where the frame of a map that is joined truly lies: x,y,yaw in the world frame. For scoring only. Default: the world's own start.
    #[arg(long, value_parser = pose::parse, allow_hyphen_values = true)]
    map_origin: Option<Pose2>,
    /// Seed of the sensors' noise and of the wheels' errors.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Seed of the light in the building.
    #[arg(long, default_value_t = 0)]
    light_seed: u64,
    /// Multiplies the wheels' errors.
    #[arg(long, default_value_t = 1.0, value_parser = drift)]
    drift: f64,
    /// Another descriptor model: an ONNX file with its description beside it.
    #[arg(long)]
    model: Option<PathBuf>,
    /// Map with the LiDAR alone: nodes carry no descriptors.
    #[arg(long)]
    no_cameras: bool,
    /// Simulated seconds per second; by default as fast as possible.
    #[arg(long, value_parser = rate)]
    rate: Option<f64>,
    /// Like a robot that drives: in real time (or at --rate), and never waiting for work beside the loop. The same seed then
    /// no longer gives the same map to the last bit.
    #[arg(long)]
    real_time: bool,
    /// Give up after this much simulated time, seconds.
    #[arg(long, default_value_t = 14_400.0, value_parser = seconds)]
    max_sim: f64,
    /// How long to wait at the end for the server to acknowledge everything, seconds.
    #[arg(long, default_value_t = 60.0, value_parser = seconds)]
    linger: f64,
    /// Write the run as a bag for ROS 2 and Foxglove: a file (FILE.mcap) or a rosbag2 folder.
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// Write the figures to this file as JSON.
    #[arg(long)]
    report: Option<PathBuf>,
    /// Print the figures as JSON.
    #[arg(long)]
    json: bool,
    /// Print a line of JSON about every simulated second: sim_s, free_area_m2, nodes, written, acknowledged, placed.
    #[arg(long)]
    progress_json: bool,
    /// No progress bar.
    #[arg(long, short)]
    quiet: bool,
}

/// How the server is reached: `explore` and `replay` share it.
#[derive(Debug, Args)]
struct LinkArgs {
    /// Where the map server (or a Zenoh router) listens (repeatable) [default: tcp/127.0.0.1:7447, unless --zenoh-config is
    /// given].
    #[arg(long, value_name = "ENDPOINT")]
    connect: Vec<String>,
    /// A Zenoh configuration file (JSON5): endpoints, TLS, credentials. --connect goes before what it says.
    #[arg(long, value_name = "FILE")]
    zenoh_config: Option<PathBuf>,
}

impl LinkArgs {
    fn config(&self) -> LinkConfig {
        LinkConfig::from_options(self.connect.clone(), self.zenoh_config.clone())
    }
}

fn number(text: &str, range: std::ops::RangeInclusive<f64>) -> Result<f64, String> {
    let value = text.parse::<f64>().ok().filter(|value| range.contains(value));
    value.ok_or_else(|| format!("'{text}' is not a number from {} to {}", range.start(), range.end()))
}

fn seconds(text: &str) -> Result<f64, String> {
    number(text, 0.0..=1e7)
}

fn rate(text: &str) -> Result<f64, String> {
    number(text, 1e-3..=1e6)
}

fn drift(text: &str) -> Result<f64, String> {
    number(text, 0.0..=100.0)
}

impl ExploreArgs {
    fn task(&self) -> Result<ExploreTask, String> {
        let name =
            Path::new(&self.world).file_stem().map_or_else(|| self.world.clone(), |s| s.to_string_lossy().into());
        let map = match &self.map {
            Some(map) => map.clone(),
            None => name.parse().map_err(|error| format!("{error}; give the map a name with --map"))?,
        };
        Ok(ExploreTask {
            world: self.world.clone(),
            textures: self.textures.clone(),
            world_seed: self.world_seed,
            sim: SimConfig { light_seed: self.light_seed, drift_factor: self.drift, ..SimConfig::default() },
            seed: self.seed,
            start: self.start,
            map_origin: self.map_origin,
            map,
            robot: self.robot.clone(),
            link: (!self.offline).then(|| self.link.config()),
            spool: self.spool.clone(),
            model: self.model.clone(),
            cameras: !self.no_cameras,
            rate: self.rate.or(self.real_time.then_some(1.0)),
            max_sim_s: self.max_sim,
            linger_s: self.linger,
            mapper: MapperConfig {
                pace: if self.real_time { Pace::RealTime } else { Pace::Repeatable },
                join: JoinConfig { looks_again: self.again, ..JoinConfig::default() },
                ..MapperConfig::default()
            },
            record: self.record.clone(),
            stop: stop_on_signal()?,
        })
    }
}

fn stop_on_signal() -> Result<Stop, String> {
    Stop::on_signal().map_err(|error| format!("signals cannot be handled: {error}"))
}

fn runtime() -> Result<tokio::runtime::Runtime, String> {
    tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()
        .map_err(|error| format!("the async runtime cannot be started: {error}"))
}

/// Runs the program with `args` (the first is its name).
pub fn main_with_args<I, T>(args: I) -> ExitCode
where
    I: IntoIterator<Item = T>,
    T: Into<OsString> + Clone,
{
    let cli = match Cli::try_parse_from(args) {
        Ok(cli) => cli,
        Err(error) => {
            // Printing help can fail only when nobody reads it.
            let _ = error.print();
            return ExitCode::from(u8::try_from(error.exit_code()).unwrap_or(2));
        }
    };
    let filter = tracing_subscriber::EnvFilter::try_from_default_env()
        .unwrap_or_else(|_| tracing_subscriber::EnvFilter::new("error,fht_link=warn"));
    // A second subscriber in one process (tests) is no harm.
    let _ = tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr).try_init();
    let outcome = match cli.command {
        Command::Explore(args) => run(&args),
        Command::Replay(args) => replay::replay_bag(&args),
        Command::Info(args) => replay::info(&args),
    };
    match outcome {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(message) => {
            eprintln!("mapper: {message}");
            ExitCode::FAILURE
        }
    }
}

fn run(args: &ExploreArgs) -> Result<bool, String> {
    let task = args.task()?;
    let is_offline = task.link.is_none();
    let runtime = runtime()?;
    let bar = if args.quiet || args.progress_json { ProgressBar::hidden() } else { spinner() };
    let progress_json = args.progress_json;
    let watched = bar.clone();
    let watch = move |snapshot: Snapshot| {
        if progress_json {
            println!(
                "{}",
                serde_json::json!({
                    "sim_s": snapshot.sim_s,
                    "free_area_m2": snapshot.free_area_m2,
                    "nodes": snapshot.nodes,
                    "written": snapshot.written,
                    "acknowledged": snapshot.acknowledged,
                    "placed": snapshot.placed,
                })
            );
        }
        let place = if snapshot.placed { "" } else { "looking for its place in the map, " };
        watched.set_message(format!(
            "{place}{:.0} m² free, {} nodes, {} of {} increments stored, {:.0} s of robot time",
            snapshot.free_area_m2, snapshot.nodes, snapshot.acknowledged, snapshot.written, snapshot.sim_s
        ));
        watched.tick();
    };
    let report = runtime.block_on(explore(task, watch)).map_err(|error| error.to_string())?;
    bar.finish_and_clear();
    let json = serde_json::to_string_pretty(&report).map_err(|error| error.to_string())?;
    if let Some(file) = &args.report {
        std::fs::write(file, &json).map_err(|error| format!("{} cannot be written: {error}", file.display()))?;
    }
    if args.json {
        println!("{json}");
    } else if !args.progress_json {
        print_report(&report);
    }
    if !is_offline && !report.delivered {
        complain_of_undelivered(args.linger, args.spool.as_deref());
        return Ok(false);
    }
    if report.ending != Ending::Complete {
        eprintln!("mapper: the map is not complete: {}", report.ending);
        return Ok(false);
    }
    Ok(true)
}

fn spinner() -> ProgressBar {
    let style =
        ProgressStyle::with_template("{spinner} exploring: {msg}").unwrap_or_else(|_| ProgressStyle::default_spinner());
    ProgressBar::new_spinner().with_style(style)
}

fn complain_of_undelivered(linger_s: f64, spool: Option<&Path>) {
    eprintln!(
        "mapper: the server did not acknowledge the whole map within {linger_s} s; may this robot write? (access control drops silently)"
    );
    if let Some(dir) = spool {
        eprintln!("mapper: the rest waits in {} for the next run of this robot", dir.display());
    }
}

fn print_report(report: &ExploreReport) {
    println!("explored    {:.1} % of {:.0} m²", report.explored_fraction * 100.0, report.free_area_m2);
    println!("ended       {}", report.ending);
    if let Some([seconds, metres]) = report.joined.filter(|[seconds, _]| *seconds > 0.0) {
        println!("joined      the map after {seconds:.0} s and {metres:.1} m");
    }
    println!(
        "map         {} main nodes, {} support nodes, {} edges, version {}",
        report.main_nodes, report.support_nodes, report.edges, report.version
    );
    println!("bytes       {} of increments, {} on the wire", report.map_bytes, report.wire_bytes);
    println!(
        "trajectory  {:.1} m driven, mean error {:.3} m and {:.2}°, greatest {:.3} m, {} collisions",
        report.driven_m,
        report.trajectory_error.mean_m,
        report.trajectory_error.mean_deg,
        report.trajectory_error.max_m,
        report.collisions
    );
    println!(
        "nodes       {:.0} % of the main nodes within 0.05 m of the truth, greatest error {:.3} m; {} loop closures",
        report.main_nodes_within_5cm * 100.0,
        report.main_node_error_max_m,
        report.closures.iter().sum::<usize>()
    );
    println!(
        "time        {:.0} s of robot time in {:.1} s; slowest frame {:.0} ms",
        report.sim_s, report.wall_s, report.frame_max_ms
    );
    println!("digest      {}", report.digest);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_that_make_no_sense_are_refused_with_the_arguments() {
        let parse = |flag: &str, value: &str| Cli::try_parse_from(["mapper", "explore", flag, value]);
        for flag in ["--linger", "--rate", "--max-sim", "--drift"] {
            for value in ["nan", "inf", "1e300", "many"] {
                let error = parse(flag, value).err().map(|error| error.to_string());
                assert!(error.is_some_and(|text| text.contains(flag)), "{flag} {value}");
            }
            assert!(parse(flag, "1.5").is_ok(), "{flag}");
        }
        assert!(parse("--rate", "1e-21").is_err() && parse("--rate", "0").is_err());
    }
}
