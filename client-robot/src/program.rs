//! The program: a robot in a simulated world that uses a map over Zenoh.

mod arguments;
mod connection;
mod display;
mod error;
mod floor;
mod graph_frames;
mod initial_pose;
mod mission;
mod nav2_driving;
mod navigate;
mod on_map;
mod other_servers;
mod path;
mod pose_publisher;
mod recording;
mod report;
mod ros_mission;
mod ros_report;
mod route;
mod scoring;
mod serve;
mod settings;

pub use report::MissionReport;
pub use ros_report::RosMissionReport;
pub use scoring::{AT_GOAL_DEG, AT_GOAL_M, MissionScore};

use self::arguments::{Cli, Command, LinkArgs, RobotArgs};
use self::error::CliError;
use self::mission::mission;
use self::path::path;
use self::ros_mission::ros_mission;
use self::route::route;
use self::serve::serving;
use self::settings::ClientFile;
use crate::mission::MissionGoal;
use fht_perception::pose::{Point2, parse as parse_pose};
use fht_program::flags::{missing_command, parse_args};
use fht_program::{ProgramFailure, Stop, Waiting, logging};
use fht_proto::api::reply::{ErrorReply, PlaceRef, parse_point};
use fht_proto::api::request::bad_request;
use std::ffi::OsString;
use std::path::Path;
use std::process::ExitCode;

/// The program's name.
const NAME: &str = "client-robot";

/// The command line, for whoever documents it.
#[must_use]
pub fn command() -> clap::Command {
    <Cli as clap::CommandFactory>::command()
}

/// Runs the program. Exit code 0: the task is done; 1: it failed, and the robot said why; 2:
/// wrong usage or bad input; 130, 143 or 129: it was interrupted.
pub fn main_with_args(args: Vec<OsString>) -> ExitCode {
    let cli: Cli = match parse_args(args) {
        Ok(cli) => cli,
        Err(code) => return code,
    };
    let stop = match Stop::on_signal("client-robot") {
        Ok(stop) => stop,
        Err(error) => {
            return ProgramFailure::of_run(format!("signals cannot be handled: {error}")).tell(NAME);
        }
    };
    logging::init(logging::ROBOT);
    let file = match cli.config.settle("client-robot", ClientFile::read(&cli.config, cli.footprint.as_ref())) {
        Ok(file) => file,
        Err(code) => return code,
    };
    let config = cli.config.config.as_deref();
    let outcome = match cli.command {
        Some(Command::Path { link, way, json }) => {
            let waiting = Waiting::new(NAME, link.server.wait, Some(Waiting::USUAL));
            path(&file.with_link(&link), &way, json, &waiting, &stop)
        }
        Some(Command::Relocalize { link, robot }) => checked(&robot, &link, config).and_then(|()| {
            carry_out(file.with_link(&link).with_robot(&robot), &robot, &MissionGoal::None, &link.waiting(), &stop)
        }),
        Some(Command::Go { link, robot, to, to_nearest }) => {
            let goal = checked(&robot, &link, config).and_then(|()| Ok(parse_goal(&to, robot.setup.seed)?));
            goal.and_then(|goal| {
                let mut file = file.with_link(&link).with_robot(&robot);
                file.client.to_nearest |= to_nearest;
                carry_out(file, &robot, &goal, &link.waiting(), &stop)
            })
        }
        Some(Command::Serve { link, args }) => checked(&args.robot, &link, config)
            .and_then(|()| serving(file.with_link(&link).with_robot(&args.robot), &args, &link.waiting(), &stop)),
        Some(Command::Route { link, args }) => route(&file.with_link(&link), &args, &link.waiting(), &stop),
        Some(Command::Completions(shell)) => {
            shell.print::<Cli>();
            Ok(ExitCode::SUCCESS)
        }
        None => return missing_command::<Cli>(),
    };
    outcome.unwrap_or_else(|error| {
        let code = ProgramFailure::of(error.is_input(), error).tell(NAME);
        stop.exit_code().unwrap_or(code)
    })
}

/// Refuses a run that would destroy one of its own files, and a simulated robot with flags of one
/// that speaks ROS 2.
fn checked(robot: &RobotArgs, link: &LinkArgs, config: Option<&Path>) -> Result<(), CliError> {
    if robot.ros.is_none() {
        robot.graph.check_none_given()?;
    }
    Ok(robot.check_files(link, config)?)
}

impl LinkArgs {
    /// A robot waits for ever to be connected.
    fn waiting(&self) -> Waiting {
        Waiting::new(NAME, self.server.wait, None)
    }
}

/// Carries out a mission, with the robot of the simulator or the one that `--ros` names.
fn carry_out(
    file: ClientFile,
    args: &RobotArgs,
    goal: &MissionGoal,
    waiting: &Waiting,
    stop: &Stop,
) -> Result<ExitCode, CliError> {
    match &args.ros {
        Some(endpoint) => ros_mission(file, args, endpoint, goal, waiting, stop),
        None => mission(file, args, goal, waiting, stop),
    }
}

fn parse_goal(text: &str, seed: u64) -> Result<MissionGoal, ErrorReply> {
    if text == mission::RANDOM {
        return Ok(MissionGoal::FarNode(seed));
    }
    if let Some((at, _)) = text.match_indices(',').nth(1) {
        parse_point(&text[..at])?;
        return parse_pose(text).map(MissionGoal::Pose).map_err(bad_request);
    }
    Ok(match text.parse::<PlaceRef>()? {
        PlaceRef::Point(point) => MissionGoal::Point(Point2::new(point.x(), point.y())),
        PlaceRef::Node(id) => MissionGoal::Node(id),
        PlaceRef::Named(name) => MissionGoal::Named(name),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_robot_is_sent_to_a_point_or_a_pose_as_operators_send_it() {
        let goal = |text: &str| parse_goal(text, 1).map_err(|refused| refused.message);
        assert!(matches!(goal("5,3"), Ok(MissionGoal::Point(_))));
        let turned = goal("5,-3,90");
        let is_turned = |pose: &fht_perception::pose::Pose2| {
            (pose.rotation.angle().to_degrees() - 90.0).abs() < 1e-9 && pose.translation.vector.y == -3.0
        };
        assert!(matches!(&turned, Ok(MissionGoal::Pose(pose)) if is_turned(pose)), "{turned:?}");
        assert!(goal("5,3,900").is_err_and(|said| said.contains("from -360 to 360 degrees")));
        assert!(goal("1e9,0,90").is_err_and(|said| said.contains("outside of all maps")));
        assert!(goal("5,3,north").is_err_and(|said| said.contains("x,y,yaw")));
        assert!(matches!(goal("dock"), Ok(MissionGoal::Named(_))));
        assert!(matches!(goal("random"), Ok(MissionGoal::FarNode(1))));
    }
}
