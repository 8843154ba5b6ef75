//! `client-robot path`: a path between two places, asked of the server.

use super::arguments::WayArgs;
use super::connection::{ASK_AGAIN, TIMEOUT, connect, wait_for_map};
use super::error::CliError;
use super::settings::ClientFile;
use fht_client::{AskError, PathQuestion, PlannedPath, ask_path, planned};
use fht_program::flags::with_flags;
use fht_program::{ProgramFailure, Stop, Waiting, print_line};
use fht_proto::api::reply::{ErrorCode, PlaceRef, SpeedLimit};
use std::process::ExitCode;

/// Asks, and prints the answer.
pub(super) fn path(
    file: &ClientFile,
    way: &WayArgs,
    json: bool,
    waiting: &Waiting,
    stop: &Stop,
) -> Result<ExitCode, CliError> {
    let WayArgs { from, to, to_nearest } = way;
    let to_nearest = *to_nearest || file.client.to_nearest;
    from.parse::<PlaceRef>()?;
    to.parse::<PlaceRef>()?;
    let (session, map) = (connect(&file.connect, waiting, stop)?, file.map());
    wait_for_map(&session, &map, waiting, stop)?;
    let question = PathQuestion { from, to, footprint: &file.client.paths.footprint, release: None, to_nearest };
    let mut content = waiting.for_content();
    let (path, goal_yaw) = loop {
        match ask_path(&session, &map, &question, TIMEOUT) {
            Ok(reply) if json => {
                print_line!("{}", serde_json::to_string_pretty(&reply)?);
                return Ok(ExitCode::SUCCESS);
            }
            Ok(reply) => {
                for SpeedLimit { zone, max_mps, along_m: [from_m, to_m] } in &reply.speed_limits {
                    print_line!("at most {max_mps} m/s in zone {zone}, from {from_m:.2} m to {to_m:.2} m of the way");
                }
                let goal_yaw = reply.goal_yaw;
                break (planned(reply)?, goal_yaw);
            }
            Err(AskError::Refused(refusal))
                if refusal.code == ErrorCode::UnknownPlace
                    && content.goes_on(format!("the place: {}", refusal.message)) =>
            {
                std::thread::sleep(ASK_AGAIN);
            }
            Err(AskError::Refused(refusal)) => {
                let code = serde_json::to_string(&refusal.code)?;
                let reason = format!("{}: {}", code.trim_matches('"'), with_flags(&refusal.message));
                return Ok(ProgramFailure::of(refusal.code.is_input(), reason).tell("client-robot"));
            }
            Err(error) => return Err(error.into()),
        }
    };
    print_path(&path, goal_yaw);
    Ok(ExitCode::SUCCESS)
}

fn print_path(path: &PlannedPath, goal_yaw: Option<f64>) {
    print_line!("{:.2} m, {} points", path.length_m, path.points.len());
    if path.goal_moved_m > 0.0 {
        print_line!("it ends {:.2} m from the goal, at the nearest point that can be reached", path.goal_moved_m);
    }
    if path.unmapped_m > 0.0 {
        print_line!("{:.2} m of it lead over ground that the map knows nothing of", path.unmapped_m);
    }
    for point in &path.points {
        let node = point.node.map(|id| id.to_string()).unwrap_or_default();
        print_line!("{:9.3} {:9.3}  {node}", point.position.x, point.position.y);
    }
    if let Some(yaw) = goal_yaw {
        print_line!("heading there: {:.1} degrees", yaw.to_degrees());
    }
}
