//! What operators change, as it is posted. Operations are called as in increments.

use fht_proto::api::reply::{DatumView, ErrorReply, FloorPlanView, RuleView};
use fht_proto::api::request::{bad_request, shown_upto};
use fht_proto::model::validate::Validate;
use fht_proto::{
    Datum, EdgeKey, FixedPoint, FixedPose, Increment, Label, MapName, NodeId, PlanImage, ReleaseName, Zone, ZoneRule,
};
use serde::{Deserialize, Deserializer};

/// One change of a map.
#[derive(Clone, Debug, PartialEq)]
pub enum MapChange {
    /// Names a place, or takes its name away.
    Place {
        /// Its name.
        name: Label,
        /// Where; none: there is no such place any more.
        pose: Option<FixedPose>,
    },
    /// Draws a zone, or takes it away.
    Zone {
        /// Its name.
        name: Label,
        /// What holds where; none: there is no such zone any more.
        zone: Option<Zone>,
    },
    /// Closes an edge, or opens it.
    Closed {
        /// The edge.
        edge: EdgeKey,
        /// Whether it is closed.
        closed: bool,
    },
    /// Erases nodes, with their edges and free space.
    Erased {
        /// The nodes.
        nodes: Vec<NodeId>,
    },
    /// Says how a floor plan's image lies in the map; none: there is no plan.
    FloorPlan(Option<PlanImage>),
    /// Says where on earth the map is; none: nobody knows.
    Datum(Option<Datum>),
    /// Makes a release of the newest state.
    Release {
        /// Its name.
        name: ReleaseName,
    },
    /// Tells robots to use a release.
    Enable {
        /// `name` or `name@author`; none: the newest state.
        release: Option<String>,
    },
    /// Takes the operator's newest increments back.
    Undo {
        /// How many.
        count: u64,
    },
}

/// A change, and of which map.
#[derive(Clone, Debug, PartialEq)]
pub struct MapChangeOrder {
    /// The map.
    pub map: MapName,
    /// What is changed.
    pub change: MapChange,
    /// Whether a place or zone is written that lies off the map.
    pub force: bool,
}

/// A change as JSON.
#[derive(Deserialize)]
#[serde(tag = "op", rename_all = "snake_case", deny_unknown_fields)]
enum Posted {
    SetPlace {
        name: Label,
        #[serde(deserialize_with = "said")]
        pose: Option<[f64; 3]>,
        #[serde(default)]
        force: bool,
    },
    SetZone {
        name: Label,
        #[serde(deserialize_with = "said")]
        zone: Option<PostedZone>,
        #[serde(default)]
        force: bool,
    },
    SetClosed {
        edge: [String; 2],
        closed: bool,
    },
    RemoveNodes {
        nodes: Vec<String>,
    },
    SetFloorPlan {
        #[serde(deserialize_with = "said")]
        plan: Option<FloorPlanView>,
    },
    SetDatum {
        #[serde(deserialize_with = "said")]
        datum: Option<DatumView>,
    },
    PutRelease {
        name: ReleaseName,
    },
    Enable {
        #[serde(deserialize_with = "said")]
        release: Option<String>,
    },
    Undo {
        #[serde(default = "one")]
        count: u64,
    },
}

/// A null that was written: what is left out was forgotten, and takes nothing away.
fn said<'de, D: Deserializer<'de>, T: Deserialize<'de>>(deserializer: D) -> Result<Option<T>, D::Error> {
    Option::deserialize(deserializer)
}

