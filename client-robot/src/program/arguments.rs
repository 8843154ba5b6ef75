//! The command line.

use super::nav2_driving::ClientDriver;
use clap::{Args, Parser, Subcommand};
use fht_program::flags::{CompletionsArgs, ConfigArgs, ConnectArgs, FileClash, ReportArgs};
use fht_program::flags::{check_files, new_file, number, seconds};
use fht_proto::{Footprint, MapName, RobotName};
use fht_ros_robot::{GraphArgs, NodeArgs};
use fht_sim::SimSetup;
use std::path::{Path, PathBuf};

/// A robot that finds its place on a map and drives there.
#[derive(Debug, Parser)]
#[command(
    name = "client-robot",
    version,
    max_term_width = 100,
    arg_required_else_help = true,
    after_help = "Examples:
  client-robot relocalize --map museum              where am I?
  client-robot go --map museum --to dock            … and drive there
  client-robot serve --map museum --robot tug-1     stays up and drives where it is sent
  client-robot path --map museum --from 0,0 --to 5,3
  client-robot --print-config > robot.toml          every parameter, with what it means
  client-robot --config robot.toml go --to dock

Exit code 0: the task is done; 1: it failed, and the robot said why; 2: wrong usage or bad input,
such as a place that the map does not have; 130, 143 or 129: it was interrupted by Ctrl-C, SIGTERM
or SIGHUP."
)]
pub(super) struct Cli {
    #[command(flatten)]
    pub(super) config: ConfigArgs,
    /// The ground that the robot covers: a radius, or the corners of a convex polygon around its
    /// base, x,y_x,y_x,y, metres. Its clearances follow from it, and its margin is the file's
    /// [default: 0.105].
    #[arg(long, value_name = "METRES|CORNERS", global = true, allow_hyphen_values = true)]
    pub(super) footprint: Option<Footprint>,
    #[command(subcommand)]
    pub(super) command: Option<Command>,
}

#[derive(Debug, Subcommand)]
pub(super) enum Command {
    /// Moves about until the robot knows where it is.
    #[command(after_help = "Examples:
  client-robot relocalize --map museum
  client-robot relocalize --map museum --start 3,2,90 --seed 7     dropped there, untold
  client-robot relocalize --map museum --no-cameras               by the scanner alone
  client-robot relocalize --map lab --ros tcp/robot:7447           a robot that speaks ROS 2")]
    Relocalize {
        #[command(flatten)]
        link: LinkArgs,
        #[command(flatten)]
        robot: RobotArgs,
    },
    /// Asks for a path between two places of the map.
    #[command(after_help = "Examples:
  client-robot path --map museum --from 0,0 --to 5,3
  client-robot path --map museum --from dock --to Küche --json
  client-robot path --map museum --from 1a2b3c4d.0 --to dock --wait 60     waits for all of them")]
    Path {
        #[command(flatten)]
        link: LinkArgs,
        #[command(flatten)]
        way: WayArgs,
        /// Print JSON.
        #[arg(long)]
        json: bool,
    },
    /// Plans for Nav2: serves the actions compute_path_to_pose and compute_route on a robot's ROS 2
    /// graph with the paths, nodes and edges of the fleet's map, its rules and closures.
    #[command(after_help = "Examples:
  client-robot route --map lab --ros tcp/robot:7447
  client-robot route --map lab --ros tcp/robot:7447 --namespace r1 --connect tcp/server:7447

Exit code 0: it was asked to end, by Ctrl-C or SIGTERM; 1: it failed; 2: wrong usage or bad input.")]
    Route {
        #[command(flatten)]
        link: LinkArgs,
        #[command(flatten)]
        args: RouteArgs,
    },
    /// Finds its place, then drives to a goal.
    #[command(after_help = "Examples:
  client-robot go --map museum --to 5,3
  client-robot go --map museum --to 5,3,90                         … and turn to the left
  client-robot go --map museum --to dock --robot tug-1
  client-robot go --map museum --to random --footprint 0.3         a larger robot
  client-robot go --map museum --to 5,3 --to-nearest               as near as it can get
  client-robot go --map museum --to 5,3 --record drive.mcap        look at it in Foxglove
  client-robot go --map lab --to dock --ros tcp/robot:7447         a robot that speaks ROS 2
  client-robot go --map lab --to dock --ros tcp/robot:7447 --drive nav2
  client-robot go --map lab --to dock --ros tcp/robot:7447 --no-cameras    though it has four")]
    Go {
        #[command(flatten)]
        link: LinkArgs,
        #[command(flatten)]
        robot: RobotArgs,
        /// Where to: x,y or x,y,yaw in the map frame, metres and degrees (or radians: 1.57rad), a
        /// node id, the name of a place, where the robot turns to its heading, or 'random'.
        #[arg(long, value_name = "PLACE", allow_hyphen_values = true)]
        to: String,
        /// If the goal cannot be reached, drive to the nearest point that can.
        #[arg(long)]
        to_nearest: bool,
    },
    /// Finds its place, then drives wherever it is sent, goal after goal, until it is asked to end.
    ///
    /// Goals are sent by `map-server send`, or by any Zenoh client under
    /// fht/{map}/robots/{robot}/goal (docs/protocol.md). The simulated world goes in real time, or
    /// at --rate.
    #[command(after_help = "Examples:
  client-robot serve --map museum --robot tug-1
  client-robot serve --map museum --robot tug-1 --start 3,2,90 --rate 5      five times as fast
  client-robot serve --map lab --robot tug-1 --ros tcp/robot:7447            a robot with ROS 2
  map-server send museum tug-1 dock --wait-arrived                        … and send it, twice
  map-server send museum tug-1 5,3
  map-server cancel museum tug-1

Exit code 0: it was asked to end, by Ctrl-C or SIGTERM; 1: it does not find its place, or failed; 2:
wrong usage or bad input.")]
    Serve {
        #[command(flatten)]
        link: LinkArgs,
        #[command(flatten)]
        args: ServeArgs,
    },
    /// Writes completions for a shell to standard output.
    Completions(CompletionsArgs),
}

