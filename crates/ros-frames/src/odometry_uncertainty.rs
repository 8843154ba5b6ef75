//! How uncertain a pose by the wheels is: a covariance that each step carries on, as in the motion
//! model of Thrun, Burgard and Fox, *Probabilistic Robotics*, section 5.4.
//!
//! The errors of two steps are independent, and their variances grow with the way and the turn of
//! a step, not with their squares. So it does not matter in how many frames a way is driven.

use fht_perception::pose::{Pose2, wrap_angle};
use nalgebra::{Matrix3, Vector3};

/// Variance of the distance, square metres per metre: 5 cm after one metre, half a metre after a
/// hundred. The simulator's wheels are off by 2 % for a whole run, so by 5 cm after 2.5 m one way.
const DISTANCE_M2_PER_M: f64 = 0.05 * 0.05;
/// Variance of the heading by driving, square radians per metre: 0.5° after one metre, as the
/// heading of the simulator's wheels walks.
const HEADING_RAD2_PER_M: f64 = 0.5_f64.to_radians() * 0.5_f64.to_radians();
/// Variance of the heading by turning, square radians per radian: 0.02 rad after one radian. The
/// simulator's wheels are off by 2 % of how far they turn one way.
const HEADING_RAD2_PER_RAD: f64 = 0.02 * 0.02;
/// Standard deviations at the first pose, metres and radians. It makes the frame `odom` and so is
/// exact, but filters divide by variances.
const FIRST_M: f64 = 0.01;
const FIRST_RAD: f64 = 0.1_f64.to_radians();

/// The covariance of x, y and yaw in the frame `odom`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PoseUncertainty {
    covariance: Matrix3<f64>,
}

impl Default for PoseUncertainty {
    fn default() -> Self {
        let variances = Vector3::new(FIRST_M, FIRST_M, FIRST_RAD).map(|sigma| sigma * sigma);
        Self { covariance: Matrix3::from_diagonal(&variances) }
    }
}

impl PoseUncertainty {
    /// Carries it on from one pose to the next, both `odom_from_base`.
    pub(crate) fn carry(&mut self, from: &Pose2, to: &Pose2) {
        let way = to.translation.vector - from.translation.vector;
        let driven_m = way.norm();
        let turned_rad = wrap_angle(to.rotation.angle() - from.rotation.angle()).abs();
        // Of the heading that was wrong before, the end of the step is off to the side.
        let jacobian = Matrix3::new(1.0, 0.0, -way.y, 0.0, 1.0, way.x, 0.0, 0.0, 1.0);
        // A heading error that builds up evenly along the step: to the side it is the integral.
        let yaw = HEADING_RAD2_PER_M * driven_m + HEADING_RAD2_PER_RAD * turned_rad;
        let (along, aside) = (DISTANCE_M2_PER_M * driven_m, yaw * driven_m.powi(2) / 3.0);
        let aside_yaw = yaw * driven_m / 2.0;
        let own = Matrix3::new(along, 0.0, 0.0, 0.0, aside, aside_yaw, 0.0, aside_yaw, yaw);
        let bearing = way.y.atan2(way.x);
        let turned = Matrix3::new_rotation(bearing);
        let covariance = jacobian * self.covariance * jacobian.transpose() + turned * own * turned.transpose();
        // Rounding leaves both halves a little different.
        self.covariance = (covariance + covariance.transpose()) * 0.5;
    }

    /// The covariance of x, y and yaw.
    pub(crate) fn covariance(&self) -> &Matrix3<f64> {
        &self.covariance
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_perception::pose::pose;

    /// What is known after `steps` even steps of `metres` and `radians` in all, straight on, and
    /// then on the spot.
    fn after(metres: f64, radians: f64, steps: u32) -> Matrix3<f64> {
        let mut known = PoseUncertainty::default();
        let mut at = Pose2::identity();
        for (forward_m, turn_rad) in [(metres, 0.0), (0.0, radians)] {
            for _ in 0..steps {
                let next = at * pose(forward_m / f64::from(steps), 0.0, turn_rad / f64::from(steps));
                known.carry(&at, &next);
                at = next;
            }
        }
        *known.covariance()
    }

    #[test]
    fn it_does_not_depend_on_how_many_frames_there_are() {
        let (few, many) = (after(20.0, 6.0, 10), after(20.0, 6.0, 4000));
        assert!((few - many).norm() < 1e-6 * many.norm(), "{few} {many}");
    }

    #[test]
    fn straight_on_all_of_it_grows() {
        let traces = [0.0, 1.0, 5.0, 20.0, 100.0].map(|metres| after(metres, 0.0, 100).trace());
        assert!(traces.is_sorted_by(|less, more| less < more), "{traces:?}");
        let known = after(100.0, 0.0, 500);
        assert!((0.3..1.0).contains(&known[(0, 0)].sqrt()), "half a metre along: {known}");
        assert!((3.0..8.0).contains(&known[(1, 1)].sqrt()), "a few per cent aside: {known}");
    }

    #[test]
    fn an_hour_of_exploring_leaves_it_sane() {
        let mut known = PoseUncertainty::default();
        let (mut at, mut volume) = (Pose2::identity(), known.covariance().determinant());
        let (mut driven_m, mut turned_rad) = (0.0, 0.0);
        // To and fro in a room of 15 m, 5 frames a second: a turn of 180° in place at each end.
        for frame in 0..18_000_u32 {
            let is_turn = frame % 200 >= 150;
            let step = if is_turn { pose(0.0, 0.0, std::f64::consts::PI / 50.0) } else { pose(0.1, 0.0, 0.0) };
            let next = at * step;
            let before = *known.covariance();
            known.carry(&at, &next);
            at = next;
            driven_m += step.translation.vector.norm();
            turned_rad += step.rotation.angle();
            let now = known.covariance();
            assert!(now.cholesky().is_some(), "frame {frame}: not positive definite: {now}");
            // On the way back the position is better known again; of all together never more is.
            assert!(now[(2, 2)] >= before[(2, 2)] && now.determinant() >= volume * (1.0 - 1e-6), "frame {frame}");
            volume = now.determinant();
            if frame == 1_600 {
                let sigmas = now.diagonal().map(f64::sqrt);
                assert!((115.0..125.0).contains(&driven_m) && turned_rad > 25.0, "{driven_m} {turned_rad}");
                assert!(sigmas.x < 5.0 && sigmas.y < 5.0 && (0.05..0.3).contains(&sigmas.z), "{sigmas}");
            }
        }
        let sigmas = known.covariance().diagonal().map(f64::sqrt);
        assert!(driven_m > 1_300.0 && sigmas.x < 20.0 && sigmas.y < 20.0 && sigmas.z < 0.8, "{sigmas}");
    }
}
