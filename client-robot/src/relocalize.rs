//! Finding out where the robot is without a guess (paper, section III-C-1).
//!
//! The main nodes that look most alike are matched by scan; every match is one estimation. Estimations that agree with
//! each other and with the odometry between them form hypotheses. The heaviest hypothesis is optimised as a pose graph,
//! checked against everything that robot and map saw as free, and declared only when enough evidence from different
//! places carries it and no rival comes near. Otherwise the robot says that it does not know.

use crate::consensus::{ConsensusConfig, MAX_ESTIMATES, agreement_graph, heaviest_clique, members, weight_of};
use crate::estimate::{Estimate, OdometryNoise, difference, rotate_covariance};
use crate::landmarks::{Landmark, Landmarks};
use crate::odometry::Odometry;
use crate::pose_graph::{PoseGraphConfig, Prior, Step, optimise};
use crate::visibility::{PolarScan, Tally, VisibilityConfig, mutual_tally};
use fht_proto::{Descriptor, NodeId};
use fht_robot::matching::{MatchConfig, SearchWindow, search};
use fht_robot::pose::{Point2, Pose2, pose};
use nalgebra::{Matrix3, Vector3};
use std::collections::{BTreeSet, VecDeque};
use std::f64::consts::PI;

/// How the robot finds out where it is.
#[derive(Clone, Debug)]
pub struct RelocalizeConfig {
    /// Main nodes tried per panorama, best first. The paper tries one; several cost little and keep a lookalike from
    /// hiding the truth. Default 4.
    pub candidates: usize,
    /// Least cosine between descriptors (the paper's th_match); `None`: what the map says of its model. Default `None`.
    pub min_similarity: Option<f32>,
    /// How far from a node the robot may be for its scan to be tried, metres each way. Default 4.
    pub window_m: f64,
    /// Greatest share of contradictions between two scans that match. Default 0.12.
    pub max_contradiction: f64,
    /// Two estimations of one node count as one until the robot has moved this far, metres. Default 0.7.
    pub min_baseline_m: f64,
    /// A hypothesis must rest on places at least this far apart, metres. Default 1.0.
    pub min_spread_m: f64,
    /// Estimations that a hypothesis must rest on if they are of two nodes or more. Default 2.
    pub min_estimates: usize,
    /// Estimations that it must rest on if they are all of one node. Default 3.
    pub min_estimates_one_node: usize,
    /// A hypothesis must weigh this many times its strongest rival. Default 1.6.
    pub dominance: f64,
    /// A rival is at least this far away, metres. Default 1.
    pub rival_m: f64,
    /// Greatest share of contradictions of a hypothesis, over all recent scans and all nodes near. Default 0.08.
    pub max_hypothesis_contradiction: f64,
    /// Greatest standard deviation of the declared position along any direction, metres. Default 0.15.
    pub max_sigma_m: f64,
    /// Estimations are forgotten after this distance, since odometry drifts, metres. Default 40.
    pub memory_m: f64,
    /// Nodes are compared with scans taken within this distance of them, metres. Default 5.
    pub verify_radius_m: f64,
    /// Added to the covariance of every match: the map is not exact, metres. Default 0.03.
    pub map_sigma_m: f64,
    /// The same for headings, radians. Default 0.3°.
    pub map_sigma_rad: f64,
    /// Drift of the odometry.
    pub noise: OdometryNoise,
    /// When estimations agree.
    pub consensus: ConsensusConfig,
    /// The optimisation.
    pub pose_graph: PoseGraphConfig,
    /// The free-space test.
    pub visibility: VisibilityConfig,
    /// The scan matching; its least score is that of an estimation.
    pub matching: MatchConfig,
}

impl Default for RelocalizeConfig {
    fn default() -> Self {
        Self {
            candidates: 4,
            min_similarity: None,
            window_m: 4.0,
            max_contradiction: 0.12,
            min_baseline_m: 0.7,
            min_spread_m: 1.0,
            min_estimates: 2,
            min_estimates_one_node: 3,
            dominance: 1.6,
            rival_m: 1.0,
            max_hypothesis_contradiction: 0.08,
            max_sigma_m: 0.15,
            memory_m: 40.0,
            verify_radius_m: 5.0,
            map_sigma_m: 0.03,
            map_sigma_rad: 0.3_f64.to_radians(),
            noise: OdometryNoise::default(),
            consensus: ConsensusConfig::default(),
            pose_graph: PoseGraphConfig::default(),
            visibility: VisibilityConfig::default(),
            matching: MatchConfig::default(),
        }
    }
}

