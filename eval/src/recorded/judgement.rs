//! Right, wrong or none.

use crate::recorded::log::RecordedLog;
use crate::recorded::registration::Registration;
use crate::recorded::set_down::{LogDrive, Statement};
use fht_localization::RelocalizationConfig;
use fht_localization::landmarks::Landmarks;
use fht_perception::evidence_grid::Beams;
use fht_perception::matching::refine;
use fht_perception::pose::{Point2, Pose2, pose};
use fht_sim::scoring::pose_error;

/// A place is right within this, metres (paper, section IV-B).
const RIGHT_M: f64 = 1.0;
/// … and this, degrees.
const RIGHT_DEG: f64 = 5.0;
/// The truth is held to the walls if they are this near, metres, since the map is bent.
const HELD_M: f64 = 0.5;
/// … and this, degrees.
const HELD_DEG: f64 = 5.0;
/// Where the truth explains at least this share of a scan, it is the truth.
const WELL_EXPLAINED: f64 = 0.75;
/// Else it is torn if a place this near, metres,
const TORN_M: f64 = 2.0;
/// and this, degrees,
const TORN_DEG: f64 = 6.0;
/// explains so much more of the scan.
const TORN_SHARE: f64 = 0.15;
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
    /// How far the log goes on from there, metres.
    pub left_m: f64,
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

/// Where the log's places lie in the map, by the walls around them.
struct Truth<'a> {
    log: &'a RecordedLog,
    landmarks: &'a Landmarks,
    registration: &'a Registration,
    config: RelocalizationConfig,
}

impl Truth<'_> {
    /// Where the robot is at `frame`, for one that says that it is at `said`; none where nobody
    /// knows how the log lies in the map. Bent maps agree on a place where the same walls are seen,
    /// so it is held to them.
    fn at(&self, frame: usize, said: Option<&Pose2>) -> Option<Pose2> {
        let log_from_base = &self.log.log_from_base[frame];
        let expected = match said {
            Some(said) => self.registration.map_from_base_near(log_from_base, said)?,
            None => self.registration.map_from_base(log_from_base)?,
        };
        let points = self.log.frames[frame].scan.points_in_base();
        let near = self.held(&points, &expected, (HELD_M, HELD_DEG)).unwrap_or(expected);
        Some(self.where_torn(frame, &points, &near).unwrap_or(near))
    }

    /// Where the log's own SLAM left a loop open, its truth lies beside what the robot sees, and
    /// the walls say so: where that is, if a place near explains clearly more of the scan.
    fn where_torn(&self, frame: usize, points: &[Point2], expected: &Pose2) -> Option<Pose2> {
        let here = self.explained(frame, expected);
        if here >= WELL_EXPLAINED {
            return None;
        }
        let steps = |half: f64| (-2..=2).map(move |step| half * f64::from(step) / 2.0);
        let moves = steps(TORN_M).flat_map(|x| steps(TORN_M).map(move |y| (x, y)));
        let moves = moves.flat_map(|(x, y)| [-1.0, 0.0, 1.0].map(|turn| (x, y, turn * TORN_DEG.to_radians() / 2.0)));
        let places = moves.filter_map(|(x, y, yaw)| {
            let at = &expected.translation.vector;
            let guess = pose(at.x + x, at.y + y, expected.rotation.angle() + yaw);
            let held = self.held(points, &guess, (TORN_M, TORN_DEG))?;
            let (metres, degrees) = pose_error(&held, expected);
            (metres <= TORN_M && degrees <= TORN_DEG).then(|| (self.explained(frame, &held), held))
        });
        let (share, best) = places.max_by(|a, b| a.0.total_cmp(&b.0))?;
        (share >= here + TORN_SHARE).then_some(best)
    }

    /// `guess`, held to the walls, if they are within so many metres and degrees.
    fn held(&self, points: &[Point2], guess: &Pose2, (most_m, most_deg): (f64, f64)) -> Option<Pose2> {
        let matching = &self.config.matching;
        let found = refine(&self.landmarks.walls().cloud, points, guess, matching)?;
        let (metres, degrees) = pose_error(&found.reference_from_moving, guess);
        let is_near = metres <= most_m && degrees <= most_deg && found.score >= matching.min_score;
        is_near.then_some(found.reference_from_moving)
    }

    /// Share of a scan that the map explains at a place.
    fn explained(&self, frame: usize, map_from_base: &Pose2) -> f64 {
        let evidence = &self.config.weigh.evidence;
        let beams = Beams::of(&self.log.frames[frame].scan, evidence);
        self.landmarks.walls().known.weigh(&beams, map_from_base, evidence).explained_share()
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
    let truth = Truth { log, landmarks, registration, config: RelocalizationConfig::default() };
    let judged = |said: &Statement| {
        let truth = truth.at(said.frame, Some(&said.map_from_base))?;
        let (error_m, error_deg) = pose_error(&said.map_from_base, &truth);
        Some(JudgedStatement { said: *said, truth, error_m, error_deg })
    };
    let explained = |frame: usize| Some(truth.explained(frame, &truth.at(frame, None)?));
    let near = (drive.start..log.frames.len())
        .take_while(|frame| log.driven_m[*frame] - log.driven_m[drive.start] <= GROUND_M)
        .step_by(GROUND_EVERY);
    let shares = near.map(explained).collect::<Option<Vec<f64>>>()?;
    Some(JudgedDrive {
        start: drive.start,
        ground: shares.iter().sum::<f64>() / shares.len().max(1) as f64,
        left_m: log.driven_m.last().copied().unwrap_or(0.0) - log.driven_m[drive.start],
        statements: drive.statements.iter().map(judged).collect::<Option<_>>()?,
        fix: drive.fix.as_ref().and_then(judged),
    })
}
