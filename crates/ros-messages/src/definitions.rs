//! The definitions of the ROS 2 interfaces as text, in the form of MCAP schemas (`ros2msg`).

/// Field lists by type; those of messages without `msg/`. What ROS makes of services and actions
/// itself (`_SendGoal`, `_Event` …) is not listed.
const DEFINITIONS: &[(&str, &str)] = &[
    ("builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n"),
    ("builtin_interfaces/Duration", "int32 sec\nuint32 nanosec\n"),
    ("std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id\n"),
    ("std_msgs/String", "string data\n"),
    ("rosgraph_msgs/Clock", "builtin_interfaces/Time clock\n"),
    ("std_msgs/ColorRGBA", "float32 r\nfloat32 g\nfloat32 b\nfloat32 a\n"),
    ("geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z\n"),
    ("geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z\n"),
    ("geometry_msgs/Quaternion", "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"),
    ("geometry_msgs/Pose", "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n"),
    ("geometry_msgs/PoseStamped", "std_msgs/Header header\ngeometry_msgs/Pose pose\n"),
    ("geometry_msgs/PoseWithCovariance", "geometry_msgs/Pose pose\nfloat64[36] covariance\n"),
    ("geometry_msgs/Twist", "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n"),
    ("geometry_msgs/TwistStamped", "std_msgs/Header header\ngeometry_msgs/Twist twist\n"),
    ("geometry_msgs/PoseArray", "std_msgs/Header header\ngeometry_msgs/Pose[] poses\n"),
    ("geometry_msgs/PoseWithCovarianceStamped", "std_msgs/Header header\ngeometry_msgs/PoseWithCovariance pose\n"),
    ("geometry_msgs/TwistWithCovariance", "geometry_msgs/Twist twist\nfloat64[36] covariance\n"),
    ("geometry_msgs/Transform", "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n"),
    (
        "geometry_msgs/TransformStamped",
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n",
    ),
    (
        "sensor_msgs/LaserScan",
        "std_msgs/Header header\nfloat32 angle_min\nfloat32 angle_max\nfloat32 angle_increment\nfloat32 time_increment\n\
         float32 scan_time\nfloat32 range_min\nfloat32 range_max\nfloat32[] ranges\nfloat32[] intensities\n",
    ),
    (
        "sensor_msgs/Image",
        "std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\nuint32 step\n\
         uint8[] data\n",
    ),
    ("sensor_msgs/CompressedImage", "std_msgs/Header header\nstring format\nuint8[] data\n"),
    (
        "sensor_msgs/RegionOfInterest",
        "uint32 x_offset\nuint32 y_offset\nuint32 height\nuint32 width\nbool do_rectify\n",
    ),
    (
        "sensor_msgs/CameraInfo",
        "std_msgs/Header header\nuint32 height\nuint32 width\nstring distortion_model\nfloat64[] d\nfloat64[9] k\n\
         float64[9] r\nfloat64[12] p\nuint32 binning_x\nuint32 binning_y\nsensor_msgs/RegionOfInterest roi\n",
    ),
    (
        "sensor_msgs/Imu",
        "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n\
         geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n\
         geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance\n",
    ),
    (
        "sensor_msgs/PointField",
        "uint8 INT8=1\nuint8 UINT8=2\nuint8 INT16=3\nuint8 UINT16=4\nuint8 INT32=5\nuint8 UINT32=6\n\
         uint8 FLOAT32=7\nuint8 FLOAT64=8\nstring name\nuint32 offset\nuint8 datatype\nuint32 count\n",
    ),
    (
        "sensor_msgs/PointCloud2",
        "std_msgs/Header header\nuint32 height\nuint32 width\nsensor_msgs/PointField[] fields\nbool is_bigendian\n\
         uint32 point_step\nuint32 row_step\nuint8[] data\nbool is_dense\n",
    ),
    (
        "nav_msgs/Odometry",
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n\
         geometry_msgs/TwistWithCovariance twist\n",
    ),
    (
        "nav_msgs/MapMetaData",
        "builtin_interfaces/Time map_load_time\nfloat32 resolution\nuint32 width\nuint32 height\n\
         geometry_msgs/Pose origin\n",
    ),
    ("nav_msgs/OccupancyGrid", "std_msgs/Header header\nnav_msgs/MapMetaData info\nint8[] data\n"),
    ("nav_msgs/Path", "std_msgs/Header header\ngeometry_msgs/PoseStamped[] poses\n"),
    (
        "map_msgs/OccupancyGridUpdate",
        "std_msgs/Header header\nint32 x\nint32 y\nuint32 width\nuint32 height\nint8[] data\n",
    ),
    ("tf2_msgs/TFMessage", "geometry_msgs/TransformStamped[] transforms\n"),
    ("visualization_msgs/UVCoordinate", "float32 u\nfloat32 v\n"),
    ("visualization_msgs/MeshFile", "string filename\nuint8[] data\n"),
    (
        "visualization_msgs/Marker",
        "int32 ARROW=0\nint32 CUBE=1\nint32 SPHERE=2\nint32 CYLINDER=3\nint32 LINE_STRIP=4\nint32 LINE_LIST=5\n\
         int32 CUBE_LIST=6\nint32 SPHERE_LIST=7\nint32 POINTS=8\nint32 TEXT_VIEW_FACING=9\nint32 MESH_RESOURCE=10\n\
         int32 TRIANGLE_LIST=11\nint32 ADD=0\nint32 MODIFY=0\nint32 DELETE=2\nint32 DELETEALL=3\n\
         std_msgs/Header header\nstring ns\nint32 id\nint32 type\nint32 action\ngeometry_msgs/Pose pose\n\
         geometry_msgs/Vector3 scale\nstd_msgs/ColorRGBA color\nbuiltin_interfaces/Duration lifetime\n\
         bool frame_locked\ngeometry_msgs/Point[] points\nstd_msgs/ColorRGBA[] colors\nstring texture_resource\n\
         sensor_msgs/CompressedImage texture\nvisualization_msgs/UVCoordinate[] uv_coordinates\nstring text\n\
         string mesh_resource\nvisualization_msgs/MeshFile mesh_file\nbool mesh_use_embedded_materials\n",
    ),
    ("visualization_msgs/MarkerArray", "visualization_msgs/Marker[] markers\n"),
    ("diagnostic_msgs/KeyValue", "string key\nstring value\n"),
    (
        "diagnostic_msgs/DiagnosticStatus",
        "byte OK=0\nbyte WARN=1\nbyte ERROR=2\nbyte STALE=3\nbyte level\nstring name\nstring message\n\
         string hardware_id\ndiagnostic_msgs/KeyValue[] values\n",
    ),
    ("diagnostic_msgs/DiagnosticArray", "std_msgs/Header header\ndiagnostic_msgs/DiagnosticStatus[] status\n"),
    ("unique_identifier_msgs/UUID", "uint8[16] uuid\n"),
    ("action_msgs/GoalInfo", "unique_identifier_msgs/UUID goal_id\nbuiltin_interfaces/Time stamp\n"),
    (
        "action_msgs/GoalStatus",
        "int8 STATUS_UNKNOWN=0\nint8 STATUS_ACCEPTED=1\nint8 STATUS_EXECUTING=2\nint8 STATUS_CANCELING=3\n\
         int8 STATUS_SUCCEEDED=4\nint8 STATUS_CANCELED=5\nint8 STATUS_ABORTED=6\n\
         action_msgs/GoalInfo goal_info\nint8 status\n",
    ),
    ("action_msgs/GoalStatusArray", "action_msgs/GoalStatus[] status_list\n"),
    ("action_msgs/srv/CancelGoal_Request", "action_msgs/GoalInfo goal_info\n"),
    ("action_msgs/srv/CancelGoal_Response", "int8 return_code\naction_msgs/GoalInfo[] goals_canceling\n"),
    (
        "service_msgs/ServiceEventInfo",
        "uint8 REQUEST_SENT=0\nuint8 REQUEST_RECEIVED=1\nuint8 RESPONSE_SENT=2\nuint8 RESPONSE_RECEIVED=3\n\
         uint8 event_type\nbuiltin_interfaces/Time stamp\nuint8[16] client_gid\nint64 sequence_number\n",
    ),
    ("std_srvs/srv/SetBool_Request", "bool data\n"),
    ("std_srvs/srv/SetBool_Response", "bool success\nstring message\n"),
    ("nav2_msgs/action/NavigateToPose_Goal", "geometry_msgs/PoseStamped pose\nstring behavior_tree\n"),
    ("nav2_msgs/action/NavigateToPose_Result", "uint16 error_code\nstring error_msg\n"),
    (
        "nav2_msgs/action/NavigateToPose_Feedback",
        "geometry_msgs/PoseStamped current_pose\nbuiltin_interfaces/Duration navigation_time\n\
         builtin_interfaces/Duration estimated_time_remaining\nint16 number_of_recoveries\nfloat32 distance_remaining\n",
    ),
    (
        "nav2_msgs/action/ComputePathToPose_Goal",
        "geometry_msgs/PoseStamped goal\ngeometry_msgs/PoseStamped start\nstring planner_id\nbool use_start\n",
    ),
    (
        "nav2_msgs/action/ComputePathToPose_Result",
        "nav_msgs/Path path\nbuiltin_interfaces/Duration planning_time\nuint16 error_code\nstring error_msg\n",
    ),
    ("nav2_msgs/action/ComputePathToPose_Feedback", ""),
    ("nav2_msgs/RouteNode", "uint16 nodeid\ngeometry_msgs/Point position\n"),
    ("nav2_msgs/RouteEdge", "uint16 edgeid\ngeometry_msgs/Point start\ngeometry_msgs/Point end\n"),
    (
        "nav2_msgs/Route",
        "std_msgs/Header header\nfloat32 route_cost\nnav2_msgs/RouteNode[] nodes\nnav2_msgs/RouteEdge[] edges\n",
    ),
    (
        "nav2_msgs/action/ComputeRoute_Goal",
        "uint16 start_id\ngeometry_msgs/PoseStamped start\nuint16 goal_id\ngeometry_msgs/PoseStamped goal\n\
         bool use_start\nbool use_poses\n",
    ),
    (
        "nav2_msgs/action/ComputeRoute_Result",
        "builtin_interfaces/Duration planning_time\nnav_msgs/Path path\nnav2_msgs/Route route\nuint16 error_code\n",
    ),
    ("nav2_msgs/action/ComputeRoute_Feedback", ""),
];

