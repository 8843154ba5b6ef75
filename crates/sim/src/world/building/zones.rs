//! Which part of a building a point is in. Large buildings have very many parts, and every cell of
//! their floor asks.

use crate::world::building::polygon::{Polygon, holds};
use fht_perception::pose::Point2;

/// Most columns and rows of the index.
const MOST_LINES: usize = 2048;

/// Areas with what they are like. The first that contains a point counts.
#[derive(Clone, Debug)]
pub(crate) struct Zones<Style> {
    zones: Vec<(Polygon, Style)>,
    low: Point2,
    /// Size of a bucket along each axis, metres.
    bucket_m: [f64; 2],
    /// Columns and rows of buckets.
    lines: usize,
    /// For each bucket the zones that may reach into it, in their order.
    buckets: Vec<Vec<u32>>,
}

/// Opposite corners of the smallest upright rectangle around some points.
fn bounds<'a>(corners: impl Iterator<Item = &'a Point2>) -> (Point2, Point2) {
    let none = (Point2::new(f64::MAX, f64::MAX), Point2::new(f64::MIN, f64::MIN));
    corners.fold(none, |(low, high), corner| (low.inf(corner), high.sup(corner)))
}

impl<Style> Zones<Style> {
    pub(crate) fn new(zones: Vec<(Polygon, Style)>) -> Self {
        let (low, high) = bounds(zones.iter().flat_map(|(area, _)| area));
        let lines = ((zones.len() as f64).sqrt().ceil() as usize).clamp(1, MOST_LINES);
        let bucket_m = [high.x - low.x, high.y - low.y].map(|extent| (extent / lines as f64).max(1e-9));
        let buckets = vec![Vec::new(); lines * lines];
        let mut indexed = Self { zones, low, bucket_m, lines, buckets };
        for index in 0..indexed.zones.len() {
            let (low, high) = bounds(indexed.zones[index].0.iter());
            let ([left, bottom], [right, top]) = (indexed.bucket_of(low), indexed.bucket_of(high));
            for row in bottom..=top {
                for column in left..=right {
                    indexed.buckets[row * lines + column].push(index as u32);
                }
            }
        }
        indexed
    }

    /// Column and row of the bucket at a point, the nearest one if the point is outside.
    fn bucket_of(&self, point: Point2) -> [usize; 2] {
        let line = |offset: f64, side: f64| ((offset / side).max(0.0) as usize).min(self.lines - 1);
        [line(point.x - self.low.x, self.bucket_m[0]), line(point.y - self.low.y, self.bucket_m[1])]
    }

    /// Index of the zone at a point; the number of zones if there is none.
    pub(crate) fn index_at(&self, point: Point2) -> usize {
        let [column, row] = self.bucket_of(point);
        let here = self.buckets[row * self.lines + column].iter().map(|&index| index as usize);
        here.into_iter().find(|&index| holds(&self.zones[index].0, point)).unwrap_or(self.zones.len())
    }

    /// What the zone of this index is like.
    pub(crate) fn get(&self, index: usize) -> Option<&Style> {
        self.zones.get(index).map(|(_, style)| style)
    }
}

#[cfg(test)]
mod tests {
    use super::Zones;
    use crate::world::building::polygon::{holds, rectangle};
    use fht_perception::pose::Point2;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn the_index_finds_the_first_zone_that_contains_a_point(
            areas in proptest::collection::vec((-9_i32..9, -9_i32..9, 1_i32..9, 1_i32..9), 0..40),
            points in proptest::collection::vec((-10_i32..20, -10_i32..20, any::<bool>()), 1..40),
        ) {
            let areas: Vec<_> = areas
                .into_iter()
                .map(|(x, y, width, height)| [x, y, x + width, y + height].map(f64::from))
                .map(|[left, bottom, right, top]| (rectangle(left, bottom, right, top), ()))
                .collect();
            let zones = Zones::new(areas.clone());
            for (x, y, is_between) in points {
                // On the corners of areas, and between them.
                let shift = if is_between { 0.3 } else { 0.0 };
                let point = Point2::new(f64::from(x) + shift, f64::from(y) + shift);
                let first = areas.iter().position(|(area, ())| holds(area, point)).unwrap_or(areas.len());
                prop_assert_eq!(zones.index_at(point), first);
            }
        }
    }
}
