//! Floor that was seen for a moment only: known, so no frontier leads there, but by too few scans
//! for a rectangle of the map. When no frontier is left, the robot looks again.

use super::frontier::{Frontier, Knowledge, cells_near, take_cluster};
use fht_perception::grid::CellBounds;
use fht_perception::pose::Point2;

/// The patches of at least `min_m2` square metres of half-seen floor in a region of the grid, in
/// the order of their first cells; their size is counted in squares of `thinning_m` metres.
pub(super) fn find_half_seen(known: &Knowledge<'_>, bounds: CellBounds, min_m2: f64, thinning_m: f64) -> Vec<Frontier> {
    let resolution_m = known.grid.resolution_m();
    let count = bounds.width() * bounds.height();
    let mut waiting: Vec<bool> = (0..count).map(|index| known.is_half_seen(bounds.cell(index))).collect();
    let least = min_m2 / resolution_m.powi(2);
    let mut patches = Vec::new();
    for first in 0..count {
        if waiting[first] {
            let cells = take_cluster(&mut waiting, &bounds, bounds.cell(first), 1);
            if cells.len() as f64 >= least {
                patches.push(Frontier::of(cells, resolution_m, thinning_m, false));
            }
        }
    }
    patches
}

/// Number of half-seen cells whose centre is within `radius_m` of a point.
pub(super) fn half_seen_cells_near(known: &Knowledge<'_>, point: Point2, radius_m: f64) -> usize {
    cells_near(known.grid, point, radius_m).filter(|cell| known.is_half_seen(*cell)).count()
}
