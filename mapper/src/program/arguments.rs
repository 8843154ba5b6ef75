//! The command line of `mapper`.

use super::replay_command::{InfoArgs, ReplayArgs};
use super::ros::Driver;
use super::ros_arguments::RosCommand;
use super::running::RunArgs;
use clap::{Args, Parser, Subcommand};
use fht_program::flags::{CompletionsArgs, ConfigArgs, folder, number, seconds};
use fht_ros_robot::GraphArgs;
use fht_sim::SimSetup;
use std::path::PathBuf;

/// Builds maps of buildings and publishes them over Zenoh.
#[derive(Debug, Parser)]
#[command(
    name = "mapper",
    version,
    max_term_width = 100,
    arg_required_else_help = true,
    after_help = "Examples:
  mapper explore --world museum --map museum        explores, and publishes the map
  mapper replay run.mcap --map lab                  makes a map from a recorded run
  mapper info run.mcap                              what is in a recording?
  mapper --print-config > robot.toml                every parameter, with what it means
  mapper --config robot.toml explore"
)]
pub(super) struct Cli {
    #[command(flatten)]
    pub(super) config: ConfigArgs,
    #[command(subcommand)]
    pub(super) command: Option<Command>,
}

#[derive(Debug, Subcommand)]
pub(super) enum Command {
    /// Explores a building, with a simulated robot or one that speaks ROS 2, until nothing
    /// reachable is unknown, and builds the map on the way.
    ///
    /// If the server has the map already, or another explorer is about to begin it, the robot
    /// joins: it explores, finds its place in the map without a guess, goes where no other explorer
    /// goes, and adds what the map lacks. So several explorers can be started at once, and one that
    /// failed can be followed by another.
    #[command(after_help = "Examples:
  map-server --data maps &
  mapper explore --world museum --map museum
  mapper explore --world museum --map museum --robot second --start 1,0,0   # a second robot
  mapper explore --world museum --map museum --robot third --again     # the building has changed
  mapper explore --world museum --map museum --spool /var/lib/mapper   # keeps what is not stored
  mapper explore --world floor/map.yaml --textures pictures/ --map floor --seed 3
  mapper explore --world office --offline --json        # no server: how good is the map?
  mapper explore --world museum --offline --record run.mcap   # look at it in Foxglove, or replay it
  mapper explore --world museum --offline --picture     # draws the map: explore-museum-1.png
  mapper explore --ros tcp/robot:7447 --namespace r1 --map lab    # a robot with rmw_zenoh
  mapper explore --ros tcp/robot:7447 --map lab --cameras a/image,b/image,c/image,d/image

Exit code 0: the map is complete and delivered; 1: it is not, or it failed; 2: wrong usage or bad
input; 130, 143 or 129: it was interrupted. Ctrl-C (or SIGTERM) ends the exploration within a
second, finishes the map as it is, and says what the server has not acknowledged; a second one ends
the program at once. Set RUST_LOG=info (or debug) for logs.")]
    Explore(Box<ExploreArgs>),
    /// Builds the map from a recorded run: a rosbag2 folder or an MCAP file with scans and
    /// odometry.
    #[command(after_help = "Examples:
  mapper replay run/ --map lab                         # a rosbag2 folder: /scan, /odom, /tf_static
  mapper replay run.mcap --offline --json                # no server: what comes of it?
  mapper replay run/ --map lab --scan-topic /front/scan --odom-topic /tf --base-frame base_footprint
  mapper replay run/ --map lab --camera-topics /cam0/image,/cam1/image,/cam2/image,/cam3/image
  mapper replay run/ --map lab --record mapped.mcap      # with /map, /path and /fht_map to look at
  mapper replay run.mcap --offline --picture lab.png     # draws the map

Needed are sensor_msgs/LaserScan and nav_msgs/Odometry (or odom → base in /tf); the scanner's place
on the robot comes from /tf_static. Four cameras ahead, left, behind and right (90° each, square
pictures) give nodes their appearance; without them the map has scans only. 'mapper info BAG' says
what a bag has.

Exit code 0: the map is made and delivered; 1: it is not; 2: wrong usage or bad input, such as a bag
without scans; 130, 143 or 129: it was interrupted. Ctrl-C (or SIGTERM) ends the replay within a
second and finishes the map as it is; a second one ends the program at once. Set RUST_LOG=info (or
debug) for logs.")]
    Replay(Box<ReplayArgs>),
    /// Says what is in a bag: topics, types, counts, times, and whether it can be read to its end.
    #[command(after_help = "Examples:
  mapper info run.mcap
  mapper info run/ --json")]
    Info(InfoArgs),
    /// A robot that speaks ROS 2: is there all that mapping needs?
    #[command(
        subcommand,
        after_help = "Examples:
  mapper ros check tcp/robot:7447
  mapper ros check tcp/robot:7447 --namespace r1"
    )]
    Ros(RosCommand),
    /// Writes completions for a shell to standard output.
    Completions(CompletionsArgs),
}

