//! The end of a drive: on the spot, to the goal's heading.

use fht_perception::frame::Twist;
use fht_perception::pose::wrap_angle;
use serde::{Deserialize, Serialize};

/// How the robot turns at its goal.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct FinalTurnConfig {
    /// The heading counts as reached this near to it, radians. Default 1°.
    pub reach_rad: f64,
    /// Slowest turn, radians per second. Default 0.05.
    pub least_radps: f64,
    /// The turn fails after this long, seconds. Default 30.
    pub patience_s: f64,
    /// The robot drives back to a goal that it has left by this much meanwhile, metres. Default
    /// 0.15 beyond where the goal counts as reached.
    pub stray_m: f64,
}

impl Default for FinalTurnConfig {
    fn default() -> Self {
        Self { reach_rad: 1.0_f64.to_radians(), least_radps: 0.05, patience_s: 30.0, stray_m: 0.15 }
    }
}

/// What is left to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Turn {
    /// Turn so.
    On(Twist),
    /// Nothing.
    Done,
    /// It does not get round; this angle is left, radians.
    Failed(f64),
}

/// A robot at its goal.
#[derive(Clone, Debug, Default)]
pub(super) struct FinalTurn {
    began_us: Option<u64>,
}

impl FinalTurn {
    /// The robot is not at its goal.
    pub(super) fn end(&mut self) {
        self.began_us = None;
    }

    /// Whether the robot has come to its goal and turns.
    pub(super) fn has_begun(&self) -> bool {
        self.began_us.is_some()
    }

    /// Turns from `heading` to `wanted` (radians, one frame), at most so fast. Half of the angle
    /// each `period_s` (seconds) does not overshoot.
    pub(super) fn step(
        &mut self,
        (heading, wanted): (f64, f64),
        now_us: u64,
        (most_radps, period_s): (f64, f64),
        config: &FinalTurnConfig,
    ) -> Turn {
        let began_us = *self.began_us.get_or_insert(now_us);
        let left_rad = wrap_angle(wanted - heading);
        if left_rad.abs() <= config.reach_rad {
            return Turn::Done;
        }
        if now_us.saturating_sub(began_us) as f64 / 1e6 > config.patience_s {
            return Turn::Failed(left_rad);
        }
        let speed_radps = (0.5 * left_rad.abs() / period_s).max(config.least_radps).min(most_radps);
        Turn::On(Twist { linear_mps: 0.0, angular_radps: speed_radps.copysign(left_rad) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Turns a robot that obeys; returns its heading and the number of commands.
    fn turned(from: f64, to: f64, obeys: f64) -> (f64, usize, Turn) {
        let (config, mut turn, mut heading) = (FinalTurnConfig::default(), FinalTurn::default(), from);
        for frame in 0..1000 {
            match turn.step((heading, to), frame * 200_000, (1.5, 0.2), &config) {
                Turn::On(twist) => heading += obeys * twist.angular_radps * 0.2,
                end => return (heading, frame as usize, end),
            }
        }
        panic!("no end");
    }

    #[test]
    fn it_turns_the_short_way_and_quickly() {
        for (from, to) in [(0.0, 1.5), (0.0, -1.5), (3.0, -3.0), (-0.02, 0.01), (1.0, 1.0 - std::f64::consts::PI)] {
            let (heading, commands, end) = turned(from, to, 1.0);
            assert_eq!(end, Turn::Done);
            assert!(wrap_angle(heading - to).abs() < 0.0175 && commands < 25, "{from} to {to}: {heading}, {commands}");
            assert!((heading - from).abs() < std::f64::consts::PI + 0.02);
        }
    }

    #[test]
    fn a_robot_that_does_not_obey_is_not_waited_for_for_ever() {
        let (_, commands, end) = turned(0.0, 1.0, 0.0);
        assert!(matches!(end, Turn::Failed(left) if (left - 1.0).abs() < 1e-9) && commands <= 151, "{commands}");
    }
}
