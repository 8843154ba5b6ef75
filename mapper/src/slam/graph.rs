//! The back end: keyframes and submaps as a pose graph, loop closures, optimisation.
//!
//! Every keyframe is joined to the submaps that it was matched to when it was taken, and to the keyframe before it by
//! the wheels. When it lies near a finished submap of an earlier visit, it is matched to that one too: close at hand by
//! refinement alone, and after a long way by a correlative search as wide as the way was long. What is found after a
//! long way is believed only when several keyframes in a row say the same.

use super::submap::Submap;
use fht_robot::matching::{MatchConfig, ScanMatch, SearchWindow, alignments, refine};
use fht_robot::pose::{Point2, Pose2, wrap_angle};
use fht_robot::pose_graph::{Edge, GraphConfig, GraphError, optimise};
use nalgebra::{Matrix3, Vector3};
use std::collections::{BTreeMap, BinaryHeap};
use std::sync::Arc;

/// Parameters of loop closure.
#[derive(Clone, Debug)]
pub struct ClosureConfig {
    /// The optimisation.
    pub graph: GraphConfig,
    /// Scan matching.
    pub matching: MatchConfig,
    /// A submap is tried when one of its keyframes is nearer than this plus the uncertainty, metres. Default 4.
    pub reach_m: f64,
    /// Half width of the search after no way at all, metres. Default 0.15.
    pub window_m: f64,
    /// Growth of the half width with the length of the way since both places were joined, metres per metre. Default 0.03.
    pub window_per_m: f64,
    /// Greatest half width, metres. Default 10.
    pub max_window_m: f64,
    /// Half width of headings after no way at all, radians. Default 0.05.
    pub window_rad: f64,
    /// Growth of the half width of headings, radians per metre. Default 0.01.
    pub window_rad_per_m: f64,
    /// Up to this half width refinement needs no search, metres. Default 0.45.
    pub refine_m: f64,
    /// Submaps tried with each keyframe by refinement. Default 3.
    pub tries: usize,
    /// Keyframes between searches. Default 4.
    pub search_every: usize,
    /// Least explained share of the points that a submap can judge. Default 0.8.
    pub min_agreement: f64,
    /// Least explained share of all points. Default 0.4.
    pub min_overlap: f64,
    /// Closures after a long way that must agree. Default 3.
    pub agreeing: usize,
    /// They agree when the corrections that they imply differ by less than this, metres. Default 0.3.
    pub agreement_m: f64,
    /// And by less than this, radians. Default 0.05.
    pub agreement_rad: f64,
    /// Standard deviation of a match beyond what its geometry says, metres: neighbouring matches err alike. Default 0.01.
    pub floor_m: f64,
    /// The same for the heading, radians. Default 0.002.
    pub floor_rad: f64,
    /// Closures after which the graph is optimised. Default 10.
    pub optimise_every: usize,
}

impl Default for ClosureConfig {
    fn default() -> Self {
        Self {
            graph: GraphConfig::default(),
            matching: MatchConfig::default(),
            reach_m: 4.0,
            window_m: 0.15,
            window_per_m: 0.03,
            max_window_m: 10.0,
            window_rad: 0.05,
            window_rad_per_m: 0.01,
            refine_m: 0.45,
            tries: 3,
            search_every: 4,
            min_agreement: 0.8,
            min_overlap: 0.4,
            agreeing: 3,
            agreement_m: 0.3,
            agreement_rad: 0.05,
            floor_m: 0.01,
            floor_rad: 0.002,
            optimise_every: 10,
        }
    }
}

/// A keyframe as the front end hands it over.
#[derive(Clone, Debug)]
pub struct NewKeyframe {
    /// Wall points in the robot's frame.
    pub points: Arc<Vec<Point2>>,
    /// What joins it to earlier keyframes; `to` is this one.
    pub edges: Vec<Edge>,
    /// Submaps that were finished with it.
    pub finished: Vec<Arc<Submap>>,
}

