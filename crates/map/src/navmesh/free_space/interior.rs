//! What lies well inside of all rectangles together.

use crate::navmesh::cell_grid::{CellGrid, Extent};
use crate::navmesh::limits::{Looks, OverBudget};
use crate::navmesh::plane::Corner;

/// What is nearer than this to the border of all rectangles together is the wall behind it,
/// millimetres.
const BORDER_MM: f64 = 50.0;

/// Rectangles, least and greatest corner, by place.
pub(crate) struct Inner<'a> {
    rectangles: &'a [Extent],
    cells: CellGrid,
}

fn contains([low, high]: &Extent, at: Corner, margin_mm: f64) -> bool {
    (0..2).all(|axis| at[axis] > low[axis] + margin_mm && at[axis] < high[axis] - margin_mm)
}

impl<'a> Inner<'a> {
    pub(crate) fn of(rectangles: &'a [Extent]) -> Self {
        let wider: Vec<Extent> = rectangles
            .iter()
            .map(|[low, high]| [low.map(|it| it - BORDER_MM), high.map(|it| it + BORDER_MM)])
            .collect();
        Self { rectangles, cells: CellGrid::of(&wider) }
    }

    /// Whether a place lies inside rectangles, well away from the border of all of them together.
    pub(crate) fn contains(&self, place: Corner, looks: &mut Looks) -> Result<bool, OverBudget> {
        let around = self.cells.at(place).iter().map(|&index| &self.rectangles[index as usize]);
        looks.add(1 + around.len())?;
        if around.clone().any(|it| contains(it, place, BORDER_MM)) {
            return Ok(true);
        }
        let near: Vec<&Extent> = around.filter(|it| contains(it, place, -BORDER_MM)).collect();
        looks.add(8 * near.len())?;
        Ok((0..8).all(|eighth| {
            let (sin, cos) = (f64::from(eighth) * std::f64::consts::FRAC_PI_4).sin_cos();
            let beside = [place[0] + BORDER_MM * cos, place[1] + BORDER_MM * sin];
            near.iter().any(|it| contains(it, beside, 0.0))
        }))
    }
}
