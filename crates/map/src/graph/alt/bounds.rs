//! How far it is at least to the goals of a query: what A* adds to the way that it has gone.
//!
//! A goal may count something itself (the way from the node to a place). For one slot of the
//! [landmarks](crate::graph::alt), goals `g` that count `c` and a node `v`, the least of `D(v) -
//! D(g) + c` and of `D(g) + c - D(v)` over all goals are both bounds; so all goals together are two
//! numbers for each slot. The bounds change by no more than an edge is long from one of its ends to
//! the other, so A* need not look at a node twice.
//!
//! Shortcuts that slots do not know of are counted with: the way either uses none of them, or it
//! first goes to an end of one, from which it is so far at least. How far that is comes from the
//! same bounds, made right with each other and with the shortcuts.

use crate::graph::alt::landmarks::{AltLandmarks, FAR};
use crate::graph::road_graph::GraphShape;
use std::cmp::Reverse;

/// Slots that a query uses: those that say most about it. Fewer are not faster: a node's numbers
/// are in one cache line anyway, and on a grid a slot that says little about the start keeps the
/// search from passing by the goal.
pub(crate) const USED: usize = 16;

/// What the used slots say about one aim: a way from `v` to it takes at least `D(v) - upper` and at
/// least `lower - D(v)`.
#[derive(Clone, Copy, Debug)]
struct Aim {
    upper: [u32; USED],
    lower: [u32; USED],
    /// How far it is at least from the aim to a goal, micrometres.
    beyond_um: u64,
}

impl Aim {
    #[inline]
    fn least(&self, numbers: &[u32; USED]) -> u32 {
        let mut least = 0;
        for ((&number, &upper), &lower) in numbers.iter().zip(&self.upper).zip(&self.lower) {
            least = least.max(number.saturating_sub(upper)).max(lower.saturating_sub(number));
        }
        least
    }
}

/// Lower bounds for one query.
#[derive(Clone, Debug)]
pub(crate) struct Bounds<'a> {
    landmarks: &'a AltLandmarks,
    slots: [usize; USED],
    goal: Aim,
    /// Ends of shortcuts.
    detours: Vec<Aim>,
}

impl<'a> Bounds<'a> {
    /// For a query from any of `starts` to any of `goals`: nodes, and what is counted for each,
    /// micrometres.
    pub(crate) fn new(
        landmarks: &'a AltLandmarks,
        shape: &GraphShape,
        starts: &[(u32, u64)],
        goals: &[(u32, u64)],
    ) -> Self {
        let scaled = |um: u64| u32::try_from(um >> landmarks.shift()).unwrap_or(FAR);
        let aim_of = |slot: usize| {
            let upper = goals.iter().map(|&(goal, um)| landmarks.of(goal)[slot].saturating_sub(scaled(um))).max();
            let lower = goals.iter().map(|&(goal, um)| landmarks.of(goal)[slot].saturating_add(scaled(um))).min();
            (upper.unwrap_or(FAR), lower.unwrap_or(0))
        };
        let says = |&(slot, (upper, lower)): &(usize, (u32, u32))| {
            let least = |start: u32| {
                let number = landmarks.of(start)[slot];
                number.saturating_sub(upper).max(lower.saturating_sub(number))
            };
            starts.iter().map(|&(start, _)| least(start)).min().unwrap_or_default()
        };
        let mut best: Vec<(usize, (u32, u32))> = landmarks.slots().map(|slot| (slot, aim_of(slot))).collect();
        best.sort_by_cached_key(|aim| (Reverse(says(aim)), aim.0));
        // A slot that there is not says nothing.
        let mut slots = [usize::MAX; USED];
        let mut goal = Aim { upper: [FAR; USED], lower: [0; USED], beyond_um: 0 };
        for (used, (slot, (upper, lower))) in best.into_iter().take(USED).enumerate() {
            (slots[used], goal.upper[used], goal.lower[used]) = (slot, upper, lower);
        }
        let mut bounds = Self { landmarks, slots, goal, detours: Vec::new() };
        bounds.count_shortcuts(shape);
        bounds
    }

    fn numbers(&self, node: u32) -> [u32; USED] {
        let all = self.landmarks.of(node);
        self.slots.map(|slot| all.get(slot).copied().unwrap_or_default())
    }

    fn um(&self, least: u32) -> u64 {
        u64::from(least) << self.landmarks.shift()
    }

    /// How far it is at least from a node to a goal, micrometres, with what the goal counts.
    #[inline]
    pub(crate) fn least_um(&self, node: u32) -> u64 {
        let numbers = self.numbers(node);
        let mut least_um = self.um(self.goal.least(&numbers));
        for aim in &self.detours {
            least_um = least_um.min(self.um(aim.least(&numbers)).saturating_add(aim.beyond_um));
        }
        least_um
    }

    fn count_shortcuts(&mut self, shape: &GraphShape) {
        let shortcuts: Vec<(u32, u32)> = self.landmarks.shortcuts().collect();
        let mut ends: Vec<u32> = shortcuts.iter().flat_map(|&(a, b)| [a, b]).collect();
        ends.sort_unstable();
        ends.dedup();
        let aim = |&end: &u32| {
            let numbers = self.numbers(end);
            Aim { upper: numbers, lower: numbers, beyond_um: self.um(self.goal.least(&numbers)) }
        };
        let mut aims: Vec<Aim> = ends.iter().map(aim).collect();
        let apart_um = |a: usize, b: usize| {
            let is_shortcut = shortcuts.contains(&(ends[a].min(ends[b]), ends[a].max(ends[b])));
            let by_slots = self.um(aims[a].least(&self.numbers(ends[b])));
            if is_shortcut { by_slots.min(shape.apart_um(ends[a], ends[b])) } else { by_slots }
        };
        let table: Vec<Vec<u64>> = (0..ends.len()).map(|a| (0..ends.len()).map(|b| apart_um(a, b)).collect()).collect();
        // As often as there are ends, so that whatever one says has come to all others.
        for _ in 0..ends.len() {
            for a in 0..ends.len() {
                for (b, &apart_um) in table[a].iter().enumerate() {
                    aims[a].beyond_um = aims[a].beyond_um.min(apart_um.saturating_add(aims[b].beyond_um));
                }
            }
        }
        self.detours = aims;
    }
}

impl AltLandmarks {
    /// How far it is at least between two nodes over edges, micrometres. 0 for numbers of no nodes.
    pub(crate) fn at_least_um(&self, shape: &GraphShape, a: u32, b: u32) -> u64 {
        let are_known = [a, b].iter().all(|&node| (node as usize) < shape.adjacency.len());
        if are_known { Bounds::new(self, shape, &[(a, 0)], &[(b, 0)]).least_um(a) } else { 0 }
    }
}
