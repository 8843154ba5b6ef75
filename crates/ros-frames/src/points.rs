//! Clouds of points, of 3D LiDARs and depth cameras, as scans of what stands in a robot's way.
//!
//! Of each direction, the nearest point between two heights over the base counts. Where no point
//! was seen, nothing is said: what the sensor cannot see there may be anything.

use crate::scan::MOUNT_LIMIT_M;
use fht_perception::frame::LaserScan;
use fht_perception::pose::pose;
use fht_ros_messages::msg::{PointCloud2, PointField};
use nalgebra::{Isometry3, Point3};
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};

/// Most points of a cloud: four times those of a LiDAR with 128 lines.
const POINT_LIMIT: u64 = 1 << 20;
/// Fewest and most beams.
const BEAMS: (usize, usize) = (8, 7200);

/// Which points count.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct BandConfig {
    /// Points lower than this over the base are floor, metres. Default 0.1.
    pub low_m: f64,
    /// Points higher than this are over the robot, metres. Default 0.6.
    pub high_m: f64,
    /// Directions all round, 8 to 7200. Default 720.
    pub beams: usize,
    /// Nearer points are the robot itself, metres from the sensor, seen from above. Default 0.2.
    pub range_min_m: f64,
    /// Farther points do not count, metres. Default 30.
    pub range_max_m: f64,
}

impl Default for BandConfig {
    fn default() -> Self {
        Self { low_m: 0.1, high_m: 0.6, beams: 720, range_min_m: 0.2, range_max_m: 30.0 }
    }
}

/// Why a cloud is of no use.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CloudRefused {
    /// A coordinate is missing.
    #[error("its points have no {0}: it needs x, y and z (ros2 topic echo --field fields)")]
    NoField(&'static str),
    /// A coordinate is no floating-point number, or does not lie within a point.
    #[error("its {0} is not a float32 or float64 within a point: see its fields and point_step")]
    BadField(&'static str),
    /// The bytes are fewer than its size.
    #[error("it has {has} bytes where its width, height and steps need {needs}: its driver is at fault")]
    Short {
        /// The bytes there are.
        has: u64,
        /// The bytes there should be.
        needs: u64,
    },
    /// More points than are read.
    #[error("{0} points are too many: thin it out (a voxel filter), 2^20 are read")]
    TooMany(u64),
    /// The band, or the sensor's place, is of no use.
    #[error("the band of heights is empty, or the sensor is not on the robot: see low_m, high_m and the ranges")]
    NoBand,
}

/// Where in a point a coordinate stands.
#[derive(Clone, Copy)]
struct Coordinate {
    offset: usize,
    is_double: bool,
}

impl Coordinate {
    fn find(cloud: &PointCloud2<'_>, name: &'static str) -> Result<Self, CloudRefused> {
        let field = cloud.fields.iter().find(|field| field.name == name).ok_or(CloudRefused::NoField(name))?;
        let (is_double, size) = match field.datatype {
            PointField::FLOAT32 => (false, 4),
            PointField::FLOAT64 => (true, 8),
            _ => return Err(CloudRefused::BadField(name)),
        };
        if u64::from(field.offset) + size > u64::from(cloud.point_step) {
            return Err(CloudRefused::BadField(name));
        }
        Ok(Self { offset: field.offset as usize, is_double })
    }

    fn of(self, point: &[u8], is_bigendian: bool) -> Option<f64> {
        let bytes = point.get(self.offset..)?;
        if self.is_double {
            let bytes = *bytes.first_chunk::<8>()?;
            Some(if is_bigendian { f64::from_be_bytes(bytes) } else { f64::from_le_bytes(bytes) })
        } else {
            let bytes = *bytes.first_chunk::<4>()?;
            Some(f64::from(if is_bigendian { f32::from_be_bytes(bytes) } else { f32::from_le_bytes(bytes) }))
        }
    }
}

/// All points of a cloud that have a place, in the frame of the sensor.
fn points<'a>(cloud: &'a PointCloud2<'a>) -> Result<impl Iterator<Item = Point3<f64>>, CloudRefused> {
    let [x, y, z] = ["x", "y", "z"].map(|name| Coordinate::find(cloud, name));
    let (x, y, z) = (x?, y?, z?);
    let (width, height) = (u64::from(cloud.width), u64::from(cloud.height));
    let (step, row) = (u64::from(cloud.point_step), u64::from(cloud.row_step));
    // Each below 2³², so that no product is beyond 2⁶⁴.
    let count = width * height;
    if count > POINT_LIMIT {
        return Err(CloudRefused::TooMany(count));
    }
    // Padding after the last row may be missing.
    let line = width * step;
    let needs = if count == 0 { 0 } else { (row.max(line) * (height - 1)).saturating_add(line) };
    let has = cloud.data.len() as u64;
    if has < needs || (height > 1 && row < line) {
        return Err(CloudRefused::Short { has, needs });
    }
    let (data, is_bigendian) = (cloud.data, cloud.is_bigendian);
    let (width, step, row) = (width as usize, step as usize, row as usize);
    Ok((0..count as usize).filter_map(move |index| {
        let point = data.get((index / width) * row + (index % width) * step..)?;
        let at = Point3::new(x.of(point, is_bigendian)?, y.of(point, is_bigendian)?, z.of(point, is_bigendian)?);
        at.coords.iter().all(|metres| metres.is_finite()).then_some(at)
    }))
}

