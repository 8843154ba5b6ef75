//! The shortest way through free space, at any angle (Cui, Harabor and Grastien, "Compromise-free
//! pathfinding on a navigation mesh", IJCAI 2017): a search over intervals of the triangles' sides,
//! each seen from the last corner that the way turned around. The result is exact on the mesh.
//!
//! Left out is what no shortest way does: to turn around a corner that free space does not go
//! round, to come to a corner on a way longer than one that is known, to enter a block that neither
//! end lies behind (`mesh.rs`). An interval that leads to one other only is followed at once, and
//! so is the best of several while nothing that waits is better.

mod interval;
mod workspace;

use crate::navmesh::mesh::{Mesh, NONE, Spot, Triangle};
use crate::navmesh::plane::{Corner, distance};
use interval::{Ray, View, least_way, meets};
use std::cell::RefCell;
use workspace::{Reach, Turn, Waiting, Workspace};

/// Steps after which a search is given up: a way through a building takes some hundred.
const MAX_STEPS: usize = 1_000_000;
/// Places nearer than this are one, millimetres.
const SAME_MM: f64 = 1e-6;

/// The two corners of a triangle after each.
const AFTER: [(usize, usize); 3] = [(1, 2), (2, 0), (0, 1)];

thread_local! {
    static WORKSPACE: RefCell<Workspace> = RefCell::default();
}

/// The corners of the shortest way between two spots of one part of the mesh, both included; `None`
/// if there is none.
pub(crate) fn shortest_way(mesh: &Mesh, from: &Spot, to: &Spot) -> Option<Vec<Corner>> {
    if from.part != to.part {
        return None;
    }
    if from.triangle == to.triangle || mesh.is_straight_free(from, to) {
        return Some(vec![from.place, to.place]);
    }
    WORKSPACE.with_borrow_mut(|workspace| {
        workspace.begin(mesh);
        let way = Search { mesh, goal: *to, workspace }.run(from);
        workspace.end();
        way
    })
}

struct Search<'a> {
    mesh: &'a Mesh,
    goal: Spot,
    workspace: &'a mut Workspace,
}

