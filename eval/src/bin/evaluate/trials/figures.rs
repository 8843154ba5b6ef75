//! Results of many trials as figures.

use crate::output::number;
use crate::systems::{Column, System};
use crate::trials::{Start, Trials};
use fht_eval::{TrialFix, TrialOutcome};
use serde::Serialize;

/// Relocalization of one system in one world.
#[derive(Clone, Debug, Serialize)]
pub struct RelocalizeFigures {
    pub world: String,
    pub system: System,
    pub column: Column,
    /// Starts drawn.
    pub trials: usize,
    /// Share of the starts with a right declared pose, within 1 m and 5° (paper).
    pub success: f64,
    /// Its interval of 95 % confidence (Wilson).
    pub success_ci95: [f64; 2],
    /// Share of the starts with one within 15 m of driving.
    pub success_within_15_m: f64,
    /// Share of the authors' own starts, and how many there are.
    pub authors_success: Option<f64>,
    pub authors_trials: usize,
    /// The same starts as the paper judges them.
    pub as_paper: Option<AsPaper>,
    /// Share of the starts with a right pose at some time, declared or not: what the paper counts.
    pub guessed_success: f64,
    /// Distance driven until then, metres: mean and standard deviation.
    pub l_guessed_mean_m: f64,
    pub l_guessed_std_m: f64,
    /// Starts with a wrong declared pose.
    pub false_fixes: usize,
    /// Distance driven until the first right and declared pose, metres: mean and standard
    /// deviation.
    pub l_reloca_mean_m: f64,
    pub l_reloca_std_m: f64,
    pub error_median_m: f64,
    pub error_median_deg: f64,
    /// Error as a share of the distance from the start to the map's origin, percent (paper): mean
    /// and standard deviation.
    pub epsilon_t_percent: f64,
    pub epsilon_t_std_percent: f64,
    /// Error of the heading, degrees: mean and standard deviation.
    pub epsilon_theta_deg: f64,
    pub epsilon_theta_std_deg: f64,
    /// Time per frame, milliseconds: mean and greatest.
    pub frame_ms_mean: f64,
    pub frame_ms_max: f64,
}

/// What the paper counts: the authors' own starts, and the first right pose, declared or not.
#[derive(Clone, Debug, Serialize)]
pub struct AsPaper {
    /// Share of the starts with a right pose.
    pub success: f64,
    /// Distance driven until then, metres: mean and standard deviation.
    pub l_reloca_m: [f64; 2],
    /// Error as a share of the distance from the start to the map's origin, percent: mean and
    /// standard deviation.
    pub epsilon_t_percent: [f64; 2],
    /// Error of the heading, degrees: mean and standard deviation.
    pub epsilon_theta_deg: [f64; 2],
}

impl AsPaper {
    fn of(authors: &[&TrialOutcome]) -> Option<Self> {
        let fixes: Vec<(&TrialOutcome, TrialFix)> =
            authors.iter().filter_map(|outcome| Some((*outcome, outcome.guessed?))).collect();
        let values = |value: &dyn Fn(&TrialFix) -> f64| {
            let values: Vec<f64> = fixes.iter().map(|(_, fix)| value(fix)).collect();
            [mean(&values), deviation(&values)]
        };
        let epsilon_t = epsilon_t(&fixes);
        (!authors.is_empty()).then(|| Self {
            success: fixes.len() as f64 / authors.len() as f64,
            l_reloca_m: values(&|fix| fix.driven_m),
            epsilon_t_percent: [mean(&epsilon_t), deviation(&epsilon_t)],
            epsilon_theta_deg: values(&|fix| fix.error_deg),
        })
    }
}

impl RelocalizeFigures {
    /// For people.
    pub fn line(&self) -> String {
        let Self { world, system, column, trials, authors_trials, false_fixes, .. } = self;
        let authors = self
            .authors_success
            .map_or_else(String::new, |share| format!(" (authors' {authors_trials} starts: {:.0} %)", 100.0 * share));
        format!(
            "{world}, {}, {}: {:.1} % of {trials}{authors}, right at some time {:.1} % after {} m, {false_fixes} with a false fix; \
             {} ± {} m driven; {} m, {}° (medians); ε_t {} %; {} ms a frame, at most {:.0}",
            system.title(),
            column.title(),
            100.0 * self.success,
            100.0 * self.guessed_success,
            number(self.l_guessed_mean_m, 1),
            number(self.l_reloca_mean_m, 1),
            number(self.l_reloca_std_m, 1),
            number(self.error_median_m, 3),
            number(self.error_median_deg, 2),
            number(self.epsilon_t_percent, 2),
            number(self.frame_ms_mean, 1),
            self.frame_ms_max
        )
    }
}

/// Starts nearer to the map's origin than this are left out of ε_t, metres.
const LEAST_TO_ORIGIN_M: f64 = 1.0;

