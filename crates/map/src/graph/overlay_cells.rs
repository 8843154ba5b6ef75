//! Cells that a search crosses in one step: pieces of the graph with few edges between them, and
//! the distances between their *doors* (the nodes with an edge to another piece).
//!
//! Landmarks alone are of little use in buildings, where a goal may lie behind any of many doors
//! whose bounds are equally good. With cells, a search that reaches a door continues from the
//! cell's other doors at once. It enters only the cells in which it begins or ends, or in which
//! something holds for this query alone. This is the overlay of customizable route planning
//! (Delling et al., "Customizable route planning in road networks", 2013) with one level. Where a
//! graph has no narrow places (a grid), cells have many doors and are searched like any other part.
//!
//! A change makes the cells that it touches *open* (searched through) until `OverlayCells::tidy`
//! has measured them again, in time by the size of a cell. Nodes added later are in no cell until
//! the next build.

use crate::graph::partition::pieces;
use crate::graph::road_graph::GraphShape;
use serde::{Deserialize, Serialize};
use std::cmp::Reverse;
use std::collections::{BTreeSet, BinaryHeap};

/// The cell of a node that is in none.
const NONE: u32 = u32::MAX;
/// A cell with more doors is searched through: passing it would save little, and each door costs a
/// search when it changes.
const MOST_DOORS: usize = 24;
/// No way inside of the cell.
const NO_WAY: u64 = u64::MAX;

/// How large cells are.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct CellsConfig {
    /// Nodes in a cell at most, up to 65,535; 0 for no cells. Default 1024.
    pub most_nodes: usize,
}

impl Default for CellsConfig {
    fn default() -> Self {
        Self { most_nodes: 1024 }
    }
}

#[derive(Clone, Debug, Default)]
struct Cell {
    /// Its nodes, in order.
    members: Vec<u32>,
    /// The members with edges to other cells, in order; empty while the cell is open.
    doors: Vec<u32>,
    /// For each door the distances to all doors, inside the cell, micrometres.
    apart_um: Vec<u64>,
    /// For each door and member the member before it on the way from the door.
    before: Vec<u16>,
    is_open: bool,
}

/// A graph's cells.
#[derive(Clone, Debug, Default)]
pub(crate) struct OverlayCells {
    of: Vec<u32>,
    cells: Vec<Cell>,
    dirty: BTreeSet<u32>,
}

impl OverlayCells {
    pub(crate) fn build(shape: &GraphShape, config: &CellsConfig) -> Self {
        if config.most_nodes == 0 {
            return Self { of: vec![NONE; shape.adjacency.len()], ..Self::default() };
        }
        let (of, count) = pieces(shape, config.most_nodes.min(u16::MAX.into()));
        let mut cells = vec![Cell::default(); count];
        for (node, &cell) in (0..).zip(&of) {
            cells[cell as usize].members.push(node);
        }
        let dirty = (0..count as u32).collect();
        let mut cells = Self { of, cells, dirty };
        cells.tidy(shape);
        cells
    }

    /// How many there are.
    pub(crate) fn len(&self) -> usize {
        self.cells.len()
    }

    /// The cell of a node, open or not.
    #[inline]
    pub(crate) fn of(&self, node: u32) -> Option<u32> {
        self.of.get(node as usize).copied().filter(|cell| *cell != NONE)
    }

    /// The cell of a node, if searches may pass it through.
    #[inline]
    pub(crate) fn closed(&self, node: u32) -> Option<u32> {
        self.of(node).filter(|cell| !self.cells[*cell as usize].is_open)
    }

