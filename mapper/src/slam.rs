//! 2D LiDAR SLAM: each scan is matched to the map made so far, starting from what the wheels say.
//!
//! The local map is a cloud of wall points that is written once: a place seen again is matched to what was first seen
//! there, so that drift inside known space does not grow. Keyframes (pose, scan) are kept so that a pose graph with
//! loop closures can take the poses over and the cloud and the grid can be made again from them.

use crate::calibration::{OdometryCalibration, OdometryNoise};
use fht_robot::frame::{LaserScan, SensorFrame};
use fht_robot::grid::{GridConfig, OccupancyGrid};
use fht_robot::matching::{MatchConfig, Prior, ReferenceCloud, refine_with_prior};
use fht_robot::pose::{Point2, Pose2};
use nalgebra::{Matrix3, Vector2};

/// Parameters of the SLAM.
#[derive(Clone, Debug)]
pub struct SlamConfig {
    /// The occupancy grid.
    pub grid: GridConfig,
    /// Scan matching.
    pub matching: MatchConfig,
    /// What the wheels are believed to be.
    pub odometry: OdometryNoise,
    /// A keyframe is taken after this much driving, metres. Default 0.3.
    pub keyframe_distance_m: f64,
    /// A keyframe is taken after this much turning, radians. Default 0.5.
    pub keyframe_turn_rad: f64,
    /// Wall points of the local map are at least this far apart, metres. Default 0.03.
    pub point_spacing_m: f64,
    /// A scan that explains less than this share of its points does not move the estimate: the wheels do. Default 0.3.
    pub min_score: f64,
}

impl Default for SlamConfig {
    fn default() -> Self {
        Self {
            grid: GridConfig::default(),
            matching: MatchConfig { first_reach_m: 0.3, ..MatchConfig::default() },
            odometry: OdometryNoise::default(),
            keyframe_distance_m: 0.3,
            keyframe_turn_rad: 0.5,
            point_spacing_m: 0.03,
            min_score: 0.3,
        }
    }
}

/// A scan and where it was taken.
#[derive(Clone, Debug)]
pub struct Keyframe {
    /// Time of the frame, microseconds.
    pub time_us: u64,
    /// Where the robot was, as estimated.
    pub map_from_base: Pose2,
    /// What the wheels said.
    pub odom_from_base: Pose2,
    /// The scan.
    pub scan: LaserScan,
}

/// The estimate after one frame.
#[derive(Clone, Debug)]
pub struct SlamUpdate {
    /// Where the robot is.
    pub map_from_base: Pose2,
    /// Covariance of x, y (metres, map frame) and yaw (radians), relative to the local map.
    pub covariance: Matrix3<f64>,
    /// Share of the scan that the map explains; 0 when the wheels alone were used.
    pub score: f64,
}

/// SLAM in progress. The map frame is where the robot was at the first frame.
#[derive(Debug)]
pub struct Slam {
    config: SlamConfig,
    grid: OccupancyGrid,
    cloud: ReferenceCloud,
    calibration: OdometryCalibration,
    keyframes: Vec<Keyframe>,
    /// The newest estimate and the wheels' word at that instant.
    latest: Option<(Pose2, Pose2)>,
}

impl Slam {
    /// Before the first frame.
    #[must_use]
    pub fn new(config: SlamConfig) -> Self {
        Self {
            grid: OccupancyGrid::new(config.grid.clone()),
            cloud: ReferenceCloud::default(),
            calibration: OdometryCalibration::new(config.odometry.clone()),
            keyframes: Vec::new(),
            latest: None,
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

    /// Takes in one frame.
    pub fn update(&mut self, frame: &SensorFrame) -> SlamUpdate {
        let points = frame.scan.points_in_base();
        let Some((last_pose, last_odom)) = self.latest else {
            return self.begin(frame, &points);
        };
        let raw_motion = last_odom.inverse() * frame.odom_from_base;
        let motion = self.calibration.correct(&raw_motion);
        let predicted = last_pose * motion;
        let information = self.calibration.information(&motion, predicted.rotation.angle());
        let prior = Prior { reference_from_moving: predicted, information };

        let matched = refine_with_prior(&self.cloud, &points, &prior, &self.config.matching)
            .filter(|found| found.score >= self.config.min_score);
        let update = match matched {
            Some(found) => SlamUpdate {
                map_from_base: found.reference_from_moving,
                covariance: found.covariance,
                score: found.score,
            },
            None => SlamUpdate {
                map_from_base: predicted,
                covariance: information.try_inverse().unwrap_or_else(Matrix3::identity),
                score: 0.0,
            },
        };
        self.latest = Some((update.map_from_base, frame.odom_from_base));
        self.grid.integrate(&update.map_from_base, &frame.scan);
        if self.is_keyframe(&update.map_from_base) {
            if update.score > 0.0 {
                let scan_information = update.covariance.try_inverse().unwrap_or_else(Matrix3::zeros) - information;
                if let Some(before) = self.keyframes.last() {
                    self.calibration.learn(
                        &(before.odom_from_base.inverse() * frame.odom_from_base),
                        &(before.map_from_base.inverse() * update.map_from_base),
                        &scan_information,
                        update.map_from_base.rotation.angle(),
                    );
                }
            }
            self.add_keyframe(frame, update.map_from_base, &points);
        }
        update
    }

    fn begin(&mut self, frame: &SensorFrame, points: &[Point2]) -> SlamUpdate {
        let map_from_base = Pose2::identity();
        self.latest = Some((map_from_base, frame.odom_from_base));
        self.grid.integrate(&map_from_base, &frame.scan);
        self.add_keyframe(frame, map_from_base, points);
        SlamUpdate { map_from_base, covariance: Matrix3::zeros(), score: 1.0 }
    }

    fn is_keyframe(&self, map_from_base: &Pose2) -> bool {
        self.keyframes.last().is_none_or(|last| {
            let motion = last.map_from_base.inverse() * map_from_base;
            motion.translation.vector.norm() >= self.config.keyframe_distance_m
                || motion.rotation.angle().abs() >= self.config.keyframe_turn_rad
        })
    }

    fn add_keyframe(&mut self, frame: &SensorFrame, map_from_base: Pose2, points: &[Point2]) {
        // Points of one scan on a near wall are denser than the spacing too: thin them among themselves.
        let mut fresh: Vec<Point2> = Vec::new();
        let mut previous: Option<Point2> = None;
        for point in points {
            let point = map_from_base * point;
            let is_apart = previous.is_none_or(|p: Point2| (p - point).norm() >= self.config.point_spacing_m);
            if is_apart && !self.cloud.has_point_within(point, self.config.point_spacing_m) {
                fresh.push(point);
                previous = Some(point);
            }
        }
        self.cloud.extend(fresh);
        self.keyframes.push(Keyframe {
            time_us: frame.time_us,
            map_from_base,
            odom_from_base: frame.odom_from_base,
            scan: frame.scan.clone(),
        });
    }
}

/// Unit vector of a heading.
pub(crate) fn direction(yaw: f64) -> Vector2<f64> {
    Vector2::new(yaw.cos(), yaw.sin())
}
