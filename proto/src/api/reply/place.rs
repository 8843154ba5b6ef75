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
        read_point(text, "place", ", a node id or the name of a place").map(Self::Point)
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

/// A yaw of at most a whole turn, radians. Whoever writes a larger one means something else.
///
/// # Errors
/// A sentence with the yaw in degrees.
pub fn check_yaw(yaw_rad: f64) -> Result<f64, String> {
    if yaw_rad.abs() > std::f64::consts::TAU {
        return Err(format!("a yaw of {}° is none: it must be from -360 to 360 degrees", yaw_rad.to_degrees()));
    }
    Ok(yaw_rad)
}

/// Parses `x,y` (metres).
///
/// # Errors
/// `BAD_REQUEST` with the text and what was expected.
pub fn parse_point(text: &str) -> Result<FixedPoint, ErrorReply> {
    read_point(text, "point", "")
}

/// `what` the text should be, `or` what else it could have been.
fn read_point(text: &str, what: &str, or: &str) -> Result<FixedPoint, ErrorReply> {
    let refused = |why: String| ErrorReply::new(ErrorCode::BadRequest, &why);
    let number = |text: &str| text.trim().parse::<f64>().ok().filter(|value| value.is_finite());
    let pair = text.split_once(',').and_then(|(x, y)| number(x).zip(number(y)));
    let shown: String = match text.trim() {
        "" => "an empty text".to_owned(),
        text => text.chars().take(80).collect(),
    };
    let Some((x, y)) = pair else {
        return Err(refused(format!("{shown} is not a {what}: give x,y in metres, such as 1.5,-2{or}")));
    };
    let most = FixedPoint::MAX_M;
    if x.abs().max(y.abs()) > most {
        return Err(refused(format!("{shown} lies outside of all maps: x and y are metres, from -{most} to {most}")));
    }
    Ok(FixedPoint::from_metres(x, y))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_too_far_is_told_from_what_is_no_point() {
        let said = |text: &str| parse_point(text).map_err(|refusal| refusal.message);
        assert_eq!(said("-1.5,2"), Ok(FixedPoint { x_mm: -1500, y_mm: 2000 }));
        for far in ["1e9,1", "0,-100000.1"] {
            let expected = format!("{far} lies outside of all maps: x and y are metres, from -100000 to 100000");
            assert_eq!(said(far), Err(expected.clone()));
            assert_eq!(far.parse::<PlaceRef>().map_err(|refusal| refusal.message), Err(expected));
        }
        for none in ["1", "nan,0", "inf,0", "a,b", "1,2,3"] {
            assert!(said(none).is_err_and(|said| said.contains("is not a point: give x,y in metres")), "{none}");
        }
    }
}
