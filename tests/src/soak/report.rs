//! What a soak has shown, minute by minute.

use crate::fleet::latencies::Latencies;
use crate::soak::robots::RobotActivity;
use serde::Serialize;

/// How much more the last third of a run may take of anything than the first, as a ratio.
const FLAT: f64 = 1.15;

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
        let steady: Vec<f64> = self.minutes.iter().filter(|minute| !minute.is_killed).map(of).collect();
        let third = steady.len().div_ceil(3);
        let most = |part: &[f64]| part.iter().copied().fold(0.0, f64::max);
        [most(&steady[..third]), most(&steady[steady.len() - third..])]
    }

    /// Questions without an answer, and refused ones, in minutes without a kill.
    #[must_use]
    pub fn failures(&self) -> u64 {
        self.minutes.iter().filter(|minute| !minute.is_killed).map(|minute| minute.unanswered + minute.refused).sum()
    }

    /// Whether nothing was lost, and memory, open files and what is stored have not grown.
    #[must_use]
    pub fn is_fine(&self) -> bool {
        let is_flat = |of: fn(&Minute) -> f64| {
            let [first, last] = self.first_and_last(of);
            last <= first * FLAT
        };
        self.lost == 0
            && self.agree
            && is_flat(|minute| minute.server_bytes as f64)
            && is_flat(|minute| minute.open_files as f64)
            && is_flat(|minute| minute.stored_bytes as f64)
    }
}
