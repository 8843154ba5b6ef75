//! What nodes saw, as points of walls: bounded in number, whatever the map.

use fht_map::MapState;
use fht_proto::{FixedPoint, FixedPose, MapName, ScanRecord};
use serde::Serialize;
use std::collections::BTreeSet;

/// Points are so far apart, centimetres.
const STEP_CM: i32 = 5;
/// So many points at most.
const MAX_POINTS: usize = 20_000;
/// Of so many nodes at most, the nearest ones.
const MAX_NODES: usize = 400;

/// Walls near a place.
#[derive(Debug, PartialEq, Serialize)]
pub(super) struct WallsReply {
    pub(super) map: MapName,
    pub(super) version: u64,
    #[serde(flatten)]
    pub(super) walls: Walls,
}

/// Points of walls.
#[derive(Debug, PartialEq, Serialize)]
pub(super) struct Walls {
    /// x and y by turns, whole centimetres in the map frame.
    points: Vec<i32>,
    /// Whether there is more.
    pub(super) truncated: bool,
}

/// What the main nodes within `radius_m` of `near` saw.
pub(super) fn walls(state: &MapState, near: FixedPoint, radius_m: f64) -> Walls {
    let nodes = state.main_nodes().filter_map(|node| {
        let distance_m = node.pose.position.distance(near);
        node.signature.filter(|_| distance_m <= radius_m).map(|signature| (distance_m, node.pose, &signature.scan))
    });
    let mut nodes: Vec<(f64, FixedPose, &ScanRecord)> = nodes.collect();
    nodes.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut truncated = nodes.len() > MAX_NODES;
    let mut cells = BTreeSet::new();
    for (_, pose, scan) in nodes.into_iter().take(MAX_NODES) {
        cells.extend(ends(pose, scan));
        if cells.len() > MAX_POINTS {
            truncated = true;
            break;
        }
    }
    let points = cells.into_iter().take(MAX_POINTS).flat_map(|(x, y)| [x * STEP_CM, y * STEP_CM]);
    Walls { points: points.collect(), truncated }
}

/// The cells in which a scan's beams have ended.
fn ends(map_from_base: FixedPose, scan: &ScanRecord) -> impl Iterator<Item = (i32, i32)> + '_ {
    let (base, sensor) = (map_from_base, scan.base_from_sensor);
    let (sin, cos) = base.yaw().sin_cos();
    let x = base.position.x() + cos * sensor.position.x() - sin * sensor.position.y();
    let y = base.position.y() + sin * sensor.position.x() + cos * sensor.position.y();
    let yaw = base.yaw() + sensor.yaw();
    let returns = scan.ranges_mm.iter().enumerate().filter(|(_, range_mm)| **range_mm > 0);
    returns.map(move |(beam, range_mm)| {
        let angle = yaw + f64::from(scan.angle_min) + beam as f64 * f64::from(scan.angle_increment);
        let range_m = f64::from(*range_mm) / 1000.0;
        // `as` saturates.
        let cell = |metres: f64| (metres * 100.0 / f64::from(STEP_CM)).round() as i32;
        (cell(x + range_m * angle.cos()), cell(y + range_m * angle.sin()))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn beams_end_where_the_sensor_looked() {
        let scan = ScanRecord {
            base_from_sensor: FixedPose::from_metres(0.2, 0.0, 0.0),
            angle_min: 0.0,
            angle_increment: std::f32::consts::FRAC_PI_2,
            ranges_mm: vec![1000, 0, 500],
        };
        let pose = FixedPose::from_metres(1.0, 2.0, std::f64::consts::FRAC_PI_2);
        // Ahead, y of the map, and behind; nothing to the left.
        let ends: Vec<_> = ends(pose, &scan).collect();
        assert_eq!(ends, [(20, 64), (20, 34)]);
    }
}