    /// The doors of a cell with their distances from one of them, micrometres.
    #[inline]
    pub(crate) fn doors_from(&self, cell: u32, door: u32) -> impl Iterator<Item = (u32, u64)> + '_ {
        let Cell { doors, apart_um, .. } = &self.cells[cell as usize];
        let row = doors.binary_search(&door).map_or(&[][..], |row| &apart_um[row * doors.len()..][..doors.len()]);
        doors.iter().copied().zip(row.iter().copied()).filter(|(_, um)| *um != NO_WAY)
    }

    /// The way from door to door inside a cell, the first door left out; empty if there is none.
    pub(crate) fn inside(&self, cell: u32, from: u32, to: u32) -> Vec<u32> {
        let Cell { members, doors, before, .. } = &self.cells[cell as usize];
        let mut way = Vec::new();
        let (Ok(row), Ok(mut at)) = (doors.binary_search(&from), members.binary_search(&to)) else { return way };
        while members[at] != from && way.len() < members.len() {
            way.push(members[at]);
            at = before[row * members.len() + at].into();
        }
        way.reverse();
        way
    }

    /// An edge of this node was added, removed or has another length, or it was moved.
    pub(crate) fn touch(&mut self, node: u32) {
        if let Some(cell) = self.of(node) {
            self.dirty.insert(cell);
            self.cells[cell as usize].is_open = true;
        }
    }

    /// Takes a node out of its cell: it was removed, or its number is given to another one. Its
    /// neighbours must be touched, too.
    pub(crate) fn forget(&mut self, node: u32) {
        self.touch(node);
        self.of.resize(self.of.len().max(node as usize + 1), NONE);
        let cell = std::mem::replace(&mut self.of[node as usize], NONE);
        if let Some(cell) = self.cells.get_mut(cell as usize) {
            cell.members.retain(|member| *member != node);
        }
    }

    /// Measures the cells that were touched.
    pub(crate) fn tidy(&mut self, shape: &GraphShape) {
        for cell in std::mem::take(&mut self.dirty) {
            let members = std::mem::take(&mut self.cells[cell as usize].members);
            self.cells[cell as usize] = self.measured(shape, cell, members);
        }
    }

    fn measured(&self, shape: &GraphShape, cell: u32, members: Vec<u32>) -> Cell {
        let leads_out = |node: &u32| shape.adjacency.arcs(*node).iter().any(|arc| self.of[arc.to as usize] != cell);
        let doors: Vec<u32> = members.iter().copied().filter(leads_out).collect();
        // To pass it, every door is joined to every other one; to go in, its edges are followed.
        if doors.len() > MOST_DOORS || doors.len() * doors.len() > 8 * members.len() {
            return Cell { members, is_open: true, ..Cell::default() };
        }
        let inside = |node: &u32| -> Vec<(u16, u64)> {
            let steps = shape.steps(*node);
            steps.filter_map(|(to, um)| Some((members.binary_search(&to).ok()? as u16, um))).collect()
        };
        let steps: Vec<Vec<(u16, u64)>> =
            if doors.len() < 2 { Vec::new() } else { members.iter().map(inside).collect() };
        let (mut apart_um, mut before) = (Vec::new(), Vec::new());
        for door in doors.iter().filter(|_| doors.len() > 1) {
            let from = members.binary_search(door).unwrap_or_default();
            let (distances, tree) = from_member(&steps, from);
            let at = |door: &u32| members.binary_search(door).map_or(NO_WAY, |place| distances[place]);
            apart_um.extend(doors.iter().map(at));
            before.extend(tree);
        }
        let doors = if doors.len() > 1 { doors } else { Vec::new() };
        Cell { members, doors, apart_um, before, is_open: false }
    }

    /// Bytes on the heap.
    pub(crate) fn bytes(&self) -> usize {
        let of_cell = |cell: &Cell| {
            (cell.members.capacity() + cell.doors.capacity()) * size_of::<u32>()
                + cell.apart_um.capacity() * size_of::<u64>()
                + cell.before.capacity() * size_of::<u16>()
                + size_of::<Cell>()
        };
        self.of.capacity() * size_of::<u32>() + self.cells.iter().map(of_cell).sum::<usize>()
    }
}

/// Distances of all members from one of them, and the member before each.
fn from_member(steps: &[Vec<(u16, u64)>], from: usize) -> (Vec<u64>, Vec<u16>) {
    let (mut distances, mut before) = (vec![NO_WAY; steps.len()], vec![0; steps.len()]);
    distances[from] = 0;
    let mut open = BinaryHeap::from([Reverse((0, from as u16))]);
    while let Some(Reverse((distance, node))) = open.pop() {
        if distance > distances[node as usize] {
            continue;
        }
        for &(to, length_um) in &steps[node as usize] {
            let through = distance.saturating_add(length_um);
            if through < distances[to as usize] {
                (distances[to as usize], before[to as usize]) = (through, node);
                open.push(Reverse((through, to)));
            }
        }
    }
    (distances, before)
}
