//! Named places, zones, closed edges.

use crate::program::operator::asking::ask_json;
use crate::program::operator::error::OperatorError;
use fht_proto::api::keys::{Key, Topic};
use fht_proto::api::reply::{NodesReply, RulesReply, parse_point};
use fht_proto::{EdgeKey, FixedPoint, FixedPose, Label, MapName, NodeId, Op, Zone, ZoneRule};
use zenoh::Session;

pub(super) async fn list(session: &Session, map: &MapName) -> Result<RulesReply, OperatorError> {
    ask_json(session, &Key::topic(map, Topic::Rules).to_string()).await
}

/// `x,y` or `x,y,yaw` in metres and degrees.
pub(super) fn parse_pose(text: &str) -> Result<FixedPose, String> {
    let (place, yaw_deg) = match text.match_indices(',').nth(1) {
        Some((at, _)) => {
            let yaw = text[at + 1..].trim().parse::<f64>().ok().filter(|yaw| yaw.is_finite());
            (&text[..at], yaw.ok_or_else(|| format!("{text} is not x,y,yaw in metres and degrees"))?)
        }
        None => (text, 0.0),
    };
    let position = parse_point(place).map_err(|error| error.message)?;
    Ok(FixedPose { position, ..FixedPose::from_metres(0.0, 0.0, yaw_deg.to_radians()) })
}

/// The corners of a zone.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Corners(pub(super) Vec<FixedPoint>);

/// `x,y x,y x,y`, also with semicolons between.
pub(super) fn parse_corners(text: &str) -> Result<Corners, String> {
    let corners = text.split([' ', ';']).filter(|corner| !corner.is_empty());
    let corners: Vec<FixedPoint> =
        corners.map(|corner| parse_point(corner).map_err(|error| error.message)).collect::<Result<_, _>>()?;
    if corners.len() < 3 {
        return Err(format!("a zone has three corners or more, and these are {}", corners.len()));
    }
    Ok(Corners(corners))
}

pub(super) fn parse_speed(text: &str) -> Result<u16, String> {
    let speed = text.parse::<f64>().ok().map(|mps| (mps * 1000.0).round()).filter(|mm| (1.0..=65_000.0).contains(mm));
    speed.map(|mm| mm as u16).ok_or_else(|| format!("{text} is not a speed of 0.001 to 65 m/s"))
}

/// The operation that draws a zone, if its border is valid.
pub(super) fn zone(name: Label, rule: ZoneRule, corners: Vec<FixedPoint>) -> Result<Op, OperatorError> {
    let zone = Zone { rule, corners };
    if zone.crosses_itself() {
        return Err(OperatorError::Usage(format!(
            "the border of zone {name} crosses itself: give its corners in order"
        )));
    }
    Ok(Op::SetZone { name, zone: Some(zone) })
}

/// The edge between two nodes, if the map has it.
pub(super) async fn edge(session: &Session, map: &MapName, a: NodeId, b: NodeId) -> Result<EdgeKey, OperatorError> {
    /// Larger than any building, metres.
    const EVERYWHERE: &str = "near=0,0;radius=100000;limit=1000";
    if a == b {
        return Err(OperatorError::Usage("an edge has two ends".to_owned()));
    }
    // Asking for the nodes is cheaper than asking for the whole map; on large maps the edge is not
    // checked.
    let selector = format!("{}?{EVERYWHERE}", Key::topic(map, Topic::Nodes));
    let nodes: NodesReply = ask_json(session, &selector).await?;
    let (a_text, b_text) = (a.to_string(), b.to_string());
    match nodes.nodes.iter().find(|node| node.id == a_text) {
        Some(node) if !node.neighbours.contains(&b_text) => {
            let known = node.neighbours.join(", ");
            Err(OperatorError::Usage(format!("no edge joins {a} and {b}; {a} is joined to: {known}")))
        }
        None if nodes.nodes.len() < 1000 => Err(OperatorError::Usage(format!("map {map} has no node {a}"))),
        _ => Ok(EdgeKey::new(a, b)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn borders_that_cross_themselves_are_refused() {
        let draw = |corners: &str| {
            let corners = parse_corners(corners);
            let name = "z".parse().map_err(|error| format!("{error}"));
            name.and_then(|name| zone(name, ZoneRule::KeepOut, corners?.0).map_err(|error| error.to_string()))
        };
        assert!(draw("0,0 1,0 1,1 0,1").is_ok() && draw("0,0;1,0; -1,1").is_ok());
        assert!(draw("0,0 1,1 1,0 0,1").is_err_and(|text| text.contains("crosses itself")));
        assert!(draw("0,0 1,1").is_err_and(|text| text.contains("three corners")));
    }

    #[test]
    fn poses_and_speeds_are_read() {
        assert_eq!(parse_pose("1.5,-2"), Ok(FixedPose::from_metres(1.5, -2.0, 0.0)));
        assert_eq!(parse_pose("1.5,-2,90"), Ok(FixedPose::from_metres(1.5, -2.0, std::f64::consts::FRAC_PI_2)));
        assert!(parse_pose("1.5").is_err() && parse_pose("1,2,north").is_err() && parse_pose("1,2,3,4").is_err());
        assert_eq!((parse_speed("0.3"), parse_speed("0").is_err(), parse_speed("nan").is_err()), (Ok(300), true, true));
    }
}
