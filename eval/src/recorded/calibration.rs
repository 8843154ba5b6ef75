//! What a place's grounds are worth: fitted to looks of recorded drives, and tried on those of the
//! logs that were left out.

use crate::recorded::figures::{Reliability, STATED};
use fht_localization::{ConfidenceConfig, PlaceEvidence};
use nalgebra::{Matrix2, Vector2};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// More ground than this adds nothing: what is wrong there has other causes.
const MOST_GROUND: f64 = 1.5;
/// Keeps the slope finite where nothing is wrong: the weight of a prior around 0.
const RIDGE: f64 = 1e-3;
/// Newton's method has long converged then.
const STEPS: usize = 60;

/// A look around of a robot that does not know where it is: a line of the table that `evaluate
/// recorded --looks` writes.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Look {
    /// The log.
    pub log: String,
    /// The map: a part of the log.
    pub map: String,
    /// The frame at which the robot was set down.
    pub start: usize,
    /// Share of what is seen in the first 5 m that the map explains at the true place.
    pub ground: f64,
    /// Driven since the start, metres.
    pub driven_m: f64,
    /// How probable the likeliest place was, as the robot said.
    pub stated: f64,
    /// How far that place is from the truth, metres,
    pub error_m: f64,
    /// and degrees.
    pub error_deg: f64,
    /// Whether that is right.
    pub right: bool,
    /// [`PlaceEvidence::walls`].
    pub walls: f64,
    /// [`PlaceEvidence::explained`].
    pub explained: f64,
    /// [`PlaceEvidence::too_short`].
    pub too_short: f64,
    /// [`PlaceEvidence::somebody`].
    pub somebody: f64,
    /// [`PlaceEvidence::seen_through`].
    pub seen_through: f64,
    /// [`PlaceEvidence::too_long`].
    pub too_long: f64,
    /// [`PlaceEvidence::over_rivals_sigmas`].
    pub over_rivals_sigmas: f64,
    /// [`PlaceEvidence::over_moved_sigmas`].
    pub over_moved_sigmas: f64,
    /// [`PlaceEvidence::spread_m`].
    pub spread_m: f64,
    /// [`PlaceEvidence::is_held`].
    pub is_held: bool,
}

impl Look {
    fn evidence(&self) -> PlaceEvidence {
        PlaceEvidence {
            walls: self.walls,
            explained: self.explained,
            too_short: self.too_short,
            somebody: self.somebody,
            seen_through: self.seen_through,
            too_long: self.too_long,
            over_rivals_sigmas: self.over_rivals_sigmas,
            over_moved_sigmas: self.over_moved_sigmas,
            spread_m: self.spread_m,
            is_held: self.is_held,
        }
    }
}

/// What was fitted without a log, and how it does on that log.
#[derive(Clone, Debug, Serialize)]
pub struct Calibration {
    /// The log that was left out; none if all were fitted and tried.
    pub left_out: Option<String>,
    /// The ground of a place that is right as often as not ([`ConfidenceConfig::even`]).
    pub even: f64,
    /// How fast the odds grow ([`ConfidenceConfig::slope`]).
    pub slope: f64,
    /// Of the looks that then say so much, how many are right.
    pub reliability: Vec<Reliability>,
}

/// Fits to all logs but one, for each of them, and to all. Each log counts alike, and each drive of
/// a log.
#[must_use]
pub fn calibrate(looks: &[Look], config: &ConfidenceConfig) -> Vec<Calibration> {
    let logs: BTreeSet<&str> = looks.iter().map(|look| look.log.as_str()).collect();
    let turns = logs.iter().filter(|_| logs.len() > 1).copied().map(Some).chain([None]);
    turns
        .map(|left_out| {
            let (tried, fitted): (Vec<&Look>, Vec<&Look>) =
                looks.iter().partition(|look| left_out == Some(look.log.as_str()));
            let (even, slope) = fit(&fitted, config);
            let fitted_config = ConfidenceConfig { even, slope, ..config.clone() };
            let tried = if left_out.is_some() { tried } else { fitted };
            let reliability = STATED.map(|stated| reliability(stated, &tried, &fitted_config)).to_vec();
            Calibration { left_out: left_out.map(str::to_owned), even, slope, reliability }
        })
        .collect()
}

