//! Which points are near a place: tiles in a hash map, each of 8 × 8 cells, and in each cell a
//! chain of points. A bit for each cell says whether it holds any, so that empty space costs
//! nothing.

use crate::pose::Point2;
use crate::square::{SquareIndex, square_of};
use nalgebra::Vector2;
use rustc_hash::FxHashMap;

/// Side of a cell, metres: most searches end in the cell where they begin.
const CELL_M: f64 = 0.1;
/// Cells along a tile's side, as a power of two.
const TILE_BITS: u32 = 3;
const TILE_CELLS: i32 = 1 << TILE_BITS;
/// The first column of a tile's cells.
const COLUMN: u64 = 0x0101_0101_0101_0101;
/// The end of a chain.
const NONE: u32 = u32::MAX;

/// Points by where they are. They are numbered in the order in which they are added.
#[derive(Clone, Debug, Default)]
pub(super) struct PointIndex {
    places: Vec<Place>,
    tiles: FxHashMap<(i32, i32), u32>,
    store: Vec<Tile>,
}

#[derive(Clone, Copy, Debug)]
struct Place {
    position: Point2,
    /// The next point of the same cell.
    next: u32,
}

#[derive(Clone, Debug)]
struct Tile {
    occupied: u64,
    heads: [u32; 64],
}

fn cell_of(point: Point2) -> SquareIndex {
    square_of(point, CELL_M)
}

fn tile_of(cell: SquareIndex) -> (i32, i32) {
    (cell.0 >> TILE_BITS, cell.1 >> TILE_BITS)
}

fn bit_of(cell: SquareIndex) -> u32 {
    ((cell.1 & (TILE_CELLS - 1)) * TILE_CELLS + (cell.0 & (TILE_CELLS - 1))) as u32
}

/// Cells from `low` to `high`, both inclusive.
#[derive(Clone, Copy)]
struct Window {
    low: SquareIndex,
    high: SquareIndex,
}

impl Window {
    fn around(point: Point2, radius_m: f64) -> Self {
        let reach = Vector2::repeat(radius_m);
        Self { low: cell_of(point - reach), high: cell_of(point + reach) }
    }

    /// The bits of a tile's cells that are in the window, if it overlaps the tile.
    fn bits_in(&self, (tile_i, tile_j): (i32, i32)) -> u64 {
        let within = |value: i32, tile: i32| (value.saturating_sub(tile << TILE_BITS)).clamp(0, TILE_CELLS - 1) as u32;
        let (left, right) = (within(self.low.0, tile_i), within(self.high.0, tile_i));
        let (bottom, top) = (within(self.low.1, tile_j), within(self.high.1, tile_j));
        let columns = COLUMN * ((0xff_u64 >> (7 - (right - left))) << left);
        let rows = (u64::MAX >> (8 * (7 - (top - bottom)))) << (8 * bottom);
        columns & rows
    }
}

impl PointIndex {
    /// Adds a point; its number is the count of those before it.
    pub fn push(&mut self, position: Point2) {
        let index = self.places.len() as u32;
        self.places.push(Place { position, next: NONE });
        self.link(index);
    }

    /// A point is elsewhere now.
    pub fn set_position(&mut self, index: u32, position: Point2) {
        let before = cell_of(self.places[index as usize].position);
        if before == cell_of(position) {
            self.places[index as usize].position = position;
            return;
        }
        self.unlink(index, before);
        self.places[index as usize].position = position;
        self.link(index);
    }

    fn link(&mut self, index: u32) {
        let cell = cell_of(self.places[index as usize].position);
        let tile = *self.tiles.entry(tile_of(cell)).or_insert_with(|| {
            self.store.push(Tile { occupied: 0, heads: [NONE; 64] });
            self.store.len() as u32 - 1
        });
        let (tile, bit) = (&mut self.store[tile as usize], bit_of(cell));
        self.places[index as usize].next = std::mem::replace(&mut tile.heads[bit as usize], index);
        tile.occupied |= 1 << bit;
    }

    fn unlink(&mut self, index: u32, cell: SquareIndex) {
        let Some(&tile) = self.tiles.get(&tile_of(cell)) else { return };
        let (tile, bit) = (&mut self.store[tile as usize], bit_of(cell));
        let after = self.places[index as usize].next;
        let mut here = tile.heads[bit as usize];
        if here == index {
            tile.heads[bit as usize] = after;
            if after == NONE {
                tile.occupied &= !(1 << bit);
            }
            return;
        }
        while here != NONE {
            let next = self.places[here as usize].next;
            if next == index {
                self.places[here as usize].next = after;
                return;
            }
            here = next;
        }
    }

    /// Visits the points within `radius_m` of `point`: number and position.
    pub fn for_each_within(&self, point: Point2, radius_m: f64, mut visit: impl FnMut(u32, Point2)) {
        let limit = radius_m * radius_m;
        let window = Window::around(point, radius_m);
        self.for_each_tile(&window, |_, tile, bits| {
            for_each_bit(bits, |bit| {
                self.for_each_of(tile.heads[bit as usize], |index, position| {
                    if (position - point).norm_squared() <= limit {
                        visit(index, position);
                    }
                });
            });
        });
    }

