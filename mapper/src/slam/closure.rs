//! Loop closure: which earlier submaps a new keyframe is matched to, and which matches are
//! believed.
//!
//! * Close at hand, where little has been driven since both places were joined: refinement from
//!   where the graph says.
//! * After a long way: a correlative search, as wide as the way was long.
//! * After a very long way: a search in all submaps that may be near (`wide`).
//! * Where the panorama looks like an earlier one: a search at all headings, whatever the graph
//!   says.
//!
//! What the last three find is believed only when several keyframes say the same (`witnesses`).
//! What is believed may still be wrong: the optimisation gives it a robust weight.
//!
//! A run that has joined a map is also matched to what the map's nodes saw (`anchors`).

mod anchors;
mod config;
mod look_alike;
mod lost;
mod matching;
mod places;
mod wide;
mod witnesses;

pub use config::ClosureConfig;
pub(super) use matching::with_floor;

use super::graph::{KeyframeGraph, Link};
use super::submap::Submap;
use crate::haste::Haste;
use fht_perception::pose::{Point2, Pose2};
use fht_perception::pose_graph::{GraphConfig, PoseConstraint, chi2};
use fht_proto::NodeId;
use matching::{BestMatch, Candidate, best_within, match_within};
use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::sync::Arc;
use witnesses::Witnesses;

/// Half widths of the search after everything was optimised: metres, radians.
const SETTLED: (f64, f64) = (0.2, 0.05);

/// A keyframe as the front end hands it over.
#[derive(Clone, Debug)]
pub struct NewKeyframe {
    /// Wall points in the robot's frame.
    pub points: Arc<Vec<Point2>>,
    /// What joins it to earlier keyframes.
    pub links: Vec<Link>,
    /// Submaps that were finished with it.
    pub finished: Vec<Arc<Submap>>,
}

/// What a panorama taken at a keyframe looks like: a unit vector, and the cosine that means "near".
#[derive(Clone, Debug)]
pub struct SubmapSighting {
    /// The keyframe.
    pub keyframe: usize,
    /// The descriptor's components.
    pub components: Arc<Vec<f32>>,
    /// The model's own threshold.
    pub match_threshold: f32,
}

/// What loop closure has done, for reports.
#[derive(Clone, Copy, Debug, Default)]
pub struct ClosureCounts {
    /// Closures close at hand.
    pub near: usize,
    /// Closures found by searching.
    pub far: usize,
    /// Of these, tried because a panorama looked alike.
    pub look_alike: usize,
    /// Searches and refinements that found nothing that could be believed.
    pub refused: usize,
    /// Keyframes matched to nodes of a map that the run has joined, each time counted.
    pub anchored: usize,
    /// Optimisations.
    pub optimised: usize,
}

/// Where a lost robot was found: a submap, and the pose therein.
#[derive(Clone, Debug)]
pub struct Found {
    /// The submap.
    pub submap: Arc<Submap>,
    /// The robot's pose in its frame.
    pub submap_from_base: Pose2,
    /// What the wheels said there.
    pub odom_from_base: Pose2,
}

/// What became of the search for a lost robot.
#[derive(Clone, Debug)]
pub enum LostSearch {
    /// It is here, and nowhere else.
    Found(Found),
    /// There are places where it may be.
    Unclear,
    /// What it sees fits no place.
    Nowhere,
}

/// Finds closures. Owns what closures are found with; the poses are the graph's.
#[derive(Debug)]
pub struct LoopCloser {
    config: ClosureConfig,
    points: Vec<Arc<Vec<Point2>>>,
    submaps: Vec<Arc<Submap>>,
    /// What nodes of the map saw that other robots made, each in its node's frame.
    anchorages: BTreeMap<NodeId, Submap>,
    sightings: Vec<SubmapSighting>,
    /// The keyframe of the newest sighting for which a look-alike was tried.
    tried_alike: Option<usize>,
    witnesses: Witnesses,
    /// The newest keyframe that stood out in a search of all submaps that may be near.
    stood_out: Option<usize>,
    tension: f64,
    /// How far the anchors pulled at the graph after it was last optimised.
    relaxed: f64,
    /// Whether closures after long ways were joined since the last optimisation.
    is_graduated: bool,
    counts: ClosureCounts,
}

