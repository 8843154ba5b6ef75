//! From sensor frames to a pose in the map: odometry, relocalization and tracking put together.

use crate::landmarks::Landmarks;
use crate::pose_fix::Fix;
use crate::relocalization::{Belief, RelocalizationConfig, Relocalizer, Sensed};
use crate::tracking::{LostReason, Tracker, TrackingConfig};
use fht_perception::candidate::PossiblePlace;
use fht_perception::frame::{LaserScan, SensorFrame};
use fht_perception::pose::{Point2, Pose2, wrap_angle};
use fht_perception::scan_odometry::{Odometry, ScanOdometry, ScanOdometryConfig};
use fht_proto::Descriptor;
use fht_proto::api::fleet::LocalizationState;
use serde::{Deserialize, Serialize};

/// How a robot localizes itself.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct LocalizerConfig {
    /// Odometry.
    pub odometry: ScanOdometryConfig,
    /// Finding the place without a guess.
    pub relocalize: RelocalizationConfig,
    /// Keeping it.
    pub track: TrackingConfig,
    /// The robot looks where it may be once in this distance, metres. Default 0.4.
    pub observe_every_m: f64,
    /// The same while the place is known, when looking only guards against a wrong fix, metres.
    /// Default 2.
    pub recheck_every_m: f64,
    /// If it has cameras, it waits this much farther for a picture, metres. Default 0.3.
    pub wait_for_picture_m: f64,
    /// Scans between two updates of the tracker, frames. Default 2.
    pub track_every: usize,
    /// A fix this far from the tracked pose replaces it, metres. Default 0.5.
    pub replace_m: f64,
    /// Or this far in heading, radians. Default 5°.
    pub replace_rad: f64,
}

impl Default for LocalizerConfig {
    fn default() -> Self {
        Self {
            odometry: ScanOdometryConfig::default(),
            relocalize: RelocalizationConfig::default(),
            track: TrackingConfig::default(),
            observe_every_m: 0.4,
            wait_for_picture_m: 0.3,
            recheck_every_m: 2.0,
            track_every: 2,
            replace_m: 0.5,
            replace_rad: 5.0_f64.to_radians(),
        }
    }
}

/// The outcome of one frame.
#[derive(Clone, Copy, Debug)]
pub struct Localization {
    /// What the robot says.
    pub state: LocalizationState,
    /// Corrected odometry.
    pub odometry: Odometry,
    /// Map frame from odometry frame; only when localized.
    pub map_from_odom: Option<Pose2>,
    /// Whether this frame declared a fix, the first or one that replaces another.
    pub is_new_fix: bool,
    /// Probability that the pose, or the likeliest place, is right, as the robot sees it; 0 when
    /// nothing fits.
    pub confidence: f64,
    /// What the present fix rested on when it was declared: estimations that agreed, of how many.
    pub evidence: Option<[usize; 2]>,
    /// Why it gave up the last place that it knew; none once it knows again.
    pub lost: Option<LostReason>,
}

impl Localization {
    /// The robot in the map frame, if it knows.
    #[must_use]
    pub fn map_from_base(&self) -> Option<Pose2> {
        Some(self.map_from_odom? * self.odometry.odom_from_base)
    }
}

/// Localizes a robot frame by frame.
pub struct Localizer {
    config: LocalizerConfig,
    odometry: ScanOdometry,
    relocalizer: Relocalizer,
    tracker: Option<Tracker>,
    state: LocalizationState,
    observed_at_m: Option<f64>,
    has_cameras: bool,
    confidence: f64,
    frames: usize,
    refixes: usize,
    evidence: Option<[usize; 2]>,
    lost: Option<LostReason>,
    /// Where somebody says that the robot is, until the next frame.
    pointed_at: Option<Pose2>,
}

impl Localizer {
    /// Knows nothing yet.
    #[must_use]
    pub fn new(config: LocalizerConfig) -> Self {
        Self {
            odometry: ScanOdometry::new(config.odometry.clone()),
            relocalizer: Relocalizer::new(config.relocalize.clone()),
            tracker: None,
            state: LocalizationState::NotLocalized,
            observed_at_m: None,
            has_cameras: false,
            confidence: 0.0,
            frames: 0,
            refixes: 0,
            evidence: None,
            lost: None,
            pointed_at: None,
            config,
        }
    }

    /// How often a fix replaced another that turned out wrong.
    #[must_use]
    pub fn refixes(&self) -> usize {
        self.refixes
    }

    /// Where the robot may be now, likeliest first.
    #[must_use]
    pub fn candidates(&self) -> Vec<PossiblePlace> {
        self.relocalizer.candidates(&self.odometry.current().odom_from_base, self.confidence)
    }

    /// The hypotheses kept, for people to look at.
    #[must_use]
    pub fn relocalizer(&self) -> &Relocalizer {
        &self.relocalizer
    }

    /// Somebody says that the robot is about here, map frame, rightly or not: it looks there with
    /// the next frame. What it sees decides, as everywhere.
    pub fn point_at(&mut self, map_from_base: Pose2) {
        let Pose2 { translation, rotation } = &map_from_base;
        if translation.vector.iter().all(|metres| metres.is_finite()) && rotation.angle().is_finite() {
            self.pointed_at = Some(map_from_base);
        }
    }

