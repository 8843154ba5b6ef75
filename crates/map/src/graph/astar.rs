//! The shortest way over a graph of a million nodes: A* with the bounds of
//! [landmarks](crate::graph::alt), which passes through [cells](crate::graph::overlay_cells) in one
//! step.
//!
//! Of nodes that promise the same the one that has come farther is looked at first: on a grid,
//! where very many ways are equally short, the search then goes straight to the goal. What a search
//! writes down stays in a [`Workspace`] and is told from older searches by their running number, so
//! that a query touches only what it reaches.
//!
//! What holds for one query alone (closed edges, edges that count more than their length) is an
//! [`Overlay`]. It needs no new landmarks: ways only become longer by it.

use crate::graph::alt::Bounds;
use crate::graph::overlay_cells::OverlayCells;
use crate::graph::road_graph::RoadGraph;
use crate::graph::search_index::SearchIndex;
use std::collections::BinaryHeap;

/// What a query thinks of edges.
pub trait Overlay {
    /// How many times its length the edge counts on the way from one node (by number) to the other,
    /// or `None` if it is closed. What is less than 1 (or not a number) counts as 1.
    fn factor(&self, from: u32, to: u32) -> Option<f64>;

    /// The ends of all edges that are closed or count more than their length. `None`: any may be;
    /// the search then does not pass through cells in one step.
    fn ends(&self) -> Option<Vec<u32>> {
        None
    }
}

/// All edges are open and count what they are long.
#[derive(Clone, Copy, Debug, Default)]
pub struct AllOpen;

impl Overlay for AllOpen {
    #[inline]
    fn factor(&self, _: u32, _: u32) -> Option<f64> {
        Some(1.0)
    }

    fn ends(&self) -> Option<Vec<u32>> {
        Some(Vec::new())
    }
}

impl<F: Fn(u32, u32) -> Option<f64>> Overlay for F {
    #[inline]
    fn factor(&self, from: u32, to: u32) -> Option<f64> {
        self(from, to)
    }
}

/// A few edges that are closed or count more than their length, both ways.
#[derive(Clone, Debug, Default)]
pub struct Exceptions {
    /// By ends, the lower number first, in order.
    factors: Vec<((u32, u32), Option<f64>)>,
}

impl Exceptions {
    /// Edges by the numbers of their ends, with their factors or `None` if they are closed. Of one
    /// edge the first counts.
    #[must_use]
    pub fn new(edges: impl IntoIterator<Item = (u32, u32, Option<f64>)>) -> Self {
        let in_order = |(a, b, factor): (u32, u32, Option<f64>)| ((a.min(b), a.max(b)), factor);
        let mut factors: Vec<((u32, u32), Option<f64>)> = edges.into_iter().map(in_order).collect();
        factors.sort_by_key(|(ends, _)| *ends); // stable
        factors.dedup_by_key(|(ends, _)| *ends);
        Self { factors }
    }
}

impl Overlay for Exceptions {
    #[inline]
    fn factor(&self, from: u32, to: u32) -> Option<f64> {
        if self.factors.is_empty() {
            return Some(1.0);
        }
        let place = self.factors.binary_search_by_key(&(from.min(to), from.max(to)), |(ends, _)| *ends);
        place.map_or(Some(1.0), |place| self.factors[place].1)
    }

    fn ends(&self) -> Option<Vec<u32>> {
        Some(self.factors.iter().flat_map(|&((a, b), _)| [a, b]).collect())
    }
}

/// What an edge counts, micrometres.
#[inline]
fn counted_um(length_um: u64, factor: f64) -> u64 {
    if factor > 1.0 { ((length_um as f64 * factor).round() as u64).max(length_um) } else { length_um }
}

/// A way found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Way {
    /// What it counts, start and goal included, micrometres.
    pub cost_um: u64,
    /// Its nodes, by number, from a start to a goal.
    pub nodes: Vec<u32>,
    /// How many nodes the search went on from.
    pub expanded: usize,
}

const NOWHERE: u32 = u32::MAX;

/// What a search knows of a node.
#[derive(Clone, Copy, Debug, Default)]
struct Reached {
    cost_um: u64,
    before: u32,
    search: u32,
}

/// A node to go on from. The heap gives the greatest: the least promise, then the greatest cost,
/// then the least number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Open {
    promise_um: u64,
    cost_um: u64,
    node: u32,
}

impl Ord for Open {
    #[inline]
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        let promise = other.promise_um.cmp(&self.promise_um);
        promise.then(self.cost_um.cmp(&other.cost_um)).then_with(|| other.node.cmp(&self.node))
    }
}

impl PartialOrd for Open {
    #[inline]
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

/// Memory that searches use again: 16 B for each node of the largest graph that was searched.
#[derive(Clone, Debug, Default)]
pub struct Workspace {
    reached: Vec<Reached>,
    open: BinaryHeap<Open>,
    /// The search that goes into a cell, by cell.
    entered: Vec<u32>,
    search: u32,
}

impl Workspace {
    fn begin(&mut self, nodes: usize, cells: usize) {
        self.open.clear();
        self.search = self.search.wrapping_add(1);
        if self.search == 0 {
            self.reached.clear(); // after 2³² searches their numbers come again
            self.entered.clear();
            self.search = 1;
        }
        self.reached.resize(nodes.max(self.reached.len()), Reached::default());
        self.entered.resize(cells.max(self.entered.len()), 0);
    }

