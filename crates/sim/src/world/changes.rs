//! A building some time after its map was made: some of its movable things are gone, shifted or
//! new.

use crate::plan::FloorPlan;
use fht_perception::pose::Point2;
use nalgebra::Vector2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// How much has changed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Changes {
    /// Share of the movable things that are gone, shifted (by 0.3 m to 1 m) or new, on average a
    /// third each.
    pub share: f64,
    /// Seed of which things change, and where to.
    pub seed: u64,
}

/// A building is taken to have at least one movable thing per this area, square metres: a map drawn
/// by a robot shows few of them as separate pieces, since most stand at walls.
const AREA_OF_A_THING_M2: f64 = 20.0;
/// Least and greatest shift, metres.
const SHIFT_M: std::ops::Range<f64> = 0.3..1.0;
/// Room left around something new, metres, so that it blocks no passage.
const ROOM_M: f64 = 0.45;
/// Radius of something new that is not a copy of anything, metres.
pub(crate) const NEW_RADIUS_M: f64 = 0.45;
/// Places tried for a thing before giving up.
const TRIES: usize = 200;

/// The extent of a movable thing from above, world frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Thing {
    /// Min corner.
    pub(crate) low: Point2,
    /// Max corner.
    pub(crate) high: Point2,
}

impl Thing {
    /// The extent of some points; `None` without any.
    pub(crate) fn around<'a>(points: impl Iterator<Item = &'a Point2>) -> Option<Self> {
        points.fold(None, |thing: Option<Self>, point| {
            let Self { low, high } = thing.unwrap_or(Self { low: *point, high: *point });
            Some(Self { low: low.inf(point), high: high.sup(point) })
        })
    }

    pub(crate) fn centre(&self) -> Point2 {
        nalgebra::center(&self.low, &self.high)
    }

    /// Longest side, metres.
    pub(crate) fn side_m(&self) -> f64 {
        (self.high - self.low).max()
    }

    fn holds(&self, point: Point2) -> bool {
        (self.low.x..=self.high.x).contains(&point.x) && (self.low.y..=self.high.y).contains(&point.y)
    }

    fn moved(&self, by: Vector2<f64>) -> Self {
        Self { low: self.low + by, high: self.high + by }
    }

    fn overlaps(&self, other: &Self) -> bool {
        let apart = self.low.x > other.high.x
            || other.low.x > self.high.x
            || self.low.y > other.high.y
            || other.low.y > self.high.y;
        !apart
    }
}

/// One change; things are named by their index in the list.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Change {
    /// Removed.
    Gone(usize),
    /// Moved by this vector, metres.
    Shifted(usize, Vector2<f64>),
    /// A new thing centred here, a copy of one in the list if there is any.
    Added(Point2, Option<usize>),
}

/// Draws the changes at random. Whatever is shifted or added stands on free floor of `plan`.
pub(crate) fn choose(things: &[Thing], plan: &FloorPlan, changes: &Changes) -> Vec<Change> {
    let mut rng = ChaCha8Rng::seed_from_u64(changes.seed);
    let expected = (plan.free_area_m2() / AREA_OF_A_THING_M2).max(things.len() as f64);
    let number = (changes.share.clamp(0.0, 1.0) * expected).round() as usize;
    let mut left: Vec<usize> = (0..things.len()).collect();
    let mut taken: Vec<Thing> = Vec::new();
    let mut chosen = Vec::new();
    for _ in 0..number {
        let sort = rng.random_range(0..3);
        let change = if sort == 2 || left.is_empty() {
            added(things, plan, &taken, &mut rng)
        } else {
            let thing = left.swap_remove(rng.random_range(0..left.len()));
            let shift = if sort == 1 { shift(&things[thing], plan, &taken, &mut rng) } else { None };
            Some(shift.map_or(Change::Gone(thing), |by| Change::Shifted(thing, by)))
        };
        match change {
            Some(Change::Shifted(thing, by)) => taken.push(things[thing].moved(by)),
            Some(Change::Added(centre, like)) => taken.push(extent_at(centre, like, things)),
            _ => {}
        }
        chosen.extend(change);
    }
    chosen
}