/// A closure that waits for others that say the same.
#[derive(Clone, Debug)]
struct Pending {
    edge: Edge,
    /// The correction in the map frame that it implies.
    correction: Pose2,
}

/// What the back end has done, for reports.
#[derive(Clone, Copy, Debug, Default)]
pub struct ClosureCounts {
    /// Closures close at hand.
    pub near: usize,
    /// Closures found by searching.
    pub far: usize,
    /// Searches and refinements that found nothing that could be believed.
    pub refused: usize,
    /// Optimisations.
    pub optimised: usize,
}

/// The pose graph and its submaps.
#[derive(Debug)]
pub struct PoseGraph {
    config: ClosureConfig,
    points: Vec<Arc<Vec<Point2>>>,
    poses: Vec<Pose2>,
    edges: Vec<Edge>,
    /// Neighbours in the graph and how far apart they are, metres.
    ways: Vec<Vec<(usize, f64)>>,
    submaps: Vec<Arc<Submap>>,
    pending: Vec<Pending>,
    since_optimised: usize,
    counts: ClosureCounts,
}

/// A submap that a keyframe could be matched to.
struct Candidate {
    submap: usize,
    window_m: f64,
    window_rad: f64,
    distance_m: f64,
}

impl PoseGraph {
    /// An empty graph.
    #[must_use]
    pub fn new(config: ClosureConfig) -> Self {
        Self {
            config,
            points: Vec::new(),
            poses: Vec::new(),
            edges: Vec::new(),
            ways: Vec::new(),
            submaps: Vec::new(),
            pending: Vec::new(),
            since_optimised: 0,
            counts: ClosureCounts::default(),
        }
    }

    /// Poses of the keyframes in the map frame, as optimised last.
    #[must_use]
    pub fn poses(&self) -> &[Pose2] {
        &self.poses
    }

    /// The edges, oldest first.
    #[must_use]
    pub fn edges(&self) -> &[Edge] {
        &self.edges
    }

    /// What was done so far.
    #[must_use]
    pub fn counts(&self) -> ClosureCounts {
        self.counts
    }

    /// Takes a keyframe in; true when poses of earlier keyframes moved.
    pub fn add(&mut self, keyframe: NewKeyframe) -> bool {
        let index = self.poses.len();
        let pose = keyframe.edges.first().map_or_else(Pose2::identity, |edge| self.poses[edge.from] * edge.measured);
        self.poses.push(pose);
        self.points.push(keyframe.points);
        self.ways.push(Vec::new());
        for edge in keyframe.edges {
            self.join(edge);
        }
        self.close(index);
        self.submaps.extend(keyframe.finished);
        let is_due = self.since_optimised >= self.config.optimise_every;
        is_due && self.optimise().is_ok()
    }

    fn join(&mut self, edge: Edge) {
        let metres = edge.measured.translation.vector.norm();
        self.ways[edge.from].push((edge.to, metres));
        self.ways[edge.to].push((edge.from, metres));
        self.edges.push(edge);
    }

    /// Optimises all poses.
    ///
    /// # Errors
    /// [`GraphError`]; the poses are then unchanged.
    pub fn optimise(&mut self) -> Result<(), GraphError> {
        self.since_optimised = 0;
        self.counts.optimised += 1;
        let before = self.poses.clone();
        let done = optimise(&mut self.poses, &self.edges, &self.config.graph);
        if std::env::var("TRACEF").is_ok() {
            let sum = |p: &[Pose2], d: bool| self.edges.iter().filter(|e| e.is_doubtful == d).map(|e| fht_robot::pose_graph::chi2(e, p)).sum::<f64>();
            println!("optimise {} {:?} firm {:.0} -> {:.0} doubtful {:.0} -> {:.0} over 200: {} {}", self.poses.len(), done.is_ok(), sum(&before, false), sum(&self.poses, false), sum(&before, true), sum(&self.poses, true),
              self.edges.iter().filter(|e| e.is_doubtful && fht_robot::pose_graph::chi2(e, &before) > 200.0).count(), self.edges.iter().filter(|e| e.is_doubtful && fht_robot::pose_graph::chi2(e, &self.poses) > 200.0).count());
        }
        done
    }