/// What the robot senses at one place.
#[derive(Clone, Copy, Debug)]
pub struct Observation<'a> {
    /// Where odometry says it is.
    pub odometry: Odometry,
    /// End points of its scan, base frame.
    pub points: &'a [Point2],
    /// The same scan by direction.
    pub polar: &'a PolarScan,
    /// The descriptor of what it sees; without one only the free-space memory grows.
    pub descriptor: Option<&'a Descriptor>,
}

/// A pose that the robot stands by.
#[derive(Clone, Debug)]
pub struct Fix {
    /// Map frame from odometry frame (REP-105's map → odom).
    pub map_from_odom: Pose2,
    /// The robot in the map frame when the fix was made.
    pub map_from_base: Pose2,
    /// Covariance of `map_from_base`: x and y (m) in the map frame, yaw (rad).
    pub covariance: Matrix3<f64>,
    /// Estimations that it rests on.
    pub estimates: usize,
    /// Different nodes among them.
    pub nodes: usize,
    /// Their weight.
    pub weight: f64,
}

/// What the robot knows of where it is.
#[derive(Clone, Debug)]
pub enum Belief {
    /// Nothing fits yet.
    NotLocalized,
    /// Something fits, but too little or too ambiguously: the estimations and the number of the heaviest that agree.
    Candidates {
        /// Estimations kept.
        estimates: usize,
        /// Most of them that agree.
        agreeing: usize,
    },
    /// It knows.
    Localized(Fix),
}

struct View {
    odom_from_base: Pose2,
    odometer_m: f64,
    points: Vec<Point2>,
    polar: PolarScan,
}

/// Distance between the scans kept for the free-space test, metres.
const VIEW_SPACING_M: f64 = 0.8;
/// Scans kept for the free-space test.
const VIEWS: usize = 12;
/// Hypotheses that are looked at before giving up for this observation.
const HYPOTHESES: usize = 4;

/// Accumulates estimations and weighs hypotheses.
pub struct Relocalizer {
    config: RelocalizeConfig,
    estimates: Vec<Estimate>,
    views: VecDeque<View>,
}

impl Relocalizer {
    /// Knows nothing.
    #[must_use]
    pub fn new(config: RelocalizeConfig) -> Self {
        Self { config, estimates: Vec::new(), views: VecDeque::new() }
    }

    /// The configuration.
    #[must_use]
    pub fn config(&self) -> &RelocalizeConfig {
        &self.config
    }

    /// The estimations kept, oldest first.
    #[must_use]
    pub fn estimates(&self) -> &[Estimate] {
        &self.estimates
    }

    /// Forgets everything, as after being carried off.
    pub fn clear(&mut self) {
        self.estimates.clear();
        self.views.clear();
    }

    /// Takes in what the robot senses now and says what it knows then. `candidates` bounds the nodes tried.
    pub fn observe(&mut self, landmarks: &Landmarks, observation: &Observation<'_>, candidates: usize) -> Belief {
        self.remember_view(observation);
        let oldest = observation.odometry.odometer_m - self.config.memory_m;
        self.estimates.retain(|estimate| estimate.odometer_m >= oldest);
        for estimate in self.single_estimations(landmarks, observation, candidates) {
            self.add(estimate);
        }
        self.judge(landmarks, &observation.odometry)
    }

    fn remember_view(&mut self, observation: &Observation<'_>) {
        let here = observation.odometry.odom_from_base;
        let moved = |view: &View| (view.odom_from_base.translation.vector - here.translation.vector).norm();
        if self.views.back().is_none_or(|last| moved(last) >= VIEW_SPACING_M) {
            self.views.push_back(View {
                odom_from_base: here,
                odometer_m: observation.odometry.odometer_m,
                points: observation.points.to_vec(),
                polar: observation.polar.clone(),
            });
        }
        while self.views.len() > VIEWS {
            self.views.pop_front();
        }
    }

    /// The paper's single estimation, for the best few nodes.
    fn single_estimations(
        &self,
        landmarks: &Landmarks,
        observation: &Observation<'_>,
        candidates: usize,
    ) -> Vec<Estimate> {
        let Some(descriptor) = observation.descriptor else { return Vec::new() };
        let threshold = self.config.min_similarity.or_else(|| landmarks.match_threshold(descriptor.model));
        let mut alike = landmarks.most_similar(descriptor, candidates);
        alike.retain(|&(_, similarity)| threshold.is_none_or(|least| similarity >= least));
        let estimates = alike
            .into_iter()
            .filter_map(|(landmark, similarity)| self.single_estimation(landmark, similarity, observation));
        estimates.collect()
    }

