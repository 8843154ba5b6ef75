//! How wrong a pose becomes that is carried along a way: by odometry, or over a map that is not
//! exact itself.

use crate::pose::{Pose2, wrap_angle};
use nalgebra::{Matrix3, Vector2};
use serde::{Deserialize, Serialize};

/// How wrong odometry becomes with motion. All values are one sigma.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct OdometryDrift {
    /// Position error per distance driven, m/m. Default 0.02.
    pub position_per_m: f64,
    /// Heading error per root of distance driven, rad/√m. Default 0.4°.
    pub yaw_per_sqrt_m: f64,
    /// Heading error per angle turned, rad/rad. Default 0.01.
    pub yaw_per_rad: f64,
    /// Position error between any two instants, metres. Default 0.01.
    pub position_floor_m: f64,
    /// Heading error between any two instants, radians. Default 0.15°.
    pub yaw_floor_rad: f64,
}

impl Default for OdometryDrift {
    fn default() -> Self {
        Self {
            position_per_m: 0.02,
            yaw_per_sqrt_m: 0.4_f64.to_radians(),
            yaw_per_rad: 0.01,
            position_floor_m: 0.01,
            yaw_floor_rad: 0.15_f64.to_radians(),
        }
    }
}

impl OdometryDrift {
    /// Standard deviations (position m, heading rad) after `driven_m` metres and `turned_rad`
    /// radians.
    #[must_use]
    pub fn sigmas(&self, driven_m: f64, turned_rad: f64) -> (f64, f64) {
        let walk = self.yaw_per_sqrt_m * self.yaw_per_sqrt_m * driven_m.max(0.0);
        let yaw = (walk + (self.yaw_per_rad * turned_rad).powi(2) + self.yaw_floor_rad.powi(2)).sqrt();
        // A heading error that builds up evenly displaces the end by yaw·distance/√3.
        let sideways = yaw * driven_m / 3.0_f64.sqrt();
        let position = (self.position_per_m * driven_m).hypot(self.position_floor_m).hypot(sideways);
        (position, yaw)
    }
}

/// The difference `a ⊖ b` as (x, y) in their common frame and yaw wrapped to (-π, π].
#[must_use]
pub fn difference(a: &Pose2, b: &Pose2) -> nalgebra::Vector3<f64> {
    let xy: Vector2<f64> = a.translation.vector - b.translation.vector;
    nalgebra::Vector3::new(xy.x, xy.y, wrap_angle(a.rotation.angle() - b.rotation.angle()))
}

/// Covariance of the pose after moving by odometry from `from` to `to` (both in the map frame): the
/// heading error at the start becomes a position error at the end, and the odometry adds its own.
#[must_use]
pub fn propagate(
    covariance: &Matrix3<f64>,
    from: &Pose2,
    to: &Pose2,
    noise: &OdometryDrift,
    driven_m: f64,
    turned_rad: f64,
) -> Matrix3<f64> {
    let moved = to.translation.vector - from.translation.vector;
    let jacobian = Matrix3::new(1.0, 0.0, -moved.y, 0.0, 1.0, moved.x, 0.0, 0.0, 1.0);
    let (position, yaw) = noise.sigmas(driven_m, turned_rad);
    let own = Matrix3::from_diagonal(&nalgebra::Vector3::new(position * position, position * position, yaw * yaw));
    jacobian * covariance * jacobian.transpose() + own
}