    /// Shortest ways along the graph from a keyframe, metres: error grows with them, and a closure makes them short.
    fn ways_from(&self, index: usize) -> Vec<f64> {
        // Millimetres as integers: an order without NaN.
        let mut shortest = vec![u64::MAX; self.poses.len()];
        let mut queue = BinaryHeap::from([(std::cmp::Reverse(0_u64), index)]);
        shortest[index] = 0;
        while let Some((std::cmp::Reverse(way), here)) = queue.pop() {
            if way > shortest[here] {
                continue;
            }
            for &(next, metres) in &self.ways[here] {
                let longer = way + (metres * 1000.0) as u64;
                if longer < shortest[next] {
                    shortest[next] = longer;
                    queue.push((std::cmp::Reverse(longer), next));
                }
            }
        }
        shortest.into_iter().map(|way| way as f64 * 1e-3).collect()
    }

    fn candidates(&self, index: usize) -> Vec<Candidate> {
        let here = self.poses[index];
        let ways = self.ways_from(index);
        let config = &self.config;
        let mut found = Vec::new();
        for (number, submap) in self.submaps.iter().enumerate() {
            let members = submap.first()..submap.first() + submap.members().len();
            if members.end > index || self.edges.iter().rev().take(8).any(|e| e.to == index && e.from == submap.first()) {
                continue;
            }
            let way_m = members.clone().map(|member| ways[member]).fold(f64::INFINITY, f64::min);
            let nearest = |member: usize| (self.poses[member].translation.vector - here.translation.vector).norm();
            let distance_m = members.map(nearest).fold(f64::INFINITY, f64::min);
            let window_m = (config.window_m + config.window_per_m * way_m).min(config.max_window_m);
            let window_rad = config.window_rad + config.window_rad_per_m * way_m;
            if distance_m < config.reach_m + window_m {
                found.push(Candidate { submap: number, window_m, window_rad: window_rad.min(std::f64::consts::PI), distance_m });
            }
        }
        found.sort_by(|a, b| a.distance_m.total_cmp(&b.distance_m).then(a.submap.cmp(&b.submap)));
        found
    }

    fn close(&mut self, index: usize) {
        let candidates = self.candidates(index);
        let (near, far): (Vec<_>, Vec<_>) =
            candidates.into_iter().partition(|candidate| candidate.window_m <= self.config.refine_m);
        for candidate in near.iter().take(self.config.tries) {
            match self.match_to(index, candidate) {
                Some(edge) => {
                    self.counts.near += 1;
                    self.since_optimised += 1;
                    self.join(edge);
                }
                None => self.counts.refused += 1,
            }
        }
        if index.is_multiple_of(self.config.search_every) {
            for candidate in far.iter().take(1) {
                match self.match_to(index, candidate) {
                    Some(edge) => self.take_far(edge),
                    None => self.counts.refused += 1,
                }
            }
        }
    }

    /// A closure found by searching: held back until enough others agree.
    fn take_far(&mut self, edge: Edge) {
        let wanted = self.poses[edge.from] * edge.measured;
        let correction = wanted * self.poses[edge.to].inverse();
        self.pending.push(Pending { edge, correction });
        let newest = self.pending.len() - 1;
        let here = self.poses[self.pending[newest].edge.to];
        let agrees = |other: &Pending| {
            let moved = |correction: &Pose2| correction * here;
            let apart = moved(&other.correction).inverse() * moved(&correction);
            apart.translation.vector.norm() < self.config.agreement_m
                && wrap_angle(apart.rotation.angle()).abs() < self.config.agreement_rad
        };
        let agreeing: Vec<usize> = (0..=newest).filter(|&i| agrees(&self.pending[i])).collect();
        if agreeing.len() < self.config.agreeing {
            let excess = self.pending.len().saturating_sub(20);
            self.pending.drain(..excess);
            return;
        }
        let chosen: BTreeMap<usize, Edge> = agreeing.iter().map(|&i| (i, self.pending[i].edge.clone())).collect();
        self.counts.far += chosen.len();
        for edge in chosen.into_values() {
            self.join(edge);
        }
        self.pending.clear();
        // A long loop is closed: at once.
        self.since_optimised = self.config.optimise_every;
    }

