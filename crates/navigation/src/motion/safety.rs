//! Stopping before obstacles: a command against the newest scan.

use fht_perception::frame::{LaserScan, Twist};
use fht_perception::pose::Point2;
use fht_proto::Footprint;
use serde::{Deserialize, Serialize};

/// What the safety check assumes of the robot.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct SafetyConfig {
    /// Radius of the robot around its base, metres. Default 0.105 (TurtleBot3 Burger).
    pub robot_radius_m: f64,
    /// Kept free around the robot, metres. Default 0.03, three times the noise of the LiDAR
    /// ([`Footprint::stop_margin_m`]).
    pub margin_m: f64,
    /// How far ahead a command is followed, seconds. Default 0.8, four LiDAR frames.
    pub horizon_s: f64,
}

impl SafetyConfig {
    /// For a robot of a footprint.
    #[must_use]
    pub fn of(footprint: &Footprint) -> Self {
        let robot_radius_m = footprint.circumscribed_radius_m();
        Self { robot_radius_m, margin_m: footprint.stop_margin_m(), horizon_s: 0.8 }
    }
}

impl Default for SafetyConfig {
    fn default() -> Self {
        Self::of(&Footprint::default())
    }
}

/// Steps of the prediction within the horizon.
const PREDICTION_STEPS: u32 = 8;
/// Speeds that are tried, in order, as parts of the command.
const SPEED_FACTORS: [f64; 6] = [1.0, 0.8, 0.6, 0.4, 0.2, 0.1];

/// The fastest command along the same arc that, kept up for the horizon, does not bring the robot's
/// disc nearer than the margin to a return of the scan, or to something too near for the scanner.
/// If there is none the robot may only turn. Moving away from something that is already too near is
/// allowed.
#[must_use]
pub fn safe_command(command: Twist, scan: &LaserScan, config: &SafetyConfig) -> Twist {
    if !(command.linear_mps.is_finite() && command.angular_radps.is_finite()) {
        return Twist::default();
    }
    if command.linear_mps == 0.0 {
        return command; // A disc that turns on the spot sweeps nothing.
    }
    let keep = config.robot_radius_m + config.margin_m;
    let reach = keep + command.linear_mps.abs() * config.horizon_s;
    let mut points = scan.obstacles_in_base();
    points.retain(|point| point.coords.norm() < reach);
    let scaled =
        |factor: f64| Twist { linear_mps: command.linear_mps * factor, angular_radps: command.angular_radps * factor };
    SPEED_FACTORS
        .into_iter()
        .map(scaled)
        .find(|&twist| is_clear(twist, &points, keep, config.horizon_s))
        .unwrap_or(Twist { linear_mps: 0.0, ..command })
}

/// Whether no point comes within `keep_m` of the robot, or nearer if it is within already.
fn is_clear(twist: Twist, points: &[Point2], keep_m: f64, horizon_s: f64) -> bool {
    (1..=PREDICTION_STEPS).all(|step| {
        let centre = position_after(twist, horizon_s * f64::from(step) / f64::from(PREDICTION_STEPS));
        points.iter().all(|point| {
            let distance = (point - centre).norm();
            distance >= keep_m || distance >= point.coords.norm()
        })
    })
}

/// Where the base is after driving `twist` for `seconds`, in the frame of the base before: an arc
/// of a circle.
pub(crate) fn position_after(twist: Twist, seconds: f64) -> Point2 {
    let turned = twist.angular_radps * seconds;
    let length = twist.linear_mps * seconds;
    if turned.abs() < 1e-6 {
        return Point2::new(length, 0.0);
    }
    Point2::new(length * turned.sin() / turned, length * (1.0 - turned.cos()) / turned)
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_perception::pose::pose;
    use std::f64::consts::{FRAC_PI_2, TAU};

    /// A scan with one flat wall ahead at `distance` from the base, 2 m wide.
    fn wall_ahead(distance: f64) -> LaserScan {
        let increment = TAU / 360.0;
        let ranges_m = (0..360)
            .map(|beam| {
                let (sin, cos) = (f64::from(beam) * increment).sin_cos();
                let range = (distance + 0.032) / cos;
                if cos > 0.0 && (range * sin).abs() < 1.0 { range as f32 } else { f32::INFINITY }
            })
            .collect();
        LaserScan {
            base_from_sensor: pose(-0.032, 0.0, 0.0),
            angle_min: 0.0,
            angle_increment: increment,
            range_min_m: 0.12,
            range_max_m: 7.0,
            ranges_m,
        }
    }

    #[test]
    fn never_drives_into_a_wall() {
        let config = SafetyConfig::default();
        let mut x = 0.0;
        for _ in 0..100 {
            let twist = safe_command(Twist { linear_mps: 0.5, angular_radps: 0.0 }, &wall_ahead(2.0 - x), &config);
            x += twist.linear_mps * 0.2;
        }
        assert!(2.0 - x >= 0.105 + 0.025, "{x}");
        assert!(2.0 - x < 0.2, "{x}");
        let turn = Twist { linear_mps: 0.0, angular_radps: 1.0 };
        assert_eq!(safe_command(turn, &wall_ahead(0.13), &config), turn);
        let back = Twist { linear_mps: -0.1, angular_radps: 0.0 };
        assert_eq!(safe_command(back, &wall_ahead(0.13), &config), back);
        let bad = Twist { linear_mps: f64::NAN, angular_radps: 0.0 };
        assert_eq!(safe_command(bad, &wall_ahead(1.0), &config), Twist::default());
    }

    #[test]
    fn what_is_too_near_to_be_measured_is_not_driven_into() {
        let (config, forward) = (SafetyConfig::default(), Twist { linear_mps: 0.5, angular_radps: 0.0 });
        for too_near in [f32::NEG_INFINITY, 0.05] {
            let mut scan = wall_ahead(2.0);
            scan.ranges_m[..5].fill(too_near);
            assert!(safe_command(forward, &scan, &config).linear_mps.abs() < 1e-12, "{too_near}");
            let back = Twist { linear_mps: -0.1, angular_radps: 0.0 };
            assert_eq!(safe_command(back, &scan, &config), back);
        }
        let mut scan = wall_ahead(2.0);
        scan.ranges_m[..5].fill(f32::NAN);
        assert_eq!(safe_command(forward, &scan, &config), forward, "NaN says nothing");
    }

    #[test]
    fn an_arc_is_an_arc() {
        let quarter = position_after(Twist { linear_mps: FRAC_PI_2, angular_radps: FRAC_PI_2 }, 1.0);
        assert!((quarter - Point2::new(1.0, 1.0)).norm() < 1e-9);
    }
}
