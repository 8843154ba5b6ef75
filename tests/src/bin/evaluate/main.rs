//! How good is it? Figures on real logs and in simulated buildings, as the field measures them.

mod chart;
mod explore;
mod relations;
mod slam;

use clap::{Parser, Subcommand};
use std::process::ExitCode;

/// Measures the map service as the field does.
#[derive(Debug, Parser)]
#[command(name = "evaluate", version)]
struct Cli {
    #[command(subcommand)]
    part: Part,
}

#[derive(Debug, Subcommand)]
enum Part {
    /// The SLAM on a recorded log, against relations between pairs of scans (Kümmerle et al., "On measuring the accuracy of
    /// SLAM algorithms", Autonomous Robots 2009).
    #[command(after_help = "Examples:
  evaluate slam ../shared/data/lidar/intel ../shared/data/lidar/intel.relations
  evaluate slam ../shared/data/lidar/aces ../shared/data/lidar/aces.relations --json aces.json --picture aces.png
  evaluate slam ../shared/data/lidar/mit-csail             # no relations: a picture only

LOG is a rosbag2 folder or an MCAP file with /scan and /odom. Each line of RELATIONS is 't1 t2 x y z roll pitch yaw': the
pose of the scan taken at t2 in the frame of the scan taken at t1, metres and radians.")]
    Slam(slam::SlamArgs),
    /// Whole explorations of simulated buildings with drifting wheels: the error of trajectory and main nodes.
    #[command(after_help = "Examples:
  evaluate explore                                         museum and office, drift 1 and 2, ten seeds: about an hour
  evaluate explore --worlds museum --seeds 3 --no-cameras")]
    Explore(explore::ExploreArgs),
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    let outcome = match cli.part {
        Part::Slam(args) => slam::run(&args),
        Part::Explore(args) => explore::run(&args),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("evaluate: {message}");
            ExitCode::FAILURE
        }
    }
}