    fn match_to(&self, index: usize, candidate: &Candidate) -> Option<Edge> {
        let config = &self.config;
        let submap = &self.submaps[candidate.submap];
        let points = self.points[index].as_slice();
        let guess = self.poses[submap.first()].inverse() * self.poses[index];
        let aligned = if candidate.window_m <= config.refine_m {
            refine(submap.cloud(), points, &guess, &config.matching).into_iter().collect()
        } else {
            let window = SearchWindow {
                centre: guess,
                half_x_m: candidate.window_m,
                half_y_m: candidate.window_m,
                half_yaw_rad: candidate.window_rad,
            };
            alignments(submap.cloud(), points, &window, &config.matching)
        };
        let is_inside = |found: &ScanMatch| {
            let off = guess.inverse() * found.reference_from_moving;
            off.translation.vector.norm() <= 1.5 * candidate.window_m + 0.1
                && off.rotation.angle().abs() <= 1.5 * candidate.window_rad
        };
        let judged = aligned.into_iter().filter(is_inside).map(|found| {
            let verdict = submap.judge(points, &found.reference_from_moving);
            (found, verdict)
        });
        let judged: Vec<_> = judged.collect();
        if candidate.window_m > config.refine_m && std::env::var("TRACEF").is_ok() {
            let best = judged.iter().max_by(|(_, a), (_, b)| a.balance().cmp(&b.balance()));
            println!("far {index} to {} window {:.2} {:.2} d {:.2}: {:?}", submap.first(), candidate.window_m, candidate.window_rad, candidate.distance_m, best.map(|b| (b.1, (guess.inverse() * b.0.reference_from_moving).translation.vector.norm())));
        }
        let (found, verdict) = judged.into_iter().max_by(|(_, a), (_, b)| a.balance().cmp(&b.balance()))?;
        if verdict.agreement() < config.min_agreement || verdict.overlap() < config.min_overlap {
            return None;
        }
        let information = with_floor(&found.covariance, config.floor_m, config.floor_rad)?;
        Some(Edge { from: submap.first(), to: index, measured: found.reference_from_moving, information, is_doubtful: true })
    }

    /// After the last keyframe: every keyframe is matched to all finished submaps near it, and all is optimised again.
    pub fn finish(&mut self) {
        if self.optimise().is_err() {
            return;
        }
        for _round in 0..2 {
            self.edges.retain(|edge| !edge.is_doubtful);
            for index in 0..self.poses.len() {
                let here = self.poses[index];
                let mut near: Vec<(f64, usize)> = Vec::new();
                for (number, submap) in self.submaps.iter().enumerate() {
                    let members = submap.first()..submap.first() + submap.members().len();
                    if members.contains(&index) {
                        continue;
                    }
                    let nearest = |member: usize| (self.poses[member].translation.vector - here.translation.vector).norm();
                    let distance_m = members.map(nearest).fold(f64::INFINITY, f64::min);
                    if distance_m < self.config.reach_m {
                        near.push((distance_m, number));
                    }
                }
                near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
                for &(distance_m, submap) in near.iter().take(self.config.tries) {
                    let candidate = Candidate { submap, window_m: 0.2, window_rad: 0.05, distance_m };
                    if let Some(edge) = self.match_to(index, &candidate) {
                        self.edges.push(edge);
                    }
                }
            }
            if self.optimise().is_err() {
                return;
            }
        }
    }
}

/// Information of a match whose covariance is at least the floor.
pub(super) fn with_floor(covariance: &Matrix3<f64>, floor_m: f64, floor_rad: f64) -> Option<Matrix3<f64>> {
    let floor = Vector3::new(floor_m * floor_m, floor_m * floor_m, floor_rad * floor_rad);
    (covariance + Matrix3::from_diagonal(&floor)).try_inverse()
}
