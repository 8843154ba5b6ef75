//! The command line.

use clap::{Args, Parser, Subcommand};
use fht_program::flags::{ConfigArgs, ConnectArgs, ReportArgs, seconds};
use fht_proto::{Footprint, MapName};
use fht_sim::SimSetup;
use std::path::PathBuf;

/// A robot that finds its place on a map and drives there.
#[derive(Debug, Parser)]
#[command(name = "client-robot", version, arg_required_else_help = true)]
pub(super) struct Cli {
    #[command(flatten)]
    pub(super) config: ConfigArgs,
    /// The ground that the robot covers: a radius, or the corners of a convex polygon around its
    /// base, x,y_x,y_x,y, metres. Its clearances follow from it, and its margin is the file's
    /// [default: 0.105].
    #[arg(long, global = true, allow_hyphen_values = true)]
    pub(super) footprint: Option<Footprint>,
    #[command(subcommand)]
    pub(super) command: Option<Command>,
}

#[derive(Debug, Subcommand)]
pub(super) enum Command {
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
        #[command(flatten)]
        way: WayArgs,
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
        /// Where to: x,y in metres (map frame), a node id, the name of a place, where the robot
        /// turns to its heading, or 'random'.
        #[arg(long, allow_hyphen_values = true)]
        to: String,
    },
}

/// Which path is asked for.
#[derive(Debug, Args)]
pub(super) struct WayArgs {
    /// From where: x,y in metres, a node id or the name of a place.
    #[arg(long, allow_hyphen_values = true)]
    pub(super) from: String,
    /// Where to: x,y in metres, a node id or the name of a place.
    #[arg(long, allow_hyphen_values = true)]
    pub(super) to: String,
    /// If the goal cannot be reached, the path to the nearest point that can.
    #[arg(long)]
    pub(super) to_nearest: bool,
}

#[derive(Debug, Args)]
pub(super) struct LinkArgs {
    #[command(flatten)]
    pub(super) server: ConnectArgs,
    /// The map [default: museum].
    #[arg(long)]
    pub(super) map: Option<MapName>,
}

#[derive(Debug, Args)]
pub(super) struct RobotArgs {
    #[command(flatten)]
    pub(super) setup: SimSetup,
    /// Seed of light and camera gain: another day than the mapping [default: 1].
    #[arg(long)]
    pub(super) light_seed: Option<u64>,
    /// The robot's name [default: client].
    #[arg(long)]
    pub(super) robot: Option<String>,
    /// A descriptor model to use in place of the built-in one: an ONNX file with its description
    /// beside it, the one that the map was made with.
    #[arg(long)]
    pub(super) model: Option<PathBuf>,
    /// Drive without cameras, as in the dark: the place is found by the scanner alone.
    #[arg(long)]
    pub(super) no_camera: bool,
    /// Give up after this many seconds of simulated time [default: 1500].
    #[arg(long, value_parser = seconds)]
    pub(super) max_time_s: Option<f64>,
    /// Write the run as a bag for ROS 2 and Foxglove: a file (FILE.mcap) or a rosbag2 folder.
    #[arg(long, value_name = "FILE")]
    pub(super) record: Option<PathBuf>,
    #[command(flatten)]
    pub(super) report: ReportArgs,
    /// Print nothing but errors.
    #[arg(long)]
    pub(super) quiet: bool,
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
