//! `mapper ros` on the command line.

use clap::{Args, Subcommand};
use fht_ros_robot::GraphArgs;

#[derive(Debug, Subcommand)]
pub(super) enum RosCommand {
    /// Says what a robot's graph has of what mapping needs, and listens whether frames come.
    #[command(after_help = "Examples:
  mapper ros check tcp/robot:7447
  mapper ros check tcp/robot:7447 --namespace r1 --domain 3 --json
  mapper ros check tcp/robot:7447 --cameras a/image,b/image,c/image,d/image

Exit code 0: all is there, and frames come; 1: something is missing; 2: wrong usage.")]
    Check(Box<CheckArgs>),
}

#[derive(Debug, Args)]
pub(super) struct CheckArgs {
    /// The robot's router, such as tcp/robot:7447.
    pub(super) endpoint: String,
    /// How long to wait for the router, and to listen, seconds each.
    #[arg(long, value_name = "SECONDS", default_value_t = 5.0, value_parser = fht_program::flags::seconds)]
    pub(super) wait: f64,
    /// Print JSON.
    #[arg(long)]
    pub(super) json: bool,
    #[command(flatten)]
    pub(super) graph: GraphArgs,
}
