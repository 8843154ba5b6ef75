//! All drives of a log together.

use crate::recorded::judgement::{JudgedDrive, JudgedStatement};
use serde::{Deserialize, Serialize};

/// The diagram's steps: statements of at least so much.
pub const STATED: [f64; 6] = [0.5, 0.8, 0.9, 0.99, 0.995, 0.999];
/// A robot should know within this, metres.
const SOON_M: f64 = 15.0;

/// How many statements of at least `stated` were right.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Reliability {
    /// Statements of at least this probability,
    pub stated: f64,
    /// of which there were so many,
    pub moments: usize,
    /// were right so often.
    pub right: usize,
}

/// The figures of a run: one log on one map.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RecordedFigures {
    /// The log.
    pub log: String,
    /// The map: a part of the log, or another's name.
    pub map: String,
    /// Robots that were set down,
    pub starts: usize,
    /// on ground that the map knows,
    pub known: usize,
    /// that declared a place,
    pub declared: usize,
    /// a wrong one.
    pub wrong: usize,
    /// Robots on known ground that declared none.
    pub none_on_known: usize,
    /// Of these, those whose log ends before they have driven 15 m.
    pub log_ended: usize,
    /// Robots on known ground that declared a right place within 15 m.
    pub within_15_m: usize,
    /// Distance driven until a place was declared, metres, mean.
    pub driven_mean_m: f64,
    /// The same of robots on known ground.
    pub driven_known_mean_m: f64,
    /// Error of right places, metres, median.
    pub error_median_m: f64,
    /// The same in degrees.
    pub error_median_deg: f64,
    /// What the robots said on their way, and how often it was right.
    pub reliability: Vec<Reliability>,
    /// Frames of the log at which the SLAM that tells the truth was lost.
    pub truth_lost: usize,
    /// Frames of the log.
    pub frames: usize,
}

impl RecordedFigures {
    /// The figures of `drives`.
    #[must_use]
    pub fn of(log: &str, map: &str, drives: &[JudgedDrive]) -> Self {
        let fixes: Vec<&JudgedStatement> = drives.iter().filter_map(|drive| drive.fix.as_ref()).collect();
        let right: Vec<&JudgedStatement> = fixes.iter().copied().filter(|fix| fix.is_right()).collect();
        let known: Vec<&JudgedDrive> = drives.iter().filter(|drive| drive.is_on_known_ground()).collect();
        let is_soon =
            |drive: &&&JudgedDrive| drive.fix.as_ref().is_some_and(|fix| fix.is_right() && fix.said.driven_m <= SOON_M);
        Self {
            log: log.to_owned(),
            map: map.to_owned(),
            starts: drives.len(),
            known: known.len(),
            declared: fixes.len(),
            wrong: fixes.len() - right.len(),
            none_on_known: known.iter().filter(|drive| drive.fix.is_none()).count(),
            log_ended: known.iter().filter(|drive| drive.fix.is_none() && drive.left_m < SOON_M).count(),
            within_15_m: known.iter().filter(is_soon).count(),
            driven_mean_m: mean(fixes.iter().map(|fix| fix.said.driven_m)),
            driven_known_mean_m: mean(known.iter().filter_map(|drive| Some(drive.fix.as_ref()?.said.driven_m))),
            error_median_m: median(right.iter().map(|fix| fix.error_m)),
            error_median_deg: median(right.iter().map(|fix| fix.error_deg)),
            reliability: STATED.map(|stated| reliability(stated, drives)).to_vec(),
            truth_lost: 0,
            frames: 0,
        }
    }
}

fn reliability(stated: f64, drives: &[JudgedDrive]) -> Reliability {
    let said = drives.iter().flat_map(|drive| &drive.statements).filter(|statement| statement.said.stated >= stated);
    let (mut moments, mut right) = (0, 0);
    for statement in said {
        moments += 1;
        right += usize::from(statement.is_right());
    }
    Reliability { stated, moments, right }
}

/// 0 of nothing.
fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let values: Vec<f64> = values.collect();
    values.iter().fold(0.0, |sum, value| sum + value) / values.len().max(1) as f64
}

/// 0 of nothing.
fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}
