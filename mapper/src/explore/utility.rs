//! Which frontier next: the paper's equation 1.

use fht_perception::pose::wrap_angle;
use serde::{Deserialize, Serialize};

/// Terms of the utility U = Infor / Cost.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct UtilityConfig {
    /// Frontiers of this size (in squares of the thinning) carry 63 % of what a frontier can carry:
    /// Infor = 1 - exp(-size / scale). Default 4.
    pub information_scale: f64,
    /// What turning by one radian costs, metres. Default 0.5.
    pub turn_cost_m_per_rad: f64,
    /// Added to every cost, so that frontiers next to the robot are compared by their size, metres.
    /// Default 1.
    pub base_cost_m: f64,
}

impl Default for UtilityConfig {
    fn default() -> Self {
        Self { information_scale: 4.0, turn_cost_m_per_rad: 0.5, base_cost_m: 1.0 }
    }
}

/// U of one frontier: `size` as counted by the frontier search, `distance_m` the length of the way
/// there, `turn_rad` how far the robot must turn to set off.
#[must_use]
pub fn utility(size: usize, distance_m: f64, turn_rad: f64, config: &UtilityConfig) -> f64 {
    let information = 1.0 - (-(size as f64) / config.information_scale).exp();
    let cost = config.base_cost_m + distance_m + config.turn_cost_m_per_rad * wrap_angle(turn_rad).abs();
    information / cost.max(1e-3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn larger_nearer_and_straight_ahead_is_better() {
        let config = UtilityConfig::default();
        let reference = utility(5, 3.0, 0.5, &config);
        assert!(utility(9, 3.0, 0.5, &config) > reference);
        assert!(utility(5, 2.0, 0.5, &config) > reference);
        assert!(utility(5, 3.0, -0.2, &config) > reference);
        assert!((utility(5, 3.0, std::f64::consts::TAU + 0.5, &config) - reference).abs() < 1e-9);
    }

    #[test]
    fn nothing_farther_beats_the_bound() {
        let config = UtilityConfig::default();
        assert!(utility(1000, 8.1, 0.0, &config) < utility(usize::MAX, 8.0, 0.0, &config));
        assert!(utility(usize::MAX, f64::INFINITY, 0.0, &config).abs() < 1e-12);
    }
}
