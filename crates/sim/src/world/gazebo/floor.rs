//! The true plan of a world made of surfaces: which part of the ground is floor.
//!
//! A surface does not say which side of it is solid. The largest connected part of the ground is
//! the floor, and everything else is solid: the inside of walls and things, rooms without a door,
//! the outside of a closed building. Parts count as connected if there is more than a crack between
//! them: walls made of meshes have cracks at their corners.

use super::report::{Flaw, ImportReport};
use crate::plan::{FloorPlan, PLAN_RESOLUTION_M};
use fht_perception::pose::Point2;

/// Margin of ground around everything, metres.
const MARGIN_M: f64 = 1.0;
/// How far the plan may reach from the origin along an axis, metres.
const FARTHEST_M: f64 = 100.0;
/// A part of the ground is floor only if it has this clearance somewhere, metres. The inside of
/// walls is narrower.
const ROOM_M: f64 = 0.2;
/// Least clearance in the middle of a gap for it to be more than a crack, metres.
const GAP_M: f64 = 0.05;
/// How far the floor reaches from the middle of gaps, cells: as far as the nearest wall, but not
/// beyond it.
const GROWTH_CELLS: f64 = 2.3;
/// Lines and polygons are shortened by this, metres, so that one that ends on the border of a cell
/// does not fill the next cell.
const TOUCH_M: f64 = 1e-3;

/// The plan, and a fence that closes it.
pub(crate) struct FencedFloor {
    /// The true plan.
    pub(crate) plan: FloorPlan,
    /// Min and max corner of the rectangle that has to be fenced if the floor is open.
    pub(crate) fence: Option<[Point2; 2]>,
}

/// Finds the floor between outlines of what a robot can hit. `None` if there are none, or no room
/// between them.
pub(crate) fn find(outlines: &[Vec<Point2>], report: &mut ImportReport) -> Option<FencedFloor> {
    if outlines.is_empty() {
        return None;
    }
    let [low, high] = bounds(outlines, report);
    let mut grid = Grid::new(low, high);
    for outline in outlines {
        grid.draw(outline);
    }
    let raw = FloorPlan::new(PLAN_RESOLUTION_M, grid.origin, grid.width, grid.height, grid.occupied.clone());
    let (width, height) = (grid.width, grid.height);
    let clearance_m = |index: usize| raw.clearance_m(raw.centre_of(index % width, index / width));
    let parts = grid.parts(|index| clearance_m(index) >= GAP_M);
    let mut found = vec![Part::default(); parts.iter().max().map_or(0, |&most| most as usize + 1)];
    // The margin must not make the outside look like the floor.
    let margin = (MARGIN_M / PLAN_RESOLUTION_M) as usize;
    let within = |index: usize, border: usize| {
        let (column, row) = (index % width, index / width);
        column >= border && row >= border && column + border < width && row + border < height
    };
    for (index, &number) in parts.iter().enumerate() {
        let part = &mut found[number as usize];
        part.cells += usize::from(within(index, margin));
        part.has_room |= clearance_m(index) >= ROOM_M;
        // The outermost cells have no clearance.
        part.is_open |= !within(index, 2);
    }
    let candidates = found.iter().enumerate().filter(|&(number, part)| part.has_room && number != SOLID as usize);
    let (floor, &Part { is_open, .. }) = candidates.max_by_key(|(_, part)| part.cells)?;
    let occupied = grid.grown(|index| parts[index] as usize == floor).iter().map(|is_floor| !is_floor).collect();
    let fence = is_open.then(|| {
        report.note(Flaw::Open, format!("{:.0} m by {:.0} m", high.x - low.x, high.y - low.y));
        let size = |cells: usize| (cells - 1) as f64 * PLAN_RESOLUTION_M;
        let corner = |x: f64, y: f64| Point2::new(grid.origin.x + x, grid.origin.y + y);
        [corner(PLAN_RESOLUTION_M, PLAN_RESOLUTION_M), corner(size(width), size(height))]
    });
    Some(FencedFloor { plan: FloorPlan::new(PLAN_RESOLUTION_M, grid.origin, width, height, occupied), fence })
}

/// A connected part of the ground.
#[derive(Clone, Copy, Debug, Default)]
struct Part {
    /// Size without the margin.
    cells: usize,
    /// Whether there is room for a robot somewhere in it.
    has_room: bool,
    /// Whether it continues beyond the plan.
    is_open: bool,
}

