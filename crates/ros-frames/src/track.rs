//! Odometry: poses by time, and interpolation between them.

use fht_perception::pose::{Pose2, pose, wrap_angle};
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Most poses that are kept: a few seconds of the fastest odometry.
const TRACK_LIMIT: usize = 4096;
/// Poses farther from the origin than this are rejected, metres.
const FARTHEST_M: f64 = 1e6;

/// Limits of plausible odometry.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct OdometryLimits {
    /// Longest gap between two messages that is interpolated, seconds. 0.5.
    pub longest_gap_s: f64,
    /// Top speed of the robot, metres per second; faster motion means that its odometry was reset.
    /// 20.
    pub max_speed_mps: f64,
}

impl Default for OdometryLimits {
    fn default() -> Self {
        Self { longest_gap_s: 0.5, max_speed_mps: 20.0 }
    }
}

/// Why a pose was rejected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PoseRefused {
    /// Not newer than the one before.
    NotNewer,
    /// Not finite, or a million metres away.
    Unusable,
}

/// What is known about the pose at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PoseLookup {
    /// The pose, interpolated.
    Known(Pose2),
    /// No pose is that new yet.
    Later,
    /// All poses are newer.
    Before,
    /// The poses before and after are too far apart in time.
    Gap,
}

/// The newest poses.
#[derive(Clone, Debug)]
pub struct OdometryTrack {
    config: OdometryLimits,
    /// Times (nanoseconds) and poses, oldest first.
    poses: VecDeque<(u64, Pose2)>,
    /// The last pose as the odometry reported it.
    raw: Option<Pose2>,
    /// Set when the odometry jumped: the motion continues from the pose before the jump.
    anchor: Option<Pose2>,
    jumps: u64,
}

impl OdometryTrack {
    /// No poses yet.
    #[must_use]
    pub fn new(config: OdometryLimits) -> Self {
        Self { config, poses: VecDeque::new(), raw: None, anchor: None, jumps: 0 }
    }

    /// How often the odometry was reset.
    #[must_use]
    pub fn jumps(&self) -> u64 {
        self.jumps
    }

    /// Takes a pose at `time_ns` nanoseconds. After a jump (a reset) the motion goes on from the
    /// pose before it.
    ///
    /// # Errors
    /// [`PoseRefused`].
    pub fn push(&mut self, time_ns: u64, odom_from_base: Pose2) -> Result<(), PoseRefused> {
        let at = odom_from_base.translation.vector;
        if !(at.norm() < FARTHEST_M && odom_from_base.rotation.angle().is_finite()) {
            return Err(PoseRefused::Unusable);
        }
        if let (Some(&(before_ns, before)), Some(raw)) = (self.poses.back(), self.raw) {
            if time_ns <= before_ns {
                return Err(PoseRefused::NotNewer);
            }
            let reach = 1.0 + self.config.max_speed_mps * (time_ns - before_ns) as f64 * 1e-9;
            if (at - raw.translation.vector).norm() > reach {
                self.jumps += 1;
                self.anchor = Some(before * odom_from_base.inverse());
            }
        }
        self.raw = Some(odom_from_base);
        // Without a jump the pose stays as it is, bit for bit.
        let pose = self.anchor.map_or(odom_from_base, |anchor| anchor * odom_from_base);
        self.poses.push_back((time_ns, pose));
        if self.poses.len() > TRACK_LIMIT {
            self.poses.pop_front();
        }
        Ok(())
    }

    /// The pose at `time_ns` nanoseconds.
    #[must_use]
    pub fn pose_at(&self, time_ns: u64) -> PoseLookup {
        let after = self.poses.partition_point(|(time, _)| *time < time_ns);
        match (after.checked_sub(1).map(|before| self.poses[before]), self.poses.get(after)) {
            (_, Some(&(time, pose))) if time == time_ns => PoseLookup::Known(pose),
            (_, None) => PoseLookup::Later,
            (None, Some(_)) => PoseLookup::Before,
            (Some((t0, a)), Some(&(t1, b))) => {
                if (t1 - t0) as f64 * 1e-9 > self.config.longest_gap_s {
                    return PoseLookup::Gap;
                }
                let share = (time_ns - t0) as f64 / (t1 - t0) as f64;
                PoseLookup::Known(between(&a, &b, share))
            }
        }
    }
}

/// The pose a `share` of the way from `a` to `b`: along a straight line, turning evenly through the
/// smaller angle.
fn between(a: &Pose2, b: &Pose2, share: f64) -> Pose2 {
    let at = a.translation.vector.lerp(&b.translation.vector, share);
    let turn = wrap_angle(b.rotation.angle() - a.rotation.angle());
    pose(at.x, at.y, a.rotation.angle() + share * turn)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    const SECOND: u64 = 1_000_000_000;

    fn track() -> OdometryTrack {
        OdometryTrack::new(OdometryLimits { longest_gap_s: 2.0, ..OdometryLimits::default() })
    }

    #[test]
    fn interpolates_across_the_seam_of_angles() {
        let mut track = track();
        track.push(SECOND, pose(0.0, 0.0, PI - 0.1)).unwrap();
        track.push(2 * SECOND, pose(1.0, 2.0, -PI + 0.1)).unwrap();
        let PoseLookup::Known(found) = track.pose_at(3 * SECOND / 2) else {
            panic!("{:?}", track.pose_at(3 * SECOND / 2))
        };
        assert!((found.translation.vector - nalgebra::Vector2::new(0.5, 1.0)).norm() < 1e-12);
        assert!(found.rotation.angle().abs() > PI - 1e-9, "{found}");
        assert_eq!(track.pose_at(2 * SECOND), PoseLookup::Known(pose(1.0, 2.0, -PI + 0.1)));
        assert_eq!(track.pose_at(SECOND / 2), PoseLookup::Before);
        assert_eq!(track.pose_at(3 * SECOND), PoseLookup::Later);
        track.push(9 * SECOND, pose(1.0, 2.0, 0.0)).unwrap();
        assert_eq!(track.pose_at(3 * SECOND), PoseLookup::Gap);
    }

    #[test]
    fn a_reset_of_the_odometry_does_not_move_the_robot() {
        let mut track = track();
        track.push(SECOND, pose(50.0, 0.0, 1.0)).unwrap();
        track.push(2 * SECOND, pose(0.0, 0.0, 0.0)).unwrap();
        track.push(3 * SECOND, pose(1.0, 0.0, 0.0)).unwrap();
        let PoseLookup::Known(found) = track.pose_at(3 * SECOND) else { panic!("unknown") };
        assert!((found.translation.vector - nalgebra::Vector2::new(50.0 + 1.0_f64.cos(), 1.0_f64.sin())).norm() < 1e-9);
        assert_eq!(track.jumps(), 1);
    }

    #[test]
    fn old_and_absurd_poses_are_refused() {
        let mut track = track();
        track.push(SECOND, pose(0.0, 0.0, 0.0)).unwrap();
        assert_eq!(track.push(SECOND, pose(0.0, 0.0, 0.0)), Err(PoseRefused::NotNewer));
        assert_eq!(track.push(SECOND / 2, pose(0.0, 0.0, 0.0)), Err(PoseRefused::NotNewer));
        for bad in [pose(f64::NAN, 0.0, 0.0), pose(1e9, 0.0, 0.0), pose(0.0, 0.0, f64::NAN)] {
            assert_eq!(track.push(2 * SECOND, bad), Err(PoseRefused::Unusable));
        }
    }
}
