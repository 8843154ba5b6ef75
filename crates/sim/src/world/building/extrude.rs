//! Walls from a plan: the borders of its free floor, smoothed by less than a cell, raised to a
//! ceiling and decorated by a seed.

use crate::plan::FloorPlan;
use crate::world::building::layout::Layout;
use crate::world::building::polygon::{Polygon, rectangle};
use crate::world::building::style::{Hanging, Style};
use crate::world::building::zones::Zones;
use crate::world::draw::art::Genre;
use crate::world::draw::surfaces::{Ceiling, FloorSurface, Wall};
use fht_perception::pose::Point2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;

/// Height of the walls, metres.
const WALL_M: f64 = 2.5;
/// Side of the squares that look alike, metres.
const ZONE_M: f64 = 7.0;
/// How far a wall may deviate from the cells' border, cells: the steps of a slanting wall (at most
/// √½ deep at 45°) become straight, but a wall of one cell keeps its thickness.
const SMOOTHING_CELLS: f64 = 0.72;

/// The building whose floor is the free part of the plan.
pub(crate) fn layout(plan: &FloorPlan, seed: u64) -> Layout<Style> {
    let to_world = |&(x, y): &(i32, i32)| {
        let (origin, side) = (plan.origin(), plan.resolution_m());
        Point2::new(origin.x + f64::from(x) * side, origin.y + f64::from(y) * side)
    };
    let rings = borders(plan).iter().map(|border| smoothed(border).iter().map(to_world).collect()).collect();
    Layout {
        rings,
        displaced: BTreeMap::new(),
        solids: Vec::new(),
        zones: Zones::new(zones(plan, seed)),
        elsewhere: Style::bare(Wall::Plaster([226, 224, 216]), FloorSurface::Linoleum([146, 148, 146])),
        ceiling_m: WALL_M,
        ceiling: Ceiling::Grid,
    }
}

/// Squares of different looks: most are full of pictures, some repeat one picture, some are bare.
fn zones(plan: &FloorPlan, seed: u64) -> Vec<(Polygon, Style)> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let extent = |cells: usize| cells as f64 * plan.resolution_m();
    let (columns, rows) = (extent(plan.width()) / ZONE_M, extent(plan.height()) / ZONE_M);
    let mut zones = Vec::new();
    for row in 0..rows.ceil() as u32 {
        for column in 0..columns.ceil() as u32 {
            let (x, y) = (plan.origin().x + f64::from(column) * ZONE_M, plan.origin().y + f64::from(row) * ZONE_M);
            zones.push((rectangle(x, y, x + ZONE_M, y + ZONE_M), random_style(&mut rng)));
        }
    }
    zones
}

fn random_style(rng: &mut ChaCha8Rng) -> Style {
    let walls = [
        Wall::Plaster([234, 230, 220]),
        Wall::Plaster([206, 216, 222]),
        Wall::TwoTone([230, 226, 214], [120, 142, 150]),
        Wall::TwoTone([232, 222, 200], [168, 130, 96]),
        Wall::Damask([124, 40, 44]),
        Wall::Stripes([212, 196, 158], [196, 174, 130]),
        Wall::Brick([162, 92, 68]),
        Wall::Wood([152, 114, 76]),
        Wall::Concrete,
    ];
    let floors = [
        FloorSurface::Parquet([158, 116, 76]),
        FloorSurface::Linoleum([142, 148, 150]),
        FloorSurface::Carpet([92, 100, 114]),
        FloorSurface::Tiles([204, 200, 192], [192, 186, 176]),
    ];
    let wall = walls[rng.random_range(0..walls.len())];
    let floor = floors[rng.random_range(0..floors.len())];
    match rng.random_range(0..10) {
        0 | 1 => Style::bare(wall, floor),
        2 => Style::hung(wall, floor, &[Hanging::Photograph], (0.8, 0.8)).repeating(),
        3 => Style::hung(wall, floor, &[Hanging::Photograph, Hanging::Poster, Hanging::Map], (0.8, 2.0)),
        4 => Style::hung(wall, floor, &[Hanging::Photograph, Hanging::Painting(Genre::Landscape)], (0.4, 1.0)),
        _ => Style::hung(wall, floor, &[Hanging::Photograph], (0.3, 1.2)),
    }
}

