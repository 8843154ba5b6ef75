//! 2D LiDAR SLAM: scans matched to submaps, submaps and keyframes held together by a pose graph.
//!
//! * The front end, here: each scan is matched to a submap of the last few metres, starting from what the wheels say.
//!   Drift inside it is millimetres, and nothing that the back end does disturbs it.
//! * The back end, [`graph`]: loop closures and optimisation. It moves submaps; the robot's pose in the map is the pose of
//!   its submap times its pose therein.
//!
//! After Hess et al., "Real-time loop closure in 2D LIDAR SLAM" (ICRA 2016), with point-to-line matching in the place of
//! their probability grids.

pub mod graph;
pub mod submap;

use crate::calibration::{OdometryCalibration, OdometryNoise};
use fht_robot::frame::{LaserScan, SensorFrame};
use fht_robot::grid::{GridConfig, OccupancyGrid};
use fht_robot::matching::{MatchConfig, Prior, ScanMatch, SearchWindow, alignments, refine_with_prior};
use fht_robot::pose::{Point2, Pose2};
use fht_robot::pose_graph::Edge;
use graph::{ClosureConfig, NewKeyframe, PoseGraph, with_floor};
use nalgebra::{Matrix3, Vector2};
use std::sync::Arc;
use submap::{Submap, SubmapConfig};

/// Parameters of the SLAM.
#[derive(Clone, Debug)]
pub struct SlamConfig {
    /// The occupancy grid.
    pub grid: GridConfig,
    /// Scan matching of the front end.
    pub matching: MatchConfig,
    /// Submaps.
    pub submap: SubmapConfig,
    /// Loop closure.
    pub closure: ClosureConfig,
    /// What the wheels are believed to be.
    pub odometry: OdometryNoise,
    /// A keyframe is taken after this much driving, metres. Default 0.3.
    pub keyframe_distance_m: f64,
    /// A keyframe is taken after this much turning, radians. Default 0.5.
    pub keyframe_turn_rad: f64,
    /// A scan that explains less than this share of its points does not move the estimate: the wheels do. Default 0.3.
    pub min_score: f64,
    /// Share of the information of a wheels' edge that counts beside an edge of the scan: wheels err alike from one
    /// keyframe to the next. Default 0.01.
    pub odometry_trust: f64,
    /// A scan that explains less than this share is also searched for elsewhere: the wheels slipped. Default 0.6.
    pub good_score: f64,
    /// Half width of that search, metres. Default 0.5.
    pub rescue_m: f64,
    /// Half width of its headings, radians. Default 0.8.
    pub rescue_rad: f64,
}

impl Default for SlamConfig {
    fn default() -> Self {
        Self {
            grid: GridConfig::default(),
            matching: MatchConfig { first_reach_m: 0.3, ..MatchConfig::default() },
            submap: SubmapConfig::default(),
            closure: ClosureConfig::default(),
            odometry: OdometryNoise::default(),
            keyframe_distance_m: 0.3,
            keyframe_turn_rad: 0.5,
            min_score: 0.3,
            odometry_trust: 0.01,
            good_score: 0.6,
            rescue_m: 0.5,
            rescue_rad: 0.8,
        }
    }
}

/// A scan and what the wheels said when it was taken.
#[derive(Clone, Debug)]
pub struct Keyframe {
    /// Time of the frame, microseconds.
    pub time_us: u64,
    /// What the wheels said.
    pub odom_from_base: Pose2,
    /// The scan.
    pub scan: LaserScan,
}

/// A pose that follows a keyframe when that is moved.
#[derive(Clone, Copy, Debug)]
pub struct Anchored {
    /// Index of the keyframe.
    pub keyframe: usize,
    /// Pose in its frame.
    pub keyframe_from_base: Pose2,
}

/// The estimate after one frame.
#[derive(Clone, Debug)]
pub struct SlamUpdate {
    /// Where the robot is.
    pub map_from_base: Pose2,
    /// The same, relative to a keyframe.
    pub anchored: Anchored,
    /// Covariance of x, y (metres, map frame) and yaw (radians), relative to the submap.
    pub covariance: Matrix3<f64>,
    /// Share of the scan that the submap explains; 0 when the wheels alone were used.
    pub score: f64,
    /// Whether earlier keyframes were moved.
    pub is_corrected: bool,
}

/// The submaps that grow: the robot is matched to the first; the second takes its place when that is full.
#[derive(Debug)]
struct Active {
    older: Submap,
    /// The next submap and the pose of its frame in that of the older one.
    newer: Option<(Submap, Pose2)>,
}

/// The newest estimate.
#[derive(Clone, Debug)]
struct Latest {
    /// Pose in the older submap.
    submap_from_base: Pose2,
    odom_from_base: Pose2,
    /// Pose of the newest keyframe in the older submap.
    submap_from_keyframe: Pose2,
}

