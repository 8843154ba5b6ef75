//! The true floor plan of a world, for simulated sensors and for scoring: no program that finds a
//! robot's place or way may look at it.

mod distance;
mod route;

use fht_perception::pose::Point2;

/// Side of a plan cell of the built-in worlds, metres.
pub(crate) const PLAN_RESOLUTION_M: f64 = 0.05;

/// Which cells of a world are free floor, and how far each is from the nearest obstacle.
#[derive(Clone, Debug)]
pub struct FloorPlan {
    resolution_m: f64,
    origin: Point2,
    width: usize,
    height: usize,
    occupied: Vec<bool>,
    clearance_m: Vec<f32>,
}

/// A set of cells of a [`FloorPlan`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mask {
    width: usize,
    cells: Vec<bool>,
}

impl Mask {
    /// Whether the cell at column `x`, row `y` is in the set.
    #[must_use]
    pub fn contains(&self, x: usize, y: usize) -> bool {
        x < self.width && self.cells.get(y * self.width + x).copied().unwrap_or(false)
    }

    /// Number of cells in the set.
    #[must_use]
    pub fn count(&self) -> usize {
        self.cells.iter().filter(|&&cell| cell).count()
    }

    /// The cells row by row from the plan's min corner.
    #[must_use]
    pub fn cells(&self) -> &[bool] {
        &self.cells
    }
}

impl FloorPlan {
    /// A plan of `width` × `height` cells of side `resolution_m` (metres), row by row from the min
    /// corner `origin` (world frame). Everything outside the plan is occupied. `occupied` is
    /// truncated, or padded with occupied cells, to fit.
    #[must_use]
    pub fn new(resolution_m: f64, origin: Point2, width: usize, height: usize, mut occupied: Vec<bool>) -> Self {
        occupied.resize(width * height, true);
        let clearance_m = distance::clearance(&occupied, width, height, resolution_m);
        Self { resolution_m, origin, width, height, occupied, clearance_m }
    }

    /// Side of a cell, metres.
    #[must_use]
    pub fn resolution_m(&self) -> f64 {
        self.resolution_m
    }

    /// Min corner of the plan in the world frame, metres.
    #[must_use]
    pub fn origin(&self) -> Point2 {
        self.origin
    }

    /// Number of columns.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Number of rows.
    #[must_use]
    pub fn height(&self) -> usize {
        self.height
    }

    /// Occupancy row by row from the min corner.
    #[must_use]
    pub fn cells(&self) -> &[bool] {
        &self.occupied
    }

    /// Column and row of the cell that holds a point of the world frame; `None` outside the plan.
    #[must_use]
    pub fn cell_of(&self, point: Point2) -> Option<(usize, usize)> {
        let column = ((point.x - self.origin.x) / self.resolution_m).floor();
        let row = ((point.y - self.origin.y) / self.resolution_m).floor();
        let inside = column >= 0.0 && row >= 0.0 && column < self.width as f64 && row < self.height as f64;
        inside.then_some((column as usize, row as usize))
    }

    /// Centre of a cell in the world frame.
    #[must_use]
    pub fn centre_of(&self, column: usize, row: usize) -> Point2 {
        Point2::new(
            self.origin.x + (column as f64 + 0.5) * self.resolution_m,
            self.origin.y + (row as f64 + 0.5) * self.resolution_m,
        )
    }

    /// Whether the point is in an obstacle or outside the plan.
    #[must_use]
    pub fn is_occupied(&self, x: f64, y: f64) -> bool {
        self.cell_of(Point2::new(x, y)).is_none_or(|(column, row)| self.occupied[row * self.width + column])
    }

    /// Distance from the centre of the point's cell to the border of the nearest occupied cell,
    /// metres: the exact Euclidean distance between cell centres less half a cell; 0 in obstacles
    /// and outside the plan.
    #[must_use]
    pub fn clearance_m(&self, point: Point2) -> f64 {
        self.cell_of(point).map_or(0.0, |(column, row)| f64::from(self.clearance_m[row * self.width + column]))
    }

