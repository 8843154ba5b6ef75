//! From sensor frames to a pose in the map: odometry, relocalization and tracking put together.

use crate::landmarks::Landmarks;
use crate::odometry::{Odometry, OdometryConfig, ScanOdometry};
use crate::relocalize::{Belief, Fix, Observation, RelocalizeConfig, Relocalizer};
use crate::tracking::{TrackConfig, Tracker};
use crate::visibility::PolarScan;
use fht_proto::Descriptor;
use fht_robot::frame::SensorFrame;
use fht_robot::pose::{Point2, Pose2, wrap_angle};

/// How a robot localizes itself.
#[derive(Clone, Debug)]
pub struct LocalizeConfig {
    /// Odometry.
    pub odometry: OdometryConfig,
    /// Finding the place without a guess.
    pub relocalize: RelocalizeConfig,
    /// Keeping it.
    pub track: TrackConfig,
    /// Panoramas nearer together than this are not compared with the map again, metres. Default 0.4.
    pub observe_every_m: f64,
    /// The same while the place is known, when comparing only guards against a wrong fix, metres. Default 2.
    pub recheck_every_m: f64,
    /// Main nodes tried per panorama while the place is known. Default 2.
    pub recheck_candidates: usize,
    /// Scans between two updates of the tracker, frames. Default 2.
    pub track_every: usize,
    /// A fix this far from the tracked pose replaces it, metres. Default 0.5.
    pub replace_m: f64,
    /// Or this far in heading, radians. Default 5°.
    pub replace_rad: f64,
}

impl Default for LocalizeConfig {
    fn default() -> Self {
        Self {
            odometry: OdometryConfig::default(),
            relocalize: RelocalizeConfig::default(),
            track: TrackConfig::default(),
            observe_every_m: 0.4,
            recheck_every_m: 2.0,
            recheck_candidates: 2,
            track_every: 2,
            replace_m: 0.5,
            replace_rad: 5.0_f64.to_radians(),
        }
    }
}

/// What the robot says of where it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// Nothing fits yet.
    NotLocalized,
    /// Something fits, but too little or too ambiguously.
    Candidates,
    /// It knows.
    Localized,
    /// It knew, and what it senses no longer fits.
    Lost,
}

/// The outcome of one frame.
#[derive(Clone, Copy, Debug)]
pub struct Localization {
    /// What the robot says.
    pub status: Status,
    /// Corrected odometry.
    pub odometry: Odometry,
    /// Map frame from odometry frame; only when localized.
    pub map_from_odom: Option<Pose2>,
    /// Whether this frame declared a fix, the first or one that replaces another.
    pub is_new_fix: bool,
    /// What the present fix rested on when it was declared: estimations, and different nodes among them.
    pub evidence: Option<[usize; 2]>,
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
    config: LocalizeConfig,
    odometry: ScanOdometry,
    relocalizer: Relocalizer,
    tracker: Option<Tracker>,
    status: Status,
    observed_at_m: Option<f64>,
    frames: usize,
    refixes: usize,
    evidence: Option<[usize; 2]>,
}

impl Localizer {
    /// Knows nothing yet.
    #[must_use]
    pub fn new(config: LocalizeConfig) -> Self {
        Self {
            odometry: ScanOdometry::new(config.odometry.clone()),
            relocalizer: Relocalizer::new(config.relocalize.clone()),
            tracker: None,
            status: Status::NotLocalized,
            observed_at_m: None,
            frames: 0,
            refixes: 0,
            evidence: None,
            config,
        }
    }

    /// How often a fix replaced another that turned out wrong.
    #[must_use]
    pub fn refixes(&self) -> usize {
        self.refixes
    }

    /// The estimations kept, for people to look at.
    #[must_use]
    pub fn relocalizer(&self) -> &Relocalizer {
        &self.relocalizer
    }

    /// Takes in a frame. `describe` is asked for the descriptor of the frame's panorama only when it will be used.
    pub fn update(
        &mut self,
        landmarks: &Landmarks,
        frame: &SensorFrame,
        describe: impl FnOnce() -> Option<Descriptor>,
    ) -> Localization {
        let points = frame.scan.points_in_base();
        let polar = PolarScan::from_scan(&frame.scan);
        let odometry = self.odometry.update(frame, &points);
        self.frames += 1;
        self.track(landmarks, &odometry, &points, &polar);

        let known = self.tracker.is_some();
        let every = if known { self.config.recheck_every_m } else { self.config.observe_every_m };
        let is_due = self.observed_at_m.is_none_or(|at| odometry.odometer_m - at >= every);
        let mut is_new_fix = false;
        if frame.panorama.is_some() && is_due {
            let descriptor = describe();
            self.observed_at_m = Some(odometry.odometer_m);
            let candidates = if known { self.config.recheck_candidates } else { self.config.relocalize.candidates };
            let observation = Observation { odometry, points: &points, polar: &polar, descriptor: descriptor.as_ref() };
            let belief = self.relocalizer.observe(landmarks, &observation, candidates);
            is_new_fix = self.take(belief, odometry);
        }
        Localization { odometry, is_new_fix, ..self.current() }
    }

    /// What the robot says since the last frame, as when a frame is left out.
    #[must_use]
    pub fn current(&self) -> Localization {
        Localization {
            status: self.status,
            odometry: self.odometry.current(),
            map_from_odom: self.tracker.as_ref().map(Tracker::map_from_odom),
            is_new_fix: false,
            evidence: self.evidence.filter(|_| self.tracker.is_some()),
        }
    }

    fn track(&mut self, landmarks: &Landmarks, odometry: &Odometry, points: &[Point2], polar: &PolarScan) {
        let Some(tracker) = &mut self.tracker else { return };
        tracker.predict(odometry);
        if self.frames.is_multiple_of(self.config.track_every.max(1)) {
            tracker.update(landmarks, points, polar);
        }
        if tracker.is_lost() {
            tracing::warn!(sigma_m = tracker.sigma_m(), "what the robot senses no longer fits the map: lost");
            self.tracker = None;
            self.status = Status::Lost;
            self.relocalizer.clear();
            self.observed_at_m = None;
        }
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
                    return false;
                }
                tracing::warn!(gap_m = gap, turn_rad = turn, "stronger evidence for another place: fix replaced");
                self.refixes += 1;
                self.start(fix, odometry);
                true
            }
            (Belief::Candidates { .. }, None) => {
                self.status = Status::Candidates;
                false
            }
            (Belief::NotLocalized, None) => {
                if self.status != Status::Lost {
                    self.status = Status::NotLocalized;
                }
                false
            }
            (_, Some(_)) => false,
        }
    }

    fn start(&mut self, fix: Fix, odometry: Odometry) {
        tracing::info!(estimates = fix.estimates, nodes = fix.nodes, weight = fix.weight, "localized");
        self.evidence = Some([fix.estimates, fix.nodes]);
        self.tracker = Some(Tracker::new(self.config.track.clone(), fix.map_from_base, fix.covariance, odometry));
        self.status = Status::Localized;
    }
}
