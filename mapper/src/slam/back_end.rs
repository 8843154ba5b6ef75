//! The back end's thread: keyframes go in, corrected poses and a grid redrawn with them come out.

use super::closure::{ClosureConfig, ClosureCounts, LoopCloser, LostSearch, NewKeyframe, SubmapSighting};
use super::estimate::{GridScan, Lost, locate};
use super::graph::KeyframeGraph;
use super::submap::SubmapConfig;
use crate::haste::Haste;
use crate::slam::foreign_nodes::{Hearsay, Shift, Told};
use fht_perception::grid::{CellBounds, GridConfig, OccupancyGrid};
use fht_perception::pose::Pose2;

/// The grid is drawn again when some keyframe has moved by this much since it was drawn, metres.
/// Less than half a cell.
pub(super) const REDRAW: Shift = Shift { least_m: 0.02, least_rad: 0.003 };

/// What the back end is given.
#[derive(Debug, Default)]
pub struct BackEndJob {
    /// Keyframes since the last job.
    pub keyframes: Vec<NewKeyframe>,
    /// What the grid is to show of them.
    pub views: Vec<GridScan>,
    /// What panoramas looked like.
    pub sightings: Vec<SubmapSighting>,
    /// What others have told of the building.
    pub told: Vec<Told>,
    /// Where the run's frame lies in the map that the robot has joined, if that was found out after
    /// the keyframes of the last job and before those of this one: [`BackEndJob::keyframes`] are in
    /// the map's frame.
    pub map_from_run: Option<Pose2>,
    /// A robot that does not know where it is.
    pub lost: Option<Lost>,
    /// With the last job: whether there is time for a last look at all closures.
    pub last: Option<Haste>,
}

/// What it made of that.
#[derive(Debug)]
pub struct BackEndResult {
    /// Poses of all keyframes that it was given, if they have moved.
    pub poses: Option<Vec<Pose2>>,
    /// The grid of all views that it was given, if it had to be drawn again.
    pub grid: Option<OccupancyGrid>,
    /// What became of the search for a lost robot.
    pub search: Option<LostSearch>,
    /// What was done so far.
    pub counts: ClosureCounts,
}

/// What the thread keeps.
pub struct BackEnd {
    grid: GridConfig,
    submap: SubmapConfig,
    graph: KeyframeGraph,
    closer: LoopCloser,
    views: Vec<GridScan>,
    hearsay: Hearsay,
    /// Poses with which the front end's grid was drawn.
    drawn: Vec<Pose2>,
    /// The room that the grid took when it was drawn last.
    room: CellBounds,
}

impl BackEnd {
    /// Before the first job.
    #[must_use]
    pub fn new(grid: GridConfig, submap: SubmapConfig, closure: ClosureConfig) -> Self {
        Self {
            grid,
            submap,
            graph: KeyframeGraph::default(),
            closer: LoopCloser::new(closure),
            views: Vec::new(),
            hearsay: Hearsay::default(),
            drawn: Vec::new(),
            room: CellBounds::EMPTY,
        }
    }

    /// Works on a job.
    pub fn work(&mut self, job: BackEndJob) -> BackEndResult {
        let mut has_moved = job.map_from_run.is_some();
        if let Some(map_from_run) = job.map_from_run {
            self.graph.place(&map_from_run);
        }
        let mut is_outdated = false;
        for (id, node) in job.told {
            let anchor = node.as_ref().filter(|node| node.is_anchor);
            self.closer.take_anchor(id, anchor, &self.submap, &mut self.graph);
            is_outdated |= !self.hearsay.take_node((id, node), REDRAW);
        }
        has_moved |= self.closer.settle(&mut self.graph);
        for keyframe in job.keyframes {
            self.closer.add(keyframe, &mut self.graph);
            has_moved |= self.closer.settle(&mut self.graph);
        }
        for sighting in job.sightings {
            self.closer.observe_appearance(sighting, &mut self.graph);
            has_moved |= self.closer.settle(&mut self.graph);
        }
        if let Some(haste) = &job.last {
            self.closer.finish(&mut self.graph, haste);
            has_moved = true;
        }
        self.views.extend(job.views);
        let search = job.lost.map(|lost| self.closer.find(&lost, &self.graph));
        let grid = if has_moved || is_outdated { self.redraw(is_outdated) } else { None };
        // Until it is drawn again, the grid shows new keyframes where they are now.
        self.drawn.extend_from_slice(&self.graph.poses()[self.drawn.len()..]);
        let poses = has_moved.then(|| self.graph.poses().to_vec());
        BackEndResult { poses, grid, search, counts: self.closer.counts() }
    }

    /// The grid as it is now, if that is another one than was drawn, or what was told
    /// `is_outdated`.
    fn redraw(&mut self, is_outdated: bool) -> Option<OccupancyGrid> {
        let poses = self.graph.poses();
        let has_moved = |(now, then): (&Pose2, &Pose2)| {
            let moved = then.inverse() * now;
            moved.translation.vector.norm() > REDRAW.least_m || moved.rotation.angle().abs() > REDRAW.least_rad
        };
        if !is_outdated && !poses.iter().zip(&self.drawn).any(has_moved) {
            return None;
        }
        self.drawn = poses.to_vec();
        let mut grid = OccupancyGrid::within(self.grid.clone(), self.room);
        self.hearsay.draw(&mut grid);
        for view in &self.views {
            grid.integrate(&locate(poses, &view.anchored), &view.scan);
        }
        self.room = grid.bounds();
        Some(grid)
    }
}
