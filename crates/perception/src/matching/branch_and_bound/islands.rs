//! Parts of a building that are so far apart that no scan sees two of them. In the picture they lie
//! side by side: a node that somebody puts a hundred kilometres away costs a little of it, and not
//! the search.

use crate::pose::Point2;
use nalgebra::Vector2;
use std::collections::BTreeMap;

/// Walls and places that lie together.
#[derive(Default)]
pub(super) struct Ground {
    pub(super) walls: Vec<Point2>,
    pub(super) places: Vec<Point2>,
}

impl Ground {
    /// The least and the greatest of all coordinates; `None` of nothing.
    fn corners(&self) -> Option<(Point2, Point2)> {
        let mut all = self.walls.iter().chain(&self.places).copied();
        let first = all.next()?;
        Some(all.fold((first, first), |(low, high), point| (low.inf(&point), high.sup(&point))))
    }
}

/// Walls and places by what lies together: parts are at least `apart_m` from each other. Those with
/// most walls come first; parts without walls, where nothing could be matched, and without places
/// are left out.
pub(super) fn parts(walls: &[Point2], places: &[Point2], apart_m: f64) -> Vec<Ground> {
    let tile = |point: &Point2| ((point.x / apart_m).floor() as i64, (point.y / apart_m).floor() as i64);
    let mut tiles: BTreeMap<(i64, i64), Ground> = BTreeMap::new();
    walls.iter().for_each(|wall| tiles.entry(tile(wall)).or_default().walls.push(*wall));
    places.iter().for_each(|place| tiles.entry(tile(place)).or_default().places.push(*place));
    let mut found = Vec::new();
    while let Some((first, ground)) = tiles.pop_first() {
        let (mut part, mut border) = (ground, vec![first]);
        while let Some((x, y)) = border.pop() {
            for near in (-1..=1).flat_map(|dx| (-1..=1).map(move |dy| (x.saturating_add(dx), y.saturating_add(dy)))) {
                if let Some(more) = tiles.remove(&near) {
                    part.walls.extend(more.walls);
                    part.places.extend(more.places);
                    border.push(near);
                }
            }
        }
        found.push(part);
    }
    found.retain(|part| !part.walls.is_empty() && !part.places.is_empty());
    found.sort_by_key(|part| std::cmp::Reverse(part.walls.len()));
    found
}

/// Where a part lies in the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Island {
    /// The corner of its first cell, map frame.
    origin: Point2,
    /// The column of that cell; its row is 0.
    column: usize,
    resolution_m: f64,
}

impl Island {
    /// The cell that shows a point of this part.
    pub(super) fn cell_of(&self, point: &Point2) -> (usize, usize) {
        let cell = (point - self.origin) / self.resolution_m;
        (cell.x as usize + self.column, cell.y as usize)
    }

    /// The point in the map that is so many cells from the picture's corner.
    pub(super) fn point_at(&self, x_cells: f64, y_cells: f64) -> Point2 {
        self.origin + Vector2::new(x_cells - self.column as f64, y_cells) * self.resolution_m
    }

    /// The one that shows a column; islands come in the order of their columns.
    pub(super) fn of_column(islands: &[Self], column: usize) -> &Self {
        let next = islands.partition_point(|island| island.column <= column);
        &islands[next.saturating_sub(1)]
    }
}

/// A picture's size in cells, and where parts lie in it.
#[derive(Default)]
pub(super) struct Layout {
    pub(super) width: usize,
    pub(super) height: usize,
    /// By part: none if there is no room for it.
    pub(super) islands: Vec<Option<Island>>,
}

/// Lays parts side by side, each with a margin around it, while the picture has at most
/// `most_cells`; the sides of each are multiples of `side` cells.
pub(super) fn lay_out(parts: &[Ground], resolution_m: f64, margin_m: f64, side: usize, most_cells: f64) -> Layout {
    let mut layout = Layout::default();
    for part in parts {
        let placed = part.corners().and_then(|(low, high)| {
            let size = (high - low).map(|metres| (metres + 2.0 * margin_m) / resolution_m);
            // Before it is a number of cells: it may be any.
            if !(size.x * size.y).is_finite() || size.x * size.y > most_cells {
                return None;
            }
            let whole = |cells: f64| (cells.ceil() as usize + 1).next_multiple_of(side);
            let (width, height) = (layout.width + whole(size.x), layout.height.max(whole(size.y)));
            if width as f64 * height as f64 > most_cells {
                return None;
            }
            let origin = Point2::new(low.x - margin_m, low.y - margin_m);
            let island = Island { origin, column: layout.width, resolution_m };
            (layout.width, layout.height) = (width, height);
            Some(island)
        });
        layout.islands.push(placed);
    }
    layout
}