impl LoopCloser {
    /// Before the first keyframe.
    #[must_use]
    pub fn new(config: ClosureConfig) -> Self {
        Self {
            config,
            points: Vec::new(),
            submaps: Vec::new(),
            anchorages: BTreeMap::new(),
            sightings: Vec::new(),
            tried_alike: None,
            witnesses: Witnesses::default(),
            stood_out: None,
            tension: 0.0,
            relaxed: 0.0,
            is_graduated: false,
            counts: ClosureCounts::default(),
        }
    }

    /// What was done so far.
    #[must_use]
    pub fn counts(&self) -> ClosureCounts {
        self.counts
    }

    /// Takes a keyframe in, and joins it to what it closes a loop with.
    pub fn add(&mut self, keyframe: NewKeyframe, graph: &mut KeyframeGraph) {
        let index = graph.add(keyframe.links);
        self.points.push(keyframe.points);
        self.close(index, graph);
        self.close_wide(index, graph);
        self.anchor(index, graph);
        self.submaps.extend(keyframe.finished);
    }

    /// Half width of the uncertainty after a way, metres: without a bound.
    fn window_m(&self, way_m: f64) -> f64 {
        self.config.window_m + self.config.window_per_m * way_m
    }

    /// Half widths of the uncertainty after a way, no wider than is searched: metres and radians.
    fn uncertainty(&self, way_m: f64) -> (f64, f64) {
        let config = &self.config;
        let window_rad = (config.window_rad + config.window_rad_per_m * way_m).min(PI);
        (self.window_m(way_m).min(config.max_window_m), window_rad)
    }

    fn is_plausible(&self, edge: &PoseConstraint, way_m: f64, graph: &KeyframeGraph) -> bool {
        let poses = graph.poses();
        let off = poses[edge.to].inverse() * (poses[edge.from] * edge.measured);
        let (window_m, window_rad) = self.uncertainty(way_m);
        off.translation.vector.norm() <= 1.5 * window_m && off.rotation.angle().abs() <= 1.5 * window_rad
    }

    /// Optimises if closures pull at the graph; true when poses have moved.
    pub fn settle(&mut self, graph: &mut KeyframeGraph) -> bool {
        if self.tension < self.config.optimise_tension {
            return false;
        }
        self.tension = 0.0;
        self.counts.optimised += 1;
        let config = GraphConfig { is_graduated: self.is_graduated, ..self.config.graph.clone() };
        self.is_graduated = false;
        match graph.optimise(&config) {
            Ok(()) => {
                self.relaxed = graph.anchor_tension(self.config.most_tension);
                true
            }
            Err(error) => {
                tracing::warn!("the pose graph was not optimised: {error}");
                false
            }
        }
    }

    fn join(&mut self, edge: PoseConstraint, graph: &mut KeyframeGraph) {
        self.tension += chi2(&edge, graph.poses()).min(self.config.most_tension);
        graph.join(Link::ordinary(edge));
    }

    fn candidates(&self, index: usize, graph: &KeyframeGraph) -> Vec<Candidate> {
        let here = graph.poses()[index];
        let config = &self.config;
        // What the front end has joined it to needs no closure.
        let recent: Vec<usize> =
            graph.edges().iter().rev().take(8).filter(|edge| edge.to == index).map(|edge| edge.from).collect();
        let near: Vec<(usize, f64)> = (0..self.submaps.len())
            .filter(|&number| !recent.contains(&self.submaps[number].first()) && !self.submaps[number].has(index))
            .map(|number| (number, distance_m(&self.submaps[number], index, graph)))
            .filter(|&(_, distance_m)| distance_m < config.reach_m + config.max_window_m)
            .collect();
        if near.is_empty() {
            return Vec::new();
        }
        let ways = graph.ways_from(index);
        let mut found: Vec<Candidate> = near
            .into_iter()
            .map(|(submap, distance_m)| {
                let way_m = self.submaps[submap].keyframes().map(|member| ways[member]).fold(f64::INFINITY, f64::min);
                let guess = graph.poses()[self.submaps[submap].first()].inverse() * here;
                let (window_m, window_rad) = self.uncertainty(way_m);
                Candidate { submap, guess, window_m, window_rad, distance_m }
            })
            .filter(|candidate| candidate.distance_m < config.reach_m + candidate.window_m)
            .collect();
        found.sort_by(|a, b| a.distance_m.total_cmp(&b.distance_m).then(a.submap.cmp(&b.submap)));
        found
    }