#[derive(Debug, Args)]
pub(super) struct ExploreArgs {
    #[command(flatten)]
    pub(super) setup: SimSetup,
    /// Explore with a robot that speaks ROS 2 over Zenoh, at its router (tcp/robot:7447), in place
    /// of a simulated one. Its map is named robot, or as its namespace, unless --map says
    /// otherwise.
    #[arg(long, value_name = "ENDPOINT", conflicts_with_all = SimSetup::FLAGS)]
    #[arg(conflicts_with_all = ["rate", "light_seed", "drift"])]
    pub(super) ros: Option<String>,
    #[command(flatten)]
    pub(super) run: RunArgs,
    /// Keep in this folder what the server has not acknowledged: if this run is killed, or its
    /// server stays away, the next run of this robot delivers that first. Use it on real robots.
    /// Default: it is lost with the run.
    #[arg(long, value_name = "DIR", conflicts_with = "offline", value_parser = folder)]
    pub(super) spool: Option<PathBuf>,
    /// Look at the whole building again, also where the map is complete: what has changed is
    /// corrected, and nodes that are not as they were lose trust and are retired.
    #[arg(long)]
    pub(super) again: bool,
    /// Seed of the light in the building [default: 0].
    #[arg(long, value_name = "NUMBER")]
    pub(super) light_seed: Option<u64>,
    /// Multiplies the wheels' errors [default: 1].
    #[arg(long, value_name = "FACTOR", value_parser = drift)]
    pub(super) drift: Option<f64>,
    /// Map with the LiDAR alone: nodes carry no descriptors.
    #[arg(long)]
    pub(super) no_cameras: bool,
    /// Like a robot that drives: in real time (or at --rate), and never waiting for work beside the
    /// loop. The same seed then no longer gives the same map to the last bit.
    #[arg(long)]
    pub(super) real_time: bool,
    /// Give up after this much simulated time, seconds [default: 14400].
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub(super) max_sim: Option<f64>,
    /// Print a line of JSON about every simulated second, and one with the final numbers when the
    /// run has ended: sim_s, free_area_m2, nodes, written, acknowledged, placed. The figures of the
    /// run come after it with --json.
    #[arg(long)]
    pub(super) progress_json: bool,
    // Last, since its heading holds for all that comes after it.
    #[command(flatten)]
    pub(super) graph: GraphArgs,
    /// Who drives the robot: the mapper, nav2, which the mapper tells what is to be seen (its
    /// action navigate_to_pose), or others (a person, a bag that is played); then nothing is put on
    /// cmd_vel, and the map is finished when the sensors have been silent for --end-after.
    #[arg(long, value_name = "WHO", default_value = "mapper", requires = "ros")]
    pub(super) drive: Driver,
    /// End when no frame has come for so long, seconds [default: 60].
    #[arg(long, value_name = "SECONDS", value_parser = seconds, requires = "ros")]
    pub(super) end_after: Option<f64>,
}

fn drift(text: &str) -> Result<f64, String> {
    number(text, 0.0..=100.0)
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
        let turned = parse("--start", "1,0,900").err().map(|error| error.to_string()).unwrap_or_default();
        assert!(turned.contains("from -360 to 360 degrees"), "{turned}");
        assert!(parse("--rate", "1e-21").is_err() && parse("--rate", "0").is_err());
    }
}