/// Covers all outlines and the origin, where robots start.
fn bounds(outlines: &[Vec<Point2>], report: &mut ImportReport) -> [Point2; 2] {
    let (mut low, mut high) = (Point2::origin(), Point2::origin());
    for corner in outlines.iter().flatten() {
        low = low.coords.zip_map(&corner.coords, f64::min).into();
        high = high.coords.zip_map(&corner.coords, f64::max).into();
    }
    let cut = |point: Point2| Point2::from(point.coords.map(|value| value.clamp(-FARTHEST_M, FARTHEST_M)));
    if cut(low) != low || cut(high) != high {
        report.note(Flaw::Extent, format!("the plan, beyond {FARTHEST_M} m from the origin"));
    }
    [cut(low), cut(high)]
}

/// Not part of the ground.
const SOLID: u32 = 0;

/// Cells that contain something.
struct Grid {
    origin: Point2,
    width: usize,
    height: usize,
    occupied: Vec<bool>,
}

impl Grid {
    fn new(low: Point2, high: Point2) -> Self {
        let cells = |from: f64, to: f64| ((to - from + 2.0 * MARGIN_M) / PLAN_RESOLUTION_M).ceil() as usize;
        let (width, height) = (cells(low.x, high.x), cells(low.y, high.y));
        let origin = Point2::new(low.x - MARGIN_M, low.y - MARGIN_M);
        Self { origin, width, height, occupied: vec![false; width * height] }
    }

    /// Fills the cells that a convex polygon or a line touches, row by row.
    fn draw(&mut self, outline: &[Point2]) {
        let cell = |value: f64, low: f64| (value - low) / PLAN_RESOLUTION_M;
        let span = |values: &mut dyn Iterator<Item = f64>| {
            values.fold((f64::MAX, f64::MIN), |(low, high), value| (low.min(value), high.max(value)))
        };
        // The cells from one number to another; at least the one in the middle.
        let cells = |(from, to): (f64, f64), count: usize| {
            let touch = (TOUCH_M / PLAN_RESOLUTION_M).min((to - from) / 2.0);
            let first = (from + touch).floor().max(0.0) as usize;
            let last = (to - touch).floor();
            let end = if last < 0.0 { 0 } else { (last as usize + 1).min(count) };
            first..end
        };
        let corners: Vec<Point2> = outline
            .iter()
            .map(|corner| Point2::new(cell(corner.x, self.origin.x), cell(corner.y, self.origin.y)))
            .collect();
        let rows = cells(span(&mut corners.iter().map(|corner| corner.y)), self.height);
        for row in rows {
            let (bottom, top) = (row as f64, row as f64 + 1.0);
            let mut crossings: Vec<f64> =
                corners.iter().filter(|corner| (bottom..=top).contains(&corner.y)).map(|corner| corner.x).collect();
            for (index, from) in corners.iter().enumerate() {
                let to = corners[(index + 1) % corners.len()];
                for y in [bottom, top] {
                    if (from.y < y) != (to.y < y) {
                        crossings.push(from.x + (to.x - from.x) * (y - from.y) / (to.y - from.y));
                    }
                }
            }
            if crossings.is_empty() {
                continue;
            }
            for column in cells(span(&mut crossings.into_iter()), self.width) {
                self.occupied[row * self.width + column] = true;
            }
        }
    }

    /// Ground that lies in a set of cells or close to it. The outermost cells are not ground.
    fn grown(&self, is_in: impl Fn(usize) -> bool) -> Vec<bool> {
        let reach = GROWTH_CELLS as isize;
        let disc: Vec<(isize, isize)> = (-reach..=reach)
            .flat_map(|dy| (-reach..=reach).map(move |dx| (dx, dy)))
            .filter(|&(dx, dy)| ((dx * dx + dy * dy) as f64) <= GROWTH_CELLS * GROWTH_CELLS)
            .collect();
        let (width, height) = (self.width as isize, self.height as isize);
        let is_floor = |index: usize| {
            let (column, row) = ((index % self.width) as isize, (index / self.width) as isize);
            let is_near = |&(dx, dy): &(isize, isize)| {
                let (x, y) = (column + dx, row + dy);
                x >= 0 && y >= 0 && x < width && y < height && is_in((y * width + x) as usize)
            };
            let is_inner = column > 0 && row > 0 && column + 1 < width && row + 1 < height;
            is_inner && !self.occupied[index] && (is_in(index) || disc.iter().any(is_near))
        };
        (0..self.occupied.len()).map(is_floor).collect()
    }

