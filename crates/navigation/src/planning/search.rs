//! Best-first search over eight-connected cells with integer costs and a bucket queue.
//!
//! Dijkstra and A* are one routine: without a target the heuristic is zero. A straight step of
//! weight 1 costs [`STRAIGHT`], a diagonal one [`DIAGONAL`]: 99/70 is √2 to 5e-5.

use fht_perception::grid::{Cell, CellBounds};

/// Cost of a straight step between cells of weight 1.
pub(super) const STRAIGHT: u32 = 70;
/// Cost of a diagonal step between cells of weight 1.
pub(super) const DIAGONAL: u32 = 99;
/// A cell's weight is stored in 16ths: 16 is plain length, 0 is not passable.
pub(super) const UNIT_WEIGHT: u8 = 16;

/// Cost to come of every cell that a search reached.
pub(super) struct CostField {
    /// Cost plus one; zero is "not reached". So a fresh field is untouched zero pages and a short
    /// search stays cheap.
    cost_plus_one: Vec<u32>,
}

impl CostField {
    /// Cost from the start to the cell at `index`, where the search got there. After a search with
    /// a target, costs of cells other than the target may be greater than the least.
    pub(super) fn cost(&self, index: usize) -> Option<u32> {
        self.cost_plus_one.get(index).and_then(|&cost| cost.checked_sub(1))
    }
}

/// The eight steps; the straight ones first, so that ties are broken in their favour.
const STEPS: [(i32, i32); 8] = [(1, 0), (0, 1), (-1, 0), (0, -1), (1, 1), (-1, 1), (-1, -1), (1, -1)];

/// Passable neighbours of a cell with the cost of the step. A diagonal step needs both cells beside
/// it passable, so that a way never squeezes through a corner.
fn for_each_step(
    bounds: &CellBounds,
    weights: &[u8],
    cell: Cell,
    index: usize,
    mut visit: impl FnMut(Cell, usize, u32),
) {
    let here = u32::from(weights[index]);
    let mut open = [false; 4];
    for (direction, &(di, dj)) in STEPS.iter().enumerate() {
        let diagonal = direction >= 4;
        if diagonal && !(open[direction - 4] && open[(direction - 3) % 4]) {
            continue;
        }
        let next = Cell { i: cell.i + di, j: cell.j + dj };
        let Some(next_index) = bounds.index(next) else { continue };
        let there = u32::from(weights[next_index]);
        if there == 0 {
            continue;
        }
        if !diagonal {
            open[direction] = true;
        }
        let length = if diagonal { DIAGONAL } else { STRAIGHT };
        visit(next, next_index, length * (here + there) / (2 * u32::from(UNIT_WEIGHT)));
    }
}

/// The least cost of eight-connected steps between two cells, whatever lies between: an admissible,
/// consistent heuristic.
fn octile(a: Cell, b: Cell) -> u32 {
    let (di, dj) = (a.i.abs_diff(b.i), a.j.abs_diff(b.j));
    STRAIGHT * di.max(dj) + (DIAGONAL - STRAIGHT) * di.min(dj)
}

/// How far a search goes.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Extent {
    /// To this cell (A*).
    Target(Cell),
    /// Everywhere that costs at most so much (Dijkstra).
    Cost(u32),
}

/// Searches from `start` over the passable cells.
pub(super) fn search(bounds: &CellBounds, weights: &[u8], start: Cell, extent: Extent) -> CostField {
    let mut field = CostField { cost_plus_one: vec![0; weights.len()] };
    let Some(start_index) = bounds.index(start).filter(|&index| weights[index] > 0) else { return field };
    let (target, limit) = match extent {
        Extent::Target(target) => (Some(target), u32::MAX),
        Extent::Cost(limit) => (None, limit),
    };
    let estimate = |cell: Cell| target.map_or(0, |target| octile(cell, target));

    // Keys in the queue differ by at most one step's cost and the change of the heuristic over it.
    let span = (2 * DIAGONAL * u32::from(u8::MAX) / u32::from(UNIT_WEIGHT) + 1).next_power_of_two() as usize;
    let mut buckets: Vec<Vec<(u32, u32)>> = vec![Vec::new(); span];
    let mut queued = 1_usize;
    field.cost_plus_one[start_index] = 1;
    let mut key = estimate(start) as usize;
    buckets[key % span].push((start_index as u32, 0));
    while queued > 0 {
        let Some((index, cost)) = buckets[key % span].pop() else {
            key += 1;
            continue;
        };
        queued -= 1;
        let index = index as usize;
        if field.cost_plus_one[index] != cost + 1 {
            continue; // A cheaper way was found after this was queued.
        }
        let cell = bounds.cell(index);
        if target == Some(cell) {
            break;
        }
        for_each_step(bounds, weights, cell, index, |next, next_index, step| {
            let next_cost = cost + step;
            let known = &mut field.cost_plus_one[next_index];
            if next_cost <= limit && (*known == 0 || *known > next_cost + 1) {
                *known = next_cost + 1;
                buckets[(next_cost + estimate(next)) as usize % span].push((next_index as u32, next_cost));
                queued += 1;
            }
        });
    }
    field
}

/// The cells from the start of the search to `end`, both included, by walking down the costs. Empty
/// if `end` was not reached. For a search with a target, `end` must be that target.
pub(super) fn trace(bounds: &CellBounds, weights: &[u8], field: &CostField, end: Cell) -> Vec<Cell> {
    let mut cells = Vec::new();
    let Some(mut index) = bounds.index(end) else { return cells };
    let Some(mut cost) = field.cost(index) else { return cells };
    let mut cell = end;
    cells.push(cell);
    while cost > 0 {
        let mut previous = None;
        for_each_step(bounds, weights, cell, index, |next, next_index, step| {
            if previous.is_none() && field.cost(next_index).is_some_and(|before| before + step == cost) {
                previous = Some((next, next_index, cost - step));
            }
        });
        // Every reached cell but the start was reached from a neighbour at exactly this difference.
        let Some((next, next_index, next_cost)) = previous else { break };
        (cell, index, cost) = (next, next_index, next_cost);
        cells.push(cell);
    }
    cells.reverse();
    cells
}
