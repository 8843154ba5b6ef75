//! A set of reference points with normals, and an index of where they are.
//!
//! Each point remembers from which side it was seen. A wall is two surfaces: what was seen from one
//! room says nothing of a point that is seen from the next, and a match that mixed them would be
//! off by the wall's thickness.

use super::point_index::PointIndex;
use crate::pose::{Point2, Pose2};
use nalgebra::{Matrix2, Vector2};

/// The farthest that a nearest neighbour is looked for, metres.
const FARTHEST_M: f64 = 0.4;
/// Neighbours within this make a point's normal, metres; wider rings are tried when there are too
/// few.
const NORMAL_RADII_M: [f64; 3] = [0.12, 0.25, 0.4];
/// A neighbourhood whose lesser spread is above this share of the greater is no line.
const MAX_FLATNESS: f64 = 0.15;

/// Surfaces face a viewer when the cosine between the normal and the direction to the viewer is
/// above this: a little below 0, for walls seen at grazing angles and for the normals' noise.
const MIN_FACING: f64 = -0.1;

/// Measurements that a point's mean remembers at most, so that it follows what changes.
const MAX_WEIGHT: f64 = 30.0;

/// A point and the direction (of length 1) to where it was seen from.
#[derive(Clone, Copy, Debug)]
pub struct SeenPoint {
    /// Where it is.
    pub position: Point2,
    /// Towards the viewer.
    pub to_viewer: Vector2<f64>,
}

impl SeenPoint {
    /// A point seen from `viewer`.
    #[must_use]
    pub fn new(position: Point2, viewer: Point2) -> Self {
        let apart = viewer - position;
        let distance = apart.norm();
        Self { position, to_viewer: if distance > 0.0 { apart / distance } else { Vector2::x() } }
    }

    /// A point of a scan, seen from the frame's origin.
    #[must_use]
    pub fn of_scan(position: Point2) -> Self {
        Self::new(position, Point2::origin())
    }

    /// The same in another frame.
    #[must_use]
    pub fn transformed(&self, transform: &Pose2) -> Self {
        Self { position: transform * self.position, to_viewer: transform.rotation * self.to_viewer }
    }
}

/// A reference point; `normal` points to the viewer's side and is absent where the neighbourhood is
/// no line.
#[derive(Clone, Copy, Debug)]
pub(super) struct ReferencePoint {
    pub position: Point2,
    pub to_viewer: Vector2<f64>,
    pub normal: Option<Vector2<f64>>,
    /// How many measurements it is the mean of.
    weight: f64,
}

impl ReferencePoint {
    /// Whether the surface here is the one that `point` was seen on.
    fn faces(&self, point: &SeenPoint) -> bool {
        self.normal.unwrap_or(self.to_viewer).dot(&point.to_viewer) > MIN_FACING
    }
}

/// Points to match against, in any frame.
#[derive(Clone, Debug, Default)]
pub struct ReferenceCloud {
    points: Vec<ReferencePoint>,
    index: PointIndex,
}

impl ReferenceCloud {
    /// A cloud of the points of one scan, seen from the frame's origin; normals come from their
    /// neighbours. Non-finite points are left out.
    #[must_use]
    pub fn from_scan(points: &[Point2]) -> Self {
        let mut cloud = Self::default();
        cloud.extend(points.iter().copied().map(SeenPoint::of_scan));
        cloud
    }

    /// Adds points; normals near them are estimated anew.
    pub fn extend(&mut self, points: impl IntoIterator<Item = SeenPoint>) {
        let first = self.points.len();
        for SeenPoint { position, to_viewer } in points {
            if !position.x.is_finite() || !position.y.is_finite() {
                continue;
            }
            self.push(SeenPoint { position, to_viewer });
        }
        self.estimate_normals((first as u32..self.points.len() as u32).collect(), first > 0);
    }

    /// Adds the points of a scan; those within `spacing_m` of a point that is there are averaged
    /// into it, across the wall. The mean of many measurements is truer than any of them.
    pub fn absorb(&mut self, points: impl IntoIterator<Item = SeenPoint>, spacing_m: f64) {
        let first = self.points.len();
        let mut moved: Vec<u32> = Vec::new();
        for point in points {
            if let Some(index) = self.nearest_index(&point, spacing_m) {
                self.average(index, &point);
                moved.push(index);
            } else if point.position.x.is_finite() && point.position.y.is_finite() {
                self.push(point);
            }
        }
        self.estimate_normals((first as u32..self.points.len() as u32).collect(), first > 0);
        moved.sort_unstable();
        moved.dedup();
        moved.retain(|index| (*index as usize) < first);
        self.estimate_normals(moved, false);
    }

    fn push(&mut self, SeenPoint { position, to_viewer }: SeenPoint) {
        self.points.push(ReferencePoint { position, to_viewer, normal: None, weight: 1.0 });
        self.index.push(position);
    }

    fn average(&mut self, index: u32, point: &SeenPoint) {
        let reference = &mut self.points[index as usize];
        let off = point.position - reference.position;
        // Along the wall points stay where they are: evenly spaced.
        let across = reference.normal.map_or(off, |normal| normal * off.dot(&normal));
        reference.position += across / (reference.weight + 1.0);
        reference.weight = (reference.weight + 1.0).min(MAX_WEIGHT);
        self.index.set_position(index, reference.position);
    }