    /// So many people have walked by of late: some may stand, where the map is free. A robot that
    /// looks for its place expects them; one that knows it gives it up for no such place.
    pub fn expect_people(&mut self, walkers: usize) {
        self.relocalizer.expect_people(if self.tracker.is_some() { 0 } else { walkers });
    }

    /// Takes in a frame. `describe` is asked for the descriptor of the frame's panorama only when
    /// it will be used.
    pub fn update(
        &mut self,
        landmarks: &Landmarks,
        frame: &SensorFrame,
        describe: impl FnOnce() -> Option<Descriptor>,
    ) -> Localization {
        let points = frame.scan.points_in_base();
        let odometry = self.odometry.update(frame, &points);
        self.frames += 1;
        self.has_cameras |= frame.panorama.is_some();
        self.track(landmarks, &odometry, &points, &frame.scan);

        if let Some(map_from_base) = self.pointed_at.take() {
            self.relocalizer.point_at(map_from_base * odometry.odom_from_base.inverse());
            self.observed_at_m = None;
        }
        let mut is_new_fix = false;
        if self.is_due(&odometry, frame.panorama.is_some()) {
            self.observed_at_m = Some(odometry.odometer_m);
            let descriptor = if frame.panorama.is_some() { describe() } else { None };
            let observation = Sensed { odometry, scan: &frame.scan, points: &points, descriptor: descriptor.as_ref() };
            let belief = self.relocalizer.observe(landmarks, &observation);
            is_new_fix = self.take(belief, odometry);
        }
        Localization { odometry, is_new_fix, ..self.current() }
    }

    /// What the robot says since the last frame, as when a frame is left out.
    #[must_use]
    pub fn current(&self) -> Localization {
        Localization {
            state: self.state,
            odometry: self.odometry.current(),
            map_from_odom: self.tracker.as_ref().map(Tracker::map_from_odom),
            is_new_fix: false,
            confidence: self.confidence,
            evidence: self.evidence.filter(|_| self.tracker.is_some()),
            lost: self.lost,
        }
    }

    /// Whether it is time to look where the robot may be.
    fn is_due(&self, odometry: &Odometry, has_picture: bool) -> bool {
        let config = &self.config;
        let every_m = if self.tracker.is_some() { config.recheck_every_m } else { config.observe_every_m };
        let wait_m = if self.has_cameras && !has_picture { config.wait_for_picture_m } else { 0.0 };
        self.observed_at_m.is_none_or(|at| odometry.odometer_m - at >= every_m + wait_m)
    }

    fn track(&mut self, landmarks: &Landmarks, odometry: &Odometry, points: &[Point2], scan: &LaserScan) {
        let Some(tracker) = &mut self.tracker else { return };
        tracker.predict(odometry);
        if self.frames.is_multiple_of(self.config.track_every.max(1)) {
            tracker.update(landmarks, points, scan);
        }
        if let Some(reason) = tracker.lost() {
            self.give_up(reason);
            // It is lost until it looks again, a little farther on.
            self.observed_at_m = Some(odometry.odometer_m);
        }
    }

    fn give_up(&mut self, reason: LostReason) {
        tracing::warn!("lost: {reason}");
        self.lost = Some(reason);
        self.tracker = None;
        self.state = LocalizationState::Lost;
        self.confidence = 0.0;
        self.relocalizer.clear();
    }

    /// The landmarks from here on are those of another map: the robot's place on the old one, if it
    /// had any, is void, and so is all that it has compared. It looks with the next frame.
    pub fn replace_map(&mut self) {
        if self.tracker.is_some() {
            self.give_up(LostReason::MapReplaced);
        } else {
            self.relocalizer.clear();
        }
        self.pointed_at = None;
        self.observed_at_m = None;
    }

    /// Takes over what the relocalizer says; true if the pose is new.
    fn take(&mut self, belief: Belief, odometry: Odometry) -> bool {
        match (belief, &self.tracker) {
            (Belief::Localized(fix), None) => {
                self.start(fix, odometry);
                true
            }
            (Belief::Localized(fix), Some(tracker)) => {
                let at = tracker.map_from_base();
                let gap = (fix.map_from_base.translation.vector - at.translation.vector).norm();
                let turn = wrap_angle(fix.map_from_base.rotation.angle() - at.rotation.angle()).abs();
                if gap <= self.config.replace_m && turn <= self.config.replace_rad {
                    self.confidence = fix.confidence;
                    return false;
                }
                tracing::warn!(gap_m = gap, turn_rad = turn, "stronger evidence for another place: fix replaced");
                self.refixes += 1;
                self.start(fix, odometry);
                true
            }
            (Belief::Candidates { confidence, .. }, None) => {
                self.confidence = confidence;
                self.state = LocalizationState::Candidates;
                false
            }
            (Belief::NotLocalized, None) => {
                self.confidence = 0.0;
                if self.state != LocalizationState::Lost {
                    self.state = LocalizationState::NotLocalized;
                }
                false
            }
            (_, Some(_)) => false,
        }
    }

    fn start(&mut self, fix: Fix, odometry: Odometry) {
        tracing::info!(estimates = fix.estimates, of = fix.views, confidence = fix.confidence, "localized");
        self.evidence = Some([fix.estimates, fix.views]);
        self.confidence = fix.confidence;
        self.tracker = Some(Tracker::new(self.config.track.clone(), fix.map_from_base, fix.covariance, odometry));
        self.state = LocalizationState::Localized;
        self.lost = None;
    }
}
