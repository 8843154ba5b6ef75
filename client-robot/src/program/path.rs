//! `client-robot path`: a path between two places, asked of the server.

use super::connection::{TIMEOUT, connect, wait_for_server};
use super::error::CliError;
use super::settings::ClientFile;
use fht_client::{AskError, PathQuestion, PlannedPath, ask_path, planned};
use fht_proto::api::reply::PlaceRef;
use std::process::ExitCode;

/// Asks, and prints the answer.
pub(super) fn path(file: &ClientFile, from: &str, to: &str, json: bool) -> Result<ExitCode, CliError> {
    from.parse::<PlaceRef>()?;
    to.parse::<PlaceRef>()?;
    let (session, map) = (connect(&file.connect)?, file.map());
    wait_for_server(&session, &map)?;
    let question = PathQuestion { from, to, footprint: &file.client.paths.footprint, release: None };
    let path = match ask_path(&session, &map, &question, TIMEOUT) {
        Ok(reply) if json => {
            println!("{}", serde_json::to_string_pretty(&reply)?);
            return Ok(ExitCode::SUCCESS);
        }
        Ok(reply) => planned(reply)?,
        Err(AskError::Refused(refusal)) => {
            eprintln!("client-robot: {:?}: {}", refusal.code, refusal.message);
            return Ok(ExitCode::from(1));
        }
        Err(error) => return Err(error.into()),
    };
    print_path(&path);
    Ok(ExitCode::SUCCESS)
}

fn print_path(path: &PlannedPath) {
    println!("{:.2} m, {} points", path.length_m, path.points.len());
    for point in &path.points {
        let node = point.node.map(|id| id.to_string()).unwrap_or_default();
        println!("{:9.3} {:9.3}  {node}", point.position.x, point.position.y);
    }
}
