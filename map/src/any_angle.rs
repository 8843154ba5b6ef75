//! The shortest way through free space, at any angle (Cui, Harabor and Grastien, "Compromise-free pathfinding on a navigation
//! mesh", IJCAI 2017): a search over intervals of the triangles' sides, each seen from the last corner that the way turned
//! around. The result is exact on the mesh.

use crate::free_space::{Corner, FreeSpace, Spot, between, cross, distance, foot_share};
use std::cmp::Ordering;
use std::collections::{BTreeMap, BinaryHeap};

/// Steps after which a search is given up: a way through a building takes some hundred.
const MAX_STEPS: usize = 1_000_000;
/// Places nearer than this are one, millimetres.
const SAME_MM: f64 = 1e-6;

/// What a search knows of one way into one triangle.
#[derive(Clone, Copy, Debug)]
struct Reach {
    /// The triangle behind the side.
    triangle: u32,
    /// The side of that triangle.
    side: u8,
    /// The part of the side that can be seen, left and right as seen from the root.
    left: Corner,
    right: Corner,
    /// The corner of the mesh at `left` and at `right`, if there is one.
    left_corner: Option<u32>,
    right_corner: Option<u32>,
    /// The last corner that was turned around.
    root: Corner,
    /// Length of the way to the root, millimetres.
    to_root: f64,
    /// Which way led to the root.
    before: u32,
}

/// A corner that a way turns around.
#[derive(Clone, Copy, Debug)]
struct Turn {
    place: Corner,
    before: u32,
}

#[derive(Clone, Copy, Debug)]
struct Waiting {
    estimate: f64,
    order: u32,
    reach: Reach,
    /// Whether the goal is seen from the root: the estimate is the length.
    is_goal: bool,
}

impl PartialEq for Waiting {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Waiting {}
impl PartialOrd for Waiting {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Waiting {
    fn cmp(&self, other: &Self) -> Ordering {
        // The least first; among equals the one found first.
        other.estimate.total_cmp(&self.estimate).then(other.order.cmp(&self.order))
    }
}

struct Search<'a> {
    space: &'a FreeSpace,
    goal: Spot,
    queue: BinaryHeap<Waiting>,
    turns: Vec<Turn>,
    /// The shortest way known to each corner.
    best: BTreeMap<u32, f64>,
    order: u32,
}

/// The corners of the shortest way between two spots of one part of the mesh, both included; `None` if there is none.
pub(crate) fn shortest_way(space: &FreeSpace, from: &Spot, to: &Spot) -> Option<Vec<Corner>> {
    if from.part != to.part {
        return None;
    }
    if from.triangle == to.triangle {
        return Some(vec![from.place, to.place]);
    }
    let start = Turn { place: from.place, before: u32::MAX };
    let mut search =
        Search { space, goal: *to, queue: BinaryHeap::new(), turns: vec![start], best: BTreeMap::new(), order: 0 };
    for side in 0..3 {
        search.cross_side(from.triangle, side, None, from.place, 0.0, 0);
    }
    for _ in 0..MAX_STEPS {
        let waiting = search.queue.pop()?;
        if waiting.is_goal {
            return Some(search.way(waiting.reach.before));
        }
        search.expand(&waiting.reach);
    }
    None
}

impl Search<'_> {
    fn way(&self, last: u32) -> Vec<Corner> {
        let mut way = vec![self.goal.place];
        let mut at = last;
        while let Some(turn) = self.turns.get(at as usize) {
            if distance(turn.place, way[way.len() - 1]) > SAME_MM {
                way.push(turn.place);
            }
            at = turn.before;
        }
        way.reverse();
        way
    }

    /// Queues what lies beyond a side of a triangle; `part` is the visible part of it as (left, right), all of it if absent.
    fn cross_side(
        &mut self,
        triangle: u32,
        side: usize,
        part: Option<(Corner, Corner)>,
        root: Corner,
        to_root: f64,
        before: u32,
    ) {
        let here = &self.space.triangles[triangle as usize];
        let Some(next) = here.beyond[side] else { return };
        // Counter-clockwise from inside: the first corner is on the right of one who leaves, the second on the left.
        let (right_corner, left_corner) = (here.corners[side], here.corners[(side + 1) % 3]);
        let (right_end, left_end) = (self.space.corner(right_corner), self.space.corner(left_corner));
        let (left, right) = part.unwrap_or((left_end, right_end));
        if distance(left, right) <= SAME_MM {
            return;
        }
        let there = &self.space.triangles[next as usize];
        let Some(entered) = (0..3).find(|&side| there.corners[side] == left_corner) else { return };
        self.push(Reach {
            triangle: next,
            side: entered as u8,
            left,
            right,
            left_corner: (distance(left, left_end) <= SAME_MM).then_some(left_corner),
            right_corner: (distance(right, right_end) <= SAME_MM).then_some(right_corner),
            root,
            to_root,
            before,
        });
    }