    fn close(&mut self, index: usize, graph: &mut KeyframeGraph) {
        let candidates = self.candidates(index, graph);
        let (near, far): (Vec<_>, Vec<_>) =
            candidates.into_iter().partition(|candidate| candidate.window_m <= self.config.refine_m);
        for candidate in near.iter().take(self.config.tries) {
            match self.match_to(index, candidate) {
                Some(edge) => {
                    self.counts.near += 1;
                    self.join(edge, graph);
                }
                None => self.counts.refused += 1,
            }
        }
        if index.is_multiple_of(self.config.search_every)
            && let Some(candidate) = self.most_seen(index, &far)
        {
            let submap = &self.submaps[candidate.submap];
            match best_within(submap, (index, &self.points[index]), candidate, &self.config) {
                Some(best) => self.take_far(best, graph),
                None => self.counts.refused += 1,
            }
        }
    }

    /// Of candidates the one that has looked at most of what a keyframe sees: a scanner of half a
    /// turn that comes back along its way faces what the nearest one had in its back.
    fn most_seen<'a>(&self, index: usize, candidates: &'a [Candidate]) -> Option<&'a Candidate> {
        candidates
            .iter()
            .min_by_key(|candidate| self.submaps[candidate.submap].judge(&self.points[index], &candidate.guess).unseen)
    }

    /// A closure found by searching: held back until enough others agree.
    fn take_far(&mut self, BestMatch { edge, is_sure }: BestMatch, graph: &mut KeyframeGraph) {
        let Some(believed) = self.witnesses.hear(edge, is_sure, graph.poses(), &self.config) else { return };
        self.counts.far += believed.len();
        for edge in believed {
            self.join(edge, graph);
        }
        // A long loop is closed: at once.
        self.tension = self.tension.max(self.config.optimise_tension);
        self.is_graduated = true;
    }

    fn match_to(&self, index: usize, candidate: &Candidate) -> Option<PoseConstraint> {
        self.match_within(&self.submaps[candidate.submap], index, candidate)
    }

    /// Matches a keyframe to a submap within a candidate's window.
    fn match_within(&self, submap: &Submap, index: usize, candidate: &Candidate) -> Option<PoseConstraint> {
        match_within(submap, (index, &self.points[index]), candidate, &self.config)
    }

    /// After the last keyframe: every keyframe is matched to all finished submaps near it, and all
    /// is optimised again. Without time for all of that nothing of it is done.
    pub fn finish(&mut self, graph: &mut KeyframeGraph, haste: &Haste) {
        let config = GraphConfig { is_graduated: false, ..self.config.graph.clone() };
        let optimise = |graph: &mut KeyframeGraph| {
            graph.optimise(&config).inspect_err(|error| tracing::warn!("the pose graph was not optimised: {error}"))
        };
        if !haste.has_time() || optimise(graph).is_err() {
            return;
        }
        graph.drop_doubtful();
        let edges = self.settled_edges(graph, haste);
        if !haste.has_time() {
            return;
        }
        edges.into_iter().for_each(|edge| graph.join(Link::ordinary(edge)));
        for index in 0..graph.poses().len() {
            self.anchor_within(index, SETTLED, graph);
        }
        let _ = optimise(graph);
    }

    /// Every keyframe matched to the finished submaps near it, in the order of the keyframes: each
    /// match for itself, so that all cores work on them.
    fn settled_edges(&self, graph: &KeyframeGraph, haste: &Haste) -> Vec<PoseConstraint> {
        let count = graph.poses().len();
        let threads = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
        let share = count.div_ceil(threads).max(1);
        std::thread::scope(|scope| {
            let parts = (0..count).step_by(share).map(|first| {
                let indices = first..(first + share).min(count);
                let edges = move || {
                    let in_time = indices.take_while(|_| haste.has_time());
                    in_time.flat_map(|index| self.settled_edges_of(index, graph)).collect::<Vec<_>>()
                };
                scope.spawn(edges)
            });
            let parts: Vec<_> = parts.collect();
            let join = |part: std::thread::ScopedJoinHandle<'_, _>| match part.join() {
                Ok(edges) => edges,
                Err(panic) => std::panic::resume_unwind(panic),
            };
            parts.into_iter().flat_map(join).collect()
        })
    }

    fn settled_edges_of(&self, index: usize, graph: &KeyframeGraph) -> Vec<PoseConstraint> {
        let (window_m, window_rad) = SETTLED;
        let here = graph.poses()[index];
        let mut near: Vec<(f64, usize)> = (0..self.submaps.len())
            .filter(|&number| !self.submaps[number].has(index))
            .map(|number| (distance_m(&self.submaps[number], index, graph), number))
            .filter(|&(distance_m, _)| distance_m < self.config.reach_m)
            .collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let candidates = near.into_iter().take(self.config.tries).map(|(distance_m, submap)| {
            let guess = graph.poses()[self.submaps[submap].first()].inverse() * here;
            Candidate { submap, guess, window_m, window_rad, distance_m }
        });
        candidates.filter_map(|candidate| self.match_to(index, &candidate)).collect()
    }
}