    /// The nearest point within `radius_m` that `is_wanted`; of two that are equally near the one
    /// with the lower number.
    pub fn nearest(&self, point: Point2, radius_m: f64, is_wanted: impl Fn(u32) -> bool) -> Option<u32> {
        let mut best = Best { index: NONE, squared: radius_m * radius_m };
        let look = |head: u32, best: &mut Best| {
            self.for_each_of(head, |index, position| {
                let squared = (position - point).norm_squared();
                if best.is_beaten_by(index, squared) && is_wanted(index) {
                    *best = Best { index, squared };
                }
            });
        };
        let home = cell_of(point);
        let home_bit = 1_u64 << bit_of(home);
        if let Some(tile) = self.tile(tile_of(home)).filter(|tile| tile.occupied & home_bit != 0) {
            look(tile.heads[bit_of(home) as usize], &mut best);
        }
        let window = Window::around(point, best.squared.sqrt());
        if window.low == window.high {
            return best.found();
        }
        self.for_each_tile(&window, |at, tile, bits| {
            let rest = if at == tile_of(home) { bits & !home_bit } else { bits };
            for_each_bit(rest, |bit| {
                if distance_squared(at, bit, point) <= best.squared {
                    look(tile.heads[bit as usize], &mut best);
                }
            });
        });
        best.found()
    }

    fn tile(&self, tile: (i32, i32)) -> Option<&Tile> {
        self.tiles.get(&tile).map(|&number| &self.store[number as usize])
    }

    /// Visits the tiles that a window overlaps, with the bits of those of its cells that hold
    /// points.
    fn for_each_tile(&self, window: &Window, mut visit: impl FnMut((i32, i32), &Tile, u64)) {
        let (low, high) = (tile_of(window.low), tile_of(window.high));
        for j in low.1..=high.1 {
            for i in low.0..=high.0 {
                if let Some(tile) = self.tile((i, j)) {
                    visit((i, j), tile, tile.occupied & window.bits_in((i, j)));
                }
            }
        }
    }

    fn for_each_of(&self, head: u32, mut visit: impl FnMut(u32, Point2)) {
        let mut here = head;
        while here != NONE {
            let Place { position, next } = self.places[here as usize];
            visit(here, position);
            here = next;
        }
    }
}

/// The nearest point so far.
struct Best {
    index: u32,
    squared: f64,
}

impl Best {
    fn is_beaten_by(&self, index: u32, squared: f64) -> bool {
        squared < self.squared || (squared == self.squared && index < self.index)
    }

    fn found(&self) -> Option<u32> {
        (self.index != NONE).then_some(self.index)
    }
}

fn for_each_bit(mut bits: u64, mut visit: impl FnMut(u32)) {
    while bits != 0 {
        visit(bits.trailing_zeros());
        bits &= bits - 1;
    }
}

/// Squared distance from a point to a cell of a tile, a little less for rounding.
fn distance_squared(tile: (i32, i32), bit: u32, point: Point2) -> f64 {
    let apart = |tile: i32, cell: u32, at: f64| {
        let low = f64::from((tile << TILE_BITS) + cell as i32) * CELL_M;
        (low - at).max(at - (low + CELL_M)).max(0.0) - 1e-9
    };
    let (dx, dy) = (apart(tile.0, bit & 7, point.x).max(0.0), apart(tile.1, bit >> 3, point.y).max(0.0));
    dx * dx + dy * dy
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn brute_force(points: &[Point2], at: Point2, radius_m: f64, is_wanted: impl Fn(u32) -> bool) -> Option<u32> {
        let squared = |index: u32| (points[index as usize] - at).norm_squared();
        let near = (0..points.len() as u32).filter(|&index| squared(index) <= radius_m * radius_m && is_wanted(index));
        near.min_by(|&a, &b| squared(a).total_cmp(&squared(b)))
    }

    fn point() -> impl Strategy<Value = Point2> {
        // Near the corner of four tiles, on a raster as well as off it.
        let coordinate = || prop_oneof![-1.0..1.0_f64, (-10..10_i32).prop_map(|step| f64::from(step) * 0.1)];
        (coordinate(), coordinate()).prop_map(|(x, y)| Point2::new(x, y))
    }

    proptest! {
        #[test]
        fn what_is_near_is_what_trying_all_points_finds(mut points in proptest::collection::vec(point(), 1..80),
                                                       moves in proptest::collection::vec((any::<u32>(), point()), 0..40),
                                                       at in point(), radius_m in 0.0..0.5_f64, parity in 0..3_u32) {
            let mut index = PointIndex::default();
            points.iter().for_each(|point| index.push(*point));
            for (number, position) in moves {
                let number = number % points.len() as u32;
                index.set_position(number, position);
                points[number as usize] = position;
            }
            let is_wanted = |number: u32| parity == 2 || number % 2 == parity;
            prop_assert_eq!(index.nearest(at, radius_m, is_wanted), brute_force(&points, at, radius_m, is_wanted));
            let mut within = Vec::new();
            index.for_each_within(at, radius_m, |number, position| within.push((number, position)));
            within.sort_by_key(|(number, _)| *number);
            let all = points.iter().enumerate().map(|(number, position)| (number as u32, *position));
            let expected: Vec<_> =
                all.filter(|(_, position)| (position - at).norm_squared() <= radius_m * radius_m).collect();
            prop_assert_eq!(within, expected);
        }
    }

    #[test]
    fn points_that_are_nowhere_near_do_no_harm() {
        let mut index = PointIndex::default();
        for far in [1e300, -1e300, 1e9, -3e8, 0.0] {
            index.push(Point2::new(far, -far));
        }
        assert_eq!(index.nearest(Point2::new(0.05, 0.0), 0.4, |_| true), Some(4));
        index.set_position(4, Point2::new(-1e300, 1e300));
        assert_eq!(index.nearest(Point2::new(0.05, 0.0), 0.4, |_| true), None);
    }
}
