//! Who runs what, as a table.

use crate::program::operator::asking::ANSWER_TIMEOUT;
use crate::program::operator::error::OperatorError;
use crate::program::operator::words::use_in_words;
use fht_client::ask_fleet_async;
use fht_proto::MapName;
use fht_proto::api::fleet::{FleetReply, RobotRole, RobotView};
use zenoh::Session;

/// Widest cell, characters: a release's name with its author. What a robot says may be longer.
const MAX_CELL: usize = 73;

pub(super) async fn fleet(session: &Session, map: &MapName) -> Result<FleetReply, OperatorError> {
    Ok(ask_fleet_async(session, map, ANSWER_TIMEOUT).await?)
}

/// The table, one line per robot.
pub(super) fn table(fleet: &FleetReply) -> String {
    let used = use_in_words(fleet.enabled.as_deref(), fleet.enabled_unused);
    let mut lines = vec![format!("map {}, version {}, {used}", fleet.map, fleet.version)];
    if fleet.robots.is_empty() {
        lines.push("no robots have been here since the server started".to_owned());
        return lines.join("\n");
    }
    let head = ["ROBOT", "ROLE", "VERSION", "BEHIND", "RUNS", "STATE", "POSE", "SEEN", ""].map(str::to_owned);
    let rows = fleet.robots.iter().map(|robot| row(robot).map(|text| cell(&text)));
    let rows: Vec<[String; 9]> = std::iter::once(head).chain(rows).collect();
    let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..9).map(width).collect();
    for row in &rows {
        let cells = row.iter().zip(&widths).map(|(cell, &width)| format!("{cell:width$}"));
        lines.push(cells.collect::<Vec<_>>().join("  ").trim_end().to_owned());
    }
    lines.join("\n")
}

/// A text that does not break the table, cut if it is too long.
fn cell(text: &str) -> String {
    let is_long = text.chars().count() > MAX_CELL;
    let most = if is_long { MAX_CELL - 1 } else { MAX_CELL };
    let shown = text.chars().filter(|letter| !letter.is_control()).take(most);
    shown.chain(is_long.then_some('…')).collect()
}

fn row(robot: &RobotView) -> [String; 9] {
    let status = &robot.status;
    let role = match status.role {
        RobotRole::Explorer => "explorer",
        RobotRole::Client => "client",
    };
    let pose = status
        .map_from_base
        .map_or_else(|| "-".to_owned(), |[x, y, yaw]| format!("{x:.2},{y:.2} {:.0}°", yaw.to_degrees()));
    let mark = match (robot.alive, robot.late) {
        (false, _) => "GONE",
        (true, true) => "LATE",
        (true, false) => "",
    };
    [
        status.robot.clone(),
        role.to_owned(),
        status.version.to_string(),
        robot.behind.to_string(),
        status.release.clone().unwrap_or_else(|| "head".to_owned()),
        status.state.to_string(),
        pose,
        format!("{:.0} s", robot.seen_s),
        mark.to_owned(),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_has_a_width_and_one_line() {
        assert_eq!((cell("tug-1"), cell("a\n\u{1b}[31m")), ("tug-1".to_owned(), "a[31m".to_owned()));
        let cut = cell(&"9".repeat(300));
        assert!(cut.chars().count() == MAX_CELL && cut.ends_with('…'), "{cut}");
        assert_eq!(cell(&"x".repeat(MAX_CELL)).len(), MAX_CELL);
    }
}