impl Search<'_> {
    fn run(&mut self, from: &Spot) -> Option<Vec<Corner>> {
        self.open_blocks(from);
        self.workspace.turns.push(Turn { place: from.place, length: 0.0, corner: NONE, before: NONE });
        let first = &self.mesh.triangles[from.triangle as usize];
        for side in 0..3 {
            let ray = |corner: usize| Ray { through: first.places[corner], corner: first.corners[corner] };
            // Counter-clockwise from inside: the first corner is on the right of one who leaves,
            // the second on the left.
            self.cross_side(first, side, View { left: ray((side + 1) % 3), right: ray(side) }, 0);
        }
        let mut at_hand = self.choose();
        let mut steps_left = MAX_STEPS;
        while steps_left > 0 {
            let reach = match at_hand {
                Some(reach) => reach,
                None => {
                    let waiting = self.workspace.queue.pop()?;
                    let reach = self.workspace.reaches[waiting.reach as usize];
                    if self.is_outdone(&self.workspace.turns[reach.root as usize]) {
                        continue;
                    }
                    reach
                }
            };
            if reach.triangle == NONE {
                return Some(self.way(reach.root));
            }
            let Some(reach) = self.follow(reach, &mut steps_left) else {
                at_hand = self.choose();
                continue;
            };
            if reach.triangle == self.goal.triangle {
                self.arrive(&reach);
            } else {
                self.expand(&reach);
            }
            at_hand = self.choose();
        }
        None
    }

    /// Opens the blocks between the ends.
    fn open_blocks(&mut self, from: &Spot) {
        let Workspace { open, search, .. } = self.workspace;
        let block_of = |spot: &Spot| self.mesh.triangles[spot.triangle as usize].block;
        let depth = |block: u32| self.mesh.blocks[block as usize].depth;
        let (mut a, mut b) = (block_of(from), block_of(&self.goal));
        open[a as usize] = *search;
        open[b as usize] = *search;
        while a != b {
            let deeper = if depth(a) >= depth(b) { &mut a } else { &mut b };
            *deeper = self.mesh.blocks[*deeper as usize].parent;
            if *deeper == NONE {
                return; // of other parts: nothing joins them
            }
            open[*deeper as usize] = *search;
        }
    }

    /// Of where a reach leads, the best to go on with; the others wait. None if something that
    /// waits is better.
    fn choose(&mut self) -> Option<Reach> {
        let mut next = std::mem::take(&mut self.workspace.next);
        let best = match next[..] {
            // Nothing to choose, unless it is the goal.
            [only] if only.triangle != NONE => Some(only),
            _ => self.best_of(&next),
        };
        next.clear();
        self.workspace.next = next;
        best
    }

    fn best_of(&mut self, next: &[Reach]) -> Option<Reach> {
        let mut best: Option<(f64, Reach)> = None;
        for reach in next {
            let estimate = self.estimate(reach);
            match &mut best {
                Some(best) if estimate < best.0 => {
                    let (worse, reach) = std::mem::replace(best, (estimate, *reach));
                    self.wait(worse, reach);
                }
                Some(_) => self.wait(estimate, *reach),
                None => best = Some((estimate, *reach)),
            }
        }
        let (estimate, reach) = best?;
        if self.workspace.queue.peek().is_some_and(|first| first.estimate < estimate) {
            self.wait(estimate, reach);
            return None;
        }
        Some(reach)
    }

    fn wait(&mut self, estimate: f64, reach: Reach) {
        self.workspace.queue.push(Waiting { estimate, reach: self.workspace.reaches.len() as u32 });
        self.workspace.reaches.push(reach);
    }

    /// The least length of a way through a reach to the goal.
    fn estimate(&self, reach: &Reach) -> f64 {
        let root = &self.workspace.turns[reach.root as usize];
        if reach.triangle == NONE {
            return root.length + distance(root.place, self.goal.place);
        }
        let triangle = &self.mesh.triangles[reach.triangle as usize];
        let side = usize::from(reach.side);
        let ends = [triangle.places[side], triangle.places[(side + 1) % 3]];
        root.length + least_way(root.place, &reach.seen, ends, self.goal.place)
    }

    fn way(&self, last: u32) -> Vec<Corner> {
        let mut way = vec![self.goal.place];
        let mut at = last;
        while let Some(turn) = self.workspace.turns.get(at as usize) {
            if distance(turn.place, way[way.len() - 1]) > SAME_MM {
                way.push(turn.place);
            }
            at = turn.before;
        }
        way.reverse();
        way
    }

    /// Leads beyond a side of a triangle, as far as it is seen from a root.
    fn cross_side(&mut self, here: &Triangle, side: usize, seen: View, root: u32) {
        let next = here.beyond[side];
        if next == NONE {
            return;
        }
        let block = self.mesh.triangles[next as usize].block;
        if self.workspace.open[block as usize] == self.workspace.search {
            self.workspace.next.push(Reach { seen, triangle: next, root, side: here.entered[side] });
        }
    }

    /// A new root at a corner, unless a shorter way to it is known.
    fn turn(&mut self, root: u32, corner: u32, place: Corner) -> Option<u32> {
        let Workspace { search, turns, best, .. } = self.workspace;
        let before = &turns[root as usize];
        let length = before.length + distance(before.place, place);
        let known = &mut best[corner as usize];
        if known.0 != *search {
            *known = (*search, f64::INFINITY);
        }
        if length > known.1 + SAME_MM {
            return None;
        }
        known.1 = length.min(known.1);
        turns.push(Turn { place, length, corner, before: root });
        Some((turns.len() - 1) as u32)
    }

    /// Whether a shorter way to a turn was found since.
    fn is_outdone(&self, turn: &Turn) -> bool {
        turn.corner != NONE && turn.length > self.workspace.best[turn.corner as usize].1 + SAME_MM
    }

    /// Goes on through triangles as long as each leads to one other only, with no turn: nine of ten
    /// do. `None` at a dead end, and when no steps are left.
    fn follow(&self, mut reach: Reach, steps_left: &mut usize) -> Option<Reach> {
        let Workspace { search, open, turns, .. } = &*self.workspace;
        let root = turns[reach.root as usize].place;
        let mut here = &self.mesh.triangles[reach.triangle as usize];
        let beyond = |triangle: &Triangle, side: usize| {
            let next = self.mesh.triangles.get(triangle.beyond[side] as usize)?;
            let is_open = next.block == triangle.block || open[next.block as usize] == *search;
            is_open.then_some(next)
        };
        loop {
            *steps_left = steps_left.checked_sub(1)?;
            if reach.triangle == self.goal.triangle {
                break;
            }
            let left_end = usize::from(reach.side);
            let (right_end, far_end) = AFTER[left_end];
            let (left_side, right_side) = (far_end, right_end);
            let far = here.places[far_end];
            let left_of = reach.seen.left_of(root, far);
            let right_of = reach.seen.right_of(root, far);
            let may_turn = |ray: &Ray, end: usize| ray.corner == here.corners[end] && here.turns[end];
            let is_turn = (left_of >= 0.0 && may_turn(&reach.seen.left, left_end))
                || (right_of >= 0.0 && may_turn(&reach.seen.right, right_end));
            if is_turn {
                break;
            }
            let (side, next) = if left_of > 0.0 {
                (right_side, beyond(here, right_side)?)
            } else if right_of > 0.0 {
                (left_side, beyond(here, left_side)?)
            } else if left_of < 0.0 && right_of < 0.0 {
                let ray = Ray { through: far, corner: here.corners[far_end] };
                match (beyond(here, left_side), beyond(here, right_side)) {
                    (Some(next), None) => {
                        reach.seen.right = ray;
                        (left_side, next)
                    }
                    (None, Some(next)) => {
                        reach.seen.left = ray;
                        (right_side, next)
                    }
                    (Some(_), Some(_)) => break,
                    (None, None) => return None,
                }
            } else {
                break;
            };
            reach.triangle = here.beyond[side];
            reach.side = here.entered[side];
            here = next;
        }
        Some(reach)
    }

    /// Goes on through a triangle. It was entered through the side from its left corner to its
    /// right one; where the far corner lies decides which of the other two sides are seen. What
    /// lies beyond a ray is seen from the corner that the ray passes, if that is an end of the
    /// side: there the way turns.
    fn expand(&mut self, reach: &Reach) {
        let triangle = &self.mesh.triangles[reach.triangle as usize];
        let left_end = usize::from(reach.side);
        let (right_end, far_end) = AFTER[left_end];
        // The sides beyond: from the far corner to the left one, and from the right one to the far
        // one.
        let (left_side, right_side) = (far_end, right_end);
        let root = self.workspace.turns[reach.root as usize].place;
        let View { left, right } = reach.seen;
        let far = Ray { through: triangle.places[far_end], corner: triangle.corners[far_end] };
        let left_of = reach.seen.left_of(root, far.through);
        let right_of = reach.seen.right_of(root, far.through);
        if left_of > 0.0 {
            self.cross_side(triangle, right_side, reach.seen, reach.root);
        } else if right_of > 0.0 {
            self.cross_side(triangle, left_side, reach.seen, reach.root);
        } else {
            if left_of < 0.0 {
                self.cross_side(triangle, left_side, View { left, right: far }, reach.root);
            }
            if right_of < 0.0 {
                self.cross_side(triangle, right_side, View { left: far, right }, reach.root);
            }
        }
        if left_of >= 0.0
            && left.corner == triangle.corners[left_end]
            && triangle.turns[left_end]
            && let Some(turn) = self.turn(reach.root, left.corner, left.through)
        {
            self.cross_side(triangle, left_side, View { left, right: far }, turn);
            if left_of > 0.0 {
                let through = meets(root, left.through, [far.through, triangle.places[right_end]]);
                let right = Ray { through, corner: NONE };
                self.cross_side(triangle, right_side, View { left: far, right }, turn);
            }
        }
        if right_of >= 0.0
            && right.corner == triangle.corners[right_end]
            && triangle.turns[right_end]
            && let Some(turn) = self.turn(reach.root, right.corner, right.through)
        {
            self.cross_side(triangle, right_side, View { left: far, right }, turn);
            if right_of > 0.0 {
                let through = meets(root, right.through, [far.through, triangle.places[left_end]]);
                let left = Ray { through, corner: NONE };
                self.cross_side(triangle, left_side, View { left, right: far }, turn);
            }
        }
    }

    /// The goal's triangle is entered: the last turn, if there is one.
    fn arrive(&mut self, reach: &Reach) {
        let root = self.workspace.turns[reach.root as usize].place;
        let triangle = &self.mesh.triangles[reach.triangle as usize];
        let left_end = usize::from(reach.side);
        let beyond = if reach.seen.left_of(root, self.goal.place) > 0.0 {
            Some((left_end, reach.seen.left))
        } else if reach.seen.right_of(root, self.goal.place) > 0.0 {
            Some(((left_end + 1) % 3, reach.seen.right))
        } else {
            None
        };
        let root = match beyond {
            None => Some(reach.root),
            Some((end, ray)) if ray.corner == triangle.corners[end] && triangle.turns[end] => {
                self.turn(reach.root, ray.corner, ray.through)
            }
            // Another reach, with a root nearer by, sees the goal.
            Some(_) => None,
        };
        if let Some(root) = root {
            self.workspace.next.push(Reach { triangle: NONE, root, ..*reach });
        }
    }
}

#[cfg(test)]
mod tests;
