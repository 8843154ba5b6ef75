//! Named places, zones, closed edges.

use crate::program::operator::asking::ask_json;
use crate::program::operator::error::OperatorError;
use crate::program::operator::transfer::fetch_state;
use fht_map::{DoubtfulWords, check_place, check_zone};
use fht_proto::api::keys::{Key, Topic};
use fht_proto::api::reply::{
    DatumView, FloorPlanView, NodesReply, RulesReply, check_yaw, known_names, parse_angle, parse_point,
};
use fht_proto::{EdgeKey, FixedPoint, FixedPose, Label, MapName, NodeId, Op, Zone, ZoneRule};
use zenoh::Session;

pub(super) async fn list(session: &Session, map: &MapName) -> Result<RulesReply, OperatorError> {
    ask_json(session, &Key::topic(map, Topic::Rules).to_string()).await
}

/// `x,y` or `x,y,yaw` in metres and degrees (or radians: `1.57rad`).
pub(super) fn parse_pose(text: &str) -> Result<FixedPose, String> {
    let (place, yaw) = match text.match_indices(',').nth(1) {
        Some((at, _)) => {
            let wrong = || format!("'{text}' is not x,y,yaw in metres and degrees (or radians: 1.57rad)");
            let yaw_rad = parse_angle(&text[at + 1..]).ok_or_else(wrong)?;
            (&text[..at], check_yaw(yaw_rad)?)
        }
        None => (text, 0.0),
    };
    let position = parse_point(place).map_err(|error| error.message)?;
    Ok(FixedPose { position, ..FixedPose::from_metres(0.0, 0.0, yaw) })
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
    let speed = text.parse::<f64>().ok().and_then(ZoneRule::limit_mm_per_s);
    speed.ok_or_else(|| format!("{text} is not a speed of 0.001 to 65 m/s"))
}

/// The operation that names a place, if a robot can be there. `is_sure`: also if not.
pub(super) async fn place(
    session: &Session,
    map: &MapName,
    (name, pose): (Label, FixedPose),
    is_sure: bool,
) -> Result<Op, OperatorError> {
    if !is_sure {
        let (_, _, state) = fetch_state(session, map, true).await?;
        let check = move || check_place(&state, pose.position);
        tokio::task::spawn_blocking(check).await.map_err(OperatorError::Lost)?.map_err(doubted)?;
    }
    Ok(Op::SetPlace { name, pose: Some(pose) })
}

/// The operation that draws a zone, if its border is valid and it lies where the map is. `is_sure`:
/// also if it lies elsewhere.
pub(super) async fn zone(
    session: &Session,
    map: &MapName,
    name: Label,
    zone: Zone,
    is_sure: bool,
) -> Result<Op, OperatorError> {
    zone.check_border().map_err(|reason| OperatorError::Usage(format!("zone {name}: {reason}")))?;
    if !is_sure {
        let (_, _, state) = fetch_state(session, map, true).await?;
        check_zone(&state, &zone).map_err(doubted)?;
    }
    Ok(Op::SetZone { name, zone: Some(zone) })
}

fn doubted(doubt: DoubtfulWords) -> OperatorError {
    OperatorError::Usage(format!("{doubt}; --force writes it all the same"))
}

/// The operation that takes a place's name away, if there is one.
pub(super) async fn no_place(session: &Session, map: &MapName, name: Label) -> Result<Op, OperatorError> {
    let places = list(session, map).await?.places;
    is_there(map, "place called", &name, places.iter().map(|place| place.name.as_str()))?;
    Ok(Op::SetPlace { name, pose: None })
}

/// The operation that takes a zone away, if there is one.
pub(super) async fn no_zone(session: &Session, map: &MapName, name: Label) -> Result<Op, OperatorError> {
    let zones = list(session, map).await?.zones;
    is_there(map, "zone", &name, zones.iter().map(|zone| zone.name.as_str()))?;
    Ok(Op::SetZone { name, zone: None })
}

fn is_there<'a>(
    map: &MapName,
    what: &str,
    name: &Label,
    known: impl Iterator<Item = &'a str> + Clone,
) -> Result<(), OperatorError> {
    if known.clone().any(|known| known == name.as_str()) {
        return Ok(());
    }
    Err(OperatorError::Usage(format!("map {map} has no {what} {name} ({})", known_names(known))))
}

