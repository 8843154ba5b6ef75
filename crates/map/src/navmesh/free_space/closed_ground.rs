//! Ground that no way may lead over, whatever the map says: what operators keep out, and barriers
//! across edges that they closed.

use crate::navmesh::plane::{Corner, between, corner_of, cross, distance, meet, nearest_on};
use fht_proto::FixedPoint;
use i_overlay::i_float::int::point::IntPoint;
use i_overlay::i_shape::int::shape::{IntContour, IntShapes};

/// A polygon.
#[derive(Clone, Debug)]
pub(crate) struct ClosedZone {
    corners: Vec<Corner>,
    low: Corner,
    high: Corner,
}

impl ClosedZone {
    /// None for fewer than three corners.
    pub(crate) fn of(corners: &[FixedPoint]) -> Option<Self> {
        if corners.len() < 3 {
            return None;
        }
        let corners: Vec<Corner> = corners.iter().map(|corner| corner_of(*corner)).collect();
        let bound = |axis: usize, pick: fn(f64, f64) -> f64, start: f64| {
            corners.iter().map(|corner| corner[axis]).fold(start, pick)
        };
        let low = [0, 1].map(|axis| bound(axis, f64::min, f64::INFINITY));
        let high = [0, 1].map(|axis| bound(axis, f64::max, f64::NEG_INFINITY));
        Some(Self { corners, low, high })
    }

    /// Its outline in whole millimetres, counter-clockwise.
    pub(crate) fn outline(&self) -> IntContour<i32> {
        let ends = self.sides().map(|[a, b]| cross([0.0; 2], a, b));
        let mut outline: IntContour<i32> =
            self.corners.iter().map(|it| IntPoint::new(it[0] as i32, it[1] as i32)).collect();
        if ends.sum::<f64>() < 0.0 {
            outline.reverse();
        }
        outline
    }

    fn sides(&self) -> impl Iterator<Item = [Corner; 2]> + '_ {
        let next = self.corners.iter().cycle().skip(1);
        self.corners.iter().zip(next).map(|(a, b)| [*a, *b])
    }

    /// Whether a place lies inside.
    pub(crate) fn contains(&self, place: Corner) -> bool {
        // The sides that a ray in the direction of x crosses.
        let crosses = |[a, b]: &[Corner; 2]| {
            (a[1] > place[1]) != (b[1] > place[1]) && (cross(*a, *b, place) > 0.0) == (b[1] > a[1])
        };
        self.sides().filter(crosses).count() % 2 == 1
    }

    /// Whether a place lies inside or on the border.
    pub(crate) fn covers(&self, place: Corner) -> bool {
        self.contains(place) || self.sides().any(|side| distance(nearest_on(side, place), place) <= BORDER_MM)
    }

    /// Whether a place lies within a distance of the box around it.
    pub(crate) fn is_within(&self, place: Corner, reach_mm: f64) -> bool {
        (0..2).all(|axis| place[axis] >= self.low[axis] - reach_mm && place[axis] <= self.high[axis] + reach_mm)
    }

    /// How far a place is from it, millimetres, if that is at most `reach_mm`; else infinite, or
    /// what is farther.
    pub(crate) fn clearance_mm(&self, place: Corner, reach_mm: f64) -> f64 {
        if !self.is_within(place, reach_mm) {
            return f64::INFINITY;
        }
        if self.contains(place) {
            return 0.0;
        }
        self.sides().map(|side| distance(nearest_on(side, place), place)).fold(f64::INFINITY, f64::min)
    }

    /// Whether the straight way between two places meets it.
    pub(crate) fn is_met(&self, ends: [Corner; 2]) -> bool {
        let is_apart = (0..2).any(|axis| {
            ends[0][axis].max(ends[1][axis]) < self.low[axis] || ends[0][axis].min(ends[1][axis]) > self.high[axis]
        });
        !is_apart && (self.contains(ends[0]) || self.sides().any(|side| meet(side, ends)))
    }
}

/// What is as near to a side is on it, millimetres.
const BORDER_MM: f64 = 1.0;
/// A passage is looked for at places this far apart along an edge, millimetres.
const STEP_MM: f64 = 50.0;
/// A barrier is this long in the direction of its edge, millimetres.
const BARRIER_MM: f64 = 50.0;
/// And reaches this far beyond the free space that it closes, millimetres: corners are rounded to
/// whole ones.
const MARGIN_MM: f64 = 10.0;
/// A screen goes on for at most this much where nothing is free, millimetres: farther than places
/// outside are joined from.
const SCREEN_MM: f64 = 2500.0;