fn one() -> u64 {
    1
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PostedZone {
    rule: RuleView,
    corners: Vec<[f64; 2]>,
}

/// Metres of the map, or a sentence.
fn point([x, y]: [f64; 2]) -> Result<FixedPoint, ErrorReply> {
    let is_in = [x, y].iter().all(|metres| metres.abs() <= FixedPoint::MAX_M);
    is_in.then(|| FixedPoint::from_metres(x, y)).ok_or_else(|| bad_request(format!("{x},{y} lies outside of all maps")))
}

fn pose([x, y, yaw]: [f64; 3]) -> Result<FixedPose, ErrorReply> {
    let position = point([x, y])?;
    let is_yaw = yaw.abs() <= FixedPose::MAX_YAW_RAD;
    let complaint = || bad_request(format!("a yaw of {yaw} rad is none: it must be from -6.2832 to 6.2832"));
    is_yaw.then(|| FixedPose { position, ..FixedPose::from_metres(0.0, 0.0, yaw) }).ok_or_else(complaint)
}

fn zone(posted: PostedZone) -> Result<Zone, ErrorReply> {
    if posted.corners.len() > Zone::MAX_CORNERS {
        return Err(bad_request(format!("a zone has {} corners at most", Zone::MAX_CORNERS)));
    }
    let rule = match posted.rule {
        RuleView::KeepOut => ZoneRule::KeepOut,
        RuleView::SpeedLimit(mps) => ZoneRule::limit_mm_per_s(mps)
            .map(ZoneRule::SpeedLimit)
            .ok_or_else(|| bad_request(format!("{mps} is not a speed of 0.001 to 65 m/s")))?,
    };
    Ok(Zone { rule, corners: posted.corners.into_iter().map(point).collect::<Result<_, _>>()? })
}

fn floor_plan(posted: FloorPlanView) -> Result<PlanImage, ErrorReply> {
    let FloorPlanView { image, metres_per_pixel, map_from_image } = posted;
    let refused = || bad_request(format!("{metres_per_pixel} m a pixel (0.000001 to 10 are allowed)"));
    let um_per_pixel = PlanImage::um_per_pixel(metres_per_pixel).ok_or_else(refused)?;
    valid(PlanImage { image, um_per_pixel, map_from_image: pose(map_from_image)? })
}

fn datum(posted: DatumView) -> Result<Datum, ErrorReply> {
    let is_yaw = posted.yaw.abs() <= FixedPose::MAX_YAW_RAD;
    let datum = Datum::from_degrees(posted.latitude, posted.longitude, posted.yaw);
    if is_yaw { valid(datum) } else { Err(bad_request(format!("a yaw of {} rad is none", posted.yaw))) }
}

fn valid<T: Validate>(of: T) -> Result<T, ErrorReply> {
    of.validate().map(|()| of).map_err(|reason| bad_request(reason.to_string()))
}

fn node(text: &str) -> Result<NodeId, ErrorReply> {
    text.parse().map_err(|error: fht_proto::ParseIdError| bad_request(error.to_string()))
}

fn edge([a, b]: [String; 2]) -> Result<EdgeKey, ErrorReply> {
    let (a, b) = (node(&a)?, node(&b)?);
    if a == b { Err(bad_request("an edge has two ends".to_owned())) } else { Ok(EdgeKey::new(a, b)) }
}

impl MapChangeOrder {
    /// Reads what was posted for a map.
    ///
    /// # Errors
    /// `BAD_REQUEST`, with what is wrong.
    pub fn parse(map: MapName, body: &[u8]) -> Result<Self, ErrorReply> {
        /// Characters of a reason: what was expected comes last.
        const MOST: usize = 400;
        let posted: Posted = serde_json::from_slice(body)
            .map_err(|error| bad_request(format!("the body is no change: {}", shown_upto(&error.to_string(), MOST))))?;
        let mut force = false;
        let change = match posted {
            Posted::SetPlace { name, pose: at, force: is_sure } => {
                force = is_sure;
                MapChange::Place { name, pose: at.map(pose).transpose()? }
            }
            Posted::SetZone { name, zone: drawn, force: is_sure } => {
                force = is_sure;
                MapChange::Zone { name, zone: drawn.map(zone).transpose()? }
            }
            Posted::SetClosed { edge: ends, closed } => MapChange::Closed { edge: edge(ends)?, closed },
            Posted::RemoveNodes { nodes } if nodes.len() > Increment::MAX_OPS => {
                return Err(bad_request(format!("{} nodes go at a time, at most", Increment::MAX_OPS)));
            }
            Posted::RemoveNodes { nodes } => {
                MapChange::Erased { nodes: nodes.iter().map(|text| node(text)).collect::<Result<_, _>>()? }
            }
            Posted::SetFloorPlan { plan } => MapChange::FloorPlan(plan.map(floor_plan).transpose()?),
            Posted::SetDatum { datum: place } => MapChange::Datum(place.map(datum).transpose()?),
            Posted::PutRelease { name } => MapChange::Release { name },
            Posted::Enable { release } => MapChange::Enable { release },
            Posted::Undo { count } => MapChange::Undo { count },
        };
        Ok(Self { map, change, force })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<MapChange, String> {
        let map = "museum".parse().unwrap_or_else(|error| panic!("{error}"));
        MapChangeOrder::parse(map, text.as_bytes()).map(|order| order.change).map_err(|error| error.message)
    }

    #[test]
    fn changes_are_read() {
        let place = read(r#"{"op":"set_place","name":"Küche","pose":[1.5,-2,1.5708]}"#);
        assert!(matches!(place, Ok(MapChange::Place { pose: Some(pose), .. }) if pose.yaw_e4 == 15_708), "{place:?}");
        assert!(matches!(
            read(r#"{"op":"set_place","name":"dock","pose":null}"#),
            Ok(MapChange::Place { pose: None, .. })
        ));
        let zone =
            read(r#"{"op":"set_zone","name":"wet","zone":{"rule":{"speed_limit":0.3},"corners":[[0,0],[1,0],[1,1]]}}"#);
        assert!(
            matches!(&zone, Ok(MapChange::Zone { zone: Some(zone), .. }) if zone.rule == ZoneRule::SpeedLimit(300)),
            "{zone:?}"
        );
        assert!(read(r#"{"op":"set_closed","edge":["0000000a.1","0000000a.2"],"closed":true}"#).is_ok());
        let erased = read(r#"{"op":"remove_nodes","nodes":["0000000a.1","0000000a.2"]}"#);
        assert!(matches!(erased, Ok(MapChange::Erased { nodes }) if nodes.len() == 2));
        let plan =
            r#"{"op":"set_floor_plan","plan":{"image":"a.png","metres_per_pixel":0.05,"map_from_image":[1,2,0.5]}}"#;
        assert!(matches!(read(plan), Ok(MapChange::FloorPlan(Some(plan))) if plan.um_per_pixel == 50_000));
        let datum = read(r#"{"op":"set_datum","datum":{"latitude":52.5,"longitude":13.4,"yaw":0}}"#);
        assert_eq!(datum, Ok(MapChange::Datum(Some(Datum::from_degrees(52.5, 13.4, 0.0)))));
        assert_eq!(read(r#"{"op":"set_datum","datum":null}"#), Ok(MapChange::Datum(None)));
        assert_eq!(read(r#"{"op":"undo"}"#), Ok(MapChange::Undo { count: 1 }));
        assert_eq!(read(r#"{"op":"enable","release":null}"#), Ok(MapChange::Enable { release: None }));
    }

    #[test]
    fn what_is_wrong_is_told() {
        for (text, reason) in [
            ("", "no change"),
            ("[]", "no change"),
            (r#"{"op":"dance"}"#, "dance"),
            (r#"{"op":"undo","colour":"red"}"#, "colour"),
            (r#"{"op":"set_place","name":"<b>","pose":[0,0,0]}"#, "no change"),
            (r#"{"op":"set_place","name":"dock"}"#, "pose"),
            (r#"{"op":"set_zone","name":"wet"}"#, "zone"),
            (r#"{"op":"enable"}"#, "release"),
            (r#"{"op":"set_place","name":"dock","pose":[1e9,0,0]}"#, "outside of all maps"),
            (r#"{"op":"set_place","name":"dock","pose":[0,0,9]}"#, "a yaw of 9 rad is none"),
            (
                r#"{"op":"set_zone","name":"wet","zone":{"rule":{"speed_limit":0},"corners":[[0,0],[1,0],[1,1]]}}"#,
                "not a speed",
            ),
            (
                r#"{"op":"set_zone","name":"wet","zone":{"rule":{"speed_limit":0.0009},"corners":[[0,0],[1,0],[1,1]]}}"#,
                "not a speed",
            ),
            (
                r#"{"op":"set_floor_plan","plan":{"image":"a","metres_per_pixel":-1,"map_from_image":[0,0,0]}}"#,
                "-1 m a pixel",
            ),
            (r#"{"op":"set_floor_plan"}"#, "plan"),
            (r#"{"op":"set_datum","datum":{"latitude":91,"longitude":0,"yaw":0}}"#, "a latitude of 91°"),
            (r#"{"op":"set_datum","datum":{"latitude":1,"longitude":0}}"#, "yaw"),
            (r#"{"op":"set_closed","edge":["0000000a.1","0000000a.1"],"closed":true}"#, "two ends"),
            (r#"{"op":"set_closed","edge":["a","b"],"closed":true}"#, "a node id"),
            (r#"{"op":"remove_nodes","nodes":["0000000a.1","7"]}"#, "a node id"),
        ] {
            let said = read(text).expect_err(text);
            assert!(said.contains(reason), "{text}: {said}");
        }
    }
}
