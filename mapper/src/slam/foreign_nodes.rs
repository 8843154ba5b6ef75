//! What other robots have told of the building: nodes of the map that this run did not make.
//!
//! Their scans and rectangles are drawn into the grid, so that what others have seen need not be
//! seen again. Nodes that were there before this robot joined the map also hold it: see
//! `closure`.

use fht_perception::frame::LaserScan;
use fht_perception::grid::OccupancyGrid;
use fht_perception::pose::{Point2, Pose2, to_fixed};
use fht_proto::{FixedPoint, NodeId, Rect, Signature};
use std::collections::BTreeMap;
use std::sync::Arc;

/// A node that another robot made.
#[derive(Clone, Debug)]
pub struct ToldNode {
    /// Where it is, as its maker has it.
    pub map_from_node: Pose2,
    /// What was seen from it, in its frame (main nodes).
    pub scan: Option<Arc<LaserScan>>,
    /// Its rectangle of free space, along the axes of the map.
    pub free_space: Option<Rect>,
    /// Whether this robot holds itself to it.
    pub is_anchor: bool,
    /// Whether what it saw need not be seen again.
    pub is_shown: bool,
}

impl ToldNode {
    /// A node of the map.
    #[must_use]
    pub fn new(map_from_node: Pose2, free_space: Option<Rect>, signature: Option<&Signature>) -> Self {
        let scan = signature.map(|signature| Arc::new(LaserScan::from_record(&signature.scan)));
        Self { map_from_node, scan, free_space, is_anchor: false, is_shown: true }
    }

    fn position(&self) -> FixedPoint {
        to_fixed(&self.map_from_node).position
    }

    /// Whether what a grid shows of it is still right when it becomes `after`, with whose rectangle
    /// drawn over it.
    fn is_drawn_over_by(&self, after: &Self, shift: Shift) -> bool {
        let off = self.map_from_node.inverse() * after.map_from_node;
        let is_within = match (&self.free_space, &after.free_space) {
            (None, _) => true,
            (Some(_), None) => false,
            (Some(before), Some(after)) => {
                after.west_mm >= before.west_mm
                    && after.east_mm >= before.east_mm
                    && after.south_mm >= before.south_mm
                    && after.north_mm >= before.north_mm
            }
        };
        is_within
            && self.scan.is_some() == after.scan.is_some()
            && off.translation.vector.norm() <= shift.least_m
            && off.rotation.angle().abs() <= shift.least_rad
    }

    fn draw_free_space(&self, grid: &mut OccupancyGrid) {
        if let Some(rect) = self.free_space.as_ref().filter(|_| self.is_shown) {
            let (min, max) = (rect.min(self.position()), rect.max(self.position()));
            grid.suppose_free(Point2::new(min.0, min.1), Point2::new(max.0, max.1));
        }
    }

    /// Draws it into a grid.
    pub fn draw(&self, grid: &mut OccupancyGrid) {
        self.draw_free_space(grid);
        if let Some(scan) = self.scan.as_ref().filter(|_| self.is_shown) {
            grid.integrate_told(&self.map_from_node, scan);
        }
    }
}

/// News of a node: what it is now, or that it is no more.
pub type Told = (NodeId, Option<ToldNode>);

/// From when on a shift shows in a grid.
#[derive(Clone, Copy, Debug)]
pub struct Shift {
    /// Metres.
    pub least_m: f64,
    /// Radians.
    pub least_rad: f64,
}

/// All that was told.
#[derive(Clone, Debug, Default)]
pub struct Hearsay(BTreeMap<NodeId, ToldNode>);

impl Hearsay {
    /// Takes news in; false when a grid that shows what was told must be drawn anew, because
    /// something is no longer there.
    pub fn take_node(&mut self, (id, node): Told, shift: Shift) -> bool {
        match node {
            None => self.0.remove(&id).is_none(),
            Some(node) => {
                let is_right = self.0.get(&id).is_none_or(|before| before.is_drawn_over_by(&node, shift));
                self.0.insert(id, node);
                is_right
            }
        }
    }

    /// Draws news into a grid that shows all that was told before them, as far as that can be done
    /// without drawing it anew.
    pub fn draw_news(&self, (id, node): &Told, grid: &mut OccupancyGrid) {
        match (self.0.get(id), node) {
            (_, None) => {}
            (None, Some(node)) => node.draw(grid),
            (Some(_), Some(node)) => node.draw_free_space(grid),
        }
    }

    /// Draws all of it, in the order of the nodes' ids.
    pub fn draw(&self, grid: &mut OccupancyGrid) {
        self.0.values().for_each(|node| node.draw(grid));
    }
}