    fn push(&mut self, reach: Reach) {
        let estimate = reach.to_root + least_way(&reach, self.goal.place);
        self.order += 1;
        self.queue.push(Waiting { estimate, order: self.order, reach, is_goal: false });
    }

    /// A new root at a corner, unless a shorter way to it is known.
    fn turn(&mut self, reach: &Reach, corner: u32) -> Option<(Corner, f64, u32)> {
        let place = self.space.corner(corner);
        let length = reach.to_root + distance(reach.root, place);
        let best = self.best.entry(corner).or_insert(f64::INFINITY);
        if length > *best + SAME_MM {
            return None;
        }
        *best = length.min(*best);
        self.turns.push(Turn { place, before: reach.before });
        Some((place, length, (self.turns.len() - 1) as u32))
    }

    fn expand(&mut self, reach: &Reach) {
        if reach.triangle == self.goal.triangle {
            return self.arrive(reach);
        }
        let triangle = self.space.triangles[reach.triangle as usize];
        let side = usize::from(reach.side);
        // Entered through the side from the left corner to the right one; the far corner sees both other sides.
        let (left_end, right_end, far) = (
            self.space.corner(triangle.corners[side]),
            self.space.corner(triangle.corners[(side + 1) % 3]),
            self.space.corner(triangle.corners[(side + 2) % 3]),
        );
        let is_at = |end: Corner| distance(reach.root, end) <= SAME_MM;
        let chain = [left_end, far, right_end];
        let left = if is_at(reach.left) { 0.0 } else { meets(reach.root, reach.left, &chain) };
        let right = if is_at(reach.right) { 2.0 } else { meets(reach.root, reach.right, &chain) };
        let right = right.max(left);
        // The sides beyond: from the far corner to the left one, and from the right one to the far one.
        let (left_side, right_side) = ((side + 2) % 3, (side + 1) % 3);
        let spans = |from: f64, to: f64| {
            let on_left = (from < 1.0).then(|| (on_chain(&chain, from), on_chain(&chain, to.min(1.0))));
            let on_right = (to > 1.0).then(|| (on_chain(&chain, from.max(1.0)), on_chain(&chain, to)));
            [(left_side, on_left), (right_side, on_right)]
        };
        for (side, span) in spans(left, right) {
            if let Some((l, r)) = span.filter(|_| right > left) {
                self.cross_side(reach.triangle, side, Some((l, r)), reach.root, reach.to_root, reach.before);
            }
        }
        let around = [(reach.left_corner, 0.0, left), (reach.right_corner, right, 2.0)];
        for (corner, from, to) in around {
            if to <= from {
                continue;
            }
            let Some((root, to_root, before)) = corner.and_then(|corner| self.turn(reach, corner)) else { continue };
            for (side, span) in spans(from, to) {
                if let Some((l, r)) = span {
                    self.cross_side(reach.triangle, side, Some((l, r)), root, to_root, before);
                }
            }
        }
    }

    /// The goal's triangle is entered: the last turns.
    fn arrive(&mut self, reach: &Reach) {
        let goal = self.goal.place;
        let seen =
            |root: Corner| cross(root, reach.left, goal) <= SAME_MM && cross(root, reach.right, goal) >= -SAME_MM;
        let is_on = distance(reach.root, reach.left) <= SAME_MM || distance(reach.root, reach.right) <= SAME_MM;
        let (length, before) = if is_on || seen(reach.root) {
            (reach.to_root + distance(reach.root, goal), reach.before)
        } else {
            let is_left = cross(reach.root, reach.left, goal) > 0.0;
            let corner = if is_left { reach.left_corner } else { reach.right_corner };
            // An end that is no corner: another interval sees the goal.
            let Some((place, to_corner, before)) = corner.and_then(|corner| self.turn(reach, corner)) else { return };
            (to_corner + distance(place, goal), before)
        };
        self.order += 1;
        let reach = Reach { before, ..*reach };
        self.queue.push(Waiting { estimate: length, order: self.order, reach, is_goal: true });
    }
}

/// The least length of a way from a root through an interval to a goal.
fn least_way(reach: &Reach, goal: Corner) -> f64 {
    let (left, right, root) = (reach.left, reach.right, reach.root);
    // A goal on the root's side of the interval is as far as its mirror image.
    let is_same_side = cross(right, left, root) * cross(right, left, goal) > 0.0;
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
fn meets(root: Corner, through: Corner, chain: &[Corner; 3]) -> f64 {
    let side = cross(root, through, chain[1]);
    // The far corner is on the left of the ray: the ray passes it on the right.
    let (first, from, to) = if side > 0.0 { (1.0, chain[1], chain[2]) } else { (0.0, chain[0], chain[1]) };
    let (a, b) = (cross(root, through, from), cross(root, through, to));
    let share = if (a - b).abs() > f64::MIN_POSITIVE { a / (a - b) } else { 0.0 };
    first + share.clamp(0.0, 1.0)
}

fn on_chain(chain: &[Corner; 3], at: f64) -> Corner {
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
