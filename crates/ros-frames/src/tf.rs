//! The tree of coordinate frames, from transforms.

use crate::yaw::rotation;
use fht_perception::pose::{Pose2, pose};
use fht_ros_messages::msg::{TransformStamped, Vector3};
use nalgebra::{Isometry3, Translation3};
use std::collections::BTreeMap;

/// Most frames that are kept: more than any robot has, few enough to survive bad data.
const FRAME_LIMIT: usize = 4096;
/// Longest chain of frames; a longer one is a loop.
const CHAIN_LIMIT: usize = 64;

/// The newest transform of every frame to its parent.
#[derive(Clone, Debug, Default)]
pub struct TransformTree {
    parents: BTreeMap<String, (String, Isometry3<f64>)>,
}

/// Frame ids with and without the leading slash of ROS 1 are the same.
#[must_use]
pub fn frame_name(id: &str) -> &str {
    id.trim_start_matches('/')
}

impl TransformTree {
    /// Inserts a transform; `false` if it is not valid (no rotation, not finite, a frame within
    /// itself).
    pub fn insert(&mut self, stamped: &TransformStamped) -> bool {
        let (parent, child) = (frame_name(&stamped.header.frame_id), frame_name(&stamped.child_frame_id));
        let Vector3 { x, y, z } = stamped.transform.position;
        let Some(rotation) = rotation(&stamped.transform.orientation) else { return false };
        let is_known = self.parents.contains_key(child);
        if child == parent
            || ![x, y, z].iter().all(|v| v.is_finite())
            || (!is_known && self.parents.len() >= FRAME_LIMIT)
        {
            return false;
        }
        let parent_from_child = Isometry3::from_parts(Translation3::new(x, y, z), rotation);
        self.parents.insert(child.to_owned(), (parent.to_owned(), parent_from_child));
        true
    }

    /// The pose of frame `sensor` in frame `base`; `None` if no chain of transforms connects them.
    #[must_use]
    pub fn base_from(&self, base: &str, sensor: &str) -> Option<Isometry3<f64>> {
        let (base, sensor) = (self.ancestors(frame_name(base)), self.ancestors(frame_name(sensor)));
        let (ancestor_from_base, ancestor_from_sensor) = base
            .iter()
            .find_map(|(name, to_base)| sensor.iter().find(|(other, _)| other == name).map(|(_, to)| (to_base, to)))?;
        Some(ancestor_from_base.inverse() * ancestor_from_sensor)
    }

    /// The names of all frames, sorted.
    #[must_use]
    pub fn frames(&self) -> Vec<&str> {
        let mut frames: Vec<&str> =
            self.parents.iter().flat_map(|(child, (parent, _))| [child.as_str(), parent.as_str()]).collect();
        frames.sort_unstable();
        frames.dedup();
        frames
    }

    /// `name` and the frames above it, each with its transform from `name`.
    fn ancestors<'a>(&'a self, name: &'a str) -> Vec<(&'a str, Isometry3<f64>)> {
        let mut chain = vec![(name, Isometry3::identity())];
        while let Some((above_name, above)) = chain.last().copied()
            && let Some((parent, parent_from_child)) = self.parents.get(above_name)
            && chain.len() < CHAIN_LIMIT
        {
            chain.push((parent, parent_from_child * above));
        }
        chain
    }
}

/// How a planar scanner is mounted on the robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mount {
    /// Its pose on the base, seen from above.
    pub base_from_sensor: Pose2,
    /// Whether it hangs upside down: its beams turn clockwise, seen from above.
    pub is_upside_down: bool,
    /// Angle between its plane and the base's, radians; 0 is level.
    pub tilt_rad: f64,
}

impl Mount {
    /// A scanner at the base's origin.
    #[must_use]
    pub fn identity() -> Self {
        Self { base_from_sensor: Pose2::identity(), is_upside_down: false, tilt_rad: 0.0 }
    }

    /// The mount of a scanner with this pose on the base.
    #[must_use]
    pub fn of(base_from_sensor: &Isometry3<f64>) -> Self {
        let q = base_from_sensor.rotation;
        let ahead = q * nalgebra::Vector3::x();
        let up = (q * nalgebra::Vector3::z()).z;
        let at = base_from_sensor.translation;
        Self {
            base_from_sensor: pose(at.x, at.y, ahead.y.atan2(ahead.x)),
            is_upside_down: up < 0.0,
            tilt_rad: up.abs().min(1.0).acos(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_ros_messages::msg::{HeaderMsg, Pose, Quaternion};
    use std::f64::consts::{FRAC_PI_2, PI};

    fn link(parent: &str, child: &str, x: f64, roll: f64, yaw: f64) -> TransformStamped {
        let q = nalgebra::UnitQuaternion::from_euler_angles(roll, 0.0, yaw);
        TransformStamped {
            header: HeaderMsg { frame_id: parent.to_owned(), ..HeaderMsg::default() },
            child_frame_id: child.to_owned(),
            transform: Pose {
                position: Vector3 { x, y: 0.0, z: 0.1 },
                orientation: Quaternion { x: q.i, y: q.j, z: q.k, w: q.w },
            },
        }
    }

    #[test]
    fn chains_are_followed_up_and_down() {
        let mut tree = TransformTree::default();
        assert!(tree.insert(&link("/base_footprint", "base_link", 0.0, 0.0, FRAC_PI_2)));
        assert!(tree.insert(&link("base_link", "mast", 1.0, 0.0, 0.0)));
        assert!(tree.insert(&link("mast", "laser", 1.0, PI, 0.0)));
        let mount = Mount::of(&tree.base_from("base_footprint", "/laser").unwrap());
        assert!((mount.base_from_sensor.translation.vector - nalgebra::Vector2::new(0.0, 2.0)).norm() < 1e-12);
        assert!((mount.base_from_sensor.rotation.angle() - FRAC_PI_2).abs() < 1e-12);
        assert!(mount.is_upside_down && mount.tilt_rad < 1e-6);
        // Siblings: odometry of base_link, while the tree has it under base_footprint.
        assert!(tree.insert(&link("base_footprint", "camera", 3.0, 0.0, 0.0)));
        let camera = tree.base_from("base_link", "camera").unwrap();
        assert!((camera.translation.vector - nalgebra::Vector3::new(0.0, -3.0, 0.0)).norm() < 1e-12);
        assert_eq!(tree.base_from("base_link", "arm"), None);
    }

    #[test]
    fn a_single_link_is_exact_and_loops_end() {
        let mut tree = TransformTree::default();
        assert!(tree.insert(&link("base_link", "laser", -0.032, 0.0, 0.0)));
        let mount = Mount::of(&tree.base_from("base_link", "laser").unwrap());
        assert_eq!(mount.base_from_sensor, pose(-0.032, 0.0, 0.0));
        assert!(tree.insert(&link("laser", "base_link", 0.0, 0.0, 0.0)));
        assert!(tree.base_from("base_link", "nowhere").is_none());
        assert!(!tree.insert(&link("laser", "laser", 0.0, 0.0, 0.0)));
        assert!(!tree.insert(&link("laser", "bad", f64::NAN, 0.0, 0.0)));
    }
}
