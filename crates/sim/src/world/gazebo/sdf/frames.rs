//! Poses, and the frames in which they are given.

use super::element::{child, name_of};
use crate::world::gazebo::report::{Flaw, ImportReport};
use fht_proto::FixedPoint;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use roxmltree::Node;
use std::collections::HashMap;

/// Largest distance of anything from its parent, metres. Worlds saved while a thing fell through
/// the floor have larger ones.
const FARTHEST_M: f64 = 1e4;
/// Longest chain of frames.
const MOST_STEPS: usize = 32;

/// The frames of one model or world by name.
#[derive(Debug, Default)]
pub(super) struct Frames<'d> {
    elements: HashMap<&'d str, Node<'d, 'd>>,
}

impl<'d> Frames<'d> {
    /// The links, frames and models that are children of an element.
    pub(super) fn of(scope: Node<'d, 'd>) -> Self {
        let named = |node: &Node<'d, 'd>| matches!(node.tag_name().name(), "frame" | "link" | "model" | "include");
        let entry = |node: Node<'d, 'd>| {
            let name = node.attribute("name").or_else(|| child(node, "name")?.text().map(str::trim))?;
            Some((name, node))
        };
        Self { elements: scope.children().filter(named).filter_map(entry).collect() }
    }

    /// Pose of a child of the scope in the scope's frame.
    pub(super) fn pose(&self, node: Node<'d, 'd>, report: &mut ImportReport) -> Isometry3<f64> {
        self.pose_within(node, MOST_STEPS, report)
    }

    /// Pose in the scope's frame of a part of a link whose own pose in the scope is `link`.
    pub(super) fn pose_in_link(
        &self,
        part: Node<'d, 'd>,
        link: &Isometry3<f64>,
        report: &mut ImportReport,
    ) -> Isometry3<f64> {
        let pose = own_pose(part, report).unwrap_or_else(Isometry3::identity);
        match reference(part) {
            Some(name) => self.frame(name, MOST_STEPS, report) * pose,
            None => link * pose,
        }
    }

    fn pose_within(&self, node: Node<'d, 'd>, steps: usize, report: &mut ImportReport) -> Isometry3<f64> {
        let pose = own_pose(node, report).unwrap_or_else(Isometry3::identity);
        let attached = node.attribute("attached_to").filter(|name| !name.is_empty());
        match reference(node).or(attached) {
            Some(name) => self.frame(name, steps, report) * pose,
            None => pose,
        }
    }

    fn frame(&self, name: &str, steps: usize, report: &mut ImportReport) -> Isometry3<f64> {
        if matches!(name, "world" | "__model__") {
            return Isometry3::identity();
        }
        match self.elements.get(name) {
            Some(&node) if steps > 0 => self.pose_within(node, steps - 1, report),
            _ => {
                report.note(Flaw::Frame, name);
                Isometry3::identity()
            }
        }
    }
}

/// The frame that an element's pose names.
fn reference<'d>(node: Node<'d, 'd>) -> Option<&'d str> {
    let pose = child(node, "pose")?;
    pose.attribute("relative_to").or_else(|| pose.attribute("frame")).filter(|name| !name.is_empty())
}

/// The pose that an element states, in whichever frame; `None` without one. Values that are not
/// numbers, or too large, become 0.
pub(super) fn own_pose(node: Node<'_, '_>, report: &mut ImportReport) -> Option<Isometry3<f64>> {
    let element = child(node, "pose")?;
    let text = element.text().unwrap_or_default().trim();
    if text.is_empty() {
        return None;
    }
    let is_quaternion = element.attribute("rotation_format") == Some("quat_xyzw");
    let in_degrees = element.attribute("degrees").is_some_and(|degrees| matches!(degrees.trim(), "true" | "1"));
    let expected = if is_quaternion { 7 } else { 6 };
    let mut numbers: Vec<f64> = text.split_ascii_whitespace().map(|word| word.parse().unwrap_or(f64::NAN)).collect();
    let mut sound = numbers.len() == expected;
    numbers.resize(expected, 0.0);
    // Heights are left out: things that fall through the floor go far.
    if numbers[..2].iter().any(|number| number.is_finite() && number.abs() > FixedPoint::MAX_M) {
        report.note(Flaw::Remote, format!("{} at {text}", name_of(node)));
    }
    for number in &mut numbers {
        if !number.is_finite() || number.abs() > FARTHEST_M {
            *number = 0.0;
            sound = false;
        }
    }
    if !sound {
        report.note(Flaw::Number, format!("pose of {}: {text}", name_of(node)));
    }
    let rotation = if is_quaternion {
        let quaternion = Quaternion::new(numbers[6], numbers[3], numbers[4], numbers[5]);
        UnitQuaternion::try_new(quaternion, 1e-9).unwrap_or_else(UnitQuaternion::identity)
    } else {
        let angle = |number: f64| if in_degrees { number.to_radians() } else { number };
        UnitQuaternion::from_euler_angles(angle(numbers[3]), angle(numbers[4]), angle(numbers[5]))
    };
    Some(Isometry3::from_parts(Translation3::new(numbers[0], numbers[1], numbers[2]), rotation))
}