    fn single_estimation(
        &self,
        landmark: &Landmark,
        similarity: f32,
        observation: &Observation<'_>,
    ) -> Option<Estimate> {
        let config = &self.config;
        let window = SearchWindow {
            centre: pose(0.0, 0.0, 0.0),
            half_x_m: config.window_m,
            half_y_m: config.window_m,
            half_yaw_rad: PI,
        };
        let found = search(&landmark.cloud, observation.points, &window, &config.matching).ok()?;
        let tally = mutual_tally(
            (&landmark.polar, &landmark.points),
            (observation.polar, observation.points),
            &found.reference_from_moving,
            &config.visibility,
        );
        if tally.contradiction() > config.max_contradiction {
            return None;
        }
        let map_yaw = landmark.map_from_node.rotation.angle();
        Some(Estimate {
            node: landmark.id,
            map_from_base: landmark.map_from_node * found.reference_from_moving,
            covariance: rotate_covariance(&found.covariance, map_yaw) + self.map_covariance(),
            odom_from_base: observation.odometry.odom_from_base,
            odometer_m: observation.odometry.odometer_m,
            turned_rad: observation.odometry.turned_rad,
            similarity,
            score: found.score,
        })
    }

    fn map_covariance(&self) -> Matrix3<f64> {
        let (m, rad) = (self.config.map_sigma_m.powi(2), self.config.map_sigma_rad.powi(2));
        Matrix3::from_diagonal(&Vector3::new(m, m, rad))
    }

    /// Keeps an estimation, unless it only repeats one: the same node from the same place with the same answer is no new
    /// evidence. The better of the two stays.
    fn add(&mut self, estimate: Estimate) {
        let config = &self.config;
        let repeats = self.estimates.iter().position(|kept| {
            let gap = difference(&kept.map_from_odom(), &estimate.map_from_odom());
            kept.node == estimate.node
                && kept.baseline_m(&estimate) < config.min_baseline_m
                && (kept.odometer_m - estimate.odometer_m).abs() < 4.0 * config.min_baseline_m
                && (kept.map_from_base * (kept.odom_from_base.inverse() * estimate.odom_from_base))
                    .translation
                    .vector
                    .metric_distance(&estimate.map_from_base.translation.vector)
                    < 0.5
                && gap.z.abs() < 0.2
        });
        match repeats {
            Some(index) if self.estimates[index].score >= estimate.score => {}
            Some(index) => {
                self.estimates.remove(index);
                self.estimates.push(estimate);
            }
            None => self.estimates.push(estimate),
        }
        if self.estimates.len() > MAX_ESTIMATES {
            self.estimates.remove(0);
        }
    }

    /// Weighs the hypotheses against each other and against free space.
    fn judge(&mut self, landmarks: &Landmarks, now: &Odometry) -> Belief {
        if self.estimates.is_empty() {
            return Belief::NotLocalized;
        }
        let graph = agreement_graph(&self.estimates, &self.config.noise, &self.config.consensus);
        let weights: Vec<f64> = self.estimates.iter().map(|estimate| estimate.score).collect();
        let mut allowed = u64::MAX;
        let mut agreeing = 0;
        let mut refuted = 0_u64;
        let mut fix = None;
        for _ in 0..HYPOTHESES {
            let set = heaviest_clique(&graph, &weights, allowed);
            if set == 0 {
                break;
            }
            let Some(mut hypothesis) = self.optimise(set, now) else { break };
            hypothesis.weight = weight_of(set, &weights);
            if self.tally(landmarks, &hypothesis.map_from_odom).contradiction()
                > self.config.max_hypothesis_contradiction
            {
                // What robot and map saw forbids it: its estimations are worth nothing, and the next set is looked at.
                refuted |= set;
                allowed &= !set;
                continue;
            }
            agreeing = set.count_ones() as usize;
            let rivals = allowed & self.far_from(&hypothesis, now);
            let rival = weight_of(heaviest_clique(&graph, &weights, rivals), &weights);
            tracing::debug!(agreeing, weight = hypothesis.weight, rival, "heaviest hypothesis");
            if self.is_enough(set, &hypothesis) && hypothesis.weight >= self.config.dominance * rival {
                fix = Some(hypothesis);
            }
            break;
        }
        let mut index = 0;
        self.estimates.retain(|_| {
            index += 1;
            refuted >> (index - 1) & 1 == 0
        });
        match fix {
            Some(fix) => Belief::Localized(fix),
            None if self.estimates.is_empty() => Belief::NotLocalized,
            None => Belief::Candidates { estimates: self.estimates.len(), agreeing },
        }
    }

