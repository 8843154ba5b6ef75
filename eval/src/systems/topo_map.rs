//! MR-TopoMap (Dong et al.). Nodes are places that look different, and edges follow the trajectory.
//! A robot is at the node that its picture looks like. Paths lead from the nearest node over nodes
//! to the nearest node.
//!
//! Its authors' thresholds, 0.97 for a new node and 0.98 for a match, are cosines of another
//! network. Ours has a cosine of 0.90 within 0.5 m on average, 0.68 at 2.5 m and 0.55 at 5 m (the
//! paper's museum, other light). So the thresholds were swept (16 drives there, 25 pairs of
//! thresholds, 14 rules of when to declare), and those were taken with which it is right most
//! often: 16 of 16 after 25 m. In 9 of these it declares a wrong place first. The strictest rules
//! that still find 13 (0.8 for a match; 5 nodes, 0.6 m, 5°) are wrong in 3.

use super::Localizing;
use fht_navigation::planning::path_length_m;
use fht_perception::frame::SensorFrame;
use fht_perception::pose::{Point2, Pose2, pose};
use fht_perception::scan_odometry::{ScanOdometry, ScanOdometryConfig};
use fht_proto::Descriptor;
use nalgebra::Vector2;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// Parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct TopoMapConfig {
    /// Cosine above which a picture shows a place that already is a node. Default 0.85.
    pub known_similarity: f32,
    /// Least distance between nodes, metres. Default 2.5 (the paper's).
    pub spacing_m: f64,
    /// Cosine above which a robot is at a node. Default 0.75.
    pub match_similarity: f32,
    /// Distance between a robot's looks, metres. Default 0.4.
    pub look_every_m: f64,
    /// Nodes that must have been recognised before the place counts as known. Default 5; a pose
    /// exists from 2 on.
    pub declare_nodes: usize,
    /// The standard error of the position must be below this, metres. Default 1.
    pub declare_sigma_m: f64,
    /// The standard error of the heading must be below this, radians. Default 10°.
    pub declare_sigma_rad: f64,
}

impl Default for TopoMapConfig {
    fn default() -> Self {
        Self {
            known_similarity: 0.85,
            spacing_m: 2.5,
            match_similarity: 0.75,
            look_every_m: 0.4,
            declare_nodes: 5,
            declare_sigma_m: 1.0,
            declare_sigma_rad: 10.0_f64.to_radians(),
        }
    }
}

/// A place along the explorer's way, and what it looked like.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Pass {
    /// x and y in the map frame, metres, as SLAM knew it in the end.
    pub place: [f64; 2],
    /// The panorama's descriptor.
    pub descriptor: Descriptor,
}

/// A node.
#[derive(Clone, Debug, Serialize)]
pub struct TopoNode {
    place: [f64; 2],
    descriptor: Descriptor,
}

impl TopoNode {
    /// Where it is, map frame.
    #[must_use]
    pub fn point(&self) -> Point2 {
        Point2::from(Vector2::from(self.place))
    }
}

/// The map.
#[derive(Clone, Debug, Default, Serialize)]
pub struct TopoMap {
    nodes: Vec<TopoNode>,
    edges: BTreeSet<(usize, usize)>,
}

impl TopoMap {
    /// From what an explorer saw on its way.
    #[must_use]
    pub fn build(passes: &[Pass], config: &TopoMapConfig) -> Self {
        let mut map = Self::default();
        let mut current: Option<usize> = None;
        for pass in passes {
            let here = Point2::from(Vector2::from(pass.place));
            let similar = |node: &TopoNode| node.descriptor.similarity(&pass.descriptor).unwrap_or(-1.0);
            let is_near = |node: &TopoNode| (node.point() - here).norm() < config.spacing_m;
            let is_known = map.nodes.iter().any(|node| is_near(node) || similar(node) > config.known_similarity);
            let next = if is_known {
                let near = map.nodes.iter().enumerate().filter(|(_, node)| is_near(node));
                near.max_by(|a, b| similar(a.1).total_cmp(&similar(b.1))).map(|(index, _)| index)
            } else {
                map.nodes.push(TopoNode { place: pass.place, descriptor: pass.descriptor.clone() });
                Some(map.nodes.len() - 1)
            };
            if let (Some(before), Some(next)) = (current, next)
                && before != next
            {
                map.edges.insert((before.min(next), before.max(next)));
            }
            current = next.or(current);
        }
        map
    }

    /// The nodes.
    #[must_use]
    pub fn nodes(&self) -> &[TopoNode] {
        &self.nodes
    }

    /// Edges.
    #[must_use]
    pub fn edges(&self) -> usize {
        self.edges.len()
    }