/// SLAM in progress. The map frame is where the robot was at the first frame.
#[derive(Debug)]
pub struct Slam {
    config: SlamConfig,
    grid: OccupancyGrid,
    calibration: OdometryCalibration,
    keyframes: Vec<Keyframe>,
    active: Option<(Active, Latest)>,
    graph: PoseGraph,
}

impl Slam {
    /// Before the first frame.
    #[must_use]
    pub fn new(config: SlamConfig) -> Self {
        Self {
            grid: OccupancyGrid::new(config.grid.clone()),
            calibration: OdometryCalibration::new(config.odometry.clone()),
            keyframes: Vec::new(),
            active: None,
            graph: PoseGraph::new(config.closure.clone()),
            config,
        }
    }

    /// The occupancy grid, in the map frame.
    #[must_use]
    pub fn grid(&self) -> &OccupancyGrid {
        &self.grid
    }

    /// The keyframes, oldest first.
    #[must_use]
    pub fn keyframes(&self) -> &[Keyframe] {
        &self.keyframes
    }

    /// The back end.
    #[must_use]
    pub fn graph(&self) -> &PoseGraph {
        &self.graph
    }

    /// Where something is in the map, as known by now.
    #[must_use]
    pub fn locate(&self, anchored: &Anchored) -> Pose2 {
        self.graph.poses().get(anchored.keyframe).copied().unwrap_or_else(Pose2::identity) * anchored.keyframe_from_base
    }

    /// Takes in one frame.
    pub fn update(&mut self, frame: &SensorFrame) -> SlamUpdate {
        let points = self.usable_points(&frame.scan);
        let Some((active, latest)) = self.active.take() else {
            return self.begin(frame, points);
        };
        let raw_motion = latest.odom_from_base.inverse() * frame.odom_from_base;
        let motion = self.calibration.correct(&raw_motion);
        let predicted = latest.submap_from_base * motion;
        let prior_information = self.calibration.information(&motion, predicted.rotation.angle());
        let prior = Prior { reference_from_moving: predicted, information: prior_information };
        let matched = self.match_to(&active.older, &points, &prior);
        let submap_from_base = matched.as_ref().map_or(predicted, |found| found.reference_from_moving);
        let latest = Latest { submap_from_base, odom_from_base: frame.odom_from_base, ..latest };

        let motion_since = latest.submap_from_keyframe.inverse() * submap_from_base;
        let mut anchored = Anchored { keyframe: self.keyframes.len() - 1, keyframe_from_base: motion_since };
        let mut is_corrected = false;
        if motion_since.translation.vector.norm() >= self.config.keyframe_distance_m
            || motion_since.rotation.angle().abs() >= self.config.keyframe_turn_rad
        {
            anchored = Anchored { keyframe: self.keyframes.len(), keyframe_from_base: Pose2::identity() };
            is_corrected = self.add_keyframe(frame, points, active, latest, matched.as_ref(), &prior_information);
        } else {
            self.active = Some((active, latest));
        }
        SlamUpdate {
            map_from_base: self.locate(&anchored),
            anchored,
            covariance: matched.as_ref().map_or_else(
                || prior_information.try_inverse().unwrap_or_else(Matrix3::identity),
                |found| found.covariance,
            ),
            score: matched.map_or(0.0, |found| found.score),
            is_corrected,
        }
    }

    /// After the last frame: the graph is closed and optimised as well as it can be.
    pub fn finish(&mut self) {
        self.graph.finish();
        self.redraw();
    }

    fn usable_points(&self, scan: &LaserScan) -> Vec<Point2> {
        let reach = self.config.grid.max_range_m;
        let sensor = Point2::from(scan.base_from_sensor.translation.vector);
        scan.points_in_base().into_iter().filter(|point| (point - sensor).norm() <= reach).collect()
    }

    /// Matches a scan to the active submap: from where the wheels say, and if that fits badly, anywhere near.
    fn match_to(&self, submap: &Submap, points: &[Point2], prior: &Prior) -> Option<ScanMatch> {
        let config = &self.config;
        let near = refine_with_prior(submap.cloud(), points, prior, &config.matching);
        let score = near.as_ref().map_or(0.0, |found| found.score);
        let best = if score < config.good_score {
            let window = SearchWindow {
                centre: prior.reference_from_moving,
                half_x_m: config.rescue_m,
                half_y_m: config.rescue_m,
                half_yaw_rad: config.rescue_rad,
            };
            let elsewhere = alignments(submap.cloud(), points, &window, &config.matching);
            let better = elsewhere.into_iter().filter(|found| found.score > score + 0.1);
            better.max_by(|a, b| a.score.total_cmp(&b.score)).or(near)
        } else {
            near
        };
        best.filter(|found| found.score >= config.min_score)
    }

