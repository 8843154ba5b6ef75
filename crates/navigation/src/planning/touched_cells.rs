//! Which cells a segment touches.

use fht_perception::grid::Cell;
use fht_perception::pose::Point2;

/// Visits every cell that a segment touches, in units of cells, in order, until `visit` says no.
/// Through a corner between four cells it visits them all.
pub(super) fn for_each_touched_cell(a: Point2, b: Point2, mut visit: impl FnMut(Cell) -> bool) {
    let floor = |value: f64| value.floor() as i32;
    let mut cell = Cell { i: floor(a.x), j: floor(a.y) };
    let end = Cell { i: floor(b.x), j: floor(b.y) };
    let along = b - a;
    // Parameter of the next crossing of a grid line, and between crossings, per axis.
    let axis = |from: f64, delta: f64| {
        let next = if delta > 0.0 { from.floor() + 1.0 } else { from.floor() };
        if delta == 0.0 { (f64::INFINITY, f64::INFINITY) } else { ((next - from) / delta, 1.0 / delta.abs()) }
    };
    let ((mut t_x, step_x), (mut t_y, step_y)) = (axis(a.x, along.x), axis(a.y, along.y));
    // Steps always go towards the end, so that rounding cannot make it miss the end and run on.
    while cell != end {
        if !visit(cell) {
            return;
        }
        let (left_x, left_y) = ((end.i - cell.i).signum(), (end.j - cell.j).signum());
        if left_x != 0 && left_y != 0 && (t_x - t_y).abs() < 1e-9 {
            if !visit(Cell { i: cell.i + left_x, j: cell.j }) || !visit(Cell { i: cell.i, j: cell.j + left_y }) {
                return;
            }
            cell = Cell { i: cell.i + left_x, j: cell.j + left_y };
            t_x += step_x;
            t_y += step_y;
        } else if left_y == 0 || (left_x != 0 && t_x < t_y) {
            cell.i += left_x;
            t_x += step_x;
        } else {
            cell.j += left_y;
            t_y += step_y;
        }
    }
    visit(end);
}

/// Whether `accept` holds for all cells on the line from centre to centre.
pub(super) fn all_cells_between(a: Cell, b: Cell, mut accept: impl FnMut(Cell) -> bool) -> bool {
    let centre = |cell: Cell| Point2::new(f64::from(cell.i) + 0.5, f64::from(cell.j) + 0.5);
    let mut all = true;
    for_each_touched_cell(centre(a), centre(b), |cell| {
        all &= accept(cell);
        all
    });
    all
}
