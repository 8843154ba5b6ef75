//! Both maps on one grid: what is known to be free, and where something was seen.

use crate::refusal::MergeRefusal;
use fht_map::{MapState, NodeRef};
use fht_perception::drivable_line::DrivableLineConfig;
use fht_perception::frame::LaserScan;
use fht_perception::grid::{Cell, CellBounds, CellState, GridConfig, OccupancyGrid};
use fht_perception::pose::{Point2, Pose2, from_fixed, pose};
use fht_proto::{FixedPoint, NodeId};
use nalgebra::Vector2;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// How both maps are drawn.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct JointGridConfig {
    /// Cells, at most. Default 40 million: 0.1 km² at 0.05 m.
    pub most_cells: usize,
    /// What the second map knows to be free counts up to this before its border: the alignment is
    /// not exact, metres. Default 0.02.
    pub margin_m: f64,
    /// The grid. Default: log-odds within ± 2, which two beams that end in a cell take back where
    /// a rectangle said that it is free.
    pub grid: GridConfig,
}

impl Default for JointGridConfig {
    fn default() -> Self {
        let grid = GridConfig { max_log_odds: 2.0, ..GridConfig::default() };
        Self { most_cells: 40_000_000, margin_m: 0.02, grid }
    }
}

/// Rectangles are rounded down to whole millimetres: a cell may stand out of one by this, metres.
const ROUNDING_M: f64 = 0.003;
/// Half the diagonal of a cell, as a share of its side.
const HALF_DIAGONAL: f64 = 0.708;

/// Where a fixed point is.
pub(crate) fn point(at: FixedPoint) -> Point2 {
    Point2::new(at.x(), at.y())
}

/// A box in a frame of its own.
struct Block {
    a_from_block: Pose2,
    low: Point2,
    high: Point2,
}

impl Block {
    fn holds(&self, at: Point2) -> bool {
        let at = self.a_from_block.inverse() * at;
        (self.low.x..=self.high.x).contains(&at.x) && (self.low.y..=self.high.y).contains(&at.y)
    }

    fn corners(&self) -> [Point2; 4] {
        let (low, high) = (self.low, self.high);
        [low, Point2::new(high.x, low.y), high, Point2::new(low.x, high.y)].map(|corner| self.a_from_block * corner)
    }
}

/// A node's rectangle, given how its map lies in the frame, with `more_m` on each side.
fn rectangle(node: &NodeRef<'_>, a_from_map: &Pose2, more_m: f64) -> Option<Block> {
    let rect = node.free_space?;
    let corner = |(x, y): (f64, f64), by: f64| Point2::new(x + by, y + by);
    let (low, high) = (corner(rect.min(node.pose.position), -more_m), corner(rect.max(node.pose.position), more_m));
    (low.x < high.x && low.y < high.y).then_some(Block { a_from_block: *a_from_map, low, high })
}

/// The corridor of an edge.
fn corridor(from: Point2, to: Point2, half_width_m: f64) -> Block {
    let along = to - from;
    let a_from_block = pose(from.x, from.y, along.y.atan2(along.x));
    Block { a_from_block, low: Point2::new(0.0, -half_width_m), high: Point2::new(along.norm(), half_width_m) }
}

