//! The numbers that landmarks give to nodes, kept right while the graph changes.

use crate::graph::components::joined;
use crate::graph::road_graph::GraphShape;
use serde::{Deserialize, Serialize};
use std::cmp::Reverse;
use std::collections::{BTreeSet, BinaryHeap};

/// The number of a node that was reached from nowhere, and of all that are farther than can be
/// said.
pub(crate) const FAR: u32 = u32::MAX;

/// Where landmarks are looked for first: the outermost nodes.
const DIRECTIONS: [[i64; 2]; 8] = [[1, 1], [-1, -1], [1, -1], [-1, 1], [1, 0], [-1, 0], [0, 1], [0, -1]];

/// How many landmarks, and when they are made anew.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct LandmarksConfig {
    /// Slots: landmarks for each part of the map. Each takes 4 B a node. Default 16.
    pub slots: usize,
    /// Numbers that mending after one change may lower in one slot; beyond, the edge waits as a
    /// shortcut. Default 1000.
    pub repair_nodes: usize,
    /// Shortcuts that searches count with themselves; slots that cannot be right about more are not
    /// used. Default 8.
    pub shortcuts: usize,
    /// Landmarks are worn when more than this share of the edges was added, removed, lengthened or
    /// shortened. Default 0.2.
    pub worn_share: f64,
}

impl Default for LandmarksConfig {
    fn default() -> Self {
        Self { slots: 16, repair_nodes: 1000, shortcuts: 8, worn_share: 0.2 }
    }
}

/// Slots of all nodes, and the shortcuts that they do not know of.
#[derive(Clone, Debug)]
pub(crate) struct AltLandmarks {
    config: LandmarksConfig,
    /// Numbers count 2^shift micrometres.
    shift: u32,
    /// `slots` numbers for each node.
    numbers: Vec<u32>,
    /// Edges that slots need not be right about, low end first.
    shortcuts: BTreeSet<(u32, u32)>,
    /// Slots that are not right any more.
    off: BTreeSet<usize>,
    /// Edges changed since all was made.
    changes: usize,
    /// Edges there were then.
    edges: usize,
}

impl AltLandmarks {
    /// Chooses landmarks and measures from them: one search over the whole map for each slot, and
    /// one more.
    pub(crate) fn build(shape: &GraphShape, edges: usize, config: LandmarksConfig) -> Self {
        let nodes = shape.adjacency.len();
        let (parts, firsts) = joined(shape);
        // How far things are at all: from the first node of each part.
        let reach_um = from_set(shape, &firsts, |length_um| length_um, u64::MAX);
        let greatest_um = reach_um.iter().copied().max().unwrap_or_default();
        // No distance is more than twice that, and the map may grow to twice its size: two bits
        // more, of which 32 are kept.
        let shift = (u64::BITS + 2 - u32::BITS).saturating_sub(greatest_um.leading_zeros());
        let scale = |length_um: u64| u32::try_from(length_um >> shift).unwrap_or(FAR);
        let mut numbers = vec![FAR; nodes * config.slots];
        let mut nearest: Vec<u32> = reach_um.iter().map(|um| scale(*um)).collect();
        drop(reach_um);
        let mut chosen: Vec<BTreeSet<u32>> = vec![BTreeSet::new(); firsts.len()];
        for slot in 0..config.slots {
            let mut farthest = firsts.clone();
            for (node, &away) in (0..).zip(&nearest) {
                let best = &mut farthest[parts[node as usize] as usize];
                if away > nearest[*best as usize] {
                    *best = node;
                }
            }
            if let Some(direction) = DIRECTIONS.get(slot) {
                for (part, node) in outermost(shape, *direction, &parts, &firsts).into_iter().enumerate() {
                    if !chosen[part].contains(&node) {
                        farthest[part] = node;
                    }
                }
            }
            for (part, &node) in farthest.iter().enumerate() {
                chosen[part].insert(node);
            }
            let distances = from_set(shape, &farthest, scale, FAR);
            for (node, distance) in distances.into_iter().enumerate() {
                numbers[node * config.slots + slot] = distance;
                // The first search was not from a landmark.
                nearest[node] = if slot == 0 { distance } else { nearest[node].min(distance) };
            }
        }
        Self { config, shift, numbers, shortcuts: BTreeSet::new(), off: BTreeSet::new(), changes: 0, edges }
    }

    /// Whether so much has changed that building them anew would make searches faster.
    pub(crate) fn are_worn(&self) -> bool {
        !self.shortcuts.is_empty()
            || !self.off.is_empty()
            || self.changes as f64 > self.config.worn_share * self.edges as f64
    }