    /// Bytes of the map in our own coding: positions and quantised descriptors.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn bytes(&self) -> Result<usize, postcard::Error> {
        postcard::to_stdvec(self).map(|bytes| bytes.len())
    }

    /// The path from the node nearest to one place to the node nearest to the other, with both
    /// places. `None` if the nodes are not connected.
    #[must_use]
    pub fn path(&self, from: Point2, to: Point2) -> Option<Vec<Point2>> {
        let nearest = |point: Point2| {
            let distance = |index: &usize| (self.nodes[*index].point() - point).norm();
            (0..self.nodes.len()).min_by(|a, b| distance(a).total_cmp(&distance(b)))
        };
        let (first, last) = (nearest(from)?, nearest(to)?);
        // Bellman-Ford suffices for some dozens of nodes.
        let mut best: BTreeMap<usize, (f64, usize)> = BTreeMap::from([(first, (0.0, first))]);
        let mut changed = true;
        while changed {
            changed = false;
            for &(a, b) in &self.edges {
                let length = (self.nodes[a].point() - self.nodes[b].point()).norm();
                for (from, to) in [(a, b), (b, a)] {
                    let Some(&(so_far, _)) = best.get(&from) else { continue };
                    if best.get(&to).is_none_or(|&(known, _)| so_far + length < known - 1e-9) {
                        best.insert(to, (so_far + length, from));
                        changed = true;
                    }
                }
            }
        }
        let mut points = vec![to];
        let mut at = last;
        loop {
            points.push(self.nodes[at].point());
            if at == first {
                break;
            }
            at = best.get(&at)?.1;
        }
        points.push(from);
        points.reverse();
        (path_length_m(&points) > 0.0).then_some(points)
    }
}

/// A node at which the robot believed itself to be.
#[derive(Clone, Copy, Debug)]
struct Sighting {
    similarity: f32,
    in_map: Point2,
    in_odom: Point2,
}

/// A robot that relocalizes on an MR-TopoMap.
pub struct TopoRobot<'a> {
    config: TopoMapConfig,
    map: &'a TopoMap,
    odometry: ScanOdometry,
    looked_at_m: Option<f64>,
    sightings: BTreeMap<usize, Sighting>,
    fit: Option<Fit>,
    map_from_base: Option<Pose2>,
}

impl<'a> TopoRobot<'a> {
    /// Before the first frame.
    #[must_use]
    pub fn new(config: TopoMapConfig, map: &'a TopoMap) -> Self {
        Self {
            config,
            map,
            odometry: ScanOdometry::new(ScanOdometryConfig::default()),
            looked_at_m: None,
            sightings: BTreeMap::new(),
            fit: None,
            map_from_base: None,
        }
    }

    /// Keeps the most similar picture of each node: it was taken nearest to it.
    pub fn look(&mut self, descriptor: &Descriptor, in_odom: Point2) {
        let similar = |node: &TopoNode| node.descriptor.similarity(descriptor).unwrap_or(-1.0);
        let nodes = self.map.nodes.iter().enumerate();
        let Some((index, node)) = nodes.max_by(|a, b| similar(a.1).total_cmp(&similar(b.1))) else { return };
        let similarity = similar(node);
        let is_better = self.sightings.get(&index).is_none_or(|known| similarity > known.similarity);
        if similarity > self.config.match_similarity && is_better {
            self.sightings.insert(index, Sighting { similarity, in_map: node.point(), in_odom });
            self.fit = fit(&self.sightings.values().copied().collect::<Vec<_>>());
        }
    }

    /// `map_from_odom`, once two nodes were recognised.
    #[must_use]
    pub fn fit(&self) -> Option<&Fit> {
        self.fit.as_ref()
    }

    /// Whether the estimate is certain enough to declare it.
    #[must_use]
    pub fn is_known(&self) -> bool {
        let config = &self.config;
        self.fit.is_some_and(|fit| {
            self.sightings.len() >= config.declare_nodes
                && fit.sigma_m <= config.declare_sigma_m
                && fit.sigma_rad <= config.declare_sigma_rad
        })
    }
}

/// A transform, and how sure it is.
#[derive(Clone, Copy, Debug)]
pub struct Fit {
    /// `map_from_odom`.
    pub map_from_odom: Pose2,
    /// Standard error of the position, metres.
    pub sigma_m: f64,
    /// Standard error of the heading, radians.
    pub sigma_rad: f64,
}

/// Rounds of reweighting.
const ROUNDS: usize = 10;

