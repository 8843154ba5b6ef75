//! What a scanner, a camera and a bumper meet of somebody: an upright cylinder.

use fht_perception::pose::Point2;
use nalgebra::Vector2;
use parry3d::math::Vector;

/// Somebody, or another robot: an upright cylinder on the floor, world frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body {
    /// Where it stands.
    pub position: Point2,
    /// How it moves, metres per second.
    pub velocity: Vector2<f64>,
    /// Radius, metres.
    pub radius_m: f64,
    /// Height, metres.
    pub height_m: f64,
    /// Whose it is.
    pub kind: BodyKind,
}

/// Whose a body is: scanner and bumper meet all alike, cameras see the difference.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BodyKind {
    /// Somebody.
    Person,
    /// Another robot.
    Robot,
}

/// A robot's housing, red, green, blue, 0 to 255.
const HOUSING: [f32; 3] = [36.0, 38.0, 42.0];
/// What people wear, by their number: red, green, blue, 0 to 255.
const CLOTHES: [[f32; 3]; 6] = [
    [52.0, 60.0, 88.0],
    [120.0, 40.0, 44.0],
    [70.0, 90.0, 62.0],
    [150.0, 140.0, 128.0],
    [40.0, 40.0, 44.0],
    [172.0, 130.0, 70.0],
];

impl Body {
    /// Distance along a ray of a plane to this body's side, metres: `ahead` has length `slope`, its
    /// part in the plane of a unit vector in space. None where the ray begins inside or passes.
    fn meets(&self, from: Point2, ahead: Vector2<f64>) -> Option<f64> {
        let slope_squared = ahead.norm_squared();
        if slope_squared < 1e-9 {
            return None;
        }
        let to = self.position - from;
        let along = to.dot(&ahead) / slope_squared;
        let beside = to.norm_squared() - along * along * slope_squared;
        let half = (self.radius_m * self.radius_m - beside) / slope_squared;
        if half < 0.0 {
            return None;
        }
        Some(along - half.sqrt()).filter(|distance| *distance > 0.0)
    }
}

/// Distance to the first body on a level ray at a height, metres.
pub(crate) fn range(bodies: &[Body], from: Point2, ahead: Vector2<f64>, height_m: f64) -> Option<f64> {
    let tall = bodies.iter().filter(|body| body.height_m > height_m);
    tall.filter_map(|body| body.meets(from, ahead)).min_by(f64::total_cmp)
}

/// The first body on a ray through space: its distance, metres, and its colour there.
pub(crate) fn seen(bodies: &[Body], origin: Vector, direction: Vector) -> Option<(f32, [f32; 3])> {
    let from = Point2::new(f64::from(origin.x), f64::from(origin.y));
    let ahead = Vector2::new(f64::from(direction.x), f64::from(direction.y));
    let met = bodies.iter().enumerate().filter_map(|(number, body)| {
        let distance = body.meets(from, ahead)?;
        let height = f64::from(origin.z) + distance * f64::from(direction.z);
        (height > 0.0 && height < body.height_m).then_some((distance, number, height / body.height_m))
    });
    let (distance, number, share) = met.min_by(|a, b| a.0.total_cmp(&b.0))?;
    // Face, clothes, trousers.
    let colour = match share {
        _ if bodies[number].kind == BodyKind::Robot => HOUSING,
        0.86.. => [190.0, 150.0, 128.0],
        0.48.. => CLOTHES[number % CLOTHES.len()],
        _ => CLOTHES[(number / 2 + 3) % CLOTHES.len()].map(|level| level * 0.6),
    };
    Some((distance as f32, colour))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn body(x: f64, y: f64) -> Body {
        Body {
            position: Point2::new(x, y),
            velocity: Vector2::zeros(),
            radius_m: 0.2,
            height_m: 1.7,
            kind: BodyKind::Person,
        }
    }

    #[test]
    fn a_ray_meets_the_nearest_side_and_passes_what_it_does_not_touch() {
        let bodies = [body(3.0, 0.1), body(2.0, 0.3), body(-1.0, 0.0)];
        let met = range(&bodies, Point2::origin(), Vector2::new(1.0, 0.0), 0.18).expect("somebody");
        assert!((met - (3.0 - (0.04_f64 - 0.01).sqrt())).abs() < 1e-9, "{met}");
        assert_eq!(range(&bodies, Point2::origin(), Vector2::new(1.0, 0.0), 1.8), None, "over all heads");
        assert_eq!(range(&bodies, Point2::origin(), Vector2::new(0.0, 1.0), 0.18), None);
    }

    #[test]
    fn a_camera_sees_somebody_up_to_the_head_and_no_farther() {
        let bodies = [body(2.0, 0.0)];
        let look = |slope: f32| {
            let scale = 1.0 / (1.0 + slope * slope).sqrt();
            seen(&bodies, Vector::new(0.0, 0.0, 1.0), Vector::new(scale, 0.0, slope * scale))
        };
        let (distance, _) = look(0.2).expect("the chest");
        assert!((distance - 1.8 * (1.04_f32).sqrt()).abs() < 1e-3, "{distance}");
        assert!(look(0.5).is_none() && look(-0.6).is_none());
    }
}