    /// Notes a way to a node if it is better than what was known.
    #[inline]
    fn reach(&mut self, node: u32, before: u32, cost_um: u64) -> bool {
        let reached = &mut self.reached[node as usize];
        let is_better = reached.search != self.search || cost_um < reached.cost_um;
        if is_better {
            *reached = Reached { cost_um, before, search: self.search };
        }
        is_better
    }

    /// The cell of a node, if this search passes it through.
    #[inline]
    fn passed(&self, cells: &OverlayCells, node: u32) -> Option<u32> {
        cells.closed(node).filter(|cell| self.entered[*cell as usize] != self.search)
    }

    /// The nodes up to `last`.
    fn way(&self, last: u32) -> Vec<u32> {
        let before = |node: &u32| Some(self.reached[*node as usize].before).filter(|before| *before != NOWHERE);
        let mut nodes: Vec<u32> = std::iter::successors(Some(last), before).collect();
        nodes.reverse();
        nodes
    }
}

/// Those of some ends that are nodes, by number, each once with the least that it counts.
fn known(ends: &[(u32, u64)], roads: &RoadGraph) -> Vec<(u32, u64)> {
    let mut known: Vec<(u32, u64)> =
        ends.iter().copied().filter(|(node, _)| (*node as usize) < roads.numbers()).collect();
    known.sort_unstable(); // of a node named twice the cheaper comes first
    known.dedup_by_key(|(node, _)| *node);
    known
}

/// The nodes of the way found to `last`, with those inside of cells that it passes through.
fn unfolded(work: &Workspace, cells: Option<&OverlayCells>, last: u32) -> Vec<u32> {
    let mut nodes = Vec::new();
    for to in work.way(last) {
        // Two nodes of a cell that was passed through are doors, and the way leads through its
        // inside.
        let passed = cells.and_then(|cells| Some((cells, work.passed(cells, to)?)));
        match (passed, nodes.last().copied()) {
            (Some((cells, cell)), Some(from)) if cells.of(from) == Some(cell) => {
                nodes.extend(cells.inside(cell, from, to));
            }
            _ => nodes.push(to),
        }
    }
    nodes
}

/// The way from one of `starts` to one of `goals` that counts least: its edges, and what the start
/// and the goal count themselves, micrometres. `None` if there is none. Numbers of no nodes are
/// passed over. `guide` must be that of `roads`, or `None` for Dijkstra's algorithm.
#[must_use]
pub fn shortest_way(
    roads: &RoadGraph,
    guide: Option<&SearchIndex>,
    starts: &[(u32, u64)],
    goals: &[(u32, u64)],
    overlay: &impl Overlay,
    work: &mut Workspace,
) -> Option<Way> {
    let (starts, mut goals) = (known(starts, roads), known(goals, roads));
    if let Some(parts) = guide.map(SearchIndex::parts) {
        let reached: Vec<Option<u32>> = starts.iter().map(|(node, _)| parts.of(*node)).collect();
        goals.retain(|(node, _)| reached.contains(&parts.of(*node)));
    }
    if starts.is_empty() || goals.is_empty() {
        return None;
    }
    let shape = roads.shape();
    let bounds = guide.map(|guide| Bounds::new(guide.landmarks(), shape, &starts, &goals));
    let least_um = |node: u32| bounds.as_ref().map_or(0, |bounds| bounds.least_um(node));
    let ends = overlay.ends();
    let cells = guide.map(SearchIndex::cells).filter(|_| ends.is_some());
    work.begin(roads.numbers(), cells.map_or(0, OverlayCells::len));
    let entered = starts.iter().chain(&goals).map(|(node, _)| *node).chain(ends.into_iter().flatten());
    for cell in entered.filter_map(|node| cells?.of(node)) {
        work.entered[cell as usize] = work.search;
    }
    for &(node, cost_um) in &starts {
        work.reach(node, NOWHERE, cost_um);
        work.open.push(Open { promise_um: cost_um.saturating_add(least_um(node)), cost_um, node });
    }
    let (mut best, mut expanded) = (None, 0);
    while let Some(Open { promise_um, cost_um, node }) = work.open.pop() {
        if best.is_some_and(|(best_um, _)| best_um <= promise_um) {
            break;
        }
        if cost_um > work.reached[node as usize].cost_um {
            continue; // a better way to it was found since
        }
        expanded += 1;
        if let Ok(place) = goals.binary_search_by_key(&node, |(goal, _)| *goal) {
            let whole_um = cost_um.saturating_add(goals[place].1);
            if best.is_none_or(|(best_um, _)| whole_um < best_um) {
                best = Some((whole_um, node));
            }
        }
        let passed = cells.and_then(|cells| Some((cells, work.passed(cells, node)?)));
        let mut reach = |to: u32, um: u64| {
            let through_um = cost_um.saturating_add(um);
            if work.reach(to, node, through_um) {
                let promise_um = through_um.saturating_add(least_um(to));
                work.open.push(Open { promise_um, cost_um: through_um, node: to });
            }
        };
        if let Some((cells, cell)) = passed {
            cells.doors_from(cell, node).for_each(|(door, um)| reach(door, um));
        }
        for (to, length_um) in shape.steps(node) {
            if passed.is_some_and(|(cells, cell)| cells.of(to) == Some(cell)) {
                continue;
            }
            if let Some(factor) = overlay.factor(node, to) {
                reach(to, counted_um(length_um, factor));
            }
        }
    }
    let (cost_um, last) = best?;
    let nodes = unfolded(work, cells, last);
    Some(Way { cost_um, nodes, expanded })
}
