//! A submap: the walls and the free space that some consecutive keyframes saw, rigid, in the frame
//! of the first of them.

use fht_perception::frame::LaserScan;
use fht_perception::grid::{CellState, GridConfig, OccupancyGrid};
use fht_perception::matching::{ReferenceCloud, SeenPoint};
use fht_perception::pose::{Point2, Pose2};
use serde::{Deserialize, Serialize};

/// Parameters of submaps.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct SubmapConfig {
    /// Keyframes after which the next submap is begun; a submap holds twice as many. Default 15.
    #[cfg_attr(feature = "schema", schemars(range(min = 1, max = 10000)))]
    pub keyframes: usize,
    /// Wall points are at least this far apart, metres. Default 0.03.
    #[cfg_attr(feature = "schema", schemars(range(min = 0.001, max = 1.0)))]
    pub point_spacing_m: f64,
    /// Side of the cells in which free space is remembered, metres. Default 0.1.
    #[cfg_attr(feature = "schema", schemars(range(min = 0.01, max = 1.0)))]
    pub resolution_m: f64,
    /// A point is explained when a wall is nearer than this, metres. Default 0.06.
    pub explained_m: f64,
}

impl Default for SubmapConfig {
    fn default() -> Self {
        Self { keyframes: 15, point_spacing_m: 0.03, resolution_m: 0.1, explained_m: 0.06 }
    }
}

/// A submap, growing or finished.
#[derive(Clone, Debug)]
pub struct Submap {
    config: SubmapConfig,
    first: usize,
    members: Vec<Pose2>,
    cloud: ReferenceCloud,
    space: OccupancyGrid,
}

/// How a scan fits a submap, in numbers of points.
#[derive(Clone, Copy, Debug, Default)]
pub struct SubmapFit {
    /// On a wall of the submap.
    pub explained: usize,
    /// In space that the submap saw empty.
    pub contradicted: usize,
    /// Where the submap did not look.
    pub unseen: usize,
}

impl SubmapFit {
    /// Explained share of what the submap can judge, 0 to 1.
    #[must_use]
    pub fn agreement(&self) -> f64 {
        self.explained as f64 / (self.explained + self.contradicted).max(1) as f64
    }

    /// Points for less points against: of several alignments the one with the greatest is the best.
    #[must_use]
    pub fn balance(&self) -> i64 {
        self.explained as i64 - self.contradicted as i64
    }

    /// Explained share of all points, 0 to 1.
    #[must_use]
    pub fn overlap(&self) -> f64 {
        self.explained as f64 / (self.explained + self.contradicted + self.unseen).max(1) as f64
    }
}

impl Submap {
    /// An empty submap in the frame of keyframe `first`.
    #[must_use]
    pub fn new(first: usize, config: &SubmapConfig) -> Self {
        let grid = GridConfig { resolution_m: config.resolution_m, max_no_return_m: 0.0, ..GridConfig::default() };
        Self {
            config: config.clone(),
            first,
            members: Vec::new(),
            cloud: ReferenceCloud::default(),
            space: OccupancyGrid::new(grid),
        }
    }

    /// A submap with its first keyframe in it.
    #[must_use]
    pub fn begin(first: usize, config: &SubmapConfig, scan: &LaserScan, points: &[Point2]) -> Self {
        let mut submap = Self::new(first, config);
        submap.insert(&Pose2::identity(), scan, points);
        submap
    }

    /// Index of the keyframe that is its frame.
    #[must_use]
    pub fn first(&self) -> usize {
        self.first
    }

    /// The indices of its keyframes.
    #[must_use]
    pub fn keyframes(&self) -> std::ops::Range<usize> {
        self.first..self.first + self.members.len()
    }

    /// Whether keyframe `index` is one of its own.
    #[must_use]
    pub fn has(&self, index: usize) -> bool {
        self.keyframes().contains(&index)
    }

    /// Poses of its keyframes in its frame; the `i`-th is keyframe `first + i`.
    #[must_use]
    pub fn members(&self) -> &[Pose2] {
        &self.members
    }

    /// Its walls.
    #[must_use]
    pub fn cloud(&self) -> &ReferenceCloud {
        &self.cloud
    }

    /// Adds the next keyframe: its pose in this frame, its scan and the scan's points in the
    /// robot's frame.
    pub fn insert(&mut self, submap_from_base: &Pose2, scan: &LaserScan, points: &[Point2]) {
        self.average(submap_from_base, points);
        self.space.integrate(submap_from_base, scan);
        self.members.push(*submap_from_base);
    }

    /// Averages in a scan that makes no keyframe, in the robot's frame: the noise of the walls
    /// becomes less.
    pub fn average(&mut self, submap_from_base: &Pose2, points: &[Point2]) {
        let seen = points.iter().copied().map(SeenPoint::of_scan);
        self.cloud.absorb(seen.map(|point| point.transformed(submap_from_base)), self.config.point_spacing_m);
    }

    /// Whether it holds all the keyframes that it is to hold.
    #[must_use]
    pub fn is_full(&self) -> bool {
        self.members.len() >= 2 * self.config.keyframes
    }

    /// How a scan taken at `submap_from_base` fits.
    #[must_use]
    pub fn judge(&self, points: &[Point2], submap_from_base: &Pose2) -> SubmapFit {
        let mut verdict = SubmapFit::default();
        for point in points {
            let point = SeenPoint::of_scan(*point).transformed(submap_from_base);
            if self.cloud.explains(&point, self.config.explained_m) {
                verdict.explained += 1;
            } else if self.space.state_at(point.position) == CellState::Free {
                verdict.contradicted += 1;
            } else {
                verdict.unseen += 1;
            }
        }
        verdict
    }
}
