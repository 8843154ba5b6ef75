//! Where main nodes saw walls: what a straight way into the mesh must not lead through.

use crate::free_space::{Corner, between, distance, foot_share};
use crate::state::{MapState, NodeRef};
use std::collections::HashMap;

/// Side of a square in which points are gathered, millimetres.
const SQUARE_MM: f64 = 250.0;

/// End points of all main nodes' scans, millimetres in the map frame.
#[derive(Clone, Debug, Default)]
pub(crate) struct SeenWalls {
    squares: HashMap<(i32, i32), Vec<Corner>>,
}

fn square_of(point: Corner) -> (i32, i32) {
    ((point[0] / SQUARE_MM).floor() as i32, (point[1] / SQUARE_MM).floor() as i32)
}

impl SeenWalls {
    /// Of all main nodes.
    pub(crate) fn of(map: &MapState) -> Self {
        let mut walls = Self::default();
        for node in map.main_nodes() {
            for point in ends(&node) {
                walls.squares.entry(square_of(point)).or_default().push(point);
            }
        }
        walls
    }

    /// Whether no point lies within `room_mm` (at most the side of a square) of the straight way between two places.
    pub(crate) fn is_clear(&self, ends: [Corner; 2], room_mm: f64) -> bool {
        let steps = (distance(ends[0], ends[1]) / SQUARE_MM).ceil().max(1.0);
        let is_near = |point: &Corner| {
            let foot = between(ends, foot_share(ends, *point).clamp(0.0, 1.0));
            distance(foot, *point) < room_mm
        };
        (0..=steps as usize).all(|step| {
            let (column, row) = square_of(between(ends, step as f64 / steps));
            let around = (row - 1..=row + 1).flat_map(|row| (column - 1..=column + 1).map(move |column| (column, row)));
            around.filter_map(|square| self.squares.get(&square)).flatten().all(|point| !is_near(point))
        })
    }
}

/// The ends of a node's beams.
fn ends(node: &NodeRef<'_>) -> impl Iterator<Item = Corner> {
    let (at, yaw) = (node.pose.position, node.pose.yaw());
    let scan = node.signature.map(|signature| &signature.scan);
    scan.into_iter().flat_map(move |scan| {
        let turned = |x: f64, y: f64, angle: f64| {
            let (sin, cos) = angle.sin_cos();
            [x * cos - y * sin, x * sin + y * cos]
        };
        let mount = scan.base_from_sensor;
        let sensor = turned(f64::from(mount.position.x_mm), f64::from(mount.position.y_mm), yaw);
        let ahead = yaw + mount.yaw() + f64::from(scan.angle_min);
        let returned = scan.ranges_mm.iter().enumerate().filter(|(_, range)| **range > 0);
        returned.map(move |(index, range)| {
            let end = turned(f64::from(*range), 0.0, ahead + index as f64 * f64::from(scan.angle_increment));
            [f64::from(at.x_mm) + sensor[0] + end[0], f64::from(at.y_mm) + sensor[1] + end[1]]
        })
    })
}
