//! Where the map lies: against a floor plan, and on earth.

use crate::program::operator::rule::parse_pose;
use clap::Args;
use fht_proto::model::validate::Validate;
use fht_proto::{Datum, FixedPose, Op, PlanImage};

/// How a floor plan's image lies in a map.
#[derive(Clone, Debug, Args)]
pub struct FloorPlanArgs {
    /// The name of the image's file. The image itself is in no map: whoever looks lays their own
    /// copy under it.
    #[arg(required_unless_present = "remove")]
    image: Option<String>,
    /// Side of a pixel, metres.
    #[arg(long, value_name = "METRES", value_parser = scale, required_unless_present = "remove")]
    scale: Option<u32>,
    /// Where the image's lower left corner is, and how the image is turned about it: x,y or
    /// x,y,yaw in the map frame, metres and degrees (or radians: 1.57rad).
    #[arg(long, value_name = "X,Y[,YAW]", value_parser = parse_pose, allow_hyphen_values = true, default_value = "0,0,0")]
    at: FixedPose,
    /// There is no plan.
    #[arg(long, conflicts_with_all = ["image", "scale", "at"])]
    remove: bool,
}

impl FloorPlanArgs {
    /// What is to be written.
    pub(super) fn op(self) -> Op {
        let plan = self.image.zip(self.scale);
        let lie = |(image, um_per_pixel)| PlanImage { image, um_per_pixel, map_from_image: self.at };
        Op::SetFloorPlan { plan: plan.map(lie) }
    }
}

/// Where on earth a map is.
#[derive(Clone, Debug, Args)]
pub struct DatumArgs {
    /// Where the map's origin is, and which way its x axis points: latitude,longitude or
    /// latitude,longitude,yaw, WGS 84, all in degrees, yaw counter-clockwise from east.
    #[arg(value_name = "LAT,LON[,YAW]", value_parser = parse_datum, allow_hyphen_values = true, required_unless_present = "remove")]
    at: Option<Datum>,
    /// Nobody knows where the map is.
    #[arg(long, conflicts_with = "at")]
    remove: bool,
}

impl DatumArgs {
    /// What is to be written.
    pub(super) fn op(self) -> Op {
        Op::SetDatum { datum: self.at }
    }
}

fn scale(text: &str) -> Result<u32, String> {
    let side = text.parse().ok().and_then(PlanImage::um_per_pixel);
    side.ok_or_else(|| format!("{text} is not the side of a pixel of 0.000001 to 10 m"))
}

fn parse_datum(text: &str) -> Result<Datum, String> {
    let wrong = || format!("'{text}' is not latitude,longitude or latitude,longitude,yaw in degrees");
    let degrees: Vec<f64> =
        text.split(',').map(|part| part.trim().parse().map_err(|_| wrong())).collect::<Result<_, _>>()?;
    let (latitude, longitude, yaw_deg) = match degrees[..] {
        [latitude, longitude] => (latitude, longitude, 0.0),
        [latitude, longitude, yaw] if yaw.abs() <= 360.0 => (latitude, longitude, yaw),
        [_, _, yaw] => return Err(format!("a yaw of {yaw}° is none: it must be from -360 to 360 degrees")),
        _ => return Err(wrong()),
    };
    let datum = Datum::from_degrees(latitude, longitude, yaw_deg.to_radians());
    let is_number = latitude.is_finite() && longitude.is_finite();
    if is_number { datum.validate().map(|()| datum).map_err(|reason| reason.to_string()) } else { Err(wrong()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_on_earth_are_read() {
        assert_eq!(parse_datum("52.5, 13.4"), Ok(Datum::from_degrees(52.5, 13.4, 0.0)));
        let turned = parse_datum("-33.9,151.2,90").map(|datum| datum.yaw_e4);
        assert_eq!(turned, Ok(15_708));
        for bad in ["", "52.5", "91,0", "0,181", "nan,0", "inf,0", "1,2,361", "1,2,3,4", "a,b"] {
            assert!(parse_datum(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn pixels_have_a_side() {
        assert_eq!(scale("0.05"), Ok(50_000));
        for bad in ["0", "-1", "11", "nan", "x"] {
            assert!(scale(bad).is_err(), "{bad}");
        }
    }
}