/// Barriers that close an edge.
///
/// Free space is one, whatever edges lead through it: where rectangles overlap in a door, a bar
/// across the edge's corridor closes nothing. Therefore all passages that the edge leads through
/// are closed from border to border: where free space across the edge's line is narrower than
/// before and after, and at most `passage_mm` wide. An edge that leads through no passage, but
/// through the middle of a hall, loses its corridor's width in its middle; ways beside it stay
/// open.
///
/// Each with its screen: on ground that the map knows nothing of a way could lead around a
/// barrier's end, where a wall stands that nobody saw. So the screen goes on where free space ends,
/// up to where it begins again.
pub(crate) fn barriers(
    free: &IntShapes<i32>,
    ends: [FixedPoint; 2],
    corridor_mm: f64,
    passage_mm: f64,
) -> Vec<[ClosedZone; 2]> {
    let [a, b] = ends.map(corner_of);
    let length = distance(a, b);
    if length < 1.0 {
        return Vec::new();
    }
    let along = [(b[0] - a[0]) / length, (b[1] - a[1]) / length];
    let across = [-along[1], along[0]];
    let near = borders_near(free, [a, b], passage_mm + SCREEN_MM);
    let count = (length / STEP_MM).ceil().max(2.0) as usize;
    let least = (STEP_MM / length).min(0.5);
    let places: Vec<Corner> = (0..=count)
        .map(|step| {
            // Not quite at the ends: nodes stand there, perhaps in a door.
            let share = (step as f64 / count as f64).clamp(least, 1.0 - least);
            between([a, b], share)
        })
        .collect();
    let sections: Vec<[Exit; 2]> = places
        .iter()
        .map(|place| [across, [-across[0], -across[1]]].map(|direction| way_out(&near, *place, direction)))
        .collect();
    let widths: Vec<f64> = sections.iter().map(|[left, right]| left.border_mm + right.border_mm).collect();
    let bar = |at: usize, [left, right]: [f64; 2]| {
        let corner = |ahead: f64, beside: f64| {
            let place = [0, 1].map(|axis| places[at][axis] + ahead * along[axis] + beside * across[axis]);
            FixedPoint { x_mm: place[0].round() as i32, y_mm: place[1].round() as i32 }
        };
        let half = 0.5 * BARRIER_MM;
        ClosedZone::of(&[corner(-half, -right), corner(half, -right), corner(half, left), corner(-half, left)])
    };
    let passages: Vec<usize> = narrowest(&widths).into_iter().filter(|at| widths[*at] <= passage_mm).collect();
    if passages.is_empty() {
        let bar = bar(count / 2, [corridor_mm + MARGIN_MM; 2]);
        return bar.into_iter().map(|bar| [bar.clone(), bar]).collect();
    }
    let barrier = |at: usize| {
        let barrier = bar(at, sections[at].map(|exit| exit.border_mm + MARGIN_MM))?;
        Some([barrier, bar(at, sections[at].map(|exit| exit.border_mm + exit.beyond_mm.max(MARGIN_MM)))?])
    };
    passages.into_iter().filter_map(barrier).collect()
}

/// Where widths are less than before and after; the middle, where they stay the same.
fn narrowest(widths: &[f64]) -> Vec<usize> {
    let mut found = Vec::new();
    let mut first = 0;
    while first < widths.len() {
        let is_same = |width: &&f64| (**width - widths[first]).abs() < 1.0;
        let last = first + widths[first..].iter().take_while(is_same).count().max(1) - 1;
        let before = first.checked_sub(1).map_or(f64::INFINITY, |before| widths[before]);
        let after = widths.get(last + 1).copied().unwrap_or(f64::INFINITY);
        if widths[first] < before && widths[last] < after {
            found.push((first + last) / 2);
        }
        first = last + 1;
    }
    found
}

/// The border's sides within reach of a line.
fn borders_near(free: &IntShapes<i32>, [a, b]: [Corner; 2], reach_mm: f64) -> Vec<[Corner; 2]> {
    let as_corner = |at: &IntPoint<i32>| [f64::from(at.x), f64::from(at.y)];
    let is_near = |side: &[Corner; 2]| {
        (0..2).all(|axis| {
            side[0][axis].min(side[1][axis]) <= a[axis].max(b[axis]) + reach_mm
                && side[0][axis].max(side[1][axis]) >= a[axis].min(b[axis]) - reach_mm
        })
    };
    let sides = free.iter().flatten().flat_map(|contour| {
        let next = contour.iter().cycle().skip(1);
        contour.iter().zip(next).map(|(from, to)| [as_corner(from), as_corner(to)])
    });
    sides.filter(is_near).collect()
}

/// Where free space ends in a direction.
#[derive(Clone, Copy, Debug)]
struct Exit {
    /// How far away the first border is, millimetres; infinite if there is none.
    border_mm: f64,
    /// How far it is from there to where free space begins again, millimetres; at most `SCREEN_MM`.
    beyond_mm: f64,
}

/// The way out of free space from a place in a direction of length 1.
fn way_out(borders: &[[Corner; 2]], place: Corner, direction: Corner) -> Exit {
    let ahead = [place[0] + direction[0], place[1] + direction[1]];
    let hits = borders.iter().filter_map(|[a, b]| {
        let (from, to) = (cross(place, ahead, *a), cross(place, ahead, *b));
        if (from >= 0.0) == (to >= 0.0) {
            return None;
        }
        let at = between([*a, *b], from / (from - to));
        let far = (at[0] - place[0]) * direction[0] + (at[1] - place[1]) * direction[1];
        (far >= 0.0).then_some(far)
    });
    let [first, second] =
        hits.fold(
            [f64::INFINITY; 2],
            |[first, second], far| {
                if far < first { [far, first] } else { [first, second.min(far)] }
            },
        );
    let beyond_mm = if first.is_finite() { (second - first).min(SCREEN_MM) } else { 0.0 };
    Exit { border_mm: first, beyond_mm }
}
