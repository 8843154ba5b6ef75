//! The ROS 2 messages, field for field in the order of their definitions, since CDR has no names.

mod diagnostics;
mod goals;
mod sensors;

pub use diagnostics::{DiagnosticArray, DiagnosticStatus, KeyValue};
pub use goals::{
    CancelGoal, CancelGoalRequest, CancelGoalResponse, GoalInfo, GoalStatusArray, GoalStatusMsg, GoalUuid,
};
pub use sensors::{CameraInfoMsg, ImuMsg, PointCloud2, PointField, RegionOfInterest};

use crate::interface::{RosMessage, RosService};
use serde::{Deserialize, Serialize};

macro_rules! message_types {
    ($($message:ty => $name:literal),+ $(,)?) => {
        $(impl RosMessage for $message { const TYPE: &'static str = $name; })+
    };
}

message_types! {
    StringMsg => "std_msgs/msg/String",
    ClockMsg => "rosgraph_msgs/msg/Clock",
    LaserScanMsg => "sensor_msgs/msg/LaserScan",
    ImuMsg => "sensor_msgs/msg/Imu",
    PointCloud2<'_> => "sensor_msgs/msg/PointCloud2",
    CameraInfoMsg => "sensor_msgs/msg/CameraInfo",
    Image<'_> => "sensor_msgs/msg/Image",
    CompressedImage<'_> => "sensor_msgs/msg/CompressedImage",
    OdometryMsg => "nav_msgs/msg/Odometry",
    TfMessage => "tf2_msgs/msg/TFMessage",
    TwistMsg => "geometry_msgs/msg/Twist",
    TwistStamped => "geometry_msgs/msg/TwistStamped",
    PoseStamped => "geometry_msgs/msg/PoseStamped",
    PoseWithCovarianceStamped => "geometry_msgs/msg/PoseWithCovarianceStamped",
    PoseArray => "geometry_msgs/msg/PoseArray",
    OccupancyGridMsg => "nav_msgs/msg/OccupancyGrid",
    OccupancyGridUpdate => "map_msgs/msg/OccupancyGridUpdate",
    PathMsg => "nav_msgs/msg/Path",
    DiagnosticArray => "diagnostic_msgs/msg/DiagnosticArray",
    GoalStatusArray => "action_msgs/msg/GoalStatusArray",
    MarkerArray => "visualization_msgs/msg/MarkerArray",
}

/// `std_msgs/String`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct StringMsg {
    pub data: String,
}

/// `rosgraph_msgs/Clock`: the simulated time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct ClockMsg {
    pub clock: Time,
}

/// `builtin_interfaces/Time`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Time {
    /// Seconds since the epoch.
    pub sec: i32,
    /// Nanoseconds since the second, below 10⁹.
    pub nanosec: u32,
}

impl Time {
    /// Nanoseconds since the epoch; `None` before it, and if the nanoseconds are out of range.
    #[must_use]
    pub fn nanoseconds(self) -> Option<u64> {
        let seconds = u64::try_from(self.sec).ok()?;
        (self.nanosec < 1_000_000_000).then(|| seconds * 1_000_000_000 + u64::from(self.nanosec))
    }

    /// The time `microseconds` after the epoch, at the latest in 2038.
    #[must_use]
    pub fn from_us(microseconds: u64) -> Self {
        let sec = i32::try_from(microseconds / 1_000_000).unwrap_or(i32::MAX);
        Self { sec, nanosec: (microseconds % 1_000_000) as u32 * 1000 }
    }
}

/// `std_msgs/Header`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct HeaderMsg {
    /// When the data was taken.
    pub stamp: Time,
    /// The frame that the data is in.
    pub frame_id: String,
}

/// `geometry_msgs/Vector3` and `geometry_msgs/Point`: metres.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct Vector3 {
    pub x: f64,
    pub y: f64,
    pub z: f64,
}

/// `geometry_msgs/Quaternion`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct Quaternion {
    pub x: f64,
    pub y: f64,
    pub z: f64,
    pub w: f64,
}

impl Default for Quaternion {
    fn default() -> Self {
        Self { x: 0.0, y: 0.0, z: 0.0, w: 1.0 }
    }
}

/// `geometry_msgs/Pose`; `geometry_msgs/Transform` has the same fields.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct Pose {
    pub position: Vector3,
    pub orientation: Quaternion,
}

/// A 6 × 6 covariance, row by row: x, y, z, roll, pitch, yaw.
pub type Covariance = [[f64; 6]; 6];

/// `geometry_msgs/PoseWithCovariance`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct PoseWithCovariance {
    pub pose: Pose,
    pub covariance: Covariance,
}

/// `geometry_msgs/TwistWithCovariance`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct TwistWithCovariance {
    pub linear: Vector3,
    pub angular: Vector3,
    pub covariance: Covariance,
}

/// `geometry_msgs/Twist`: metres and radians per second.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct TwistMsg {
    pub linear: Vector3,
    pub angular: Vector3,
}

/// `geometry_msgs/TwistStamped`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct TwistStamped {
    pub header: HeaderMsg,
    pub twist: TwistMsg,
}

/// `nav_msgs/Odometry`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct OdometryMsg {
    /// Stamp, and the frame of the pose (`odom`).
    pub header: HeaderMsg,
    /// The frame of the robot (`base_link` or `base_footprint`).
    pub child_frame_id: String,
    /// Pose of the child frame in the header's.
    pub pose: PoseWithCovariance,
    /// Velocity in the child frame.
    pub twist: TwistWithCovariance,
}

