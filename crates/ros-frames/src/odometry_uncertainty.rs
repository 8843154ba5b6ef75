//! How uncertain a pose by the wheels is: a covariance that each step carries on.
//!
//! The wheels are off in distance and in turning by factors that stay as they are, so these errors
//! add up, and cancel when the robot turns back. The heading walks at random besides, with a
//! variance that grows with the way (Thrun, Burgard, Fox, *Probabilistic Robotics*, section 5.4).
//! So it does not matter in how many frames a way is driven.

use fht_perception::pose::{Pose2, wrap_angle};
use nalgebra::{Matrix3, Vector3};

/// Error of wheels in distance and in rotation, a fraction, constant over a run: the standard
/// deviation that the simulator's robot has, and more than a calibrated one.
pub(crate) const SCALE_SIGMA: f64 = 0.02;
/// Variance of the heading by driving, square radians per metre: 0.5° after one metre, as the
/// heading of the simulator's wheels walks.
const HEADING_RAD2_PER_M: f64 = 0.5_f64.to_radians() * 0.5_f64.to_radians();
/// Standard deviations at the first pose, metres and radians. It makes the frame `odom` and so is
/// exact, but filters divide by variances.
const FIRST_M: f64 = 0.01;
const FIRST_RAD: f64 = 0.1_f64.to_radians();

/// The covariance of x, y and yaw in the frame `odom`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PoseUncertainty {
    /// Of the heading's walk.
    walked: Matrix3<f64>,
    /// How the pose changes with the factor of the distance …
    by_distance: Vector3<f64>,
    /// … and with that of the rotation.
    by_rotation: Vector3<f64>,
}

impl Default for PoseUncertainty {
    fn default() -> Self {
        let variances = Vector3::new(FIRST_M, FIRST_M, FIRST_RAD).map(|sigma| sigma * sigma);
        Self {
            walked: Matrix3::from_diagonal(&variances),
            by_distance: Vector3::zeros(),
            by_rotation: Vector3::zeros(),
        }
    }
}

impl PoseUncertainty {
    /// Carries it on from one pose to the next, both `odom_from_base`.
    pub(crate) fn carry(&mut self, from: &Pose2, to: &Pose2) {
        let way = to.translation.vector - from.translation.vector;
        let driven_m = way.norm();
        let turned_rad = wrap_angle(to.rotation.angle() - from.rotation.angle());
        // Of the heading that was wrong before, the end of the step is off to the side.
        let jacobian = Matrix3::new(1.0, 0.0, -way.y, 0.0, 1.0, way.x, 0.0, 0.0, 1.0);
        self.by_distance = jacobian * self.by_distance + Vector3::new(way.x, way.y, 0.0);
        // A heading error that builds up evenly along the step: to the side it is the integral.
        let half_rad = turned_rad / 2.0;
        self.by_rotation = jacobian * self.by_rotation + Vector3::new(-way.y * half_rad, way.x * half_rad, turned_rad);
        let yaw = HEADING_RAD2_PER_M * driven_m;
        let (aside, aside_yaw) = (yaw * driven_m.powi(2) / 3.0, yaw * driven_m / 2.0);
        let own = Matrix3::new(0.0, 0.0, 0.0, 0.0, aside, aside_yaw, 0.0, aside_yaw, yaw);
        let turned = Matrix3::new_rotation(way.y.atan2(way.x));
        let walked = jacobian * self.walked * jacobian.transpose() + turned * own * turned.transpose();
        // Rounding leaves both halves a little different.
        self.walked = (walked + walked.transpose()) * 0.5;
    }

    /// The covariance of x, y and yaw.
    pub(crate) fn covariance(&self) -> Matrix3<f64> {
        let scales = [self.by_distance, self.by_rotation].map(|by| by * by.transpose() * SCALE_SIGMA.powi(2));
        self.walked + scales[0] + scales[1]
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
        known.covariance()
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
        assert!((1.9..2.1).contains(&known[(0, 0)].sqrt()), "2 % along: {known}");
        assert!((3.0..8.0).contains(&known[(1, 1)].sqrt()), "a few per cent aside: {known}");
    }

    #[test]
    fn turns_one_way_add_up_and_turns_back_cancel() {
        let left = after(0.0, 25.0, 500);
        assert!((0.49..0.51).contains(&left[(2, 2)].sqrt()), "2 % of 25 rad: {left}");
        let mut known = PoseUncertainty::default();
        let (here, there) = (pose(0.0, 0.0, 0.0), pose(0.0, 0.0, 1.0));
        for (from, to) in [(&here, &there), (&there, &here)].repeat(20) {
            known.carry(from, to);
        }
        assert!((known.covariance() - PoseUncertainty::default().covariance()).norm() < 1e-12);
    }

    #[test]
    fn an_hour_of_exploring_leaves_it_sane() {
        let mut known = PoseUncertainty::default();
        let (mut at, mut volume) = (Pose2::identity(), known.walked.determinant());
        let mut driven_m = 0.0;
        // To and fro in a room of 15 m, 5 frames a second: half a turn at each end, left and right.
        for frame in 0..18_000_u32 {
            let turn_rad = std::f64::consts::PI / if frame % 400 < 200 { 50.0 } else { -50.0 };
            let step = if frame % 200 >= 150 { pose(0.0, 0.0, turn_rad) } else { pose(0.1, 0.0, 0.0) };
            let next = at * step;
            let before = known.walked;
            known.carry(&at, &next);
            at = next;
            driven_m += step.translation.vector.norm();
            let now = known.covariance();
            assert!(now.cholesky().is_some(), "frame {frame}: not positive definite: {now}");
            // On the way back the position is better known again; of all together never more is.
            let walked = known.walked;
            assert!(walked[(2, 2)] >= before[(2, 2)] && walked.determinant() >= volume * (1.0 - 1e-6), "frame {frame}");
            volume = walked.determinant();
            if frame >= 1_600 {
                let sigmas = now.diagonal().map(f64::sqrt);
                assert!(sigmas.x.max(sigmas.y) < 0.05 * driven_m, "{sigmas} after {driven_m} m");
                assert!((0.05..0.5).contains(&sigmas.z), "{sigmas} after {driven_m} m");
            }
        }
        assert!((1_300.0..1_400.0).contains(&driven_m), "{driven_m}");
    }
}
