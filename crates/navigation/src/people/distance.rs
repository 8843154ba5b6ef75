//! Commands that keep a distance from people.
//!
//! The distances follow ISO 13855, as the standards for mobile robots (ISO 3691-4, ISO 13482) take
//! it: S = K · T + C, with K = 1.6 m/s for somebody who walks, T the time until the robot stands,
//! and C for what the scanner does not see.

use super::bystanders::Bystander;
use crate::motion::position_after;
use fht_perception::frame::Twist;
use fht_proto::Footprint;
use serde::{Deserialize, Serialize};

/// How near a robot comes to people. Distances are between the robot's edge and what is seen of
/// somebody.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct DistanceConfig {
    /// Radius of the robot around its base, metres. Default 0.105 (TurtleBot3 Burger).
    pub robot_radius_m: f64,
    /// Kept from somebody who walks, metres: 1.6 m/s · 0.25 s (a frame, and the wheels) + 0.05 m.
    /// Default 0.45. The robot stands rather than come nearer.
    pub walking_m: f64,
    /// Kept from somebody who stands, metres. Default 0.15.
    pub standing_m: f64,
    /// Somebody's way, and the robot's, are followed so far ahead, seconds. Default 1.2.
    pub horizon_s: f64,
    /// Within `slow_m` of somebody ahead the robot is slower, down to this at the distance that it
    /// keeps, metres per second. Default 0.15: it stands within a step.
    pub slow_mps: f64,
    /// The robot slows down from this distance on, metres. Default 1.2 (Hall's personal space).
    pub slow_m: f64,
    /// The robot's greatest speed, metres per second, at `slow_m` and beyond. Default 0.5.
    pub full_mps: f64,
}

impl DistanceConfig {
    /// For a robot of a footprint.
    #[must_use]
    pub fn of(footprint: &Footprint) -> Self {
        Self {
            robot_radius_m: footprint.circumscribed_radius_m(),
            walking_m: 0.45,
            standing_m: 0.15,
            horizon_s: 1.2,
            slow_mps: 0.15,
            slow_m: 1.2,
            full_mps: 0.5,
        }
    }

    fn kept_m(&self, somebody: &Bystander) -> f64 {
        if somebody.is_walking { self.walking_m } else { self.standing_m }
    }

    /// The greatest speed near somebody ahead.
    fn limit_mps(&self, somebody: &Bystander) -> f64 {
        let gap_m = somebody.position.coords.norm() - self.robot_radius_m;
        let kept_m = self.kept_m(somebody);
        let share = ((gap_m - kept_m) / (self.slow_m - kept_m)).clamp(0.0, 1.0);
        self.slow_mps + share * (self.full_mps - self.slow_mps)
    }
}

impl Default for DistanceConfig {
    fn default() -> Self {
        Self::of(&Footprint::default())
    }
}

/// Steps of the prediction within the horizon.
const STEPS: u32 = 12;
/// Speeds that are tried, in order, as parts of the command.
const FACTORS: [f64; 6] = [1.0, 0.75, 0.5, 0.35, 0.2, 0.1];

/// The fastest command along the same arc that brings the robot no nearer to anybody than it may
/// come, and no nearer than standing would where somebody comes by himself. If there is none the
/// robot only turns. `people` are in the frame of the robot's base.
#[must_use]
pub fn keep_distance(command: Twist, people: &[Bystander], config: &DistanceConfig) -> Twist {
    if command.linear_mps == 0.0 || people.is_empty() {
        return command; // A disc that turns on the spot comes nearer to nobody.
    }
    let is_ahead = |somebody: &&Bystander| somebody.position.x * command.linear_mps.signum() > -0.1;
    let limits = people.iter().filter(is_ahead).map(|somebody| config.limit_mps(somebody));
    let slow = limits.fold(command, Twist::limited);
    let scaled =
        |factor: f64| Twist { linear_mps: slow.linear_mps * factor, angular_radps: slow.angular_radps * factor };
    let is_kept = |twist: &Twist| people.iter().all(|somebody| keeps(*twist, somebody, config));
    let found = FACTORS.into_iter().map(scaled).find(is_kept);
    found.unwrap_or(Twist { linear_mps: 0.0, ..slow })
}

fn keeps(twist: Twist, somebody: &Bystander, config: &DistanceConfig) -> bool {
    let kept_m = config.kept_m(somebody) + config.robot_radius_m;
    (1..=STEPS).all(|step| {
        let seconds = config.horizon_s * f64::from(step) / f64::from(STEPS);
        let there = somebody.position + somebody.velocity * seconds;
        let apart_m = (there - position_after(twist, seconds)).norm();
        apart_m >= kept_m || apart_m >= there.coords.norm() - 1e-6
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_perception::pose::Point2;
    use nalgebra::Vector2;

    const AHEAD: Twist = Twist { linear_mps: 0.5, angular_radps: 0.0 };

    fn somebody(place: (f64, f64), velocity: (f64, f64)) -> Bystander {
        let velocity = Vector2::new(velocity.0, velocity.1);
        Bystander { position: Point2::new(place.0, place.1), velocity, is_walking: velocity.norm() > 0.25 }
    }

    fn speed(place: (f64, f64), velocity: (f64, f64)) -> f64 {
        keep_distance(AHEAD, &[somebody(place, velocity)], &DistanceConfig::default()).linear_mps
    }

    #[test]
    fn a_walker_who_crosses_in_front_makes_the_robot_stop_and_one_who_is_far_does_not() {
        assert_eq!(speed((0.5, 0.8), (0.0, -1.3)), 0.0);
        assert_eq!(speed((0.5, 0.0), (0.0, -1.3)), 0.0);
        assert!((speed((4.0, 1.0), (0.0, 1.3)) - 0.5).abs() < 1e-9);
        assert!((speed((-1.5, 0.0), (-1.0, 0.0)) - 0.5).abs() < 1e-9, "behind, and going");
    }

    #[test]
    fn beside_somebody_who_stands_the_robot_passes_slowly_and_before_him_it_stops() {
        let passing = speed((0.3, 0.4), (0.0, 0.0));
        assert!(passing > 0.1 && passing < 0.3, "{passing}");
        assert_eq!(speed((0.27, 0.0), (0.0, 0.0)), 0.0);
        let back = Twist { linear_mps: -0.15, angular_radps: 0.0 };
        let away = keep_distance(back, &[somebody((0.27, 0.0), (0.0, 0.0))], &DistanceConfig::default());
        assert_eq!(away, back, "away from him it may go");
    }
}