/// Corners of closed lines along cell borders with free floor on the left, in cells from the plan's
/// min corner. Free cells that touch only at a corner are not connected: no disc can pass there.
fn borders(plan: &FloorPlan) -> Vec<Vec<(i32, i32)>> {
    /// East, north, west, south.
    const STEPS: [(i32, i32); 4] = [(1, 0), (0, 1), (-1, 0), (0, -1)];
    let (width, height) = (plan.width() as i32, plan.height() as i32);
    let is_free =
        |x: i32, y: i32| x >= 0 && y >= 0 && x < width && y < height && !plan.cells()[(y * width + x) as usize];
    // Free floor on the left of the step `direction` from a grid corner, none on its right.
    let is_border = |x: i32, y: i32, direction: usize| {
        let (left, right) = match direction {
            0 => ((x, y), (x, y - 1)),
            1 => ((x - 1, y), (x, y)),
            2 => ((x - 1, y - 1), (x - 1, y)),
            _ => ((x, y - 1), (x - 1, y - 1)),
        };
        is_free(left.0, left.1) && !is_free(right.0, right.1)
    };
    let mut used = vec![0_u8; ((width + 1) * (height + 1)) as usize];
    let mut rings = Vec::new();
    for y in 0..=height {
        for x in 0..=width {
            for first in 0..4 {
                if used[(y * (width + 1) + x) as usize] >> first & 1 == 1 || !is_border(x, y, first) {
                    continue;
                }
                let mut ring = Vec::new();
                let (mut at, mut direction) = ((x, y), first);
                loop {
                    let index = (at.1 * (width + 1) + at.0) as usize;
                    if used[index] >> direction & 1 == 1 {
                        break;
                    }
                    used[index] |= 1 << direction;
                    ring.push(at);
                    at = (at.0 + STEPS[direction].0, at.1 + STEPS[direction].1);
                    // Left first: this stays with the same free cell where two meet at a corner.
                    let turns = [(direction + 1) % 4, direction, (direction + 3) % 4];
                    match turns.into_iter().find(|&next| is_border(at.0, at.1, next)) {
                        Some(next) => direction = next,
                        None => break,
                    }
                }
                rings.push(ring);
            }
        }
    }
    rings
}

/// A closed line with fewer corners (Douglas and Peucker, in both halves between its first corner
/// and the farthest).
fn smoothed(ring: &[(i32, i32)]) -> Vec<(i32, i32)> {
    let Some(&first) = ring.first() else { return Vec::new() };
    let squared = |a: (i32, i32), b: (i32, i32)| i64::from(a.0 - b.0).pow(2) + i64::from(a.1 - b.1).pow(2);
    let opposite = (0..ring.len()).max_by_key(|&index| squared(first, ring[index])).unwrap_or(0);
    let mut keep = vec![false; ring.len() + 1];
    keep[0] = true;
    keep[opposite] = true;
    let corner = |index: usize| ring[index % ring.len()];
    let mut open = vec![(0, opposite), (opposite, ring.len())];
    while let Some((from, to)) = open.pop() {
        let farthest = (from + 1..to)
            .map(|index| (off_line(corner(index), corner(from), corner(to)), index))
            .max_by(|a, b| a.0.total_cmp(&b.0));
        if let Some((distance, index)) = farthest
            && distance > SMOOTHING_CELLS
        {
            keep[index] = true;
            open.push((from, index));
            open.push((index, to));
        }
    }
    (0..ring.len()).filter(|&index| keep[index]).map(corner).collect()
}

/// Distance of a point from a segment.
fn off_line(point: (i32, i32), a: (i32, i32), b: (i32, i32)) -> f64 {
    let vector =
        |from: (i32, i32), to: (i32, i32)| nalgebra::Vector2::new(f64::from(to.0 - from.0), f64::from(to.1 - from.1));
    let (along, to_point) = (vector(a, b), vector(a, point));
    let part = (to_point.dot(&along) / along.norm_squared().max(1e-12)).clamp(0.0, 1.0);
    (to_point - along * part).norm()
}

#[cfg(test)]
mod tests {
    use super::{borders, smoothed};
    use crate::plan::FloorPlan;
    use fht_perception::pose::Point2;

    fn plan(rows: &[&str]) -> FloorPlan {
        let occupied = rows.iter().rev().flat_map(|row| row.bytes().map(|cell| cell != b'.')).collect();
        FloorPlan::new(1.0, Point2::origin(), rows[0].len(), rows.len(), occupied)
    }

    /// Twice the area, positive counter-clockwise.
    fn doubled_area(ring: &[(i32, i32)]) -> i32 {
        ring.iter().zip(ring.iter().cycle().skip(1)).map(|(a, b)| a.0 * b.1 - a.1 * b.0).sum()
    }

    #[test]
    fn borders_have_the_floor_on_their_left() {
        let rings = borders(&plan(&["#####", "#...#", "#.#.#", "#...#", "#####"]));
        let mut areas: Vec<i32> = rings.iter().map(|ring| doubled_area(ring)).collect();
        areas.sort_unstable();
        assert_eq!(areas, vec![-2, 18]);
    }

    #[test]
    fn floor_at_the_edge_of_the_map_is_closed() {
        let rings = borders(&plan(&["..", ".."]));
        assert_eq!(rings.iter().map(|ring| doubled_area(ring)).collect::<Vec<_>>(), vec![8]);
        assert_eq!(smoothed(&rings[0]).len(), 4);
    }

    #[test]
    fn cells_that_touch_at_a_corner_stay_apart() {
        assert_eq!(borders(&plan(&["####", "#.##", "##.#", "####"])).len(), 2);
    }

    #[test]
    fn stairs_become_slopes_and_thin_walls_stay() {
        let stairs = borders(&plan(&["......", ".....#", "....##", "...###", "..####", ".#####"]));
        assert!(smoothed(&stairs[0]).len() <= 6);
        let thin = borders(&plan(&["......", ".####.", "......"]));
        assert!(thin.iter().all(|ring| smoothed(ring).len() == 4));
    }
}
