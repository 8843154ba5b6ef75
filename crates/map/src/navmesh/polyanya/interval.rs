//! What is seen of a triangle's sides from a corner that a way turned around.

use crate::navmesh::mesh::{Mesh, NONE, Spot};
use crate::navmesh::plane::{Corner, between, cross, distance, foot_share};

/// A ray that bounds what is seen: from the root through a place.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ray {
    pub(crate) through: Corner,
    /// The number of the mesh's corner there, or [`NONE`].
    pub(crate) corner: u32,
}

/// What is seen from a root: all between two rays. A ray that passes through the root itself bounds
/// nothing.
#[derive(Clone, Copy, Debug)]
pub(crate) struct View {
    pub(crate) left: Ray,
    pub(crate) right: Ray,
}

impl View {
    /// How far left of the left ray a place is, as a signed area; negative inside.
    pub(crate) fn left_of(&self, root: Corner, place: Corner) -> f64 {
        if self.left.through == root { -1.0 } else { cross(root, self.left.through, place) }
    }

    /// How far right of the right ray a place is, as a signed area; negative inside.
    pub(crate) fn right_of(&self, root: Corner, place: Corner) -> f64 {
        if self.right.through == root { -1.0 } else { -cross(root, self.right.through, place) }
    }
}

/// A root nearer to a side's line than this is on it, square millimetres (twice the area between
/// them).
const ON_LINE_MM2: f64 = 1e-3;

/// The least length of a way from a root to a goal through what is seen of a side, were nothing
/// else in the way. The side by its left and right end, as seen from where it is crossed.
pub(crate) fn least_way(root: Corner, seen: &View, [left, right]: [Corner; 2], goal: Corner) -> f64 {
    let root_side = cross(right, left, root);
    if root_side.abs() <= ON_LINE_MM2 {
        return distance(root, goal);
    }
    // A goal on the root's side is as far as its mirror image.
    let is_same_side = root_side * cross(right, left, goal) > 0.0;
    let goal = if is_same_side { mirrored(right, left, goal) } else { goal };
    let end = if seen.left_of(root, goal) > 0.0 {
        seen.left
    } else if seen.right_of(root, goal) > 0.0 {
        seen.right
    } else {
        return distance(root, goal);
    };
    let end = meets(root, end.through, [left, right]);
    distance(root, end) + distance(end, goal)
}

fn mirrored(a: Corner, b: Corner, point: Corner) -> Corner {
    let foot = between([a, b], foot_share([a, b], point));
    [2.0 * foot[0] - point[0], 2.0 * foot[1] - point[1]]
}

/// Where the ray from `root` through `through` meets a line whose ends lie on either side of it.
pub(crate) fn meets(root: Corner, through: Corner, ends: [Corner; 2]) -> Corner {
    let (a, b) = (cross(root, through, ends[0]), cross(root, through, ends[1]));
    let share = if a == b { 0.0 } else { a / (a - b) };
    between(ends, share.clamp(0.0, 1.0))
}

impl Mesh {
    /// Whether the straight way between two spots lies in the mesh for certain: it meets no corner
    /// on its way.
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
