//! Durations as counts, rounded to three digits, so that a million of them take a few hundred
//! numbers.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::time::Duration;

/// Counted durations.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Latencies {
    /// By microseconds, rounded to three digits.
    counts: BTreeMap<u64, u64>,
    max_us: u64,
}

fn rounded(us: u64) -> u64 {
    let step = 10_u64.pow(us.checked_ilog10().unwrap_or(0).saturating_sub(2));
    (us + step / 2) / step * step
}

impl Latencies {
    /// Adds a duration.
    pub fn add(&mut self, duration: Duration) {
        let us = u64::try_from(duration.as_micros()).unwrap_or(u64::MAX);
        *self.counts.entry(rounded(us)).or_default() += 1;
        self.max_us = self.max_us.max(us);
    }

    /// Adds those of others.
    pub fn add_all(&mut self, others: &Self) {
        for (us, count) in &others.counts {
            *self.counts.entry(*us).or_default() += count;
        }
        self.max_us = self.max_us.max(others.max_us);
    }

    /// How many there are.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.counts.values().sum()
    }

    /// The duration that `share` of them (0 to 1) do not exceed, milliseconds; NaN if there is
    /// none.
    #[must_use]
    pub fn quantile_ms(&self, share: f64) -> f64 {
        let rank = (self.count() as f64 * share).ceil().max(1.0);
        let mut below = 0;
        for (us, count) in &self.counts {
            below += count;
            if below as f64 >= rank {
                return *us as f64 * 1e-3;
            }
        }
        f64::NAN
    }

    /// The longest, milliseconds.
    #[must_use]
    pub fn max_ms(&self) -> f64 {
        self.max_us as f64 * 1e-3
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_the_durations() {
        let mut latencies = Latencies::default();
        assert!(latencies.quantile_ms(0.5).is_nan());
        (1..=1000).for_each(|us| latencies.add(Duration::from_micros(us)));
        latencies.add(Duration::from_micros(123_456));
        assert_eq!(latencies.count(), 1001);
        assert_eq!((latencies.quantile_ms(0.5), latencies.quantile_ms(0.9)), (0.501, 0.901));
        assert_eq!((latencies.quantile_ms(1.0), latencies.max_ms()), (123.0, 123.456));
    }
}
