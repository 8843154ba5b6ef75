//! How much of what a robot sees the main nodes' scans know. Where they know little, no robot can
//! relocalize.

use crate::survey::Survey;
use fht_perception::frame::LaserScan;
use fht_perception::pose::{Point2, Pose2, from_fixed};
use fht_perception::square::{SquareIndex, square_of};
use fht_proto::NodeKind;
use fht_sim::{SimConfig, Simulator};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;

/// A return is known when the end of a node's beam lies this near, metres.
const NEAR_M: f64 = 0.1;
/// Shares of known returns that count as enough.
const ENOUGH: f64 = 0.8;
/// Room around a place, metres.
const CLEARANCE_M: f64 = 0.2;

/// Figures over places drawn uniformly from where the robot has room.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct KnownShare {
    /// Places.
    pub places: usize,
    /// Share of the places from which at least 80 % of a scan's returns lie within 0.1 m of the
    /// main nodes' scans.
    pub explained: f64,
    /// Mean share of known returns.
    pub returns_mean: f64,
    /// The share of known returns that all but 1 % of the places exceed.
    pub returns_p01: f64,
    /// Share of the places from which some main node is in sight, within the scanner's range.
    pub in_sight: f64,
    /// Mean distance to the nearest main node in sight, metres.
    pub nearest_mean_m: f64,
    /// The distance that 5 % of the places exceed, metres.
    pub nearest_p95_m: f64,
}

/// Points by squares of side [`NEAR_M`].
#[derive(Default)]
struct Points(BTreeMap<SquareIndex, Vec<Point2>>);

impl Points {
    fn add(&mut self, point: Point2) {
        self.0.entry(square_of(point, NEAR_M)).or_default().push(point);
    }

    fn has_near(&self, point: Point2) -> bool {
        let (i, j) = square_of(point, NEAR_M);
        let mut squares = (i - 1..=i + 1).flat_map(|i| (j - 1..=j + 1).map(move |j| (i, j)));
        squares.any(|square| {
            self.0.get(&square).is_some_and(|points| points.iter().any(|other| (other - point).norm() <= NEAR_M))
        })
    }
}

impl KnownShare {
    /// Looks around at `places` places of a surveyed world.
    #[must_use]
    pub fn of(survey: &Survey, places: u64) -> Self {
        let mut ends = Points::default();
        let mut nodes: Vec<Point2> = Vec::new();
        for node in survey.map.nodes().filter(|node| node.kind == NodeKind::Main) {
            let world_from_base = survey.world_from_map * from_fixed(node.pose);
            nodes.push(Point2::from(world_from_base.translation.vector));
            let points = node.signature.map(|signature| LaserScan::record_points_in_base(&signature.scan));
            points.into_iter().flatten().for_each(|point| ends.add(world_from_base * point));
        }
        let (mut shares, mut distances) = (Vec::new(), Vec::new());
        for seed in 1..=places {
            let place = survey.world.random_free_pose(seed, CLEARANCE_M);
            shares.push(known_share(survey, &place, &ends));
            distances.extend(nearest_in_sight_m(survey, &place, &nodes));
        }
        shares.sort_by(f64::total_cmp);
        distances.sort_by(f64::total_cmp);
        let quantile = |values: &[f64], share: f64| {
            values.get((values.len() as f64 * share) as usize).copied().unwrap_or(f64::NAN)
        };
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
        let count = places.max(1) as f64;
        Self {
            places: shares.len(),
            explained: shares.iter().filter(|share| **share >= ENOUGH).count() as f64 / count,
            returns_mean: mean(&shares),
            returns_p01: quantile(&shares, 0.01),
            in_sight: distances.len() as f64 / count,
            nearest_mean_m: mean(&distances),
            nearest_p95_m: quantile(&distances, 0.95),
        }
    }
}

/// The share of a scan's returns, without noise, that lie near `ends` (world frame).
fn known_share(survey: &Survey, world_from_base: &Pose2, ends: &Points) -> f64 {
    // No picture is used, so the smallest will do.
    let sim = SimConfig { lidar_noise_m: 0.0, view_pixels: 1, ..SimConfig::default() };
    let frame = Simulator::new(Arc::clone(&survey.world), sim, *world_from_base, 1).sense_first();
    let returns = frame.scan.points_in_base();
    let known = returns.iter().filter(|point| ends.has_near(world_from_base * **point)).count();
    known as f64 / returns.len().max(1) as f64
}

fn nearest_in_sight_m(survey: &Survey, place: &Pose2, nodes: &[Point2]) -> Option<f64> {
    let here = Point2::from(place.translation.vector);
    let range_m = SimConfig::default().lidar_range_max_m;
    let plan = survey.world.plan();
    let near = nodes.iter().map(|node| ((node - here).norm(), node)).filter(|(distance, _)| *distance <= range_m);
    near.filter(|(_, node)| plan.is_clear(here, **node, 0.0)).map(|(distance, _)| distance).min_by(f64::total_cmp)
}
