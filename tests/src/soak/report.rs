//! What a soak has shown, minute by minute.

use crate::fleet::latencies::Latencies;
use crate::soak::robots::RobotActivity;
use serde::Serialize;

/// How much more the last third of a run may take of anything than the first, as a ratio; also the
/// last third of what is between two restarts.
const FLAT: f64 = 1.15;
/// The store's file grows in steps: an hour's increments are a few hundred kilobytes.
const STORE_STEP_BYTES: f64 = 1_048_576.0;

/// One minute.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Minute {
    /// Since the begin, seconds.
    pub at_s: f64,
    /// Whether the server was killed in it.
    pub is_killed: bool,
    /// The server's resident memory, bytes.
    pub server_bytes: u64,
    /// Files and sockets that it has open.
    pub open_files: usize,
    /// Size of its data directory, bytes.
    pub stored_bytes: u64,
    /// Paths that were asked for.
    pub asked: u64,
    /// Of these, how many were refused.
    pub refused: u64,
    /// Of these, how many stayed without an answer.
    pub unanswered: u64,
    /// The time of an answer, milliseconds: median.
    pub median_ms: f64,
    /// 99 of 100 are as fast.
    pub p99_ms: f64,
    /// Robots that have left, each with one that came in its place.
    pub replaced: u64,
}

impl Minute {
    /// Adds what robots report.
    pub(super) fn of(windows: &[RobotActivity]) -> Self {
        let mut latencies = Latencies::default();
        windows.iter().for_each(|window| latencies.add_all(&window.latencies));
        let sum = |of: fn(&RobotActivity) -> u64| windows.iter().map(of).sum();
        Self {
            asked: sum(|window| window.asked),
            refused: sum(|window| window.refused),
            unanswered: sum(|window| window.unanswered),
            median_ms: latencies.quantile_ms(0.5),
            p99_ms: latencies.quantile_ms(0.99),
            replaced: sum(|window| window.replaced),
            ..Self::default()
        }
    }
}

/// The results.
#[derive(Clone, Debug, Default, Serialize)]
pub struct SoakReport {
    /// How many robots there were at a time.
    pub robots: usize,
    /// The minutes, from the first in which all robots were there.
    pub minutes: Vec<Minute>,
    /// Increments that the server has acknowledged.
    pub acknowledged: u64,
    /// Of these, how many it does not have in the end.
    pub lost: u64,
    /// How often something was not acknowledged in time, and given up.
    pub not_acknowledged: u64,
    /// Whether a copy is the server's map in the end.
    pub agree: bool,
}

impl SoakReport {
    /// The largest of a figure in the first and in the last third of the minutes without a kill.
    #[must_use]
    pub fn first_and_last(&self, of: impl Fn(&Minute) -> f64) -> [f64; 2] {
        first_and_last(&self.minutes.iter().filter(|minute| !minute.is_killed).map(of).collect::<Vec<f64>>())
    }

    /// The same between two restarts, where it has grown most: what grows with a server's age and
    /// not with the hour.
    #[must_use]
    pub fn first_and_last_between_restarts(&self, of: impl Fn(&Minute) -> f64) -> [f64; 2] {
        // The minute of a restart is neither's.
        let lives = self.minutes.split(|minute| minute.is_killed).filter(|life| !life.is_empty());
        let lives = lives.map(|life| first_and_last(&life.iter().map(&of).collect::<Vec<f64>>()));
        let growth = |[first, last]: &[f64; 2]| last / first;
        lives.max_by(|a, b| growth(a).total_cmp(&growth(b))).unwrap_or_default()
    }

    /// Questions without an answer, and refused ones, in minutes without a kill.
    #[must_use]
    pub fn failures(&self) -> u64 {
        self.minutes.iter().filter(|minute| !minute.is_killed).map(|minute| minute.unanswered + minute.refused).sum()
    }

    /// Whether nothing was lost, and memory, open files and what is stored have not grown.
    #[must_use]
    pub fn is_fine(&self) -> bool {
        let is_flat = |of: fn(&Minute) -> f64, step: f64| {
            let parts = [self.first_and_last(of), self.first_and_last_between_restarts(of)];
            parts.iter().all(|[first, last]| *last <= (first * FLAT).max(first + step))
        };
        self.lost == 0
            && self.agree
            && is_flat(|minute| minute.server_bytes as f64, 0.0)
            && is_flat(|minute| minute.open_files as f64, 0.0)
            && is_flat(|minute| minute.stored_bytes as f64, STORE_STEP_BYTES)
    }
}

/// The largest in the first and in the last third.
fn first_and_last(of: &[f64]) -> [f64; 2] {
    let third = of.len().div_ceil(3);
    let most = |part: &[f64]| part.iter().copied().fold(0.0, f64::max);
    [most(&of[..third]), most(&of[of.len() - third..])]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_grows_between_restarts_is_seen_though_the_hour_is_flat() {
        let minute = |at: u64| Minute {
            is_killed: at.is_multiple_of(10) && at > 0,
            server_bytes: 75 + 4 * (at % 10),
            ..Minute::default()
        };
        let mut report = SoakReport { agree: true, minutes: (0..60).map(minute).collect(), ..SoakReport::default() };
        let bytes = |minute: &Minute| minute.server_bytes as f64;
        assert_eq!(report.first_and_last(bytes), [111.0, 111.0]);
        assert_eq!(report.first_and_last_between_restarts(bytes), [87.0, 111.0]);
        assert!(!report.is_fine());
        report.minutes.iter_mut().for_each(|minute| minute.server_bytes = 75);
        assert!(report.is_fine());
    }
}