    /// For each `passable` cell the number of its connected part, from 1; [`SOLID`] for the others.
    fn parts(&self, passable: impl Fn(usize) -> bool) -> Vec<u32> {
        let mut parts = vec![SOLID; self.occupied.len()];
        let mut count = SOLID;
        let mut open = Vec::new();
        for first in 0..parts.len() {
            if !passable(first) || parts[first] != SOLID {
                continue;
            }
            count += 1;
            parts[first] = count;
            open.push(first);
            while let Some(index) = open.pop() {
                let (column, row) = (index % self.width, index / self.width);
                let neighbours = [
                    (column > 0).then(|| index - 1),
                    (column + 1 < self.width).then(|| index + 1),
                    (row > 0).then(|| index - self.width),
                    (row + 1 < self.height).then(|| index + self.width),
                ];
                for next in neighbours.into_iter().flatten() {
                    if parts[next] == SOLID && passable(next) {
                        parts[next] = count;
                        open.push(next);
                    }
                }
            }
        }
        parts
    }
}

#[cfg(test)]
mod tests {
    use super::find;
    use crate::world::gazebo::report::ImportReport;
    use fht_perception::pose::Point2;

    fn ring(x: f64, y: f64, half: f64) -> Vec<Vec<Point2>> {
        let corner = |sx: f64, sy: f64| Point2::new(x + sx * half, y + sy * half);
        let corners = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
        (0..4).map(|side| vec![corners[side], corners[(side + 1) % 4]]).collect()
    }

    #[test]
    fn the_inside_of_a_closed_room_is_the_floor() {
        // Double walls, and a hollow box in the room.
        let outlines = [ring(0.0, 0.0, 2.0), ring(0.0, 0.0, 2.15), ring(1.0, 1.0, 0.3)].concat();
        let floor = find(&outlines, &mut ImportReport::default()).unwrap();
        assert!(floor.fence.is_none());
        let area = floor.plan.free_area_m2();
        assert!((area - (16.0 - 0.36)).abs() < 1.2, "{area}");
        assert!(floor.plan.is_occupied(1.0, 1.0) && floor.plan.is_occupied(2.08, 0.0));
        assert!(floor.plan.is_occupied(2.6, 0.0) && !floor.plan.is_occupied(1.9, -1.9));
    }

    #[test]
    fn open_ground_is_fenced() {
        let mut report = ImportReport::default();
        let floor = find(&ring(3.0, 0.0, 0.5), &mut report).unwrap();
        let [low, high] = floor.fence.unwrap();
        assert!((low.x + 0.95).abs() < 1e-9 && (high.x - 4.45).abs() < 0.06, "{low} {high}");
        assert!(!floor.plan.is_occupied(0.0, 0.0) && floor.plan.is_occupied(3.0, 0.0));
        assert_eq!(report.sentences().len(), 1);
    }

    #[test]
    fn cracks_in_walls_do_not_let_the_outside_in() {
        let mut outlines = ring(0.0, 0.0, 2.0);
        outlines.truncate(3);
        outlines.extend([
            vec![Point2::new(-2.0, 2.0), Point2::new(-2.0, 0.06)],
            vec![Point2::new(-2.0, -0.03), Point2::new(-2.0, -2.0)],
        ]);
        let floor = find(&outlines, &mut ImportReport::default()).unwrap();
        assert!(floor.fence.is_none() && floor.plan.is_occupied(-2.5, 0.0));
    }

    #[test]
    fn slanting_walls_are_tight() {
        let corners: Vec<Point2> = (0..7)
            .map(|side| {
                let angle = 0.3 + std::f64::consts::TAU * f64::from(side) / 7.0;
                Point2::new(3.0 * angle.cos(), 3.0 * angle.sin())
            })
            .collect();
        let outlines: Vec<Vec<Point2>> = (0..7).map(|side| vec![corners[side], corners[(side + 1) % 7]]).collect();
        let floor = find(&outlines, &mut ImportReport::default()).unwrap();
        assert!(floor.fence.is_none());
        assert!((floor.plan.free_area_m2() - 24.6).abs() < 1.0, "{}", floor.plan.free_area_m2());
    }
}
