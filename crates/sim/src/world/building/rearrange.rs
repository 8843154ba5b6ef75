//! Changes to buildings that are plain data: drawn furniture, and the small pieces of a map raised
//! to walls.

use crate::plan::FloorPlan;
use crate::world::building::layout::{Layout, Placement, Solid};
use crate::world::building::polygon::{cells_inside, holds, turned_box};
use crate::world::building::style::Style;
use crate::world::changes::{Change, Changes, NEW_RADIUS_M, Thing, choose};
use crate::world::draw::furniture::Kind;
use fht_perception::pose::Point2;
use nalgebra::Vector2;

/// A piece of a map with a side longer than this is a wall, metres.
const LONGEST_PIECE_M: f64 = 1.5;
/// Kinds and heights (metres) of new things in a map raised to walls.
const NEW_THINGS: [(Kind, f64); 4] =
    [(Kind::Cupboard, 1.6), (Kind::Plant, 1.4), (Kind::Showcase, 1.5), (Kind::Lockers, 1.85)];
/// Variants of new things start here, so that none looks like a drawn one.
const NEW_VARIANT: u32 = 1000;

/// Changes the furniture of a drawn building. What stands on a thing moves with it. Returns how
/// many changes there are.
pub(crate) fn furniture(layout: &mut Layout<Style>, plan: &FloorPlan, changes: &Changes) -> usize {
    let groups = groups(&layout.solids);
    let extent = |group: &Vec<usize>| Thing::around(group.iter().flat_map(|&solid| &layout.solids[solid].footprint));
    let things: Vec<Thing> = groups.iter().filter_map(extent).collect();
    let chosen = choose(&things, plan, changes);
    let mut gone = vec![false; layout.solids.len()];
    for change in &chosen {
        match *change {
            Change::Gone(thing) => groups[thing].iter().for_each(|&solid| gone[solid] = true),
            Change::Shifted(thing, by) => {
                groups[thing].iter().for_each(|&solid| shift(&mut layout.solids[solid], by));
            }
            Change::Added(centre, Some(like)) => {
                for &solid in &groups[like] {
                    let mut copy = layout.solids[solid].clone();
                    shift(&mut copy, centre - things[like].centre());
                    layout.solids.push(copy);
                }
            }
            Change::Added(_, None) => {}
        }
    }
    let mut index = 0;
    layout.solids.retain(|_| {
        index += 1;
        !gone.get(index - 1).copied().unwrap_or(false)
    });
    chosen.len()
}

fn shift(solid: &mut Solid, by: Vector2<f64>) {
    solid.footprint.iter_mut().for_each(|corner| *corner += by);
}

/// Movable things: for each, the solid that stands on the floor, then those that stand on it.
fn groups(solids: &[Solid]) -> Vec<Vec<usize>> {
    let is_fixed = |kind: Kind| matches!(kind, Kind::Partition | Kind::Pillar | Kind::Frame);
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for (index, solid) in solids.iter().enumerate().filter(|(_, solid)| !is_fixed(solid.kind)) {
        if solid.bottom_m <= 0.0 {
            groups.push(vec![index]);
        } else if let Some(group) = groups.last_mut() {
            let sum = solid.footprint.iter().fold(Vector2::zeros(), |sum, corner| sum + corner.coords);
            let centre = Point2::from(sum / solid.footprint.len().max(1) as f64);
            if holds(&solids[group[0]].footprint, centre) {
                group.push(index);
            }
        }
    }
    groups
}

/// Changes the small pieces of a map raised to walls, and puts new things between them. Returns the
/// new plan and how many changes there are.
pub(crate) fn pieces(layout: &mut Layout<Style>, plan: &FloorPlan, changes: &Changes) -> (FloorPlan, usize) {
    let pieces = small_pieces(plan);
    let things: Vec<Thing> = pieces.iter().map(|piece| piece.extent).collect();
    let chosen = choose(&things, plan, changes);
    let mut occupied = plan.cells().to_vec();
    let (width, side_m) = (plan.width(), plan.resolution_m());
    for (index, change) in chosen.iter().enumerate() {
        match *change {
            Change::Gone(piece) => {
                pieces[piece].cells.iter().for_each(|&cell| occupied[cell] = false);
                displace(layout, &things[piece], side_m, Placement::Gone);
            }
            Change::Shifted(piece, by) => {
                // By whole cells, so that the plan stays exact.
                let by = by.map(|metres| (metres / side_m).round());
                pieces[piece].cells.iter().for_each(|&cell| occupied[cell] = false);
                for &cell in &pieces[piece].cells {
                    let (column, row) = ((cell % width) as f64 + by.x, (cell / width) as f64 + by.y);
                    if let Some(there) = occupied.get_mut(row as usize * width + column as usize) {
                        *there = true;
                    }
                }
                displace(layout, &things[piece], side_m, Placement::Moved(by * side_m));
            }
            Change::Added(centre, _) => {
                let (kind, top_m) = NEW_THINGS[index % NEW_THINGS.len()];
                let footprint = turned_box(centre, 1.5 * NEW_RADIUS_M, NEW_RADIUS_M, index as f64);
                for cell in
                    cells_inside(std::slice::from_ref(&footprint), plan.origin(), side_m, (width, plan.height()))
                {
                    occupied[cell] = true;
                }
                layout.solids.push(Solid {
                    footprint,
                    bottom_m: 0.0,
                    top_m,
                    kind,
                    variant: NEW_VARIANT + index as u32,
                });
            }
        }
    }
    (FloorPlan::new(side_m, plan.origin(), width, plan.height(), occupied), chosen.len())
}

/// The walls around a piece move with it.
fn displace(layout: &mut Layout<Style>, piece: &Thing, side_m: f64, placement: Placement) {
    let grown = Vector2::repeat(side_m);
    let (low, high) = (piece.low - grown, piece.high + grown);
    let is_around = |ring: &[Point2]| {
        ring.iter().all(|corner| low.x <= corner.x && corner.x <= high.x && low.y <= corner.y && corner.y <= high.y)
    };
    let rings = layout.rings.iter().enumerate().filter(|(_, ring)| is_around(ring));
    layout.displaced.extend(rings.map(|(index, _)| (index, placement)));
}

/// A small connected set of solid cells.
struct Piece {
    cells: Vec<usize>,
    extent: Thing,
}

fn small_pieces(plan: &FloorPlan) -> Vec<Piece> {
    let (width, height) = (plan.width(), plan.height());
    let mut seen = vec![false; width * height];
    let mut pieces = Vec::new();
    for first in 0..width * height {
        if seen[first] || !plan.cells()[first] {
            continue;
        }
        seen[first] = true;
        let mut cells = vec![first];
        let mut next = 0;
        while next < cells.len() {
            let (column, row) = (cells[next] % width, cells[next] / width);
            next += 1;
            for neighbour in 0..9 {
                let (x, y) = ((column + neighbour % 3).wrapping_sub(1), (row + neighbour / 3).wrapping_sub(1));
                if x < width && y < height && plan.cells()[y * width + x] && !seen[y * width + x] {
                    seen[y * width + x] = true;
                    cells.push(y * width + x);
                }
            }
        }
        let half = Vector2::repeat(plan.resolution_m() / 2.0);
        let centres: Vec<Point2> = cells.iter().map(|cell| plan.centre_of(cell % width, cell / width)).collect();
        if let Some(Thing { low, high }) = Thing::around(centres.iter()) {
            let extent = Thing { low: low - half, high: high + half };
            if extent.side_m() < LONGEST_PIECE_M {
                pieces.push(Piece { cells, extent });
            }
        }
    }
    pieces
}
