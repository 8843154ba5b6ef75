//! The shortest way through free space, at any angle (Cui, Harabor and Grastien, "Compromise-free pathfinding on a navigation
//! mesh", IJCAI 2017): a search over intervals of the triangles' sides, each seen from the last corner that the way turned
//! around. The result is exact on the mesh.
//!
//! Left out is what no shortest way does: to turn around a corner that free space does not go round, to come to a corner
//! on a way longer than one that is known, to enter a block that neither end lies behind (`mesh.rs`). An interval that
//! leads to one other only is followed at once, and so is the best of several while nothing that waits is better.

use crate::interval::{Interval, least_way, meets, on_chain};
use crate::mesh::{Mesh, NONE, Spot, Triangle};
use crate::plane::{Corner, cross, distance};
use std::cell::RefCell;
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// Steps after which a search is given up: a way through a building takes some hundred.
const MAX_STEPS: usize = 1_000_000;
/// Places nearer than this are one, millimetres.
pub(crate) const SAME_MM: f64 = 1e-6;
/// A workspace with room for more than this is not kept for the next search.
const KEPT_REACHES: usize = 1 << 14;
/// An interval leads to at most so many: two sides as seen from its root, and both from either of its ends.
const MOST_NEXT: usize = 6;

/// What a search knows of one way into one triangle.
#[derive(Clone, Copy, Debug)]
struct Reach {
    /// The triangle behind the side; [`NONE`] once the goal is reached.
    triangle: u32,
    /// The side of that triangle.
    side: u8,
    /// Whether the interval's left and right ends are corners of the mesh.
    is_corner: [bool; 2],
    /// The part of the side that can be seen from the root.
    seen: Interval,
    /// The corner that was turned around last, by its number among the turns.
    root: u32,
}

/// A corner that a way turns around.
#[derive(Clone, Copy, Debug)]
struct Turn {
    place: Corner,
    /// Length of the way to it, millimetres.
    length: f64,
    /// The corner's number; [`NONE`] for the start.
    corner: u32,
    /// The turn before it, or [`NONE`].
    before: u32,
}

#[derive(Clone, Copy, Debug)]
struct Waiting {
    /// Least length of a way to the goal; its length, if the goal is reached.
    estimate: f64,
    /// Which reach, in the order in which they were found.
    reach: u32,
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
        other.estimate.total_cmp(&self.estimate).then(other.reach.cmp(&self.reach))
    }
}

/// What a search writes down. Kept from one search to the next, since most of what planning costs is to get memory; entries count
/// if they bear the number of the search.
#[derive(Default)]
struct Workspace {
    search: u32,
    queue: BinaryHeap<Waiting>,
    reaches: Vec<Reach>,
    turns: Vec<Turn>,
    /// The shortest way known to each corner.
    best: Vec<(u32, f64)>,
    /// Blocks that ways may lead through.
    open: Vec<u32>,
}

thread_local! {
    static WORKSPACE: RefCell<Workspace> = RefCell::default();
}

impl Workspace {
    fn begin(&mut self, mesh: &Mesh) {
        self.queue.clear();
        self.reaches.clear();
        self.turns.clear();
        self.search = self.search.wrapping_add(1);
        if self.search == 0 {
            // After four billion searches.
            *self = Self { search: 1, ..Self::default() };
        }
        // Of another mesh there may be more: the number of the search tells them apart.
        self.best.resize(self.best.len().max(mesh.corner_count), (0, f64::INFINITY));
        self.open.resize(self.open.len().max(mesh.blocks.len()), 0);
    }

    fn end(&mut self) {
        if self.reaches.capacity() > KEPT_REACHES {
            (self.queue, self.reaches, self.turns) = Default::default();
        }
    }
}

/// The corners of the shortest way between two spots of one part of the mesh, both included; `None` if there is none.
pub(crate) fn shortest_way(mesh: &Mesh, from: &Spot, to: &Spot) -> Option<Vec<Corner>> {
    if from.part != to.part {
        return None;
    }
    if from.triangle == to.triangle || mesh.is_straight_free(from, to) {
        return Some(vec![from.place, to.place]);
    }
    WORKSPACE.with_borrow_mut(|workspace| {
        workspace.begin(mesh);
        let mut search = Search { mesh, goal: *to, workspace, next: [None; MOST_NEXT], next_count: 0 };
        let way = search.run(from);
        workspace.end();
        way
    })
}