    /// The slots that are right.
    pub(crate) fn slots(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.config.slots).filter(|slot| !self.off.contains(slot))
    }

    /// Bytes on the heap.
    pub(crate) fn bytes(&self) -> usize {
        self.numbers.capacity() * size_of::<u32>()
    }

    pub(crate) fn shift(&self) -> u32 {
        self.shift
    }

    pub(crate) fn shortcuts(&self) -> impl Iterator<Item = (u32, u32)> + '_ {
        self.shortcuts.iter().copied()
    }

    /// The numbers of a node, one for each slot.
    #[inline]
    pub(crate) fn of(&self, node: u32) -> &[u32] {
        let slots = self.config.slots;
        &self.numbers[node as usize * slots..][..slots]
    }

    fn at(&self, node: u32, slot: usize) -> u32 {
        self.numbers[node as usize * self.config.slots + slot]
    }

    fn scaled(&self, length_um: u64) -> u32 {
        u32::try_from(length_um >> self.shift).unwrap_or(FAR)
    }

    /// A number was given to a new node, which has no edges yet.
    pub(crate) fn node_added(&mut self, node: u32) {
        let (start, slots) = (node as usize * self.config.slots, self.config.slots);
        self.numbers.resize(self.numbers.len().max(start + slots), FAR);
        self.numbers[start..start + slots].fill(FAR);
    }

    /// An edge was taken away.
    pub(crate) fn edge_removed(&mut self, a: u32, b: u32) {
        self.shortcuts.remove(&(a.min(b), a.max(b)));
        self.changes += 1;
    }

    /// An edge was added, or has another length. `shape` has it already.
    pub(crate) fn edge_changed(&mut self, shape: &GraphShape, a: u32, b: u32) {
        self.changes += 1;
        self.mend(shape, (a.min(b), a.max(b)));
    }

    fn mend(&mut self, shape: &GraphShape, edge: (u32, u32)) {
        if self.shortcuts.contains(&edge) {
            return;
        }
        let mut lowered = Vec::new();
        for slot in self.slots().collect::<Vec<_>>() {
            lowered.clear();
            if self.lower(shape, edge, slot, &mut lowered) {
                continue;
            }
            for &(node, before) in lowered.iter().rev() {
                self.numbers[node as usize * self.config.slots + slot] = before;
            }
            if self.shortcuts.len() < self.config.shortcuts {
                self.shortcuts.insert(edge);
                return; // slots mended so far are right with the edge and without it
            }
            self.off.insert(slot);
        }
    }

    /// Lowers the numbers of a slot until it is right about an edge. False if it gave up; `lowered`
    /// says what it did.
    fn lower(&mut self, shape: &GraphShape, (a, b): (u32, u32), slot: usize, lowered: &mut Vec<(u32, u32)>) -> bool {
        let length = self.scaled(shape.steps(a).find(|(to, _)| *to == b).map_or(u64::MAX, |(_, um)| um));
        let mut open = BinaryHeap::new();
        for (from, to) in [(a, b), (b, a)] {
            let through = self.at(from, slot).saturating_add(length);
            if through < self.at(to, slot) {
                open.push(Reverse((through, to)));
            }
        }
        while let Some(Reverse((number, node))) = open.pop() {
            let place = node as usize * self.config.slots + slot;
            if self.numbers[place] <= number {
                continue;
            }
            if lowered.len() >= self.config.repair_nodes {
                return false;
            }
            lowered.push((node, self.numbers[place]));
            self.numbers[place] = number;
            for (to, length_um) in shape.steps(node) {
                let through = number.saturating_add(self.scaled(length_um));
                if through < self.at(to, slot) && !self.shortcuts.contains(&(node.min(to), node.max(to))) {
                    open.push(Reverse((through, to)));
                }
            }
        }
        true
    }
}

/// The node of each part that lies farthest in a direction; of equally far ones the lowest number.
fn outermost(shape: &GraphShape, direction: [i64; 2], parts: &[u32], firsts: &[u32]) -> Vec<u32> {
    let along = |node: u32| {
        let place = shape.positions[node as usize];
        direction[0] * i64::from(place.x_mm) + direction[1] * i64::from(place.y_mm)
    };
    let mut outermost = firsts.to_vec();
    for (node, part) in (0..).zip(parts) {
        let best = &mut outermost[*part as usize];
        if along(node) > along(*best) {
            *best = node;
        }
    }
    outermost
}

/// How far every node is from the nearest of `sources`; `far` where none is reached.
fn from_set<T: Distance>(shape: &GraphShape, sources: &[u32], scale: impl Fn(u64) -> T, far: T) -> Vec<T> {
    let mut distances = vec![far; shape.adjacency.len()];
    let mut open = BinaryHeap::new();
    for &source in sources {
        distances[source as usize] = T::ZERO;
        open.push(Reverse((T::ZERO, source)));
    }
    while let Some(Reverse((distance, node))) = open.pop() {
        if distance > distances[node as usize] {
            continue;
        }
        for (to, length_um) in shape.steps(node) {
            let through = distance.plus(scale(length_um));
            if through < distances[to as usize] {
                distances[to as usize] = through;
                open.push(Reverse((through, to)));
            }
        }
    }
    distances
}

/// What distances are counted in; sums stop at the greatest.
trait Distance: Copy + Ord {
    const ZERO: Self;
    fn plus(self, other: Self) -> Self;
}

impl Distance for u32 {
    const ZERO: Self = 0;
    fn plus(self, other: Self) -> Self {
        self.saturating_add(other)
    }
}

impl Distance for u64 {
    const ZERO: Self = 0;
    fn plus(self, other: Self) -> Self {
        self.saturating_add(other)
    }
}
