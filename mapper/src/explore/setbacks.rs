//! Places that exploration failed to reach or to see into.

use fht_perception::pose::Point2;
use serde::{Deserialize, Serialize};

/// When a place is given up.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct SetbackConfig {
    /// Targets this near to a failed one share its fate, metres. Default 0.6.
    pub radius_m: f64,
    /// A failed target is left alone for this long, seconds. Default 60.
    pub rest_s: f64,
    /// After so many failures a target is given up for good. Default 2.
    pub max_failures: u32,
}

impl Default for SetbackConfig {
    fn default() -> Self {
        Self { radius_m: 0.6, rest_s: 60.0, max_failures: 2 }
    }
}

#[derive(Clone, Debug)]
struct Setback {
    target: Point2,
    failures: u32,
    rests_until_us: u64,
}

/// The memory of failed targets.
#[derive(Clone, Debug, Default)]
pub(super) struct Setbacks {
    places: Vec<Setback>,
}

impl Setbacks {
    /// Counts one failure.
    pub(super) fn record(&mut self, target: Point2, time_us: u64, config: &SetbackConfig) {
        let rests_until_us = time_us.saturating_add((config.rest_s.max(0.0) * 1e6) as u64);
        match self.places.iter_mut().find(|place| (place.target - target).norm() <= config.radius_m) {
            Some(place) => {
                place.failures += 1;
                place.rests_until_us = rests_until_us;
            }
            None => self.places.push(Setback { target, failures: 1, rests_until_us }),
        }
    }

    /// Whether a target may be tried now.
    pub(super) fn allows(&self, target: Point2, time_us: u64, config: &SetbackConfig) -> bool {
        self.near(target, config).all(|place| place.failures < config.max_failures && place.rests_until_us <= time_us)
    }

    /// Whether a target may be tried now or later.
    pub(super) fn allows_later(&self, target: Point2, config: &SetbackConfig) -> bool {
        self.near(target, config).all(|place| place.failures < config.max_failures)
    }

    /// Whether some target may be tried later that may not be tried now.
    pub(super) fn has_resting(&self, time_us: u64, config: &SetbackConfig) -> bool {
        self.places.iter().any(|place| place.failures < config.max_failures && place.rests_until_us > time_us)
    }

    fn near<'a>(&'a self, target: Point2, config: &'a SetbackConfig) -> impl Iterator<Item = &'a Setback> {
        self.places.iter().filter(move |place| (place.target - target).norm() <= config.radius_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_target_rests_comes_back_and_is_given_up() {
        let config = SetbackConfig::default();
        let (place, beside, far) = (Point2::new(1.0, 1.0), Point2::new(1.3, 1.0), Point2::new(3.0, 1.0));
        let mut setbacks = Setbacks::default();
        setbacks.record(place, 0, &config);
        assert!(!setbacks.allows(beside, 1_000_000, &config));
        assert!(setbacks.allows_later(beside, &config));
        assert!(setbacks.allows(beside, 61_000_000, &config));
        assert!(setbacks.allows(far, 0, &config));
        setbacks.record(beside, 61_000_000, &config);
        assert!(!setbacks.allows_later(place, &config));
    }
}
