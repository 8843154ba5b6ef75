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
        judge_among(&[(self, *submap_from_base)], points)
    }

    /// Whether a point in its frame is on a wall.
    fn explains(&self, point: &SeenPoint) -> bool {
        self.cloud.explains(point, self.config.explained_m)
    }

    /// Whether a point in its frame is in space that was seen empty.
    fn is_empty_at(&self, point: &SeenPoint) -> bool {
        self.space.state_at(point.position) == CellState::Free
    }
}

/// How a scan fits several submaps together, in each of which it was taken at the pose beside it: on
/// a wall of one, or else in space that one saw empty.
#[must_use]
pub fn judge_among(submaps: &[(&Submap, Pose2)], points: &[Point2]) -> SubmapFit {
    let mut verdict = SubmapFit::default();
    for point in points.iter().copied().map(SeenPoint::of_scan) {
        if submaps.iter().any(|(submap, from_base)| submap.explains(&point.transformed(from_base))) {
            verdict.explained += 1;
        } else if submaps.iter().any(|(submap, from_base)| submap.is_empty_at(&point.transformed(from_base))) {
            verdict.contradicted += 1;
        } else {
            verdict.unseen += 1;
        }
    }
    verdict
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_perception::pose::pose;
    use std::f64::consts::PI;

    /// What a scanner sees from the middle of a room of 8 by 5 metres, over half a turn from
    /// `angle_min`.
    fn half_turn(angle_min: f64) -> LaserScan {
        let angle_increment = PI / 180.0;
        let range = |index: usize| {
            let (sin, cos) = (angle_min + index as f64 * angle_increment).sin_cos();
            (4.0 / cos.abs()).min(2.5 / sin.abs()) as f32
        };
        LaserScan {
            base_from_sensor: Pose2::identity(),
            angle_min,
            angle_increment,
            range_min_m: 0.1,
            range_max_m: 30.0,
            ranges_m: (0..180).map(range).collect(),
        }
    }

    #[test]
    fn a_scan_that_two_submaps_have_seen_half_of_each_is_seen_whole_by_both_together() {
        let submap = |angle_min: f64| {
            let scan = half_turn(angle_min);
            Submap::begin(0, &SubmapConfig::default(), &scan, &scan.points_in_base())
        };
        let (ahead, behind) = (submap(-PI / 2.0), submap(PI / 2.0));
        let whole: Vec<Point2> =
            [half_turn(-PI / 2.0), half_turn(PI / 2.0)].iter().flat_map(LaserScan::points_in_base).collect();
        let here = Pose2::identity();
        for alone in [ahead.judge(&whole, &here), behind.judge(&whole, &here)] {
            assert!((0.49..0.55).contains(&alone.overlap()) && alone.agreement() > 0.99, "{alone:?}");
        }
        let together = judge_among(&[(&ahead, here), (&behind, here)], &whole);
        assert_eq!(together.explained, whole.len(), "{together:?}");
        // What the one has not seen the other contradicts.
        let aside = pose(0.5, 0.0, 0.0);
        let wrong = judge_among(&[(&ahead, aside), (&behind, aside)], &whole);
        assert!(wrong.contradicted > 60 && wrong.agreement() < 0.7, "{wrong:?}");
    }
}