/// From a keyframe to the nearest keyframe of a submap, metres.
fn distance_m(submap: &Submap, index: usize, graph: &KeyframeGraph) -> f64 {
    let here = graph.poses()[index].translation.vector;
    let apart = |member: usize| (graph.poses()[member].translation.vector - here).norm();
    submap.keyframes().map(apart).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::slam::submap::SubmapConfig;
    use fht_perception::frame::LaserScan;
    use fht_perception::pose::pose;

    /// What a scanner of half a turn sees at `x` in a hall of 40 by 5 metres, facing along it or
    /// back.
    fn scan(x: f64, faces_back: bool) -> LaserScan {
        let (turn, angle_increment) = (if faces_back { PI } else { 0.0 }, PI / 180.0);
        let range = |index: usize| {
            let (sin, cos) = (turn - PI / 2.0 + index as f64 * angle_increment).sin_cos();
            let along_m = if cos > 0.0 { (20.0 - x) / cos } else { (-20.0 - x) / cos };
            along_m.min(2.5 / sin.abs()) as f32
        };
        LaserScan {
            base_from_sensor: Pose2::identity(),
            angle_min: turn - PI / 2.0,
            angle_increment,
            range_min_m: 0.1,
            range_max_m: 80.0,
            ranges_m: (0..180).map(range).collect(),
        }
    }

    #[test]
    fn who_comes_back_is_matched_to_what_was_seen_and_not_to_where_the_robot_was() {
        let mut closer = LoopCloser::new(ClosureConfig::default());
        // On the way out: here, and 8 m before.
        for (first, x) in [(0, 0.0), (1, -8.0)] {
            let out = scan(x, false);
            closer.submaps.push(Arc::new(Submap::begin(first, &SubmapConfig::default(), &out, &out.points_in_base())));
        }
        closer.points.push(Arc::new(scan(0.0, true).points_in_base()));
        let candidate = |submap: usize, x: f64| {
            // The graph is off by half a metre.
            let guess = pose(0.5 - x, 0.2, 0.0);
            Candidate { submap, guess, window_m: 2.0, window_rad: 0.3, distance_m: x.abs() }
        };
        let chosen = closer.most_seen(0, &[candidate(0, 0.0), candidate(1, -8.0)]).map(|chosen| chosen.submap);
        assert_eq!(chosen, Some(1));
        assert!(closer.most_seen(0, &[]).is_none());
    }
}
