//! Headings as quaternions and back.

use fht_ros_messages::msg::Quaternion;
use nalgebra::{UnitComplex, UnitQuaternion};
use std::f64::consts::{PI, TAU};

/// Quaternions shorter than this are not rotations (some drivers leave all four numbers at 0).
const LEAST_NORM: f64 = 1e-3;

/// The normalised rotation; `None` if the quaternion is not one.
pub(crate) fn rotation(q: &Quaternion) -> Option<UnitQuaternion<f64>> {
    let quaternion = nalgebra::Quaternion::new(q.w, q.x, q.y, q.z);
    let norm = quaternion.norm();
    (norm.is_finite() && norm > LEAST_NORM).then(|| UnitQuaternion::from_quaternion(quaternion))
}

/// The heading of a rotation, radians in [-π, π]: where the x axis points, seen from above.
/// `None` if the quaternion is not a rotation.
#[must_use]
pub fn yaw_of(q: &Quaternion) -> Option<f64> {
    let rotation = rotation(q)?;
    if q.x == 0.0 && q.y == 0.0 {
        // A rotation about z only: this form is the exact inverse of `quaternion_of`.
        return Some(half_turns(q.z, q.w));
    }
    let ahead = rotation * nalgebra::Vector3::x();
    Some(ahead.y.atan2(ahead.x))
}

fn half_turns(z: f64, w: f64) -> f64 {
    let yaw = 2.0 * z.atan2(w);
    if yaw > PI {
        yaw - TAU
    } else if yaw < -PI {
        yaw + TAU
    } else {
        yaw
    }
}

/// The rotation about z by `yaw` radians in [-π, π], such that [`yaw_of`] gives the same number,
/// bit for bit: a recorded run replays to the same map.
#[must_use]
pub fn quaternion_of(yaw: f64) -> Quaternion {
    /// How much each attempt shortens the pair: too little to matter, but it rounds differently.
    const SHORTER: f64 = 1.0 / (1_u64 << 40) as f64;
    let (z, w) = (yaw / 2.0).sin_cos();
    // Rounding sometimes makes the nearest pair miss by the last bit. Then a neighbouring pair
    // fits, or a slightly shorter one: one in a thousand headings needs that, one in a hundred
    // thousand twice.
    let shorter = (0..64_u32).map(|attempt| 1.0 - f64::from(attempt) * SHORTER).map(|length| (z * length, w * length));
    let exact = shorter
        .flat_map(|(z, w)| [0, 1, -1].map(|step| (nudge(z, step), w)))
        .find(|(z, w)| half_turns(*z, *w).to_bits() == yaw.to_bits());
    let (z, w) = exact.unwrap_or((z, w));
    Quaternion { x: 0.0, y: 0.0, z, w }
}

/// The heading whose cosine and sine are exactly those of `rotation`, if there is one; else the
/// nearest, radians.
#[must_use]
pub fn heading_of(rotation: &UnitComplex<f64>) -> f64 {
    let nearest = rotation.angle();
    // The arc tangent of a rounded sine and cosine may miss the original angle by some last bits.
    let steps = (0..=8_i32).flat_map(|step| [step, -step]);
    let exact = steps.map(|step| nudge(nearest, step)).find(|yaw| {
        let made = UnitComplex::new(*yaw);
        made.re.to_bits() == rotation.re.to_bits() && made.im.to_bits() == rotation.im.to_bits()
    });
    exact.filter(|yaw| yaw.abs() <= PI).unwrap_or(nearest)
}

/// The number `steps` representable numbers away.
fn nudge(value: f64, steps: i32) -> f64 {
    (0..steps.abs()).fold(value, |value, _| if steps > 0 { value.next_up() } else { value.next_down() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn special_headings_come_back() {
        // 0.12483903495459238: no pair within 80 last bits of the nearest recovers it, only shorter
        // ones.
        for yaw in [
            0.0,
            -0.0,
            0.12499520326311165,
            0.12483903495459238,
            PI,
            -PI,
            PI / 2.0,
            -PI / 2.0,
            f64::MIN_POSITIVE,
            1e-12,
            PI.next_down(),
            3.0,
        ] {
            assert_eq!(yaw_of(&quaternion_of(yaw)).unwrap().to_bits(), yaw.to_bits(), "{yaw}");
        }
    }

    #[test]
    fn what_is_no_rotation_is_refused() {
        for (z, w) in [(0.0, 0.0), (f64::NAN, 1.0), (f64::INFINITY, 0.0)] {
            assert_eq!(yaw_of(&Quaternion { x: 0.0, y: 0.0, z, w }), None);
        }
        assert_eq!(yaw_of(&Quaternion { x: 0.0, y: 0.0, z: 2.0, w: 2.0 }), Some(PI / 2.0));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]
        #[test]
        fn every_heading_comes_back_bit_for_bit(yaw in -PI..=PI, shift in 0..60_i32) {
            for yaw in [yaw, yaw * 0.5_f64.powi(shift)] {
                prop_assert_eq!(yaw_of(&quaternion_of(yaw)).unwrap().to_bits(), yaw.to_bits());
            }
        }

        #[test]
        fn every_rotation_made_from_a_heading_comes_back_bit_for_bit(yaw in -PI..=PI, shift in 0..60_i32) {
            for yaw in [yaw, yaw * 0.5_f64.powi(shift)] {
                let rotation = UnitComplex::new(yaw);
                let back = UnitComplex::new(yaw_of(&quaternion_of(heading_of(&rotation))).unwrap());
                prop_assert_eq!([back.re.to_bits(), back.im.to_bits()], [rotation.re.to_bits(), rotation.im.to_bits()]);
            }
        }

        #[test]
        fn a_heading_of_a_tilted_frame_is_where_x_points(yaw in -3.0..3.0_f64, roll in -0.5..0.5_f64) {
            let q = UnitQuaternion::from_euler_angles(roll, 0.0, yaw);
            let found = yaw_of(&Quaternion { x: q.i, y: q.j, z: q.k, w: q.w }).unwrap();
            prop_assert!((found - yaw).abs() < 1e-9);
        }
    }
}