struct Search<'a> {
    mesh: &'a Mesh,
    goal: Spot,
    workspace: &'a mut Workspace,
    /// Where the reach that is looked at leads.
    next: [Option<Reach>; MOST_NEXT],
    next_count: usize,
}

impl Search<'_> {
    fn run(&mut self, from: &Spot) -> Option<Vec<Corner>> {
        self.open_blocks(from);
        self.workspace.turns.push(Turn { place: from.place, length: 0.0, corner: NONE, before: NONE });
        let mesh = self.mesh;
        let first = &mesh.triangles[from.triangle as usize];
        for side in 0..3 {
            self.cross_side(first, side, None, 0);
        }
        let mut at_hand = self.choose();
        for _ in 0..MAX_STEPS {
            let reach = match at_hand {
                Some(reach) => reach,
                None => {
                    let waiting = self.workspace.queue.pop()?;
                    self.workspace.reaches[waiting.reach as usize]
                }
            };
            if reach.triangle == NONE {
                return Some(self.way(reach.root));
            }
            self.expand(&reach);
            at_hand = self.choose();
        }
        None
    }

    /// Opens the blocks between the ends.
    fn open_blocks(&mut self, from: &Spot) {
        let Workspace { open, search, .. } = self.workspace;
        let block_of = |spot: &Spot| self.mesh.triangles[spot.triangle as usize].block;
        let (mut a, mut b) = (block_of(from), block_of(&self.goal));
        open[a as usize] = *search;
        open[b as usize] = *search;
        while a != b {
            let deeper =
                if self.mesh.blocks[a as usize].depth >= self.mesh.blocks[b as usize].depth { &mut a } else { &mut b };
            *deeper = self.mesh.blocks[*deeper as usize].parent;
            if *deeper == NONE {
                return; // other parts: nothing joins them
            }
            open[*deeper as usize] = *search;
        }
    }

    /// Of where a reach leads, the best to go on with; the others wait. None if something that waits is better.
    fn choose(&mut self) -> Option<Reach> {
        let count = std::mem::take(&mut self.next_count);
        if count == 1 {
            // Nothing to choose, unless it is the goal.
            if let Some(only) = self.next[0].filter(|only| only.triangle != NONE) {
                return Some(only);
            }
        }
        let (turns, goal) = (&self.workspace.turns, self.goal.place);
        let estimate = |reach: &Reach| {
            let root = &turns[reach.root as usize];
            root.length
                + if reach.triangle == NONE { distance(root.place, goal) } else { least_way(root.place, &reach.seen, goal) }
        };
        let mut best: Option<(f64, Reach)> = None;
        let mut wait = |estimate: f64, reach: Reach| {
            self.workspace.reaches.push(reach);
            self.workspace.queue.push(Waiting { estimate, reach: (self.workspace.reaches.len() - 1) as u32 });
        };
        for reach in self.next[..count].iter().flatten() {
            let estimate = estimate(reach);
            match &mut best {
                Some(best) if estimate < best.0 => {
                    let (worse, reach) = std::mem::replace(best, (estimate, *reach));
                    wait(worse, reach);
                }
                Some(_) => wait(estimate, *reach),
                None => best = Some((estimate, *reach)),
            }
        }
        let (estimate, reach) = best?;
        if self.workspace.queue.peek().is_some_and(|first| first.estimate < estimate) {
            self.workspace.reaches.push(reach);
            self.workspace.queue.push(Waiting { estimate, reach: (self.workspace.reaches.len() - 1) as u32 });
            return None;
        }
        Some(reach)
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

    fn lead_to(&mut self, reach: Reach) {
        self.next[self.next_count] = Some(reach);
        self.next_count += 1;
    }

    /// Leads beyond a side of a triangle; `seen` is the visible part of it, all of it if absent.
    fn cross_side(&mut self, here: &Triangle, side: usize, seen: Option<Interval>, root: u32) {
        let next = here.beyond[side];
        if next == NONE {
            return;
        }
        let there = &self.mesh.triangles[next as usize];
        if self.workspace.open[there.block as usize] != self.workspace.search {
            return;
        }
        // Counter-clockwise from inside: the first corner is on the right of one who leaves, the second on the left.
        let (right_end, left_end) = (here.places[side], here.places[(side + 1) % 3]);
        let seen = seen.unwrap_or(Interval { left: left_end, right: right_end });
        let is_at = |a: Corner, b: Corner| (a[0] - b[0]).abs() <= SAME_MM && (a[1] - b[1]).abs() <= SAME_MM;
        if is_at(seen.left, seen.right) {
            return;
        }
        self.lead_to(Reach {
            triangle: next,
            side: here.entered[side],
            is_corner: [is_at(seen.left, left_end), is_at(seen.right, right_end)],
            seen,
            root,
        });
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

    fn expand(&mut self, reach: &Reach) {
        let root = self.workspace.turns[reach.root as usize];
        if self.is_outdone(&root) {
            return;
        }
        if reach.triangle == self.goal.triangle {
            return self.arrive(reach, root.place);
        }
        let mesh = self.mesh;
        let triangle = &mesh.triangles[reach.triangle as usize];
        let side = usize::from(reach.side);
        // Entered through the side from the left corner to the right one; the far corner sees both other sides.
        let (left_end, right_end, far) = (side, (side + 1) % 3, (side + 2) % 3);
        let chain = [left_end, far, right_end].map(|corner| triangle.places[corner]);
        let is_at = |end: Corner| distance(root.place, end) <= SAME_MM;
        let Interval { left, right } = reach.seen;
        let left = if is_at(left) { 0.0 } else { meets(root.place, left, &chain) };
        let right = if is_at(right) { 2.0 } else { meets(root.place, right, &chain) };
        let right = right.max(left);
        // The sides beyond: from the far corner to the left one, and from the right one to the far one.
        let look = |search: &mut Self, from: f64, to: f64, root: u32| {
            if from < 1.0 {
                let seen = Interval { left: on_chain(&chain, from), right: on_chain(&chain, to.min(1.0)) };
                search.cross_side(triangle, far, Some(seen), root);
            }
            if to > 1.0 {
                let seen = Interval { left: on_chain(&chain, from.max(1.0)), right: on_chain(&chain, to) };
                search.cross_side(triangle, right_end, Some(seen), root);
            }
        };
        if right > left {
            look(self, left, right, reach.root);
        }
        for (which, corner, from, to) in [(0, left_end, 0.0, left), (1, right_end, right, 2.0)] {
            if to > from
                && reach.is_corner[which]
                && triangle.turns[corner]
                && let Some(root) = self.turn(reach.root, triangle.corners[corner], triangle.places[corner])
            {
                look(self, from, to, root);
            }
        }
    }

    /// The goal's triangle is entered: the last turns.
    fn arrive(&mut self, reach: &Reach, root: Corner) {
        let (goal, Interval { left, right }) = (self.goal.place, reach.seen);
        let is_seen = cross(root, left, goal) <= SAME_MM && cross(root, right, goal) >= -SAME_MM;
        let is_on = distance(root, left) <= SAME_MM || distance(root, right) <= SAME_MM;
        let root = if is_on || is_seen {
            reach.root
        } else {
            let is_left = cross(root, left, goal) > 0.0;
            let which = usize::from(!is_left);
            // An end that is no corner: another interval sees the goal.
            if !reach.is_corner[which] {
                return;
            }
            let triangle = &self.mesh.triangles[reach.triangle as usize];
            let corner = (usize::from(reach.side) + which) % 3;
            if !triangle.turns[corner] {
                return;
            }
            let Some(root) = self.turn(reach.root, triangle.corners[corner], triangle.places[corner]) else { return };
            root
        };
        self.lead_to(Reach { triangle: NONE, root, ..*reach });
    }
}
