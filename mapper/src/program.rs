//! The program: an explorer in a simulated building, a ROS robot, or a recorded run, whose map goes
//! to a server.

mod arguments;
mod bodies_score;
mod explore;
mod explore_command;
mod keeping;
mod map_figures;
mod nav2_guide;
mod picture;
mod record;
mod replay;
mod replay_command;
mod report;
mod ros;
mod ros_arguments;
mod ros_command;
mod ros_outputs;
mod running;
mod scoring;
mod settings;
mod until_silent;
mod way;

pub use explore::{ExploreError, ExploreProgress, ExploreTask, explore};
pub use keeping::{KeepError, Kept};
pub use map_figures::MapFigures;
pub use picture::PictureTask;
pub use replay::{ReplayError, ReplayReport, ReplaySnapshot, ReplayTask, replay};
pub use report::{ExploreReport, PeopleFigures, RobotFigures};
pub use ros::{Driver, RosExploreError, RosExploreReport, RosExploreTask, RosSnapshot, explore_robot};
pub use scoring::main_node_errors;

use self::arguments::{Cli, Command};
use self::ros_arguments::RosCommand;
use self::settings::MapperFile;
use fht_program::flags::{missing_command, parse_args};
use fht_program::{ProgramFailure, Stop, logging};
use std::ffi::OsString;
use std::process::ExitCode;

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
    let stop = match Stop::on_signal("mapper") {
        Ok(stop) => stop,
        Err(error) => {
            return ProgramFailure::of_run(format!("signals cannot be handled: {error}")).tell("mapper");
        }
    };
    logging::init(logging::ROBOT);
    let file = match cli.config.settle("mapper", cli.config.over(MapperFile::default())) {
        Ok(file) => file,
        Err(code) => return code,
    };
    let config = cli.config.config.as_deref();
    let outcome = match cli.command {
        Some(Command::Explore(args)) => args.check_files(config).and_then(|()| match &args.ros {
            Some(endpoint) => ros_command::explore_ros(&args, endpoint, file, stop.clone()),
            None => explore_command::explore_world(&args, file, stop.clone()),
        }),
        Some(Command::Ros(RosCommand::Check(args))) => ros_command::check_robot(&args, file),
        Some(Command::Replay(args)) => {
            args.check_files(config).and_then(|()| replay_command::replay_bag(&args, file, stop.clone()))
        }
        Some(Command::Info(args)) => replay_command::info(&args),
        Some(Command::Completions(shell)) => {
            shell.print::<Cli>();
            Ok(true)
        }
        None => return missing_command::<Cli>(),
    };
    match outcome {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => stop.exit_code().unwrap_or(ExitCode::FAILURE),
        Err(failure) => {
            let code = failure.tell("mapper");
            stop.exit_code().unwrap_or(code)
        }
    }
}
