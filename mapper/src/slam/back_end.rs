//! The back end's thread: keyframes go in, corrected poses and a grid redrawn with them come out.

use super::closure::{ClosureConfig, ClosureCounts, Found, LoopCloser, NewKeyframe, Sighting};
use super::estimate::{View, locate};
use super::graph::KeyframeGraph;
use fht_robot::grid::{GridConfig, OccupancyGrid};
use fht_robot::pose::{Point2, Pose2};

/// The grid is drawn again when some keyframe has moved by this much since it was drawn, metres. Less than half a cell.
const REDRAW_M: f64 = 0.02;
/// The same, radians.
const REDRAW_RAD: f64 = 0.003;

/// What a robot sees that does not know where it is.
#[derive(Clone, Debug)]
pub struct Lost {
    /// Wall points in its frame.
    pub points: Vec<Point2>,
    /// What the wheels said there.
    pub odom_from_base: Pose2,
}

/// What the back end is given.
#[derive(Debug, Default)]
pub struct Job {
    /// Keyframes since the last job.
    pub keyframes: Vec<NewKeyframe>,
    /// What the grid is to show of them.
    pub views: Vec<View>,
    /// What panoramas looked like.
    pub sightings: Vec<Sighting>,
    /// A robot that does not know where it is.
    pub lost: Option<Lost>,
    /// Whether this is the last job.
    pub is_last: bool,
}

/// What it made of that.
#[derive(Debug)]
pub struct Outcome {
    /// Poses of all keyframes that it was given, if they have moved.
    pub poses: Option<Vec<Pose2>>,
    /// The grid of all views that it was given, if it had to be drawn again.
    pub grid: Option<OccupancyGrid>,
    /// Where the lost robot is.
    pub found: Option<Found>,
    /// What was done so far.
    pub counts: ClosureCounts,
}

/// What the thread keeps.
pub struct BackEnd {
    grid: GridConfig,
    graph: KeyframeGraph,
    closer: LoopCloser,
    views: Vec<View>,
    /// Poses with which the front end's grid was drawn.
    drawn: Vec<Pose2>,
}

impl BackEnd {
    /// Before the first job.
    #[must_use]
    pub fn new(grid: GridConfig, closure: ClosureConfig) -> Self {
        Self {
            grid,
            graph: KeyframeGraph::default(),
            closer: LoopCloser::new(closure),
            views: Vec::new(),
            drawn: Vec::new(),
        }
    }

    /// Works on a job.
    pub fn work(&mut self, job: Job) -> Outcome {
        let mut has_moved = false;
        for keyframe in job.keyframes {
            self.closer.add(keyframe, &mut self.graph);
            has_moved |= self.closer.settle(&mut self.graph);
        }
        for sighting in job.sightings {
            self.closer.see(sighting, &mut self.graph);
            has_moved |= self.closer.settle(&mut self.graph);
        }
        if job.is_last {
            self.closer.finish(&mut self.graph);
            has_moved = true;
        }
        self.views.extend(job.views);
        let found = job.lost.and_then(|lost| self.closer.find(&lost, &self.graph));
        let grid = if has_moved { self.redraw() } else { None };
        // Until it is drawn again, the grid shows new keyframes where they are now.
        self.drawn.extend_from_slice(&self.graph.poses()[self.drawn.len()..]);
        let poses = has_moved.then(|| self.graph.poses().to_vec());
        Outcome { poses, grid, found, counts: self.closer.counts() }
    }

    fn redraw(&mut self) -> Option<OccupancyGrid> {
        let poses = self.graph.poses();
        let has_moved = |(now, then): (&Pose2, &Pose2)| {
            let moved = then.inverse() * now;
            moved.translation.vector.norm() > REDRAW_M || moved.rotation.angle().abs() > REDRAW_RAD
        };
        if !poses.iter().zip(&self.drawn).any(has_moved) {
            return None;
        }
        self.drawn = poses.to_vec();
        let mut grid = OccupancyGrid::new(self.grid.clone());
        for view in &self.views {
            grid.integrate(&locate(poses, &view.anchored), &view.scan);
        }
        Some(grid)
    }
}