/// The rigid motion with the least sum of distances (not squared, as in the paper's code), by
/// reweighted least squares.
fn fit(sightings: &[Sighting]) -> Option<Fit> {
    if sightings.len() < 2 {
        return None;
    }
    let mut weights = vec![1.0; sightings.len()];
    let mut map_from_odom = Pose2::identity();
    let mut spread = 0.0;
    for _ in 0..ROUNDS {
        let total: f64 = weights.iter().sum();
        let weighted = || sightings.iter().zip(&weights);
        let mean = |point: &dyn Fn(&Sighting) -> Vector2<f64>| {
            weighted().map(|(sighting, weight)| point(sighting) * *weight).sum::<Vector2<f64>>() / total
        };
        let (in_map, in_odom) = (mean(&|sighting| sighting.in_map.coords), mean(&|sighting| sighting.in_odom.coords));
        let (mut dot, mut cross) = (0.0, 0.0);
        spread = 0.0;
        for (sighting, weight) in weighted() {
            let (to, from) = (sighting.in_map.coords - in_map, sighting.in_odom.coords - in_odom);
            dot += weight * from.dot(&to);
            cross += weight * from.perp(&to);
            spread += from.norm_squared();
        }
        let turn = pose(0.0, 0.0, cross.atan2(dot));
        let shift = in_map - (turn * Point2::from(in_odom)).coords;
        map_from_odom = pose(shift.x, shift.y, cross.atan2(dot));
        let off = |sighting: &Sighting| (map_from_odom * sighting.in_odom - sighting.in_map).norm();
        weights = sightings.iter().map(|sighting| 1.0 / off(sighting).max(0.05)).collect();
    }
    let squares: f64 =
        sightings.iter().map(|sighting| (map_from_odom * sighting.in_odom - sighting.in_map).norm_squared()).sum();
    // Two equations each, less three unknowns.
    let variance = squares / (2.0 * sightings.len() as f64 - 3.0);
    let (sigma_m, sigma_rad) = ((variance / sightings.len() as f64).sqrt(), (variance / spread.max(1e-9)).sqrt());
    Some(Fit { map_from_odom, sigma_m, sigma_rad })
}

impl Localizing for TopoRobot<'_> {
    fn update(&mut self, frame: &SensorFrame, describe: &mut dyn FnMut() -> Option<Descriptor>) -> Option<Pose2> {
        let odometry = self.odometry.update(frame, &frame.scan.points_in_base());
        let is_due = self.looked_at_m.is_none_or(|at| odometry.odometer_m - at >= self.config.look_every_m);
        if frame.panorama.is_some() && is_due {
            self.looked_at_m = Some(odometry.odometer_m);
            if let Some(descriptor) = describe() {
                self.look(&descriptor, Point2::from(odometry.odom_from_base.translation.vector));
            }
        }
        self.map_from_base = Some(self.fit?.map_from_odom * odometry.odom_from_base);
        self.map_from_base.filter(|_| self.is_known())
    }

    fn guess(&self) -> Option<Pose2> {
        self.map_from_base
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_proto::ModelId;

    /// A corridor of 30 m, there and back, where each place looks a little different from its
    /// neighbours.
    fn corridor() -> Vec<Pass> {
        let pass = |x: f64| {
            let components: Vec<f32> =
                (0..64).map(|index| (-((f64::from(index) * 0.5 - x) / 1.2).powi(2)).exp() as f32).collect();
            Pass { place: [x, 0.0], descriptor: Descriptor::quantise(ModelId(1), &components) }
        };
        (0..=60)
            .map(|step| f64::from(step) * 0.5)
            .chain((0..60).rev().map(|step| f64::from(step) * 0.5))
            .map(pass)
            .collect()
    }

    #[test]
    fn nodes_keep_their_distance_and_edges_follow_the_way() {
        let config = TopoMapConfig::default();
        let map = TopoMap::build(&corridor(), &config);
        assert!((8..=13).contains(&map.nodes().len()), "{}", map.nodes().len());
        for (index, node) in map.nodes().iter().enumerate() {
            let others = &map.nodes()[index + 1..];
            assert!(others.iter().all(|other| (other.point() - node.point()).norm() >= config.spacing_m));
        }
        assert!(map.edges() >= map.nodes().len() - 1);
        let path = map.path(Point2::new(1.0, 1.0), Point2::new(28.0, 1.0)).expect("the corridor is joined");
        assert!((27.0..32.0).contains(&path_length_m(&path)), "{path:?}");
    }

    #[test]
    fn two_nodes_give_a_heading_and_more_a_certain_one() {
        let truth = pose(3.0, -2.0, 0.7);
        let sighting = |x: f64, y: f64, off: f64| {
            let in_odom = Point2::new(x, y);
            Sighting { similarity: 0.9, in_map: truth * in_odom + Vector2::new(off, -off), in_odom }
        };
        assert!(fit(&[sighting(0.0, 0.0, 0.1)]).is_none());
        let two = fit(&[sighting(0.0, 0.0, 0.1), sighting(4.0, 0.0, -0.1)]).expect("a pose");
        assert!((two.map_from_odom.rotation.angle() - 0.7).abs() < 0.1);
        let many = [(0.0, 0.0, 0.1), (4.0, 0.0, -0.1), (4.0, 4.0, 0.1), (0.0, 4.0, -0.1), (-4.0, 2.0, 0.0)];
        let many: Vec<Sighting> = many.into_iter().map(|(x, y, off)| sighting(x, y, off)).collect();
        let sure = fit(&many).expect("a pose");
        assert!(sure.sigma_rad < 5.0_f64.to_radians() && (sure.map_from_odom.rotation.angle() - 0.7).abs() < 0.05);
    }
}