/// Types that have other fields in Kilted than in Jazzy.
const KILTED: &[(&str, &str)] = &[(
    "nav2_msgs/action/ComputeRoute_Result",
    "builtin_interfaces/Duration planning_time\nnav_msgs/Path path\nnav2_msgs/Route route\nuint16 error_code\n\
     string error_msg\n",
)];

/// The fields in Kilted of a type that has others there; its name has no `/msg/`.
pub(crate) fn kilted_fields(name: &str) -> Option<&'static str> {
    KILTED.iter().find(|(known, _)| *known == name).map(|(_, fields)| *fields)
}

/// The fields of a type, whose name has no `/msg/`.
pub(crate) fn fields(name: &str) -> Option<&'static str> {
    DEFINITIONS.iter().find(|(known, _)| *known == name).map(|(_, fields)| *fields)
}

/// The definition of `type_name` (such as `nav_msgs/msg/Odometry`), followed by those of all types
/// that it contains, each after a line of 80 `=`. `None` for a type that is not defined here.
#[must_use]
pub fn definition(type_name: &str) -> Option<String> {
    let root = type_name.replacen("/msg/", "/", 1);
    let mut text = fields(&root)?.to_owned();
    let mut types: Vec<&str> = Vec::new();
    collect(fields(&root)?, &mut types);
    for name in types {
        let separator = "=".repeat(80);
        text.push_str(&format!("{separator}\nMSG: {name}\n{}", fields(name)?));
    }
    Some(text)
}

/// Collects the types of `fields`, each once.
fn collect(fields_text: &'static str, types: &mut Vec<&'static str>) {
    for line in fields_text.lines() {
        let name = line.split([' ', '[']).next().unwrap_or_default();
        if let Some(fields) = fields(name)
            && !types.contains(&name)
        {
            types.push(name);
            collect(fields, types);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_definition_holds_all_that_it_needs_once() {
        let text = definition("nav_msgs/msg/Odometry").unwrap();
        for name in ["std_msgs/Header", "builtin_interfaces/Time", "geometry_msgs/Point", "geometry_msgs/Vector3"] {
            assert_eq!(text.matches(&format!("\nMSG: {name}\n")).count(), 1, "{name}");
        }
        assert!(text.starts_with("std_msgs/Header header\n"));
        assert!(definition("nav_msgs/msg/Goals").is_none());
    }

    #[test]
    fn every_type_is_known() {
        const PLAIN: [&str; 13] = [
            "int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "float32", "float64", "string", "bool",
            "byte", "",
        ];
        for (_, text) in DEFINITIONS {
            for line in text.lines() {
                let name = line.split([' ', '[']).next().unwrap();
                assert!(PLAIN.contains(&name) || fields(name).is_some(), "{line}");
            }
        }
    }
}