/// `geometry_msgs/TransformStamped`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TransformStamped {
    /// Stamp, and the parent frame.
    pub header: HeaderMsg,
    /// The child frame.
    pub child_frame_id: String,
    /// Pose of the child in the parent.
    pub transform: Pose,
}

/// `tf2_msgs/TFMessage`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct TfMessage {
    pub transforms: Vec<TransformStamped>,
}

/// `sensor_msgs/LaserScan`: angles in radians, counter-clockwise about the frame's z; ranges in
/// metres.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct LaserScanMsg {
    pub header: HeaderMsg,
    pub angle_min: f32,
    pub angle_max: f32,
    pub angle_increment: f32,
    /// Seconds between beams.
    pub time_increment: f32,
    /// Seconds between scans.
    pub scan_time: f32,
    pub range_min: f32,
    pub range_max: f32,
    pub ranges: Vec<f32>,
    pub intensities: Vec<f32>,
}

/// `sensor_msgs/Image`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Image<'a> {
    /// Stamp and the camera's frame.
    pub header: HeaderMsg,
    /// Rows.
    pub height: u32,
    /// Columns.
    pub width: u32,
    /// Layout of a pixel, such as `rgb8`.
    pub encoding: String,
    /// Byte order of pixels with more than 8 bits.
    pub is_bigendian: u8,
    /// Bytes from one row to the next.
    pub step: u32,
    /// `step · height` bytes.
    pub data: &'a [u8],
}

/// `sensor_msgs/CompressedImage`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CompressedImage<'a> {
    /// Stamp and the camera's frame.
    pub header: HeaderMsg,
    /// `png`, `jpeg`, or what `image_transport` writes: `rgb8; jpeg compressed bgr8`.
    pub format: String,
    /// The picture's file.
    pub data: &'a [u8],
}

/// `nav_msgs/MapMetaData`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MapMetaData {
    /// When the map was loaded.
    pub map_load_time: Time,
    /// Side of a cell, metres.
    pub resolution: f32,
    /// Cells along x.
    pub width: u32,
    /// Cells along y.
    pub height: u32,
    /// The lower left corner of cell (0, 0).
    pub origin: Pose,
}

/// `nav_msgs/OccupancyGrid`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct OccupancyGridMsg {
    /// Stamp and the map's frame.
    pub header: HeaderMsg,
    /// Size and place.
    pub info: MapMetaData,
    /// Row by row from the origin: 0 free, 100 occupied, -1 unknown.
    pub data: Vec<i8>,
}

/// `geometry_msgs/PoseStamped`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct PoseStamped {
    pub header: HeaderMsg,
    pub pose: Pose,
}

/// `geometry_msgs/PoseWithCovarianceStamped`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct PoseWithCovarianceStamped {
    pub header: HeaderMsg,
    pub pose: PoseWithCovariance,
}

/// `geometry_msgs/PoseArray`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct PoseArray {
    pub header: HeaderMsg,
    pub poses: Vec<Pose>,
}

/// `map_msgs/OccupancyGridUpdate`: a rectangle of cells of a grid that was published before.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct OccupancyGridUpdate {
    pub header: HeaderMsg,
    /// Column of its first cell.
    pub x: i32,
    /// Row of its first cell.
    pub y: i32,
    pub width: u32,
    pub height: u32,
    /// Row by row, as in the grid.
    pub data: Vec<i8>,
}

/// `nav_msgs/Path`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct PathMsg {
    pub header: HeaderMsg,
    pub poses: Vec<PoseStamped>,
}

/// `std_msgs/ColorRGBA`, each from 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct Color {
    pub r: f32,
    pub g: f32,
    pub b: f32,
    pub a: f32,
}

/// `visualization_msgs/UVCoordinate`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct UvCoordinate {
    pub u: f32,
    pub v: f32,
}

/// `visualization_msgs/MeshFile`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct MeshFile {
    pub filename: String,
    pub data: Vec<u8>,
}

/// `visualization_msgs/Marker`, as of ROS 2 Humble.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct Marker {
    pub header: HeaderMsg,
    pub ns: String,
    pub id: i32,
    pub kind: i32,
    pub action: i32,
    pub pose: Pose,
    pub scale: Vector3,
    pub color: Color,
    /// How long it is shown; zero is for ever.
    pub lifetime: Time,
    pub frame_locked: bool,
    pub points: Vec<Vector3>,
    pub colors: Vec<Color>,
    pub texture_resource: String,
    pub texture: CompressedImage<'static>,
    pub uv_coordinates: Vec<UvCoordinate>,
    pub text: String,
    pub mesh_resource: String,
    pub mesh_file: MeshFile,
    pub mesh_use_embedded_materials: bool,
}

impl Marker {
    /// `kind` of a list of spheres, one at each of `points`.
    pub const SPHERE_LIST: i32 = 7;
    /// `kind` of a list of lines, one between each pair of `points`.
    pub const LINE_LIST: i32 = 5;
}

/// `visualization_msgs/MarkerArray`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct MarkerArray {
    pub markers: Vec<Marker>,
}

/// `std_srvs/SetBool`.
pub struct SetBool;

/// What [`SetBool`] is asked.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct SetBoolRequest {
    pub data: bool,
}

/// What [`SetBool`] answers.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct SetBoolResponse {
    pub success: bool,
    pub message: String,
}

impl RosService for SetBool {
    const TYPE: &'static str = "std_srvs/srv/SetBool";
    type Request = SetBoolRequest;
    type Response = SetBoolResponse;
}
