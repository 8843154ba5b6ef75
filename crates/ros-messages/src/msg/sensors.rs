//! Sensors beside planar scanners, and what cameras are like.

use super::{HeaderMsg, Quaternion, Vector3};
use serde::{Deserialize, Serialize};

/// `sensor_msgs/Imu`: radians per second, metres per second squared, in the frame of the sensor.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct ImuMsg {
    pub header: HeaderMsg,
    pub orientation: Quaternion,
    /// Row by row about x, y, z. The first element is -1 if there is no orientation.
    pub orientation_covariance: [f64; 9],
    pub angular_velocity: Vector3,
    pub angular_velocity_covariance: [f64; 9],
    pub linear_acceleration: Vector3,
    pub linear_acceleration_covariance: [f64; 9],
}

/// `sensor_msgs/PointField`: where in a point one of its numbers stands.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct PointField {
    /// `x`, `y`, `z`, `intensity` …
    pub name: String,
    /// Bytes from the start of the point.
    pub offset: u32,
    /// 7 is a 32-bit float ([`Self::FLOAT32`]), 8 a 64-bit one; 1 to 6 are integers.
    pub datatype: u8,
    /// How many of them follow each other.
    pub count: u32,
}

impl PointField {
    /// `datatype` of a 32-bit float.
    pub const FLOAT32: u8 = 7;
    /// `datatype` of a 64-bit float.
    pub const FLOAT64: u8 = 8;
}

/// `sensor_msgs/PointCloud2`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PointCloud2<'a> {
    /// Stamp and the sensor's frame.
    pub header: HeaderMsg,
    /// Rows; 1 if the points have no order.
    pub height: u32,
    /// Points a row.
    pub width: u32,
    /// What a point is made of.
    pub fields: Vec<PointField>,
    /// Byte order of the numbers.
    pub is_bigendian: bool,
    /// Bytes from one point to the next.
    pub point_step: u32,
    /// Bytes from one row to the next.
    pub row_step: u32,
    /// `row_step · height` bytes.
    pub data: &'a [u8],
    /// Whether all points are finite.
    pub is_dense: bool,
}

/// `sensor_msgs/RegionOfInterest`: the part of the sensor that pictures show; 0 is all of it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct RegionOfInterest {
    pub x_offset: u32,
    pub y_offset: u32,
    pub height: u32,
    pub width: u32,
    pub do_rectify: bool,
}

/// `sensor_msgs/CameraInfo`: how a camera looks.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CameraInfoMsg {
    /// Stamp and the camera's optical frame: z ahead, x to the right, y down.
    pub header: HeaderMsg,
    /// Rows.
    pub height: u32,
    /// Columns.
    pub width: u32,
    /// `plumb_bob`, `rational_polynomial`, `equidistant` …
    pub distortion_model: String,
    /// Its parameters.
    pub d: Vec<f64>,
    /// Row by row: `fx 0 cx 0 fy cy 0 0 1`, pixels.
    pub k: [f64; 9],
    /// Of stereo cameras.
    pub r: [f64; 9],
    /// `k` of rectified pictures, with a fourth column.
    pub p: [f64; 12],
    /// Pixels of the sensor that are one here; 0 is 1.
    pub binning_x: u32,
    /// The same along y.
    pub binning_y: u32,
    /// The part that is shown.
    pub roi: RegionOfInterest,
}