/// The operation that closes or opens the edge between two nodes, if the map has it.
pub(super) async fn closing(
    session: &Session,
    map: &MapName,
    [a, b]: [NodeId; 2],
    closed: bool,
) -> Result<Op, OperatorError> {
    let usage = |text: String| Err(OperatorError::Usage(text));
    if a == b {
        return usage("an edge has two ends".to_owned());
    }
    let edge = EdgeKey::new(a, b);
    let op = Op::SetClosed { edge, closed };
    // One that was closed while it was there can be opened when it is not.
    if list(session, map).await?.closed_edges.contains(&edge.to_texts()) {
        return Ok(op);
    }
    match neighbours(session, map, [a, b]).await? {
        [None, None] => usage(format!("map {map} has neither a node {a} nor a node {b}")),
        [None, Some(_)] => usage(format!("map {map} has no node {a}")),
        [Some(_), None] => usage(format!("map {map} has no node {b}")),
        [Some(known), Some(_)] if !known.contains(&b.to_string()) => {
            let known = if known.is_empty() { "nothing".to_owned() } else { known.join(", ") };
            usage(format!("no edge joins {a} and {b}; {a} is joined to: {known}"))
        }
        _ => Ok(op),
    }
}

/// The nodes that edges join to each of two nodes; none if the map has no such node.
async fn neighbours(
    session: &Session,
    map: &MapName,
    nodes: [NodeId; 2],
) -> Result<[Option<Vec<String>>; 2], OperatorError> {
    let (texts, key) = (nodes.map(|node| node.to_string()), Key::topic(map, Topic::Nodes));
    let (mut found, mut after) = ([None, None], String::new());
    loop {
        let selector = format!("{key}?near=0,0;radius=100000;limit=1000;after={after}");
        let page: NodesReply = ask_json(session, &selector).await?;
        for node in page.nodes {
            if let Some(index) = texts.iter().position(|text| *text == node.id) {
                found[index] = Some(node.neighbours);
            }
        }
        match page.next {
            Some(next) if next != after && found.contains(&None) => after = next,
            _ => return Ok(found),
        }
    }
}

/// Whether a map on which `rules` hold is the same after the operation: the same place, the same
/// zone, an edge that is closed or open already.
pub(super) fn changes_nothing(rules: &RulesReply, op: &Op) -> bool {
    match op {
        Op::SetPlace { name, pose: Some(pose) } => {
            // As it was written: 180° as the wire has it is a little more than π.
            let fixed = |[x, y, yaw]: [f64; 3]| FixedPose {
                position: FixedPoint::from_metres(x, y),
                yaw_e4: (yaw * 1e4).round() as i16,
            };
            rules.places.iter().any(|place| place.name == name.as_str() && fixed(place.pose) == *pose)
        }
        Op::SetZone { name, zone: Some(zone) } => rules.zones.iter().any(|known| {
            let corners = known.corners.iter().map(|[x, y]| FixedPoint::from_metres(*x, *y));
            known.name == name.as_str() && known.rule == zone.rule.into() && corners.eq(zone.corners.iter().copied())
        }),
        Op::SetClosed { edge, closed } => rules.closed_edges.contains(&edge.to_texts()) == *closed,
        Op::SetFloorPlan { plan } => rules.floor_plan == plan.as_ref().map(FloorPlanView::from),
        Op::SetDatum { datum } => rules.datum == datum.map(DatumView::from),
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_are_read() {
        assert!(parse_corners("0,0 1,0 1,1 0,1").is_ok() && parse_corners("0,0;1,0; -1,1").is_ok());
        assert!(parse_corners("0,0 1,1").is_err_and(|text| text.contains("three corners")));
        assert!(parse_corners("0,0 1,1 nan,0").is_err() && parse_corners("0,0 1,1 2e5,0").is_err());
    }

    #[test]
    fn poses_and_speeds_are_read() {
        assert_eq!(parse_pose("1.5,-2"), Ok(FixedPose::from_metres(1.5, -2.0, 0.0)));
        assert_eq!(parse_pose("1.5,-2,90deg"), parse_pose("1.5,-2,90"));
        assert_eq!(parse_pose("1.5,-2,1.5707963267948966rad"), parse_pose("1.5,-2,90"));
        assert_eq!(parse_pose("1.5,-2,90"), Ok(FixedPose::from_metres(1.5, -2.0, std::f64::consts::FRAC_PI_2)));
        assert!(parse_pose("1.5").is_err() && parse_pose("1,2,north").is_err() && parse_pose("1,2,3,4").is_err());
        for yaw in ["900", "-361", "nan", "inf"] {
            assert!(parse_pose(&format!("1,2,{yaw}")).is_err_and(|text| text.contains("degrees")), "{yaw}");
        }
        assert_eq!((parse_speed("0.001"), parse_speed("65")), (Ok(1), Ok(65_000)));
        assert!(parse_speed("0.0009").is_err() && parse_speed("65.0001").is_err());
        assert_eq!((parse_speed("0.3"), parse_speed("0").is_err(), parse_speed("nan").is_err()), (Ok(300), true, true));
    }
}
