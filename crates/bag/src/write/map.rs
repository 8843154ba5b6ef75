//! A map as messages: `/map` as ROS 2 has it, and `/fht_map` for people to look at.

use super::metadata::Durability;
use super::writer::{BagWriter, WriteError};
use fht_map::MapState;
use fht_perception::evidence_grid::EvidenceGrid;
use fht_perception::grid::{Cell, CellState, OccupancyGrid};
use fht_perception::pose::Point2;
use fht_proto::{NodeId, NodeKind};
use fht_ros_frames::header_message;
use fht_ros_messages::msg::{Color, MapMetaData, Marker, MarkerArray, OccupancyGridMsg, Pose, Vector3};

/// The paper's colours.
const MAIN: Color = Color { r: 0.86, g: 0.15, b: 0.15, a: 1.0 };
const SUPPORT: Color = Color { r: 0.98, g: 0.80, b: 0.10, a: 1.0 };
const RECTANGLE: Color = Color { r: 0.15, g: 0.65, b: 0.25, a: 0.6 };
const EDGE: Color = Color { r: 0.35, g: 0.35, b: 0.35, a: 0.9 };

/// Cells row by row, from the one of least x and y, in the frame `map`.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedGrid {
    /// Side of a cell, metres.
    pub resolution_m: f64,
    /// The corner of least x and y, metres.
    pub origin: Point2,
    /// Cells along x.
    pub width: usize,
    /// What is known of each cell.
    pub cells: Vec<CellState>,
}

impl From<&OccupancyGrid> for RecordedGrid {
    fn from(grid: &OccupancyGrid) -> Self {
        let bounds = grid.bounds();
        let cells = (bounds.min.j..bounds.max.j).flat_map(|j| (bounds.min.i..bounds.max.i).map(move |i| Cell { i, j }));
        let metres = |index: i32| f64::from(index) * grid.resolution_m();
        Self {
            resolution_m: grid.resolution_m(),
            origin: Point2::new(metres(bounds.min.i), metres(bounds.min.j)),
            width: bounds.width(),
            cells: cells.map(|cell| grid.state(cell)).collect(),
        }
    }
}

impl From<&EvidenceGrid> for RecordedGrid {
    fn from(grid: &EvidenceGrid) -> Self {
        let (origin, width) = (grid.origin(), grid.width());
        Self { resolution_m: grid.resolution_m(), origin, width, cells: grid.states().collect() }
    }
}

/// Writes what a robot knows of its map at `time_us`: the grid on `/map` (`OccupancyGrid`) and the
/// nodes, edges and rectangles on `/fht_map` (`MarkerArray`: main nodes red, support nodes yellow,
/// rectangles green). Who subscribes late gets the newest.
///
/// # Errors
/// [`WriteError`].
pub fn write_map(bag: &mut BagWriter, time_us: u64, grid: &RecordedGrid, map: &MapState) -> Result<(), WriteError> {
    bag.write("/map", Durability::TransientLocal, time_us, &grid_message(time_us, grid))?;
    bag.write("/fht_map", Durability::TransientLocal, time_us, &markers(time_us, map))
}

fn grid_message(time_us: u64, grid: &RecordedGrid) -> OccupancyGridMsg {
    let value = |state: &CellState| match state {
        CellState::Free => 0,
        CellState::Occupied => 100,
        CellState::Unknown => -1,
    };
    let header = header_message(time_us, "map");
    OccupancyGridMsg {
        info: MapMetaData {
            map_load_time: header.stamp,
            resolution: grid.resolution_m as f32,
            width: grid.width as u32,
            height: (grid.cells.len() / grid.width.max(1)) as u32,
            origin: Pose { position: Vector3 { x: grid.origin.x, y: grid.origin.y, z: 0.0 }, ..Pose::default() },
        },
        header,
        data: grid.cells.iter().map(value).collect(),
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use fht_perception::evidence_grid::Sighting;
    use fht_perception::grid::{CellBounds, GridConfig};

    #[test]
    fn both_kinds_of_grid_lie_where_they_are() {
        let bounds = CellBounds { min: Cell { i: -2, j: 4 }, max: Cell { i: 1, j: 6 } };
        let states = [CellState::Free, CellState::Occupied, CellState::Unknown].repeat(2);
        let grid = OccupancyGrid::from_states(GridConfig::default(), bounds, states);
        let message = grid_message(7, &RecordedGrid::from(&grid));
        assert_eq!((message.info.width, message.info.height, message.data), (3, 2, vec![0, 100, -1, 0, 100, -1]));
        assert!(
            (message.info.origin.position.x + 0.1).abs() < 1e-9 && (message.info.origin.position.y - 0.2).abs() < 1e-9
        );

        let end = Point2::new(2.0, 1.0);
        let grid = EvidenceGrid::new(&[Sighting { from: Point2::origin(), ends: vec![end] }], &[]);
        let recorded = RecordedGrid::from(&grid);
        let state_at = |place: Point2| {
            let cell = (place - recorded.origin) / recorded.resolution_m;
            recorded.cells[cell.y as usize * recorded.width + cell.x as usize]
        };
        assert_eq!((state_at(end), state_at(Point2::new(1.0, 0.5))), (CellState::Occupied, CellState::Free));
        assert_eq!(state_at(Point2::new(0.2, 0.9)), CellState::Unknown);
        assert_eq!(recorded.cells.len() % recorded.width, 0);
    }
}