/// Which path is asked for.
#[derive(Debug, Args)]
pub(super) struct WayArgs {
    /// From where: x,y in metres, a node id or the name of a place.
    #[arg(long, value_name = "PLACE", allow_hyphen_values = true)]
    pub(super) from: String,
    /// Where to: x,y in metres, a node id or the name of a place.
    #[arg(long, value_name = "PLACE", allow_hyphen_values = true)]
    pub(super) to: String,
    /// If the goal cannot be reached, the path to the nearest point that can.
    #[arg(long)]
    pub(super) to_nearest: bool,
}

#[derive(Debug, Args)]
pub(super) struct RouteArgs {
    /// The robot's router, such as tcp/robot:7447.
    #[arg(long, value_name = "ENDPOINT")]
    pub(super) ros: String,
    #[command(flatten)]
    pub(super) node: NodeArgs,
    /// The robot's frame: a path without a start begins where that is [default: base_link].
    #[arg(long, value_name = "FRAME")]
    pub(super) base_frame: Option<String>,
}

#[derive(Debug, Args)]
pub(super) struct LinkArgs {
    #[command(flatten)]
    pub(super) server: ConnectArgs,
    /// The map [default: as a simulated robot's world is called, or museum].
    #[arg(long, value_name = "NAME")]
    pub(super) map: Option<MapName>,
}

#[derive(Debug, Args)]
pub(super) struct RobotArgs {
    #[command(flatten)]
    pub(super) setup: SimSetup,
    /// Seed of light and camera gain: another day than the mapping [default: 1].
    #[arg(long, value_name = "NUMBER")]
    pub(super) light_seed: Option<u64>,
    /// The robot's name: 1 to 64 of the letters a to z and A to Z, digits, _ or - [default:
    /// client].
    #[arg(long, value_name = "NAME")]
    pub(super) robot: Option<RobotName>,
    /// A descriptor model to use in place of the built-in one: an ONNX file with its description
    /// beside it, the one that the map was made with.
    #[arg(long, value_name = "FILE")]
    pub(super) model: Option<PathBuf>,
    /// Do not fetch a missing ONNX Runtime library from PyPI: start no process for it.
    #[arg(long)]
    pub(super) no_fetch: bool,
    /// Drive without cameras, as in the dark: the place is found by the scanner alone.
    #[arg(long, alias = "no-camera")]
    pub(super) no_cameras: bool,
    /// Give up after this much simulated time, seconds [default: 1500].
    #[arg(long, value_name = "SECONDS", alias = "max-time-s", value_parser = seconds)]
    pub(super) max_sim: Option<f64>,
    /// Write the run, with the map that the robot uses, as a bag for ROS 2 and Foxglove: a file
    /// (FILE.mcap) or a rosbag2 folder.
    #[arg(long, value_name = "FILE", value_parser = new_file)]
    pub(super) record: Option<PathBuf>,
    #[command(flatten)]
    pub(super) report: ReportArgs,
    /// Print nothing but errors.
    #[arg(long, short)]
    pub(super) quiet: bool,
    /// Use a robot that speaks ROS 2 over Zenoh, at its router (tcp/robot:7447), in place of a
    /// simulated one. Its figures are its own word: nobody knows the truth about it.
    #[arg(long, value_name = "ENDPOINT", conflicts_with_all = SimSetup::FLAGS)]
    pub(super) ros: Option<String>,
    // Last, since its heading holds for all that comes after it.
    #[command(flatten)]
    pub(super) graph: GraphArgs,
    /// Who drives a robot with ROS 2 once it knows its place: the client (on cmd_vel), or nav2,
    /// which is sent along the fleet's path by its action navigate_to_pose.
    #[arg(long, value_name = "WHO", default_value = "client", requires = "ros")]
    pub(super) drive: ClientDriver,
}

impl RobotArgs {
    /// Refuses a run that would destroy one of its own files; `config` is that of its
    /// configuration.
    ///
    /// # Errors
    /// [`FileClash`].
    pub(super) fn check_files(&self, link: &LinkArgs, config: Option<&Path>) -> Result<(), FileClash> {
        let world = self.setup.files();
        let inputs = [
            ("the configuration", config),
            ("the Zenoh configuration", link.server.zenoh_config.as_deref()),
            ("the model", self.model.as_deref()),
        ];
        let outputs = [("--record", self.record.as_deref()), ("--report", self.report.report.as_deref())];
        check_files(world.iter().map(|file| ("the world", Some(file.as_path()))).chain(inputs), outputs)
    }
}

#[derive(Debug, Args)]
pub(super) struct ServeArgs {
    #[command(flatten)]
    pub(super) robot: RobotArgs,
    /// Simulated seconds a second [default: 1].
    #[arg(long, value_name = "FACTOR", value_parser = rate, conflicts_with = "ros")]
    pub(super) rate: Option<f64>,
}

fn rate(text: &str) -> Result<f64, String> {
    number(text, 1e-3..=1e6)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_that_never_comes_is_refused() {
        let parse = |value: &str| Cli::try_parse_from(["client-robot", "relocalize", "--max-sim", value]);
        assert!(parse("60").is_ok());
        for value in ["nan", "inf", "-1", "1e300", "soon"] {
            assert!(parse(value).is_err(), "{value}");
        }
    }
}
