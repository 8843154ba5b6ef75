//! Where main nodes saw walls: what a straight way into the mesh must not lead through, and what stands in free space after all.

use crate::free_space::{Corner, between, distance, foot_share};
use crate::state::{MapState, NodeRef};
use std::collections::HashMap;

/// Side of a square in which points are gathered, millimetres.
const SQUARE_MM: f64 = 250.0;

/// End points of all main nodes' scans, millimetres in the map frame.
#[derive(Clone, Debug, Default)]
pub(crate) struct SeenWalls {
    squares: HashMap<(i32, i32), Vec<Sighting>>,
}

/// A beam's end.
#[derive(Clone, Copy, Debug)]
struct Sighting {
    at: Corner,
    /// Which node's, in the order of their ids.
    node: u32,
}

fn square_of(point: Corner) -> (i32, i32) {
    ((point[0] / SQUARE_MM).floor() as i32, (point[1] / SQUARE_MM).floor() as i32)
}

impl SeenWalls {
    /// Of all main nodes.
    pub(crate) fn of(map: &MapState) -> Self {
        let mut walls = Self::default();
        for (number, node) in map.main_nodes().enumerate() {
            for at in ends(&node) {
                walls.squares.entry(square_of(at)).or_default().push(Sighting { at, node: number as u32 });
            }
        }
        walls
    }

    /// The places for which `is_inside` holds, or within `room_mm` of a line, where two nodes saw something within `apart_mm` (all
    /// of these at most the side of a square): a thin pole, say. What only one saw may have been somebody who passed. In a
    /// fixed order.
    pub(crate) fn seen_twice(
        &self,
        apart_mm: f64,
        is_inside: impl Fn(Corner) -> bool,
        lines: impl Iterator<Item = [Corner; 2]>,
        room_mm: f64,
    ) -> Vec<Corner> {
        let inside = self.squares.values().flatten().filter(|sighting| is_inside(sighting.at));
        let beside = lines.flat_map(|line| self.near(line, room_mm));
        let is_twice = |sighting: &&Sighting| {
            let mut around = self.around(sighting.at);
            around.any(|other| other.node != sighting.node && distance(other.at, sighting.at) < apart_mm)
        };
        let mut places: Vec<Corner> = inside.chain(beside).filter(is_twice).map(|sighting| sighting.at).collect();
        places.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
        places.dedup();
        places
    }

    /// What was seen within `room_mm` (at most the side of a square) of the straight way between two places; the same may come
    /// several times.
    fn near(&self, ends: [Corner; 2], room_mm: f64) -> impl Iterator<Item = &Sighting> {
        let steps = (distance(ends[0], ends[1]) / SQUARE_MM).ceil().max(1.0);
        let along = (0..=steps as usize).map(move |step| between(ends, step as f64 / steps));
        along.flat_map(|place| self.around(place)).filter(move |sighting| {
            let foot = between(ends, foot_share(ends, sighting.at).clamp(0.0, 1.0));
            distance(foot, sighting.at) < room_mm
        })
    }

    /// What was seen in the squares at and around a place.
    fn around(&self, place: Corner) -> impl Iterator<Item = &Sighting> {
        let (column, row) = square_of(place);
        let squares =
            (row - 1..=row + 1).flat_map(move |row| (column - 1..=column + 1).map(move |column| (column, row)));
        squares.filter_map(|square| self.squares.get(&square)).flatten()
    }

    /// Whether no point lies within `room_mm` (at most the side of a square) of the straight way between two places.
    pub(crate) fn is_clear(&self, ends: [Corner; 2], room_mm: f64) -> bool {
        self.near(ends, room_mm).next().is_none()
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