    /// Estimates the normals of points, and of those around them if `with_neighbours`.
    fn estimate_normals(&mut self, mut touched: Vec<u32>, with_neighbours: bool) {
        if with_neighbours {
            let mut around = Vec::new();
            for &index in &touched {
                let point = &self.points[index as usize];
                self.for_each_beside(point, 0.25, |index, _| around.push(index));
            }
            touched = around;
            touched.sort_unstable();
            touched.dedup();
        }
        let mut offsets = Vec::new();
        let normals: Vec<_> = touched.iter().map(|&index| self.normal_at(index, &mut offsets)).collect();
        for (index, normal) in touched.into_iter().zip(normals) {
            self.points[index as usize].normal = normal;
        }
    }

    /// How many points.
    #[must_use]
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// The points, in the order in which they were added.
    pub fn points(&self) -> impl Iterator<Item = SeenPoint> + '_ {
        self.points.iter().map(|point| SeenPoint { position: point.position, to_viewer: point.to_viewer })
    }

    /// Where they are.
    pub fn positions(&self) -> impl Iterator<Item = Point2> + '_ {
        self.points.iter().map(|point| point.position)
    }

    /// Whether some point seen from the same side lies within `radius_m` (at most 0.4) of `point`.
    #[must_use]
    pub fn has_point_within(&self, point: &SeenPoint, radius_m: f64) -> bool {
        self.nearest(point, radius_m).is_some()
    }

    /// The nearest point that was seen from the same side.
    pub(super) fn nearest(&self, point: &SeenPoint, radius_m: f64) -> Option<&ReferencePoint> {
        self.nearest_index(point, radius_m).map(|index| &self.points[index as usize])
    }

    fn nearest_index(&self, point: &SeenPoint, radius_m: f64) -> Option<u32> {
        let radius_m = radius_m.min(FARTHEST_M);
        self.index.nearest(point.position, radius_m, |index| self.points[index as usize].faces(point))
    }

    /// Visits the points around one that were seen from the same side: number and position.
    fn for_each_beside(&self, point: &ReferencePoint, radius_m: f64, mut visit: impl FnMut(u32, Point2)) {
        self.index.for_each_within(point.position, radius_m, |index, position| {
            if self.points[index as usize].to_viewer.dot(&point.to_viewer) > 0.0 {
                visit(index, position);
            }
        });
    }

    /// The direction of least spread of the neighbourhood, if the neighbourhood is a line.
    /// `offsets` is room for the neighbours.
    fn normal_at(&self, index: u32, offsets: &mut Vec<Vector2<f64>>) -> Option<Vector2<f64>> {
        let point = &self.points[index as usize];
        for radius in NORMAL_RADII_M {
            offsets.clear();
            self.for_each_beside(point, radius, |_, position| offsets.push(position - point.position));
            if offsets.len() < 3 {
                continue;
            }
            let count = offsets.len() as f64;
            let mean = offsets.iter().sum::<Vector2<f64>>() / count;
            let spread = offsets.iter().map(|d| (d - mean) * (d - mean).transpose());
            let covariance: Matrix2<f64> = spread.sum::<Matrix2<f64>>() / count;
            // Closed form of the 2 × 2 symmetric eigenproblem.
            let (a, b, c) = (covariance[(0, 0)], covariance[(0, 1)], covariance[(1, 1)]);
            let root = (0.25 * (a - c) * (a - c) + b * b).sqrt();
            let (greater, lesser) = (0.5 * (a + c) + root, 0.5 * (a + c) - root);
            if greater <= 0.0 || lesser / greater > MAX_FLATNESS {
                return None;
            }
            let line_angle = 0.5 * (2.0 * b).atan2(a - c);
            let normal = Vector2::new(-line_angle.sin(), line_angle.cos());
            return Some(if normal.dot(&point.to_viewer) < 0.0 { -normal } else { normal });
        }
        None
    }

    /// Whether `point` lies within `explained_m` of the line of its nearest point, or of the point
    /// itself where it has no line.
    #[must_use]
    pub fn explains(&self, point: &SeenPoint, explained_m: f64) -> bool {
        self.nearest(point, 2.5 * explained_m).is_some_and(|reference| match reference.normal {
            Some(normal) => (point.position - reference.position).dot(&normal).abs() <= explained_m,
            None => (point.position - reference.position).norm() <= explained_m,
        })
    }

    /// Share of all `points` (after `transform`) that [`Self::explains`]. Points without a
    /// reference point near count as not explained, also where the reference never looked. `None`
    /// without points.
    pub(super) fn explained_share(
        &self,
        points: impl Iterator<Item = SeenPoint>,
        transform: &Pose2,
        explained_m: f64,
    ) -> Option<f64> {
        let (mut count, mut explained) = (0, 0);
        for point in points {
            count += 1;
            explained += usize::from(self.explains(&point.transformed(transform), explained_m));
        }
        (count > 0).then(|| explained as f64 / count as f64)
    }
}