    /// Estimations that speak for another place than the hypothesis.
    fn far_from(&self, hypothesis: &Fix, now: &Odometry) -> u64 {
        let far = |estimate: &Estimate| {
            let here = estimate.map_from_base * (estimate.odom_from_base.inverse() * now.odom_from_base);
            let gap = difference(&here, &hypothesis.map_from_base);
            gap.xy().norm() > self.config.rival_m || gap.z.abs() > 0.35
        };
        self.estimates.iter().enumerate().filter(|(_, e)| far(e)).fold(0, |set, (index, _)| set | 1 << index)
    }

    fn is_enough(&self, set: u64, hypothesis: &Fix) -> bool {
        let config = &self.config;
        let chosen: Vec<&Estimate> = members(set).filter_map(|index| self.estimates.get(index)).collect();
        let spread = chosen
            .iter()
            .enumerate()
            .flat_map(|(i, a)| chosen[..i].iter().map(move |b| a.baseline_m(b)))
            .fold(0.0, f64::max);
        let least = if hypothesis.nodes >= 2 { config.min_estimates } else { config.min_estimates_one_node };
        let sigma = hypothesis.covariance.fixed_view::<2, 2>(0, 0).symmetric_eigenvalues().max().max(0.0).sqrt();
        chosen.len() >= least && spread >= config.min_spread_m && sigma <= config.max_sigma_m
    }

    /// Pose graph over the estimations of a set and the robot's pose now.
    fn optimise(&self, set: u64, now: &Odometry) -> Option<Fix> {
        let mut chosen: Vec<&Estimate> = members(set).filter_map(|index| self.estimates.get(index)).collect();
        chosen.sort_by(|a, b| a.odometer_m.total_cmp(&b.odometer_m));
        let noise = &self.config.noise;
        let mut steps = Vec::with_capacity(chosen.len());
        for (index, from) in chosen.iter().enumerate() {
            let (to, driven, turned) = match chosen.get(index + 1) {
                Some(next) => (next.odom_from_base, next.odometer_m, next.turned_rad),
                None => (now.odom_from_base, now.odometer_m, now.turned_rad),
            };
            let (sigma_m, sigma_rad) = noise.sigmas((driven - from.odometer_m).abs(), (turned - from.turned_rad).abs());
            steps.push(Step { relative: from.odom_from_base.inverse() * to, sigma_m, sigma_rad });
        }
        let priors: Vec<Prior> = chosen
            .iter()
            .enumerate()
            .map(|(index, e)| Prior { index, map_from_base: e.map_from_base, covariance: e.covariance })
            .collect();
        let solution = optimise(&priors, &steps, &self.config.pose_graph)?;
        let map_from_base = *solution.poses.last()?;
        let nodes: BTreeSet<NodeId> = chosen.iter().map(|estimate| estimate.node).collect();
        Some(Fix {
            map_from_odom: map_from_base * now.odom_from_base.inverse(),
            map_from_base,
            covariance: solution.last_covariance * solution.mean_squared_error.max(1.0),
            estimates: chosen.len(),
            nodes: nodes.len(),
            weight: 0.0,
        })
    }

    /// Everything that recent scans and the nodes near them say about a hypothesis.
    fn tally(&self, landmarks: &Landmarks, map_from_odom: &Pose2) -> Tally {
        let config = &self.config;
        let newest = self.views.back().map_or(0.0, |view| view.odometer_m);
        let mut tally = Tally::default();
        for view in self.views.iter().filter(|view| newest - view.odometer_m <= config.memory_m / 2.0) {
            let map_from_view = map_from_odom * view.odom_from_base;
            for landmark in landmarks.within(&map_from_view, config.verify_radius_m) {
                let node_from_view = landmark.map_from_node.inverse() * map_from_view;
                let node = (&landmark.polar, landmark.points.as_slice());
                let robot = (&view.polar, view.points.as_slice());
                tally.add(mutual_tally(node, robot, &node_from_view, &config.visibility));
            }
            let inside = |point: &&Point2| landmarks.is_free(&(map_from_view * **point), config.visibility.margin_m);
            tally.contradicting += view.points.iter().filter(inside).count();
        }
        tally
    }
}
