//! Connected triangles: what lies beyond each side, which triangle contains a point, and through
//! which parts of the mesh a way between two triangles can lead.
//!
//! A side whose removal would divide the mesh is a *bridge*, such as the only door of a room. What
//! is connected without bridges is a *block*. Blocks and bridges form a tree, and a way leads only
//! through the blocks between its ends in that tree: a search enters a room with one door only if
//! the way begins or ends there.

use crate::navmesh::cell_grid::{CellGrid, Extent};
use crate::navmesh::plane::{Corner, cross, nearest_on};

/// No triangle, no block.
pub(crate) const NONE: u32 = u32::MAX;

/// A triangle of the mesh.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Triangle {
    /// Where its corners are, counter-clockwise.
    pub(crate) places: [Corner; 3],
    /// Their numbers.
    pub(crate) corners: [u32; 3],
    /// The triangle beyond the side from corner `i` to corner `i + 1`, or [`NONE`].
    pub(crate) beyond: [u32; 3],
    /// Which side of that triangle it is.
    pub(crate) entered: [u8; 3],
    /// Whether a shortest way may turn around the corner: free space is wider than half a turn
    /// there.
    pub(crate) turns: [bool; 3],
    /// Triangles that hang together have the same number.
    pub(crate) part: u32,
    /// Which block it belongs to.
    pub(crate) block: u32,
}

/// A block's place in the tree of blocks.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Block {
    /// The block beyond the bridge towards the root, or [`NONE`].
    pub(crate) parent: u32,
    /// Bridges between it and the root.
    pub(crate) depth: u32,
}

/// Triangles that hang together.
#[derive(Clone, Debug, Default)]
pub(crate) struct Mesh {
    pub(crate) triangles: Vec<Triangle>,
    pub(crate) blocks: Vec<Block>,
    /// One more than the greatest number of a corner.
    pub(crate) corner_count: usize,
    /// Triangles by place.
    cells: CellGrid,
    /// Sides that nothing is beyond.
    borders: Vec<(u32, [Corner; 2])>,
    border_cells: CellGrid,
}

/// A place in the mesh.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spot {
    pub(crate) triangle: u32,
    pub(crate) part: u32,
    pub(crate) place: Corner,
}

fn extent_of(places: &[Corner]) -> Extent {
    let start = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
    places.iter().fold(start, |[low, high], place| {
        [[low[0].min(place[0]), low[1].min(place[1])], [high[0].max(place[0]), high[1].max(place[1])]]
    })
}

impl Mesh {
    /// Of corners and triangles, counter-clockwise, by the numbers of their corners.
    pub(crate) fn of(corners: &[Corner], triangles: &[[u32; 3]]) -> Self {
        let places = triangles.iter().map(|t| t.map(|corner| corners[corner as usize]));
        let triangle = |(corners, places): (&[u32; 3], [Corner; 3])| Triangle {
            places,
            corners: *corners,
            beyond: [NONE; 3],
            entered: [0; 3],
            turns: [false; 3],
            part: NONE,
            block: NONE,
        };
        let triangles: Vec<Triangle> = triangles.iter().zip(places).map(triangle).collect();
        let extents: Vec<Extent> = triangles.iter().map(|triangle| extent_of(&triangle.places)).collect();
        let cells = CellGrid::of(&extents);
        let mut mesh = Self { triangles, cells, corner_count: corners.len(), ..Self::default() };
        mesh.join();
        mesh.find_turns();
        mesh.find_blocks();
        let open = mesh.triangles.iter().zip(0..).flat_map(|(triangle, index)| {
            let sides = (0..3).filter(|&side| triangle.beyond[side] == NONE);
            sides.map(move |side| (index, [triangle.places[side], triangle.places[(side + 1) % 3]]))
        });
        mesh.borders = open.collect();
        let extents: Vec<Extent> = mesh.borders.iter().map(|(_, ends)| extent_of(ends)).collect();
        mesh.border_cells = CellGrid::of(&extents);
        mesh
    }

    /// Finds the neighbours and the parts.
    fn join(&mut self) {
        let side = |triangle: &Triangle, side: usize| (triangle.corners[side], triangle.corners[(side + 1) % 3]);
        let mut sides: Vec<((u32, u32), u32, u8)> = Vec::with_capacity(3 * self.triangles.len());
        for (triangle, index) in self.triangles.iter().zip(0..) {
            sides.extend((0..3).map(|it| (side(triangle, it), index, it as u8)));
        }
        sides.sort_unstable();
        for index in 0..self.triangles.len() {
            for it in 0..3 {
                let (from, to) = side(&self.triangles[index], it);
                if let Ok(found) = sides.binary_search_by_key(&(to, from), |entry| entry.0) {
                    (self.triangles[index].beyond[it], self.triangles[index].entered[it]) =
                        (sides[found].1, sides[found].2);
                }
            }
        }
        for first in 0..self.triangles.len() {
            let mut waiting = vec![first as u32];
            while let Some(index) = waiting.pop() {
                let triangle = &mut self.triangles[index as usize];
                if triangle.part == NONE {
                    triangle.part = first as u32;
                    waiting.extend(triangle.beyond.iter().filter(|next| **next != NONE));
                }
            }
        }
    }