fn extent_at(centre: Point2, like: Option<usize>, things: &[Thing]) -> Thing {
    let half = like
        .and_then(|index| things.get(index))
        .map_or(Vector2::repeat(NEW_RADIUS_M), |thing| (thing.high - thing.low) / 2.0);
    Thing { low: centre - half, high: centre + half }
}

fn shift(thing: &Thing, plan: &FloorPlan, taken: &[Thing], rng: &mut ChaCha8Rng) -> Option<Vector2<f64>> {
    let is_free = |moved: &Thing| {
        let step = plan.resolution_m();
        let (columns, rows) = ((moved.high.x - moved.low.x) / step, (moved.high.y - moved.low.y) / step);
        let cells =
            (0..=rows.ceil() as u32).flat_map(|row| (0..=columns.ceil() as u32).map(move |column| (column, row)));
        let mut places = cells.map(|(column, row)| moved.low + Vector2::new(f64::from(column), f64::from(row)) * step);
        places.all(|place| thing.holds(place) || !plan.is_occupied(place.x, place.y))
    };
    (0..TRIES).find_map(|_| {
        let (length, heading) = (rng.random_range(SHIFT_M), rng.random_range(0.0..std::f64::consts::TAU));
        let by = Vector2::new(heading.cos(), heading.sin()) * length;
        let moved = thing.moved(by);
        (is_free(&moved) && !taken.iter().any(|other| other.overlaps(&moved))).then_some(by)
    })
}

fn added(things: &[Thing], plan: &FloorPlan, taken: &[Thing], rng: &mut ChaCha8Rng) -> Option<Change> {
    let like = (!things.is_empty()).then(|| rng.random_range(0..things.len()));
    let radius_m = like.map_or(NEW_RADIUS_M, |index| (things[index].high - things[index].low).norm() / 2.0);
    (0..TRIES * 10).find_map(|_| {
        let (column, row) = (rng.random_range(0..plan.width()), rng.random_range(0..plan.height()));
        let centre = plan.centre_of(column, row);
        let is_near_another =
            taken.iter().any(|other| (other.centre() - centre).norm() < radius_m + other.side_m() + ROOM_M);
        (plan.clearance_m(centre) >= radius_m + ROOM_M && !is_near_another).then_some(Change::Added(centre, like))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An empty hall of 20 m × 20 m with 40 posts of 0.4 m.
    fn hall() -> (Vec<Thing>, FloorPlan) {
        let mut occupied = vec![false; 200 * 200];
        let mut things = Vec::new();
        for index in 0..40 {
            let low = Point2::new(1.0 + f64::from(index % 8) * 2.4, 1.0 + f64::from(index / 8) * 4.0);
            things.push(Thing { low, high: low + Vector2::repeat(0.4) });
            for cell in 0..16 {
                let (column, row) =
                    ((low.x / 0.1).round() as usize + cell % 4, (low.y / 0.1).round() as usize + cell / 4);
                occupied[row * 200 + column] = true;
            }
        }
        (things, FloorPlan::new(0.1, Point2::origin(), 200, 200, occupied))
    }

    #[test]
    fn a_tenth_changes_and_stands_on_free_floor() {
        let (things, plan) = hall();
        for seed in 0..20 {
            let chosen = choose(&things, &plan, &Changes { share: 0.1, seed });
            assert_eq!(chosen.len(), 4, "{chosen:?}");
            for change in chosen {
                match change {
                    Change::Shifted(_, by) => assert!(SHIFT_M.contains(&by.norm())),
                    Change::Added(centre, _) => assert!(plan.clearance_m(centre) > ROOM_M),
                    Change::Gone(thing) => assert!(thing < things.len()),
                }
            }
        }
        assert!(choose(&things, &plan, &Changes { share: 0.0, seed: 1 }).is_empty());
    }
}
