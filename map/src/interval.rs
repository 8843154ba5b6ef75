//! What is seen of a triangle's side, and of what lies beyond it.

use crate::mesh::{Mesh, NONE, Spot};
use crate::plane::{Corner, between, cross, distance, foot_share};

/// A part of a triangle's side, from left to right as seen from where it is entered.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Interval {
    pub(crate) left: Corner,
    pub(crate) right: Corner,
}

/// A root nearer to an interval's line than this has no side of it, square millimetres (twice the area between them).
const ON_LINE_MM2: f64 = 1e-3;

/// The least length of a way from a root through an interval to a goal, were nothing else in the way.
pub(crate) fn least_way(root: Corner, seen: &Interval, goal: Corner) -> f64 {
    let Interval { left, right } = *seen;
    let root_side = cross(right, left, root);
    if root_side.abs() <= ON_LINE_MM2 {
        return distance(root, goal);
    }
    // A goal on the root's side of the interval is as far as its mirror image.
    let is_same_side = root_side * cross(right, left, goal) > 0.0;
    let goal = if is_same_side { mirrored(right, left, goal) } else { goal };
    let is_left_of_left = cross(root, left, goal) > 0.0;
    let is_right_of_right = cross(root, right, goal) < 0.0;
    if is_left_of_left {
        distance(root, left) + distance(left, goal)
    } else if is_right_of_right {
        distance(root, right) + distance(right, goal)
    } else {
        distance(root, goal)
    }
}

fn mirrored(a: Corner, b: Corner, point: Corner) -> Corner {
    let foot = between([a, b], foot_share([a, b], point));
    [2.0 * foot[0] - point[0], 2.0 * foot[1] - point[1]]
}

/// Where the ray from `root` through `through` meets the chain left, far, right: 0 to 1 on its first part, to 2 on the second.
pub(crate) fn meets(root: Corner, through: Corner, chain: &[Corner; 3]) -> f64 {
    let side = cross(root, through, chain[1]);
    // The far corner is on the left of the ray: the ray passes it on the right.
    let (first, other) = if side > 0.0 { (1.0, chain[2]) } else { (0.0, chain[0]) };
    let end = cross(root, through, other);
    let (a, b) = if side > 0.0 { (side, end) } else { (end, side) };
    let share = if (a - b).abs() > f64::MIN_POSITIVE { a / (a - b) } else { 0.0 };
    first + share.clamp(0.0, 1.0)
}

pub(crate) fn on_chain(chain: &[Corner; 3], at: f64) -> Corner {
    let (from, to, share) = if at <= 1.0 { (chain[0], chain[1], at) } else { (chain[1], chain[2], at - 1.0) };
    // The corners themselves exactly: they are told by their places.
    if share <= 0.0 {
        from
    } else if share >= 1.0 {
        to
    } else {
        between([from, to], share)
    }
}

impl Mesh {
    /// Whether the straight way between two spots lies in the mesh for certain: it meets no corner on its way.
    pub(crate) fn is_straight_free(&self, from: &Spot, to: &Spot) -> bool {
        let (from_place, to_place) = (from.place, to.place);
        let is_left = |corner: Corner| cross(from_place, to_place, corner) > 0.0;
        let is_right = |corner: Corner| cross(from_place, to_place, corner) < 0.0;
        let first = &self.triangles[from.triangle as usize];
        // The side that is left through: its first corner on the right, its second on the left.
        let leaves = |side: &usize| is_right(first.places[*side]) && is_left(first.places[(side + 1) % 3]);
        let Some(mut side) = (0..3).find(leaves) else { return false };
        let mut here = from.triangle;
        for _ in 0..self.triangles.len() {
            let triangle = &self.triangles[here as usize];
            (here, side) = (triangle.beyond[side], usize::from(triangle.entered[side]));
            if here == to.triangle {
                return true;
            }
            if here == NONE {
                return false;
            }
            let far = self.triangles[here as usize].places[(side + 2) % 3];
            side = match (is_left(far), is_right(far)) {
                (true, _) => (side + 1) % 3,
                (_, true) => (side + 2) % 3,
                _ => return false,
            };
        }
        false
    }
}
