//! Wheel odometry corrected by matching each scan to the last few: it still drifts, but an order
//! less than wheels.
//!
//! The odometry frame stays what REP-105 wants of it: continuous, and right over short ways.
//! Everything downstream (live grid, consistency of estimations, tracking) leans on that.

use crate::frame::SensorFrame;
use crate::matching::{MatchConfig, ReferenceCloud, SeenPoint, refine};
use crate::pose::{Point2, Pose2, wrap_angle};
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// How scans correct the wheels.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct ScanOdometryConfig {
    /// A scan is kept for reference after this distance, metres. Default 0.4.
    pub keyframe_m: f64,
    /// Or after this turn, radians. Default 25°.
    pub keyframe_rad: f64,
    /// Scans kept for reference. Default 10.
    #[cfg_attr(feature = "schema", schemars(range(min = 1, max = 1000)))]
    pub keyframes: usize,
    /// Least share of a scan that must be explained by the reference. Default 0.5.
    pub min_score: f64,
    /// Greatest correction of one frame, metres; beyond, the match is wrong. Default 0.2.
    pub max_correction_m: f64,
    /// Greatest correction of one frame, radians. Default 6°.
    pub max_correction_rad: f64,
    /// Standard deviation along a direction beyond which the match says nothing there, metres.
    /// Default 0.05.
    pub max_sigma_m: f64,
    /// The refinement.
    pub matching: MatchConfig,
}

impl Default for ScanOdometryConfig {
    fn default() -> Self {
        Self {
            keyframe_m: 0.4,
            keyframe_rad: 25.0_f64.to_radians(),
            keyframes: 10,
            min_score: 0.5,
            max_correction_m: 0.2,
            max_correction_rad: 6.0_f64.to_radians(),
            max_sigma_m: 0.05,
            matching: MatchConfig::default(),
        }
    }
}

/// Where odometry says the robot is.
#[derive(Clone, Copy, Debug)]
pub struct Odometry {
    /// Pose of the base in the corrected odometry frame.
    pub odom_from_base: Pose2,
    /// Distance driven so far, metres.
    pub odometer_m: f64,
    /// Turned so far (either way), radians.
    pub turned_rad: f64,
    /// Whether this frame became a reference: the robot is somewhere new.
    pub is_keyframe: bool,
}

struct Keyframe {
    odom_from_base: Pose2,
    points: Vec<Point2>,
}

/// Scan-corrected odometry.
pub struct ScanOdometry {
    config: ScanOdometryConfig,
    wheels: Option<Pose2>,
    current: Pose2,
    odometer_m: f64,
    turned_rad: f64,
    keyframes: VecDeque<Keyframe>,
    reference: Option<ReferenceCloud>,
}

impl ScanOdometry {
    /// Starts where the wheels start.
    #[must_use]
    pub fn new(config: ScanOdometryConfig) -> Self {
        Self {
            config,
            wheels: None,
            current: Pose2::identity(),
            odometer_m: 0.0,
            turned_rad: 0.0,
            keyframes: VecDeque::new(),
            reference: None,
        }
    }

    /// Where odometry says the robot is since the last frame.
    #[must_use]
    pub fn current(&self) -> Odometry {
        let (odometer_m, turned_rad) = (self.odometer_m, self.turned_rad);
        Odometry { odom_from_base: self.current, odometer_m, turned_rad, is_keyframe: false }
    }

    /// Takes in a frame with its scan's `points` (base frame).
    pub fn update(&mut self, frame: &SensorFrame, points: &[Point2]) -> Odometry {
        let step = match self.wheels {
            Some(before) => before.inverse() * frame.odom_from_base,
            None => {
                self.current = frame.odom_from_base;
                Pose2::identity()
            }
        };
        self.wheels = Some(frame.odom_from_base);
        self.odometer_m += step.translation.vector.norm();
        self.turned_rad += step.rotation.angle().abs();
        let predicted = self.current * step;
        self.current = self.corrected(&predicted, points).unwrap_or(predicted);
        let is_keyframe = self.keep_if_new(points);
        Odometry { is_keyframe, ..self.current() }
    }

    fn corrected(&self, predicted: &Pose2, points: &[Point2]) -> Option<Pose2> {
        let found = refine(self.reference.as_ref()?, points, predicted, &self.config.matching)?;
        let correction = found.reference_from_moving.translation.vector - predicted.translation.vector;
        let turn = wrap_angle(found.reference_from_moving.rotation.angle() - predicted.rotation.angle());
        let spread = found.covariance.fixed_view::<2, 2>(0, 0).symmetric_eigenvalues().max().max(0.0).sqrt();
        let believable = found.score >= self.config.min_score
            && correction.norm() <= self.config.max_correction_m
            && turn.abs() <= self.config.max_correction_rad
            && spread <= self.config.max_sigma_m;
        believable.then_some(found.reference_from_moving)
    }

    fn keep_if_new(&mut self, points: &[Point2]) -> bool {
        let is_new = self.keyframes.back().is_none_or(|last| {
            let moved = last.odom_from_base.inverse() * self.current;
            moved.translation.vector.norm() >= self.config.keyframe_m
                || moved.rotation.angle().abs() >= self.config.keyframe_rad
        });
        if !is_new || points.is_empty() {
            return false;
        }
        self.keyframes.push_back(Keyframe { odom_from_base: self.current, points: points.to_vec() });
        while self.keyframes.len() > self.config.keyframes.max(1) {
            self.keyframes.pop_front();
        }
        let mut reference = ReferenceCloud::default();
        reference.extend(self.keyframes.iter().flat_map(|keyframe| {
            let seen = keyframe.points.iter().copied().map(SeenPoint::of_scan);
            seen.map(|point| point.transformed(&keyframe.odom_from_base))
        }));
        self.reference = Some(reference);
        true
    }
}