/// The scan of what stands between the band's heights, from a sensor at `base_from_sensor`: beams
/// all round from where the sensor stands, ahead of the base first behind it. Directions in which
/// no point counts are NaN.
///
/// # Errors
/// [`CloudRefused`].
pub fn scan_of_points(
    cloud: &PointCloud2<'_>,
    base_from_sensor: &Isometry3<f64>,
    config: &BandConfig,
) -> Result<LaserScan, CloudRefused> {
    let sensor = base_from_sensor.translation.vector;
    let is_on_robot = sensor.xy().norm() <= MOUNT_LIMIT_M;
    // Comparisons with what is no number are false.
    let is_band = config.low_m < config.high_m && 0.0 <= config.range_min_m && config.range_min_m < config.range_max_m;
    if !(is_on_robot && is_band && config.range_max_m.is_finite()) {
        return Err(CloudRefused::NoBand);
    }
    let beams = config.beams.clamp(BEAMS.0, BEAMS.1);
    let increment = TAU / beams as f64;
    let mut ranges_m = vec![f32::NAN; beams];
    for point in points(cloud)? {
        let at = base_from_sensor * point;
        let (dx, dy) = (at.x - sensor.x, at.y - sensor.y);
        let range_m = dx.hypot(dy);
        let is_seen = (config.low_m..=config.high_m).contains(&at.z)
            && range_m >= config.range_min_m
            && range_m < config.range_max_m;
        if is_seen {
            let beam = (((dy.atan2(dx) + PI) / increment) as usize).min(beams - 1);
            // The least of a number and NaN is the number.
            ranges_m[beam] = ranges_m[beam].min(range_m as f32);
        }
    }
    Ok(LaserScan {
        base_from_sensor: pose(sensor.x, sensor.y, 0.0),
        angle_min: 0.5 * increment - PI,
        angle_increment: increment,
        range_min_m: config.range_min_m,
        range_max_m: config.range_max_m,
        ranges_m,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Translation3, UnitQuaternion};
    use proptest::prelude::*;

    /// How a cloud is laid out.
    #[derive(Clone, Copy, Debug)]
    struct Layout {
        width: usize,
        is_bigendian: bool,
        is_double: bool,
        /// Bytes before x, after a point, and after a row.
        padding: (usize, usize, usize),
        has_last_padding: bool,
    }

    const PLAIN: Layout =
        Layout { width: 4, is_bigendian: false, is_double: false, padding: (0, 0, 0), has_last_padding: true };

    fn bytes(points: &[[f64; 3]], layout: &Layout) -> Vec<u8> {
        let mut data = Vec::new();
        for row in points.chunks(layout.width) {
            for point in row {
                data.extend(vec![0x7f; layout.padding.0]);
                for value in point {
                    match (layout.is_double, layout.is_bigendian) {
                        (false, false) => data.extend((*value as f32).to_le_bytes()),
                        (false, true) => data.extend((*value as f32).to_be_bytes()),
                        (true, false) => data.extend(value.to_le_bytes()),
                        (true, true) => data.extend(value.to_be_bytes()),
                    }
                }
                data.extend(vec![0x7f; layout.padding.1]);
            }
            data.extend(vec![0x7f; layout.padding.2]);
        }
        if !layout.has_last_padding {
            data.truncate(data.len() - layout.padding.2);
        }
        data
    }

    fn cloud<'a>(data: &'a [u8], count: usize, layout: &Layout) -> PointCloud2<'a> {
        let size = if layout.is_double { 8 } else { 4 };
        let point_step = layout.padding.0 + 3 * size + layout.padding.1;
        let field = |(index, name): (usize, &str)| PointField {
            name: name.to_owned(),
            offset: (layout.padding.0 + index * size) as u32,
            datatype: if layout.is_double { PointField::FLOAT64 } else { PointField::FLOAT32 },
            count: 1,
        };
        PointCloud2 {
            height: (count / layout.width) as u32,
            width: layout.width as u32,
            fields: ["x", "y", "z"].into_iter().enumerate().map(field).collect(),
            is_bigendian: layout.is_bigendian,
            point_step: point_step as u32,
            row_step: (point_step * layout.width + layout.padding.2) as u32,
            data,
            ..PointCloud2::default()
        }
    }

    fn scan(points: &[[f64; 3]], sensor: &Isometry3<f64>) -> LaserScan {
        let data = bytes(points, &PLAIN);
        let cloud = cloud(&data, points.len(), &PLAIN);
        scan_of_points(&cloud, sensor, &BandConfig::default()).expect("a good cloud")
    }

    #[test]
    fn the_nearest_point_at_the_robots_height_counts() {
        let sensor = Isometry3::translation(0.2, 0.0, 0.5);
        // Two walls ahead, the floor, the ceiling, the robot itself, nothing, and one to the left.
        let points = [
            [3.0, 0.01, 0.0],
            [2.0, 0.01, -0.2],
            [1.0, 0.01, -0.5],
            [1.0, 0.01, 1.5],
            [0.1, 0.01, 0.0],
            [f64::NAN, 0.0, 0.0],
            [0.01, 1.5, -0.3],
            [40.0, -0.01, 0.0],
        ];
        let scan = scan(&points, &sensor);
        let ends = scan.points_in_base();
        assert_eq!(ends.len(), 2, "{ends:?}");
        let has = |x: f64, y: f64| ends.iter().any(|end| (end.x - x).hypot(end.y - y) < 0.03);
        assert!(has(2.2, 0.01) && has(0.21, 1.5), "{ends:?}");
        assert!(scan.ranges_m.iter().filter(|range| range.is_nan()).count() == 718);
    }

    #[test]
    fn a_sensor_that_looks_down_is_turned_level() {
        // It looks down by 30°, and to the left.
        let rotation = UnitQuaternion::from_euler_angles(0.0, 30.0_f64.to_radians(), 90.0_f64.to_radians());
        let sensor = Isometry3::from_parts(Translation3::new(0.0, 0.1, 1.0), rotation);
        let wall = sensor.inverse() * Point3::new(0.0, 1.1, 0.4);
        let ends = scan(&[[wall.x, wall.y, wall.z]; 4], &sensor).points_in_base();
        assert!(ends.len() == 1 && (ends[0].x.hypot(ends[0].y - 1.1)) < 0.01, "{ends:?}");
    }

    #[test]
    fn what_is_missing_or_hostile_is_named() {
        let data = bytes(&[[1.0, 0.0, 0.3]; 8], &PLAIN);
        let good = cloud(&data, 8, &PLAIN);
        let said = |cloud: &PointCloud2<'_>| {
            scan_of_points(cloud, &Isometry3::identity(), &BandConfig::default()).map_err(|why| why.to_string())
        };
        assert!(said(&good).is_ok());
        let mut no_z = good.clone();
        no_z.fields.pop();
        assert!(said(&no_z).is_err_and(|why| why.contains("have no z")));
        let mut whole = good.clone();
        whole.fields[0].datatype = 5;
        assert!(said(&whole).is_err_and(|why| why.contains("its x is not a float32")));
        let mut outside = good.clone();
        outside.fields[1].offset = u32::MAX;
        assert!(said(&outside).is_err_and(|why| why.contains("its y is not")));
        let short = PointCloud2 { height: 3, ..good.clone() };
        assert!(said(&short).is_err_and(|why| why.contains("96 bytes where")), "{:?}", said(&short));
        let endless = PointCloud2 { height: u32::MAX, width: u32::MAX, row_step: u32::MAX, ..good.clone() };
        assert!(said(&endless).is_err_and(|why| why.contains("are too many")));
        let folded = PointCloud2 { row_step: 1, ..good.clone() };
        assert!(said(&folded).is_err());
        let empty = PointCloud2 { height: 0, width: 0, data: &[], ..good.clone() };
        assert!(said(&empty).is_ok_and(|scan| scan.points_in_base().is_empty()));
        let no_band = BandConfig { low_m: 1.0, high_m: f64::NAN, ..BandConfig::default() };
        assert_eq!(scan_of_points(&good, &Isometry3::identity(), &no_band).err(), Some(CloudRefused::NoBand));
        let far = Isometry3::translation(1e7, 0.0, 0.0);
        assert_eq!(scan_of_points(&good, &far, &BandConfig::default()).err(), Some(CloudRefused::NoBand));
    }

    proptest! {
        #[test]
        fn any_layout_says_the_same(
            points in prop::collection::vec([-9.0..9.0_f64, -9.0..9.0_f64, -1.0..2.0_f64], 12),
            width in prop::sample::select(vec![1_usize, 2, 3, 4, 6, 12]),
            is_bigendian: bool,
            is_double: bool,
            padding in (0..9_usize, 0..9_usize, 0..33_usize),
            has_last_padding: bool,
        ) {
            // As single precision has them.
            let points: Vec<[f64; 3]> = points.iter().map(|point| point.map(|value| f64::from(value as f32))).collect();
            let layout = Layout { width, is_bigendian, is_double, padding, has_last_padding };
            let data = bytes(&points, &layout);
            let found = scan_of_points(&cloud(&data, 12, &layout), &Isometry3::identity(), &BandConfig::default());
            let found = found.map_err(|why| TestCaseError::fail(why.to_string()))?;
            let plain = scan(&points, &Isometry3::identity());
            let bits = |scan: &LaserScan| scan.ranges_m.iter().map(|range| range.to_bits()).collect::<Vec<_>>();
            prop_assert_eq!(bits(&found), bits(&plain));
            // No point is nearer than what the scan says in its direction.
            for [x, y, z] in points {
                if (0.1..=0.6).contains(&z) && x.hypot(y) >= 0.2 {
                    let beam = (((y.atan2(x) + PI) / found.angle_increment) as usize).min(719);
                    prop_assert!(f64::from(found.ranges_m[beam]) <= x.hypot(y) + 1e-6);
                }
            }
        }

        #[test]
        fn no_header_is_too_hostile(
            numbers in prop::array::uniform4(prop_oneof![0..64_u32, any::<u32>()]),
            offsets in prop::array::uniform3(prop_oneof![0..64_u32, any::<u32>()]),
            kinds in prop::array::uniform3(0..10_u8),
            data in prop::collection::vec(any::<u8>(), 0..600),
            is_bigendian: bool,
        ) {
            let [height, width, point_step, row_step] = numbers;
            let field = |index: usize, name: &str| PointField {
                name: name.to_owned(), offset: offsets[index], datatype: kinds[index], count: 1,
            };
            let fields = vec![field(0, "x"), field(1, "y"), field(2, "z")];
            let cloud = PointCloud2 {
                height, width, fields, is_bigendian, point_step, row_step, data: &data, ..PointCloud2::default()
            };
            if let Ok(scan) = scan_of_points(&cloud, &Isometry3::identity(), &BandConfig::default()) {
                prop_assert!(scan.ranges_m.len() == 720 && u64::from(width) * u64::from(height) <= POINT_LIMIT);
            }
        }
    }
}
