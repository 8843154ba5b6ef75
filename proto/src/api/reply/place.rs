//! Places in requests.

use crate::api::reply::error::{ErrorCode, ErrorReply};
use crate::model::annotation::Label;
use crate::model::geometry::FixedPoint;
use crate::model::ids::NodeId;
use std::str::FromStr;

/// A place in a request: `x,y` in metres, a node id, or the name of a place.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PlaceRef {
    /// Coordinates in the map frame.
    Point(FixedPoint),
    /// The place of a node.
    Node(NodeId),
    /// A place that an operator has named.
    Named(Label),
}

impl FromStr for PlaceRef {
    type Err = ErrorReply;
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        if let Ok(id) = text.parse() {
            return Ok(Self::Node(id));
        }
        if let Ok(name) = text.parse() {
            return Ok(Self::Named(name));
        }
        let point = read_point(text);
        point.map(Self::Point).ok_or_else(|| bad(text, "place", ", a node id or the name of a place"))
    }
}

/// Reads an angle, to radians: degrees, such as `90` or `90deg`, or radians, such as `1.57rad`.
#[must_use]
pub fn parse_angle(text: &str) -> Option<f64> {
    let text = text.trim();
    let number = |text: &str| text.trim_end().parse::<f64>().ok().filter(|value| value.is_finite());
    match text.strip_suffix("rad") {
        Some(radians) => number(radians),
        None => number(text.strip_suffix("deg").unwrap_or(text)).map(f64::to_radians),
    }
}

/// Parses `x,y` (metres).
///
/// # Errors
/// `BAD_REQUEST` with the text and what was expected.
pub fn parse_point(text: &str) -> Result<FixedPoint, ErrorReply> {
    read_point(text).ok_or_else(|| bad(text, "point", ""))
}

fn read_point(text: &str) -> Option<FixedPoint> {
    let (x, y) = text.split_once(',')?;
    let number = |t: &str| t.trim().parse::<f64>().ok().filter(|v| v.is_finite() && v.abs() <= FixedPoint::MAX_M);
    Some(FixedPoint::from_metres(number(x)?, number(y)?))
}

fn bad(text: &str, what: &str, or: &str) -> ErrorReply {
    let shown: String = text.chars().take(80).collect();
    let text = format!("{shown} is not a {what}: give x,y in metres, such as 1.5,-2{or}");
    ErrorReply::new(ErrorCode::BadRequest, &text)
}
