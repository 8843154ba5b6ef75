//! The reply to `rules`: places, zones, closed edges, and what robots found blocked.

use crate::api::fleet::BlockedReport;
use crate::model::annotation::ZoneRule;
use crate::model::ids::MapName;
use crate::model::siting::{Datum, PlanImage};
use serde::{Deserialize, Serialize};

/// A named place.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct PlaceView {
    /// Its name.
    pub name: String,
    /// `[x, y, yaw]` in the map frame, metres and radians.
    pub pose: [f64; 3],
}

/// What holds inside a zone.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum RuleView {
    /// No robot's centre may enter.
    KeepOut,
    /// Robots drive no faster than this, metres per second.
    SpeedLimit(f64),
}

impl From<ZoneRule> for RuleView {
    fn from(rule: ZoneRule) -> Self {
        match rule {
            ZoneRule::KeepOut => Self::KeepOut,
            ZoneRule::SpeedLimit(mm_per_s) => Self::SpeedLimit(f64::from(mm_per_s) / 1000.0),
        }
    }
}

/// A zone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ZoneView {
    /// Its name.
    pub name: String,
    /// What holds there.
    pub rule: RuleView,
    /// Its corners `[x, y]` in the map frame, metres.
    pub corners: Vec<[f64; 2]>,
}

/// How the image of a floor plan lies in the map.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct FloorPlanView {
    /// Which image is meant: the name of its file. The image is in no map.
    pub image: String,
    /// Side of a pixel, metres: 0.000001 to 10.
    pub metres_per_pixel: f64,
    /// Pose of its lower left corner: `[x, y, yaw]` in the map frame, metres and radians. Its lower
    /// edge runs along x of that pose.
    pub map_from_image: [f64; 3],
}

impl From<&PlanImage> for FloorPlanView {
    fn from(plan: &PlanImage) -> Self {
        let PlanImage { image, um_per_pixel, map_from_image: pose } = plan;
        Self {
            image: image.clone(),
            metres_per_pixel: f64::from(*um_per_pixel) / 1e6,
            map_from_image: [pose.position.x(), pose.position.y(), pose.yaw()],
        }
    }
}

/// Where on earth the map is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct DatumView {
    /// Latitude of the map's origin, WGS 84, degrees.
    pub latitude: f64,
    /// Longitude of the map's origin, WGS 84, degrees.
    pub longitude: f64,
    /// Direction of the map's x axis, counter-clockwise from east, radians.
    pub yaw: f64,
}

impl From<Datum> for DatumView {
    fn from(datum: Datum) -> Self {
        // To the last digit that is kept, so that the text is short.
        Self { latitude: datum.latitude_deg(), longitude: datum.longitude_deg(), yaw: datum.yaw() }
    }
}

/// Something that a robot found blocked.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct BlockedView {
    /// The robot.
    pub robot: String,
    /// For how much longer it is avoided, seconds.
    pub for_s: f64,
    /// Edges, each by the ids of its ends.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub edges: Vec<[String; 2]>,
    /// Places, `[x, y]` in the map frame, metres.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub places: Vec<[f64; 2]>,
}

impl BlockedView {
    /// The robot, and its report as if it came now. `None` of a view without anything: as a report
    /// that would take back what the robot said.
    #[must_use]
    pub fn into_report(self) -> Option<(String, BlockedReport)> {
        let Self { robot, for_s, edges, places } = self;
        let says_something = !(edges.is_empty() && places.is_empty());
        says_something.then_some((robot, BlockedReport { for_s, edges, places }))
    }
}

/// A robot whose reports of blocked places do not count for a while, because an operator said so.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct IgnoredView {
    /// The robot.
    pub robot: String,
    /// For how much longer, seconds.
    pub for_s: f64,
}

/// The reply to `rules`: what operators and robots have added to the map.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct RulesReply {
    /// The map.
    pub map: MapName,
    /// Its version.
    pub version: u64,
    /// Named places.
    pub places: Vec<PlaceView>,
    /// Zones.
    pub zones: Vec<ZoneView>,
    /// Edges that operators have closed, each by the ids of its ends.
    pub closed_edges: Vec<[String; 2]>,
    /// How a floor plan's image lies in the map, if somebody has said so.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub floor_plan: Option<FloorPlanView>,
    /// Where on earth the map is, if somebody has said so.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub datum: Option<DatumView>,
    /// What robots found blocked, and for how much longer.
    pub blocked: Vec<BlockedView>,
    /// Robots whose reports do not count now.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub ignored: Vec<IgnoredView>,
}