    fn begin(&mut self, frame: &SensorFrame, points: Vec<Point2>) -> SlamUpdate {
        let origin = Pose2::identity();
        let mut older = Submap::new(0, &self.config.submap);
        older.insert(&origin, &frame.scan, &points);
        self.graph.add(NewKeyframe { points: Arc::new(points), edges: Vec::new(), finished: Vec::new() });
        self.grid.integrate(&origin, &frame.scan);
        self.keyframes.push(Keyframe {
            time_us: frame.time_us,
            odom_from_base: frame.odom_from_base,
            scan: frame.scan.clone(),
        });
        let latest = Latest {
            submap_from_base: origin,
            odom_from_base: frame.odom_from_base,
            submap_from_keyframe: origin,
        };
        self.active = Some((Active { older, newer: None }, latest));
        SlamUpdate {
            map_from_base: origin,
            anchored: Anchored { keyframe: 0, keyframe_from_base: origin },
            covariance: Matrix3::zeros(),
            score: 1.0,
            is_corrected: false,
        }
    }

    fn add_keyframe(
        &mut self,
        frame: &SensorFrame,
        points: Vec<Point2>,
        mut active: Active,
        mut latest: Latest,
        matched: Option<&ScanMatch>,
        prior_information: &Matrix3<f64>,
    ) -> bool {
        let index = self.keyframes.len();
        let here = latest.submap_from_base;
        let mut edges = Vec::new();
        if let Some(found) = matched {
            // What the scan alone knows: the wheels have an edge of their own.
            let information = found.covariance.try_inverse().unwrap_or_else(Matrix3::zeros) - prior_information;
            let covariance = (information + Matrix3::from_diagonal_element(1e-4)).try_inverse();
            let closure = &self.config.closure;
            if let Some(information) = covariance.and_then(|c| with_floor(&c, closure.floor_m, closure.floor_rad)) {
                let from = active.older.first();
                edges.push(Edge { from, to: index, measured: here, information, is_doubtful: false });
            }
        }
        let before = &self.keyframes[index - 1];
        let raw = before.odom_from_base.inverse() * frame.odom_from_base;
        let between = latest.submap_from_keyframe.inverse() * here;
        if let Some(found) = matched {
            let scan_information = found.covariance.try_inverse().unwrap_or_else(Matrix3::zeros) - prior_information;
            self.calibration.learn(&raw, &between, &scan_information, here.rotation.angle());
        }
        let driven = self.calibration.correct(&raw);
        let trust = if matched.is_some() { self.config.odometry_trust } else { 1.0 };
        let information = self.calibration.information(&driven, driven.rotation.angle()) * trust;
        edges.push(Edge { from: index - 1, to: index, measured: driven, information, is_doubtful: false });

        active.older.insert(&here, &frame.scan, &points);
        if let Some((newer, older_from_newer)) = &mut active.newer {
            newer.insert(&(older_from_newer.inverse() * here), &frame.scan, &points);
        } else if active.older.members().len() >= self.config.submap.keyframes {
            active.newer = Some((Submap::begin(index, &self.config.submap, &frame.scan, &points), here));
        }
        let mut finished = Vec::new();
        latest.submap_from_keyframe = here;
        if active.older.is_full()
            && let Some((newer, older_from_newer)) = active.newer.take()
        {
            latest.submap_from_base = older_from_newer.inverse() * here;
            latest.submap_from_keyframe = latest.submap_from_base;
            let next = Submap::begin(index, &self.config.submap, &frame.scan, &points);
            let newer_from_next = latest.submap_from_base;
            finished.push(Arc::new(std::mem::replace(&mut active.older, newer)));
            active.newer = Some((next, newer_from_next));
        }
        self.keyframes.push(Keyframe {
            time_us: frame.time_us,
            odom_from_base: frame.odom_from_base,
            scan: frame.scan.clone(),
        });
        self.active = Some((active, latest));
        let is_corrected = self.graph.add(NewKeyframe { points: Arc::new(points), edges, finished });
        if is_corrected {
            self.redraw();
        } else if let Some(pose) = self.graph.poses().last() {
            self.grid.integrate(pose, &frame.scan);
        }
        is_corrected
    }

    fn redraw(&mut self) {
        let mut grid = OccupancyGrid::new(self.config.grid.clone());
        for (keyframe, pose) in self.keyframes.iter().zip(self.graph.poses()) {
            grid.integrate(pose, &keyframe.scan);
        }
        self.grid = grid;
    }
}

/// Unit vector of a heading.
pub(crate) fn direction(yaw: f64) -> Vector2<f64> {
    Vector2::new(yaw.cos(), yaw.sin())
}
