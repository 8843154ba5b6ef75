//! The forces of Helbing and Molnár, "Social force model for pedestrian dynamics" (Physical Review
//! E 51, 1995), as accelerations.

use super::body::Body;
use super::config::PeopleConfig;
use nalgebra::Vector2;

/// Others farther than this are not looked at, metres.
const REACH_M: f64 = 4.0;

/// Towards the velocity that somebody would like (equation 2).
pub(super) fn drive(wanted: Vector2<f64>, velocity: Vector2<f64>, config: &PeopleConfig) -> Vector2<f64> {
    (wanted - velocity) / config.relaxation_s
}

/// Away from somebody else (equations 3, 4 and 8): by the ellipse that has the other's next step as
/// its foci. `heading` is where somebody wants to go; nothing where he stands.
pub(super) fn repulsion(
    apart: Vector2<f64>,
    other: &Body,
    heading: Vector2<f64>,
    config: &PeopleConfig,
) -> Vector2<f64> {
    let distance = apart.norm();
    if !(1e-6..REACH_M).contains(&distance) {
        return Vector2::zeros();
    }
    let step = other.velocity * config.foresight_s;
    let ahead = apart - step;
    let sum = distance + ahead.norm();
    let half_axis = 0.5 * (sum * sum - step.norm_squared()).max(1e-6).sqrt();
    let outwards = (apart / distance + ahead / ahead.norm().max(1e-6)) * (sum / (4.0 * half_axis));
    let strength = config.repulsion_m2ps2 / config.repulsion_range_m * (-half_axis / config.repulsion_range_m).exp();
    // Two who meet head on would stop each other for ever: everybody keeps a little to the right.
    let force = outwards.cap_magnitude(2.0) * strength;
    let force = force + Vector2::new(force.y, -force.x) * 0.1;
    let is_seen = heading.dot(&-force) >= force.norm() * config.sight_rad.cos();
    if heading == Vector2::zeros() || is_seen { force } else { force * config.behind }
}

/// Away from the nearest wall (equation 5): `away` is a unit vector or zero.
pub(super) fn wall(away: Vector2<f64>, clearance_m: f64, config: &PeopleConfig) -> Vector2<f64> {
    away * (config.wall_m2ps2 / config.wall_range_m * (-clearance_m / config.wall_range_m).exp())
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_perception::pose::Point2;

    #[test]
    fn others_push_away_more_when_they_come_and_less_from_behind() {
        let config = PeopleConfig::default();
        let other = |vx: f64| Body {
            position: Point2::origin(),
            velocity: Vector2::new(vx, 0.0),
            radius_m: 0.2,
            height_m: 1.7,
            kind: super::super::body::BodyKind::Person,
        };
        let apart = Vector2::new(1.5, 0.0);
        let of = |vx: f64, heading: f64| repulsion(apart, &other(vx), Vector2::new(heading, 0.0), &config).x;
        assert!(of(0.0, -1.0) > 0.0);
        // Whose next step does not lead through here: on its line there is no aside.
        assert!(of(0.5, -1.0) > 2.0 * of(0.0, -1.0), "one who comes");
        assert!((of(0.0, 1.0) - 0.5 * of(0.0, -1.0)).abs() < 1e-9, "one behind");
        assert_eq!(repulsion(Vector2::new(9.0, 0.0), &other(1.0), Vector2::zeros(), &config), Vector2::zeros());
    }

    #[test]
    fn somebody_gets_to_the_speed_that_he_likes() {
        let config = PeopleConfig::default();
        let (wanted, mut velocity) = (Vector2::new(1.3, 0.0), Vector2::zeros());
        (0..100).for_each(|_| velocity += drive(wanted, velocity, &config) * 0.02);
        assert!((velocity - wanted).norm() < 0.03, "{velocity}");
    }
}
