//! Limits on the work that a mesh may take. Maps come over the network, and a valid one may be of
//! any size: thousands of rectangles that all cross each other, thousands of scans of one spot. The
//! limits count the map and the steps made on it, never time, so that robot and server give up on
//! the same maps.

use i_overlay::i_float::int::point::IntPoint;
use i_overlay::i_shape::int::shape::IntContour;
use serde::{Deserialize, Serialize};

/// The most that a mesh is made of. At any of the defaults making it takes about two seconds and a
/// few hundred megabytes on one core.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct SpaceLimits {
    /// Outlines: rectangles, corridors of edges, places where something stands. Default 100,000.
    pub outlines: usize,
    /// Pairs of outlines whose bounding boxes meet: each may cross the other. Default 400,000.
    pub overlaps: usize,
    /// Beams of all main nodes' scans. Default 2,000,000.
    pub beams: usize,
    /// Comparisons of a beam's end with other beams, rectangles and edges. Default 50,000,000.
    pub looks: usize,
    /// Corners of free space once all outlines are put together. Default 40,000.
    pub corners: usize,
}

impl Default for SpaceLimits {
    fn default() -> Self {
        Self { outlines: 100_000, overlaps: 400_000, beams: 2_000_000, looks: 50_000_000, corners: 40_000 }
    }
}

/// Why no mesh was made of a map.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum OverBudget {
    /// More than [`SpaceLimits::outlines`].
    #[error("the map has more than {0} rectangles, edges and things seen")]
    Outlines(usize),
    /// More than [`SpaceLimits::overlaps`].
    #[error("more than {0} pairs of the map's rectangles and edges meet")]
    Overlaps(usize),
    /// More than [`SpaceLimits::beams`].
    #[error("the map's scans have more than {0} beams")]
    Beams(usize),
    /// More than [`SpaceLimits::looks`].
    #[error("to compare what the map's scans saw takes more than {0} steps")]
    Looks(usize),
    /// More than [`SpaceLimits::corners`].
    #[error("the map's free space has more than {0} corners")]
    Corners(usize),
}

/// Counts comparisons.
#[derive(Debug)]
pub(crate) struct Looks {
    most: usize,
    done: usize,
}

impl Looks {
    pub(crate) fn new(most: usize) -> Self {
        Self { most, done: 0 }
    }

    /// So many more.
    pub(crate) fn add(&mut self, count: usize) -> Result<(), OverBudget> {
        self.done = self.done.saturating_add(count);
        if self.done > self.most { Err(OverBudget::Looks(self.most)) } else { Ok(()) }
    }
}

/// Collects outlines, as long as there are not too many.
pub(crate) fn collect_outlines(
    outlines: impl Iterator<Item = IntContour<i32>>,
    most: usize,
) -> Result<Vec<IntContour<i32>>, OverBudget> {
    let collected: Vec<IntContour<i32>> = outlines.take(most.saturating_add(1)).collect();
    if collected.len() > most { Err(OverBudget::Outlines(most)) } else { Ok(collected) }
}

/// Refuses outlines of which too many pairs meet.
pub(crate) fn check_overlaps(outlines: &[IntContour<i32>], most: usize) -> Result<(), OverBudget> {
    if overlaps(outlines) > most { Err(OverBudget::Overlaps(most)) } else { Ok(()) }
}

/// How many pairs of outlines have bounding boxes that meet, without looking at each pair: a line
/// sweeps over the boxes, and of those on it all meet a new one that do not end below it or begin
/// above it.
fn overlaps(outlines: &[IntContour<i32>]) -> usize {
    let boxes: Vec<[IntPoint<i32>; 2]> = outlines.iter().filter_map(|outline| box_of(outline)).collect();
    let mut heights: Vec<i32> = boxes.iter().flat_map(|[low, high]| [low.y, high.y]).collect();
    heights.sort_unstable();
    heights.dedup();
    let rank = |y: i32| heights.partition_point(|height| *height < y);
    // What begins at an x comes before what ends there.
    let mut events: Vec<(i32, bool, u32)> = Vec::with_capacity(2 * boxes.len());
    for ([low, high], index) in boxes.iter().zip(0..) {
        events.extend([(low.x, false, index), (high.x, true, index)]);
    }
    events.sort_unstable();
    let (mut begun, mut ended) = (Tally::new(heights.len()), Tally::new(heights.len()));
    let (mut on_line, mut meeting) = (0, 0_usize);
    for (_, is_end, index) in events {
        let [low, high] = boxes[index as usize].map(|corner| rank(corner.y));
        if is_end {
            begun.add(low, -1);
            ended.add(high, -1);
            on_line -= 1;
        } else {
            let apart = ended.below(low) + (on_line - begun.below(high + 1));
            meeting = meeting.saturating_add(usize::try_from(on_line - apart).unwrap_or(0));
            begun.add(low, 1);
            ended.add(high, 1);
            on_line += 1;
        }
    }
    meeting
}

fn box_of(outline: &[IntPoint<i32>]) -> Option<[IntPoint<i32>; 2]> {
    let first = *outline.first()?;
    Some(outline.iter().fold([first, first], |[low, high], at| {
        [IntPoint::new(low.x.min(at.x), low.y.min(at.y)), IntPoint::new(high.x.max(at.x), high.y.max(at.y))]
    }))
}

/// Counts by rank, with sums over all ranks below one (a Fenwick tree).
struct Tally(Vec<i64>);

impl Tally {
    fn new(ranks: usize) -> Self {
        Self(vec![0; ranks + 1])
    }

    fn add(&mut self, rank: usize, count: i64) {
        let mut at = rank + 1;
        while at < self.0.len() {
            self.0[at] += count;
            at += at & at.wrapping_neg();
        }
    }

    fn below(&self, rank: usize) -> i64 {
        let (mut at, mut sum) = (rank, 0);
        while at > 0 {
            sum += self.0[at];
            at -= at & at.wrapping_neg();
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn pairs_are_counted_as_if_one_by_one(boxes in prop::collection::vec((0..40, 0..40, 1..12, 1..12), 0..60)) {
            let outline = |&(x, y, width, height): &(i32, i32, i32, i32)| {
                vec![IntPoint::new(x, y), IntPoint::new(x + width, y), IntPoint::new(x + width, y + height)]
            };
            let outlines: Vec<IntContour<i32>> = boxes.iter().map(outline).collect();
            let meet = |a: &(i32, i32, i32, i32), b: &(i32, i32, i32, i32)| {
                a.0 <= b.0 + b.2 && b.0 <= a.0 + a.2 && a.1 <= b.1 + b.3 && b.1 <= a.1 + a.3
            };
            let pairs = (0..boxes.len()).flat_map(|a| (0..a).map(move |b| (a, b)));
            let expected = pairs.filter(|&(a, b)| meet(&boxes[a], &boxes[b])).count();
            prop_assert_eq!(overlaps(&outlines), expected);
        }
    }
}