    /// Finds the corners that a shortest way may turn around: those at which the border turns
    /// right, with free space on its left.
    fn find_turns(&mut self) {
        // The border's sides that lead to and from each corner; where there are two of either,
        // parts of the mesh touch.
        let mut leads: Vec<[Option<Corner>; 2]> = vec![[None; 2]; self.corner_count];
        let mut turns = vec![false; self.corner_count];
        for triangle in &self.triangles {
            for side in (0..3).filter(|&side| triangle.beyond[side] == NONE) {
                let (from, to) = (side, (side + 1) % 3);
                for (end, which, other) in [(from, 1, to), (to, 0, from)] {
                    let corner = triangle.corners[end] as usize;
                    turns[corner] |= leads[corner][which].replace(triangle.places[other]).is_some();
                }
            }
        }
        for triangle in &mut self.triangles {
            for it in 0..3 {
                let corner = triangle.corners[it] as usize;
                let [Some(before), Some(after)] = leads[corner] else { continue };
                let is_bent = cross(before, triangle.places[it], after) <= 0.0;
                triangle.turns[it] = turns[corner] || is_bent;
            }
        }
    }

    /// Finds bridges, blocks and their tree (Tarjan: a side is a bridge if nothing behind it leads
    /// back past it).
    fn find_blocks(&mut self) {
        let count = self.triangles.len();
        // When each triangle was found, and the earliest that is found again from it or from behind
        // it.
        let (mut found, mut earliest) = (vec![NONE; count], vec![NONE; count]);
        let mut order: Vec<u32> = Vec::with_capacity(count);
        let mut parents = vec![NONE; count];
        let mut is_below_bridge = vec![false; count];
        for first in 0..count {
            if found[first] != NONE {
                continue;
            }
            // Triangles on the way, and the side of each that is looked at next.
            let mut way = vec![(first, 0)];
            (found[first], earliest[first]) = (order.len() as u32, order.len() as u32);
            order.push(first as u32);
            while let Some((here, side)) = way.last_mut() {
                let here = *here;
                if *side < 3 {
                    let next = self.triangles[here].beyond[*side];
                    *side += 1;
                    if next == NONE || next == parents[here] {
                        continue;
                    }
                    let next = next as usize;
                    if found[next] == NONE {
                        (found[next], earliest[next]) = (order.len() as u32, order.len() as u32);
                        order.push(next as u32);
                        parents[next] = here as u32;
                        way.push((next, 0));
                    } else {
                        earliest[here] = earliest[here].min(found[next]);
                    }
                } else {
                    way.pop();
                    let parent = parents[here];
                    if parent != NONE {
                        is_below_bridge[here] = earliest[here] > found[parent as usize];
                        earliest[parent as usize] = earliest[parent as usize].min(earliest[here]);
                    }
                }
            }
        }
        for index in order {
            let parent = parents[index as usize];
            let above = if parent == NONE { NONE } else { self.triangles[parent as usize].block };
            self.triangles[index as usize].block = if above == NONE || is_below_bridge[index as usize] {
                let depth = if above == NONE { 0 } else { self.blocks[above as usize].depth + 1 };
                self.blocks.push(Block { parent: above, depth });
                (self.blocks.len() - 1) as u32
            } else {
                above
            };
        }
    }

    /// The triangle that a place lies in.
    pub(crate) fn triangle_at(&self, place: Corner) -> Option<u32> {
        self.cells.at(place).iter().copied().find(|&index| {
            let [a, b, c] = self.triangles[index as usize].places;
            cross(a, b, place) >= 0.0 && cross(b, c, place) >= 0.0 && cross(c, a, place) >= 0.0
        })
    }

    pub(crate) fn spot(&self, triangle: u32, place: Corner) -> Spot {
        Spot { triangle, part: self.triangles[triangle as usize].part, place }
    }

    /// The border within `reach_mm` of a place: triangles, their sides that nothing is beyond, and
    /// the nearest place on each.
    pub(crate) fn borders_around(
        &self,
        place: Corner,
        reach_mm: f64,
    ) -> impl Iterator<Item = (u32, [Corner; 2], Corner)> + '_ {
        let around = [[place[0] - reach_mm, place[1] - reach_mm], [place[0] + reach_mm, place[1] + reach_mm]];
        self.border_cells.within(&around).into_iter().map(move |index| {
            let (triangle, ends) = self.borders[index as usize];
            (triangle, ends, nearest_on(ends, place))
        })
    }
}