    /// Largest clearance anywhere, metres.
    #[must_use]
    pub fn max_clearance_m(&self) -> f64 {
        f64::from(self.clearance_m.iter().copied().fold(0.0, f32::max))
    }

    /// Cells that the centre of a disc of radius `radius_m` can reach from the cell of `from` (or
    /// from the nearest cell within `radius_m` + 0.5 m that has room for it). Empty if there is
    /// none.
    #[must_use]
    pub fn reachable(&self, from: Point2, radius_m: f64) -> Mask {
        let mut cells = vec![false; self.width * self.height];
        if let Some(start) = self.nearest_with_clearance(from, radius_m) {
            let mut open = vec![start];
            cells[start] = true;
            while let Some(index) = open.pop() {
                let (column, row) = (index % self.width, index / self.width);
                let mut visit = |next: usize| {
                    if !cells[next] && self.has_room(next, radius_m) {
                        cells[next] = true;
                        open.push(next);
                    }
                };
                if column > 0 {
                    visit(index - 1);
                }
                if column + 1 < self.width {
                    visit(index + 1);
                }
                if row > 0 {
                    visit(index - self.width);
                }
                if row + 1 < self.height {
                    visit(index + self.width);
                }
            }
        }
        Mask { width: self.width, cells }
    }

    /// Free cells that a disc of radius `radius_m` can cover when it starts at `from`: the cells of
    /// [`reachable`](Self::reachable), dilated by the radius.
    #[must_use]
    pub fn reachable_free(&self, from: Point2, radius_m: f64) -> Mask {
        let centres = self.reachable(from, radius_m);
        let to_centre = distance::to_set(&centres.cells, self.width, self.height, self.resolution_m);
        let reach = (radius_m + self.resolution_m) as f32;
        let cells = to_centre.iter().zip(&self.occupied).map(|(&d, &occupied)| !occupied && d <= reach).collect();
        Mask { width: self.width, cells }
    }

    /// Area of a set of cells, square metres.
    #[must_use]
    pub fn area_m2(&self, mask: &Mask) -> f64 {
        mask.count() as f64 * self.resolution_m * self.resolution_m
    }

    /// Area of all free cells, square metres.
    #[must_use]
    pub fn free_area_m2(&self) -> f64 {
        self.occupied.iter().filter(|&&occupied| !occupied).count() as f64 * self.resolution_m * self.resolution_m
    }

    fn has_room(&self, index: usize, radius_m: f64) -> bool {
        !self.occupied[index] && f64::from(self.clearance_m[index]) >= radius_m
    }

    /// Index of the cell nearest to `point` where a disc of `radius_m` fits, within `radius_m` +
    /// 0.5 m.
    fn nearest_with_clearance(&self, point: Point2, radius_m: f64) -> Option<usize> {
        let reach = ((radius_m + 0.5) / self.resolution_m).ceil() as isize;
        let (column, row) = self.cell_of(point)?;
        let mut best: Option<(isize, usize)> = None;
        for dy in -reach..=reach {
            for dx in -reach..=reach {
                let (x, y) = (column as isize + dx, row as isize + dy);
                if x < 0 || y < 0 || x >= self.width as isize || y >= self.height as isize {
                    continue;
                }
                let index = y as usize * self.width + x as usize;
                let squared = dx * dx + dy * dy;
                if squared <= reach * reach && self.has_room(index, radius_m) && best.is_none_or(|(b, _)| squared < b) {
                    best = Some((squared, index));
                }
            }
        }
        best.map(|(_, index)| index)
    }
}

/// Length of a polyline, metres.
#[must_use]
pub fn path_length_m(path: &[Point2]) -> f64 {
    path.windows(2).map(|pair| (pair[1] - pair[0]).norm()).sum()
}