/// Errors as shares of the distances to the map's origin, percent.
fn epsilon_t(fixes: &[(&TrialOutcome, TrialFix)]) -> Vec<f64> {
    let far = fixes.iter().filter(|(outcome, _)| outcome.to_origin_m >= LEAST_TO_ORIGIN_M);
    far.map(|(outcome, fix)| 100.0 * fix.error_m / outcome.to_origin_m).collect()
}

pub fn relocalize_figures(trials: &Trials) -> RelocalizeFigures {
    let of = |drawn: bool| {
        let all = trials.outcomes.iter().filter(move |(start, _)| matches!(start, Start::Drawn(_)) == drawn);
        all.map(|(_, outcome)| outcome).collect::<Vec<&TrialOutcome>>()
    };
    let (drawn, authors) = (of(true), of(false));
    let right = |outcomes: &[&TrialOutcome]| outcomes.iter().filter(|outcome| outcome.right.is_some()).count();
    let share = |count: usize, of: usize| count as f64 / of.max(1) as f64;
    let fixes: Vec<(&TrialOutcome, TrialFix)> =
        drawn.iter().filter_map(|outcome| Some((*outcome, outcome.right?))).collect();
    let values = |value: &dyn Fn(&TrialFix) -> f64| fixes.iter().map(|(_, fix)| value(fix)).collect::<Vec<f64>>();
    let epsilon_t = epsilon_t(&fixes);
    let (distances, degrees) = (values(&|fix| fix.driven_m), values(&|fix| fix.error_deg));
    let guessed: Vec<f64> = drawn.iter().filter_map(|outcome| Some(outcome.guessed?.driven_m)).collect();
    let frames: Vec<f64> = drawn.iter().map(|outcome| outcome.frame_ms[0]).collect();
    RelocalizeFigures {
        world: trials.world.clone(),
        system: trials.system,
        column: trials.column,
        trials: drawn.len(),
        success: share(right(&drawn), drawn.len()),
        success_ci95: wilson(right(&drawn), drawn.len()),
        success_within_15_m: share(fixes.iter().filter(|(_, fix)| fix.driven_m <= 15.0).count(), drawn.len()),
        authors_success: (!authors.is_empty()).then(|| share(right(&authors), authors.len())),
        authors_trials: authors.len(),
        as_paper: AsPaper::of(&authors),
        guessed_success: share(guessed.len(), drawn.len()),
        l_guessed_mean_m: mean(&guessed),
        l_guessed_std_m: deviation(&guessed),
        false_fixes: drawn.iter().filter(|outcome| outcome.false_fixes > 0).count(),
        l_reloca_mean_m: mean(&distances),
        l_reloca_std_m: deviation(&distances),
        error_median_m: quantile(values(&|fix| fix.error_m), 0.5),
        error_median_deg: quantile(degrees.clone(), 0.5),
        epsilon_t_percent: mean(&epsilon_t),
        epsilon_t_std_percent: deviation(&epsilon_t),
        epsilon_theta_deg: mean(&degrees),
        epsilon_theta_std_deg: deviation(&degrees),
        frame_ms_mean: mean(&frames),
        frame_ms_max: drawn.iter().map(|outcome| outcome.frame_ms[1]).fold(0.0, f64::max),
    }
}

/// NaN without values, which is `null` in JSON.
pub fn mean(values: &[f64]) -> f64 {
    if values.is_empty() { f64::NAN } else { values.iter().sum::<f64>() / values.len() as f64 }
}

/// Standard deviation of a sample.
pub fn deviation(values: &[f64]) -> f64 {
    let mean = mean(values);
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    if values.len() < 2 { f64::NAN } else { (squares / (values.len() - 1) as f64).sqrt() }
}

/// The value below which a share of the values lies.
pub fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get((values.len().saturating_sub(1) as f64 * share) as usize).copied().unwrap_or(f64::NAN)
}

/// Wilson's interval of 95 % confidence for a share.
pub fn wilson(successes: usize, trials: usize) -> [f64; 2] {
    let (n, z) = (trials.max(1) as f64, 1.96_f64);
    let share = successes as f64 / n;
    let centre = (share + z * z / (2.0 * n)) / (1.0 + z * z / n);
    let half = z / (1.0 + z * z / n) * (share * (1.0 - share) / n + z * z / (4.0 * n * n)).sqrt();
    [(centre - half).max(0.0), (centre + half).min(1.0)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_nothing_is_known_of_is_an_empty_cell() {
        let trials =
            Trials { world: "hall".to_owned(), system: System::Ours, column: Column::AsMapped, outcomes: Vec::new() };
        let line = relocalize_figures(&trials).line();
        assert!(line.contains("– ± – m driven; – m, –° (medians)") && !line.contains("NaN"), "{line}");
    }
}