/// Draws `a`, and `b` with its nodes at `a_from_nodes`.
pub(crate) fn draw(
    a: &MapState,
    b: &MapState,
    a_from_nodes: &BTreeMap<NodeId, Pose2>,
    edges: &DrivableLineConfig,
    config: &JointGridConfig,
) -> Result<OccupancyGrid, MergeRefusal> {
    let side_m = config.grid.resolution_m;
    let clear_m = edges.half_width_m - HALF_DIAGONAL * side_m;
    let still = Pose2::identity();
    let mut blocks: Vec<Block> = a.nodes().filter_map(|node| rectangle(&node, &still, ROUNDING_M)).collect();
    blocks.extend(b.nodes().filter_map(|node| {
        let motion = a_from_nodes.get(&node.id)? * from_fixed(node.pose).inverse();
        rectangle(&node, &motion, -config.margin_m)
    }));
    blocks.extend(a.edges().filter_map(|edge| {
        let end = |id| a.node(id).map(|node| point(node.pose.position));
        Some(corridor(end(edge.low())?, end(edge.high())?, clear_m))
    }));
    blocks.extend(b.edges().filter_map(|edge| {
        let end = |id| a_from_nodes.get(&id).map(|pose| Point2::from(pose.translation.vector));
        Some(corridor(end(edge.low())?, end(edge.high())?, clear_m - config.margin_m))
    }));
    let bounds = bounds(a, &blocks, a_from_nodes, config)?;
    let mut states = vec![CellState::Unknown; bounds.width() * bounds.height()];
    let frame = OccupancyGrid::new(config.grid.clone());
    for block in &blocks {
        free(&mut states, &bounds, &frame, block);
    }
    let mut grid = OccupancyGrid::from_states(config.grid.clone(), bounds, states.iter().copied());
    for node in a.main_nodes() {
        if let Some(signature) = node.signature {
            grid.integrate(&from_fixed(node.pose), &LaserScan::from_record(&signature.scan));
        }
    }
    for node in b.main_nodes() {
        if let (Some(signature), Some(a_from_node)) = (node.signature, a_from_nodes.get(&node.id)) {
            grid.integrate(a_from_node, &LaserScan::from_record(&signature.scan));
        }
    }
    // What one scan from far away shows is too little to drive on: only what a map itself says is
    // free. Beyond `bounds` no map does.
    grid.forget_free(|cell| bounds.index(cell).is_some_and(|index| states[index] == CellState::Free));
    Ok(grid)
}

fn bounds(
    a: &MapState,
    blocks: &[Block],
    a_from_nodes: &BTreeMap<NodeId, Pose2>,
    config: &JointGridConfig,
) -> Result<CellBounds, MergeRefusal> {
    let nodes = a.nodes().map(|node| point(node.pose.position));
    let others = a_from_nodes.values().map(|pose| Point2::from(pose.translation.vector));
    let all = blocks.iter().flat_map(Block::corners).chain(nodes).chain(others);
    let (low, high) = all
        .fold((Point2::new(f64::MAX, f64::MAX), Point2::new(f64::MIN, f64::MIN)), |(low, high), at| {
            (low.inf(&at), high.sup(&at))
        });
    // Scans reach farther than rectangles; the grid grows with them.
    let size = (high - low) / config.grid.resolution_m + Vector2::repeat(2.0);
    if !(size.x * size.y).is_finite() || size.x * size.y > config.most_cells as f64 {
        let what = format!("both maps together measure {:.0} m × {:.0} m", high.x - low.x, high.y - low.y);
        let most = format!("{:.0} m²", config.most_cells as f64 * config.grid.resolution_m.powi(2));
        return Err(MergeRefusal::TooLarge { what, most });
    }
    let cell = |at: Point2| {
        let index = |metres: f64| (metres / config.grid.resolution_m).floor() as i32;
        Cell { i: index(at.x), j: index(at.y) }
    };
    let (min, max) = (cell(low), cell(high));
    Ok(CellBounds { min, max: Cell { i: max.i + 1, j: max.j + 1 } })
}

/// Frees the cells that lie in a block whole.
fn free(states: &mut [CellState], bounds: &CellBounds, frame: &OccupancyGrid, block: &Block) {
    let corners = block.corners();
    let low = corners.iter().fold(corners[0], |low, corner| low.inf(corner));
    let high = corners.iter().fold(corners[0], |high, corner| high.sup(corner));
    let (first, last) = (frame.cell_of(low), frame.cell_of(high));
    let half = 0.5 * frame.resolution_m();
    let beside = [(-half, -half), (half, -half), (half, half), (-half, half)];
    for j in first.j..=last.j {
        for i in first.i..=last.i {
            let centre = frame.centre(Cell { i, j });
            if beside.iter().all(|&(x, y)| block.holds(centre + Vector2::new(x, y)))
                && let Some(index) = bounds.index(Cell { i, j })
            {
                states[index] = CellState::Free;
            }
        }
    }
}
