//! Where a map lies: against the image of a floor plan, and on earth.

use crate::model::geometry::{FixedPoint, FixedPose};
use serde::{Deserialize, Serialize};

/// How the image of a floor plan lies in the map. The image itself is in no map.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PlanImage {
    /// Which image is meant, for people: the name of its file.
    pub image: String,
    /// Side of a pixel, micrometres.
    pub um_per_pixel: u32,
    /// Pose of the image's lower left corner; x runs along its lower edge, y up.
    pub map_from_image: FixedPose,
}

impl PlanImage {
    /// The side of a pixel, micrometres, of metres.
    #[must_use]
    pub fn um_per_pixel(metres: f64) -> Option<u32> {
        let um = (metres * 1e6).round();
        (1.0..=f64::from(Self::MAX_UM_PER_PIXEL)).contains(&um).then_some(um as u32)
    }

    /// Longest name of an image, bytes.
    pub const MAX_NAME_BYTES: usize = 200;
    /// Largest pixel, micrometres: 10 m.
    pub const MAX_UM_PER_PIXEL: u32 = 10_000_000;
}

/// Where on earth a map's origin is, and how the map is turned: what `robot_localization` calls a
/// datum.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Datum {
    /// Latitude in WGS 84, 1e-9 degrees (0.1 mm).
    pub latitude_e9: i64,
    /// Longitude in WGS 84, 1e-9 degrees.
    pub longitude_e9: i64,
    /// Direction of the map's x axis, counter-clockwise from east (REP-103), 1e-4 rad.
    pub yaw_e4: i16,
}

/// Units in a degree.
const DEGREE: f64 = 1e9;

impl Datum {
    /// From degrees and radians; the angle is wrapped. What is no latitude or longitude is found by
    /// [`Validate`](crate::model::validate::Validate).
    #[must_use]
    pub fn from_degrees(latitude_deg: f64, longitude_deg: f64, yaw: f64) -> Self {
        let units = |degrees: f64| (degrees * DEGREE).round() as i64;
        let yaw_e4 = FixedPose::from_metres(0.0, 0.0, yaw).yaw_e4;
        Self { latitude_e9: units(latitude_deg), longitude_e9: units(longitude_deg), yaw_e4 }
    }

    /// Latitude of the map's origin, degrees.
    #[must_use]
    pub fn latitude_deg(self) -> f64 {
        self.latitude_e9 as f64 / DEGREE
    }

    /// Longitude of the map's origin, degrees.
    #[must_use]
    pub fn longitude_deg(self) -> f64 {
        self.longitude_e9 as f64 / DEGREE
    }

    /// Direction of the map's x axis, counter-clockwise from east, radians.
    #[must_use]
    pub fn yaw(self) -> f64 {
        FixedPose { position: FixedPoint::default(), yaw_e4: self.yaw_e4 }.yaw()
    }

    /// Latitude and longitude, degrees, of a point in the map, metres. In the plane that touches
    /// the ellipsoid at the origin: a kilometre from there it is a millimetre off, ten kilometres
    /// some metres.
    #[must_use]
    pub fn locate(self, x: f64, y: f64) -> [f64; 2] {
        let (sin, cos) = self.yaw().sin_cos();
        let (east, north) = (cos * x - sin * y, sin * x + cos * y);
        let [meridian_m, parallel_m] = metres_per_radian(self.latitude_deg().to_radians());
        let longitude = self.longitude_deg() + (east / parallel_m).to_degrees();
        let wrapped = (longitude + 180.0).rem_euclid(360.0) - 180.0;
        [self.latitude_deg() + (north / meridian_m).to_degrees(), wrapped]
    }

    /// The datum of another map whose frame is `map_from_other` in this one.
    #[must_use]
    pub fn of_other(self, map_from_other: FixedPose) -> Self {
        let at = map_from_other.position;
        let [latitude, longitude] = self.locate(at.x(), at.y());
        Self::from_degrees(latitude, longitude, self.yaw() + map_from_other.yaw())
    }
}

/// Lengths of a radian along the meridian and along the parallel of a latitude, metres: radii of
/// curvature of the WGS 84 ellipsoid.
fn metres_per_radian(latitude: f64) -> [f64; 2] {
    /// Semi-major axis, metres.
    const A_M: f64 = 6_378_137.0;
    /// First eccentricity, squared.
    const E2: f64 = 6.694_379_990_14e-3;
    let w2 = 1.0 - E2 * latitude.sin().powi(2);
    let meridian_m = A_M * (1.0 - E2) / (w2 * w2.sqrt());
    [meridian_m, A_M / w2.sqrt() * latitude.cos()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_where_geodesy_has_them() {
        // Lengths of a degree at 45°: 111 131.8 m north, 78 846.8 m east.
        let datum = Datum::from_degrees(45.0, 179.9999, 0.0);
        let [north, _] = datum.locate(0.0, 111.1318);
        assert!((north - 45.001).abs() < 1e-8, "{north}");
        let [_, east] = datum.locate(78.8468, 0.0);
        assert!((east - -179.9991).abs() < 1e-8, "over the date line: {east}");
        // The x axis points north.
        let turned = Datum::from_degrees(45.0, 9.0, std::f64::consts::FRAC_PI_2);
        let [latitude, longitude] = turned.locate(111.1318, 0.0);
        assert!((latitude - 45.001).abs() < 1e-7 && (longitude - 9.0).abs() < 1e-7, "{latitude} {longitude}");
    }

    #[test]
    fn what_people_write_is_what_they_read() {
        let datum = Datum::from_degrees(52.5186, -13.408_3, 0.0);
        assert_eq!((datum.latitude_deg(), datum.longitude_deg()), (52.5186, -13.4083));
        let sides = [0.05, 10.0, 0.0, -1.0, 10.1, f64::NAN, f64::INFINITY].map(PlanImage::um_per_pixel);
        assert_eq!(sides, [Some(50_000), Some(10_000_000), None, None, None, None, None]);
    }

    #[test]
    fn another_map_has_the_same_places() {
        let datum = Datum::from_degrees(52.5, 13.4, 0.3);
        let (sin, cos) = 0.7_f64.sin_cos();
        let other = datum.of_other(FixedPose::from_metres(20.0, -5.0, 0.7));
        let [x, y] = [3.0, 4.0];
        let there = other.locate(x, y);
        let here = datum.locate(20.0 + cos * x - sin * y, -5.0 + sin * x + cos * y);
        assert!(there.iter().zip(here).all(|(a, b)| (a - b).abs() < 2e-8), "{there:?} {here:?}");
    }
}
