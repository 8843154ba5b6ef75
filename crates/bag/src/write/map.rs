//! A map as messages: `/map` as ROS 2 has it, and `/fht_map` for people to look at.

use super::metadata::Durability;
use super::writer::{BagWriter, WriteError};
use fht_map::MapState;
use fht_proto::{NodeId, NodeKind};
use fht_ros_frames::{FloorGrid, grid_message, header_message};
use fht_ros_messages::msg::{Color, Marker, MarkerArray, Vector3};

/// The paper's colours.
const MAIN: Color = Color { r: 0.86, g: 0.15, b: 0.15, a: 1.0 };
const SUPPORT: Color = Color { r: 0.98, g: 0.80, b: 0.10, a: 1.0 };
const RECTANGLE: Color = Color { r: 0.15, g: 0.65, b: 0.25, a: 0.6 };
const EDGE: Color = Color { r: 0.35, g: 0.35, b: 0.35, a: 0.9 };

/// Writes what a robot knows of its map at `time_us`: the grid on `/map` (`OccupancyGrid`) and the
/// nodes, edges and rectangles on `/fht_map` (`MarkerArray`: main nodes red, support nodes yellow,
/// rectangles green). Who subscribes late gets the newest.
///
/// # Errors
/// [`WriteError`].
pub fn write_map(bag: &mut BagWriter, time_us: u64, grid: &FloorGrid, map: &MapState) -> Result<(), WriteError> {
    bag.write("/map", Durability::TransientLocal, time_us, &grid_message(time_us, grid))?;
    bag.write("/fht_map", Durability::TransientLocal, time_us, &markers(time_us, map))
}

fn markers(time_us: u64, map: &MapState) -> MarkerArray {
    let place =
        |id: NodeId| map.node(id).map(|node| Vector3 { x: node.pose.position.x(), y: node.pose.position.y(), z: 0.0 });
    let nodes = |kind: NodeKind| {
        map.nodes().filter(|node| node.kind == kind).filter_map(|node| place(node.id)).collect::<Vec<_>>()
    };
    let edges = map.edges().filter_map(|edge| Some([place(edge.low())?, place(edge.high())?]));
    let rectangles = map.nodes().filter_map(|node| {
        let rect = node.free_space?;
        let ((west, south), (east, north)) = (rect.min(node.pose.position), rect.max(node.pose.position));
        let corner = |x, y| Vector3 { x, y, z: 0.0 };
        let corners = [corner(west, south), corner(east, south), corner(east, north), corner(west, north)];
        Some((0..4).flat_map(move |side| [corners[side], corners[(side + 1) % 4]]))
    });
    let marker = |ns: &str, kind: i32, width: f64, color: Color, points: Vec<Vector3>| Marker {
        header: header_message(time_us, "map"),
        ns: ns.to_owned(),
        kind,
        scale: Vector3 { x: width, y: width, z: width },
        color,
        points,
        ..Marker::default()
    };
    MarkerArray {
        markers: vec![
            marker("rectangles", Marker::LINE_LIST, 0.03, RECTANGLE, rectangles.flatten().collect()),
            marker("edges", Marker::LINE_LIST, 0.04, EDGE, edges.flatten().collect()),
            marker("support nodes", Marker::SPHERE_LIST, 0.2, SUPPORT, nodes(NodeKind::Support)),
            marker("main nodes", Marker::SPHERE_LIST, 0.3, MAIN, nodes(NodeKind::Main)),
        ],
    }
}
