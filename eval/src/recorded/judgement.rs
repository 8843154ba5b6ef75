//! Right, wrong or none.

use crate::recorded::log::RecordedLog;
use crate::recorded::registration::Registration;
use crate::recorded::set_down::{LogDrive, Statement};
use fht_localization::RelocalizationConfig;
use fht_localization::landmarks::Landmarks;
use fht_perception::evidence_grid::Beams;
use fht_perception::matching::refine;
use fht_perception::pose::Pose2;
use fht_sim::scoring::pose_error;

/// A place is right within this, metres (paper, section IV-B).
const RIGHT_M: f64 = 1.0;
/// … and this, degrees.
const RIGHT_DEG: f64 = 5.0;
/// The truth is held to the walls if they are this near, metres, since the map is bent.
const HELD_M: f64 = 0.5;
/// … and this, degrees.
const HELD_DEG: f64 = 5.0;
/// How far from its start the ground is looked at, metres.
const GROUND_M: f64 = 5.0;
/// Frames between two looks at it.
const GROUND_EVERY: usize = 5;
/// Ground is known where the map explains at least this share of what is seen there.
const KNOWN_SHARE: f64 = 0.75;

/// A statement, and how far from the truth it is.
#[derive(Clone, Copy, Debug)]
pub struct JudgedStatement {
    /// What the robot said.
    pub said: Statement,
    /// Where it was, map frame.
    pub truth: Pose2,
    /// Distance, metres.
    pub error_m: f64,
    /// Angle, degrees.
    pub error_deg: f64,
}

impl JudgedStatement {
    /// Within 1 m and 5°.
    #[must_use]
    pub fn is_right(&self) -> bool {
        self.error_m < RIGHT_M && self.error_deg < RIGHT_DEG
    }
}

/// A drive, judged.
#[derive(Clone, Debug)]
pub struct JudgedDrive {
    /// The frame at which the robot was set down.
    pub start: usize,
    /// Share of what is seen in the first 5 m that the map explains at the true place.
    pub ground: f64,
    /// All that it said.
    pub statements: Vec<JudgedStatement>,
    /// The place that it declared.
    pub fix: Option<JudgedStatement>,
}

impl JudgedDrive {
    /// Whether the map knows the ground that it was set down on.
    #[must_use]
    pub fn is_on_known_ground(&self) -> bool {
        self.ground >= KNOWN_SHARE
    }
}

/// Judges a drive on the map of `landmarks`; none where nobody knows how the log lies in the map.
#[must_use]
pub fn judge(
    drive: &LogDrive,
    log: &RecordedLog,
    landmarks: &Landmarks,
    registration: &Registration,
) -> Option<JudgedDrive> {
    let config = RelocalizationConfig::default();
    // Bent maps agree on a place where the same walls are seen.
    let truth = |frame: usize, said: Option<&Pose2>| {
        let log_from_base = &log.log_from_base[frame];
        let expected = match said {
            Some(said) => registration.map_from_base_near(log_from_base, said)?,
            None => registration.map_from_base(log_from_base)?,
        };
        let points = log.frames[frame].scan.points_in_base();
        let held = refine(&landmarks.walls().cloud, &points, &expected, &config.matching);
        let held = held.filter(|held| held.score >= config.matching.min_score);
        let held = held.map(|held| held.reference_from_moving).filter(|held| {
            let (metres, degrees) = pose_error(held, &expected);
            metres <= HELD_M && degrees <= HELD_DEG
        });
        Some(held.unwrap_or(expected))
    };
    let judged = |said: &Statement| {
        let truth = truth(said.frame, Some(&said.map_from_base))?;
        let (error_m, error_deg) = pose_error(&said.map_from_base, &truth);
        Some(JudgedStatement { said: *said, truth, error_m, error_deg })
    };
    let explained = |frame: usize| {
        let beams = Beams::of(&log.frames[frame].scan, &config.weigh.evidence);
        Some(landmarks.walls().known.weigh(&beams, &truth(frame, None)?, &config.weigh.evidence).explained_share())
    };
    let near = (drive.start..log.frames.len())
        .take_while(|frame| log.driven_m[*frame] - log.driven_m[drive.start] <= GROUND_M)
        .step_by(GROUND_EVERY);
    let shares = near.map(explained).collect::<Option<Vec<f64>>>()?;
    Some(JudgedDrive {
        start: drive.start,
        ground: shares.iter().sum::<f64>() / shares.len().max(1) as f64,
        statements: drive.statements.iter().map(judged).collect::<Option<_>>()?,
        fix: drive.fix.as_ref().and_then(judged),
    })
}
