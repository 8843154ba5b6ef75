//! The figures for people.

use crate::output::number;
use fht_eval::recorded::{RecordedFigures, Reliability};

/// The figures of one run.
pub fn text(figures: &RecordedFigures) -> String {
    let RecordedFigures { starts, known, declared, wrong, none_on_known, log_ended, within_15_m, .. } = figures;
    let mut lines = vec![format!("{} on the map of {}", figures.log, figures.map)];
    if figures.truth_lost > 0 {
        lines.push(format!(
            "  truth       the SLAM that tells it was lost at {} of {} scans",
            figures.truth_lost, figures.frames
        ));
    }
    lines.push(format!("  starts      {starts}, {known} of them on known ground"));
    lines.push(format!("  declared    {declared}, {wrong} of them wrong"));
    lines.push(format!(
        "  known       {within_15_m} of {known} right within 15 m, {none_on_known} declared nothing, of which the log \
         ended for {log_ended}"
    ));
    lines.push(format!(
        "  until then  {} m, on known ground {} m; error {} m, {}°",
        number(figures.driven_mean_m, 1),
        number(figures.driven_known_mean_m, 1),
        number(figures.error_median_m, 3),
        number(figures.error_median_deg, 2)
    ));
    lines.push(format!("  said        {}", figures.reliability.iter().map(said).collect::<Vec<_>>().join(", ")));
    lines.join("\n")
}

/// The figures of all runs together.
pub fn sum(runs: &[RecordedFigures]) -> String {
    let total = |count: fn(&RecordedFigures) -> usize| runs.iter().map(count).sum::<usize>();
    format!(
        "all: {} starts, {} declared, {} wrong; of {} on known ground {} right within 15 m and {} without a \
         place, of which the log ended for {}",
        total(|run| run.starts),
        total(|run| run.declared),
        total(|run| run.wrong),
        total(|run| run.known),
        total(|run| run.within_15_m),
        total(|run| run.none_on_known),
        total(|run| run.log_ended)
    )
}

fn said(step: &Reliability) -> String {
    format!("{} right of {} at {} or more", step.right, step.moments, step.stated)
}