fn reliability(stated: f64, looks: &[&Look], config: &ConfidenceConfig) -> Reliability {
    let said = looks.iter().filter(|look| config.probability(&look.evidence()) >= stated);
    let (moments, right) = said.fold((0, 0), |(moments, right), look| (moments + 1, right + usize::from(look.right)));
    Reliability { stated, moments, right }
}

/// Even ground and slope: logistic regression by Newton's method.
fn fit(looks: &[&Look], config: &ConfidenceConfig) -> (f64, f64) {
    let mut of_drive: BTreeMap<(&str, &str, usize), f64> = BTreeMap::new();
    looks.iter().for_each(|look| *of_drive.entry((&look.log, &look.map, look.start)).or_default() += 1.0);
    let mut of_log: BTreeMap<&str, f64> = BTreeMap::new();
    of_drive.keys().for_each(|(log, ..)| *of_log.entry(log).or_default() += 1.0);
    let weight = |look: &Look| {
        let drive = of_drive[&(look.log.as_str(), look.map.as_str(), look.start)];
        looks.len() as f64 / (of_log.len() as f64 * of_log[look.log.as_str()] * drive)
    };
    let rows: Vec<(Vector2<f64>, f64, f64)> = looks
        .iter()
        .map(|look| {
            let ground = config.ground(&look.evidence()).clamp(0.0, MOST_GROUND);
            (Vector2::new(1.0, ground), f64::from(u8::from(look.right)), weight(look))
        })
        .collect();
    let mut parameters = Vector2::new(0.0, 1.0);
    for _ in 0..STEPS {
        let mut curvature = Matrix2::identity() * RIDGE;
        let mut gradient = -RIDGE * parameters;
        for (row, right, weight) in &rows {
            let probability = 1.0 / (1.0 + (-row.dot(&parameters)).exp());
            curvature += *weight * probability * (1.0 - probability) * row * row.transpose();
            gradient += *weight * (right - probability) * row;
        }
        let Some(inverse) = curvature.try_inverse() else { break };
        parameters += inverse * gradient;
    }
    (-parameters.x / parameters.y, parameters.y)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A look with so much ground, by its distinct pieces.
    fn look(log: &str, start: usize, ground: f64, right: bool) -> Look {
        Look {
            log: log.to_owned(),
            map: String::new(),
            start,
            ground: 1.0,
            driven_m: 0.0,
            stated: 0.0,
            error_m: 0.0,
            error_deg: 0.0,
            right,
            walls: 400.0,
            explained: 1.0,
            too_short: 0.0,
            somebody: 0.0,
            seen_through: 0.0,
            too_long: 0.0,
            over_rivals_sigmas: f64::INFINITY,
            over_moved_sigmas: 2.75 * ground,
            spread_m: 10.0,
            is_held: true,
        }
    }

    #[test]
    fn the_fit_finds_the_odds_that_looks_were_drawn_from() {
        let (even, slope) = (0.4, 6.0);
        // Of a hundred looks with each ground, as many are right as the odds say.
        let mut looks = Vec::new();
        for step in 0..12_u32 {
            let ground = f64::from(step) * 0.1;
            let probability = 1.0 / (1.0 + f64::exp(-slope * (ground - even)));
            let right = (100.0 * probability).round() as usize;
            looks.extend((0..100).map(|number| look(["a", "b"][number % 2], number, ground, number < right)));
        }
        let found = calibrate(&looks, &ConfidenceConfig::default());
        assert_eq!(found.len(), 3, "without a, without b, all");
        for calibration in &found {
            assert!((calibration.even - even).abs() < 0.03, "{calibration:?}");
            assert!((calibration.slope - slope).abs() < 0.6, "{calibration:?}");
        }
    }
}
