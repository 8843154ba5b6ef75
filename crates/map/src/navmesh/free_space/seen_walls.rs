//! Where main nodes saw walls: what a way into the mesh must keep away from, and what stands in
//! free space after all.

use crate::navmesh::free_space::visibility::{ONE_THING_MM, Visibility, WALL_GAP_MM};
use crate::navmesh::limits::{Looks, OverBudget};
use crate::navmesh::plane::{Corner, between, distance, foot_share, nearest_on};
use std::collections::{BTreeMap, HashMap};

/// Side of a square in which points are gathered, millimetres.
const SQUARE_MM: f64 = 250.0;

/// Two nodes saw the same when they saw it within this, millimetres.
const SAME_MM: f64 = 60.0;
/// Who stands where a beam went through stands in all that was seen within this, millimetres.
const BODY_MM: f64 = 300.0;
/// Of what was seen this near together, one place is enough, millimetres.
const THIN_MM: f64 = 5.0;

/// A square in which more was seen than this keeps one place of each cell of `THIN_MM`.
const CROWD: usize = 2_500;

/// So many lines of walls around a place are looked at.
const MOST_LINES: usize = 4096;
/// A node's beam that passes within this of the middle of a line says that no wall is there,
/// millimetres.
const THROUGH_MM: f64 = 50.0;
/// Only nodes this near to it are asked, millimetres.
const ASKED_MM: f64 = 8_000.0;

/// End points of all main nodes' scans, millimetres in the map frame.
#[derive(Clone, Debug, Default)]
pub(crate) struct SeenWalls {
    sightings: Vec<Sighting>,
    /// Which of them lie in a square.
    squares: HashMap<(i32, i32), Vec<u32>>,
}

/// A beam's end.
#[derive(Clone, Copy, Debug)]
struct Sighting {
    at: Corner,
    /// Which node's, in the order of their ids.
    node: u32,
    /// Which of its beams.
    beam: u32,
}

fn cell_of(point: Corner, side_mm: f64) -> (i32, i32) {
    ((point[0] / side_mm).floor() as i32, (point[1] / side_mm).floor() as i32)
}

fn square_of(point: Corner) -> (i32, i32) {
    cell_of(point, SQUARE_MM)
}

impl SeenWalls {
    /// The ends of all beams.
    pub(crate) fn of(views: &[Visibility]) -> Self {
        let mut walls = Self::default();
        for (node, view) in (0_u32..).zip(views) {
            for (beam, at) in view.ends() {
                walls.squares.entry(square_of(at)).or_default().push(walls.sightings.len() as u32);
                walls.sightings.push(Sighting { at, node, beam: beam as u32 });
            }
        }
        walls
    }

    /// Where something stands in what should be free: places for which `is_inside` holds, or within
    /// `room_mm` of a line. Two nodes saw it within `SAME_MM`, a thin pole, say; or one node saw it
    /// and no beam of another went through it. What others see through may have been somebody who
    /// passed. In a fixed order.
    pub(crate) fn things(
        &self,
        views: &[Visibility],
        is_inside: impl Fn(Corner, &mut Looks) -> Result<bool, OverBudget>,
        lines: impl Iterator<Item = [Corner; 2]>,
        room_mm: f64,
        looks: &mut Looks,
    ) -> Result<Vec<Corner>, OverBudget> {
        let mut is_in_the_way = Vec::with_capacity(self.sightings.len());
        for sighting in &self.sightings {
            is_in_the_way.push(is_inside(sighting.at, looks)?);
        }
        for line in lines {
            looks.add(self.squares_along(line, rings_of(room_mm)).map(|points| 1 + points.len()).sum())?;
            for index in self.near(line, room_mm) {
                is_in_the_way[index as usize] = true;
            }
        }
        let (mut twice, mut once): (Vec<&Sighting>, Vec<&Sighting>) = Default::default();
        for (sighting, _) in self.sightings.iter().zip(is_in_the_way).filter(|(_, is_in_the_way)| *is_in_the_way) {
            let mut looked = 0;
            let is_same = |other: &Sighting| {
                looked += 1;
                other.node != sighting.node && distance(other.at, sighting.at) < SAME_MM
            };
            let is_twice = self.around(sighting.at, 1).any(is_same);
            looks.add(looked)?;
            if is_twice { twice.push(sighting) } else { once.push(sighting) }
        }
        // By node: what of it others saw through.
        let mut denied: BTreeMap<u32, Vec<&Sighting>> = BTreeMap::new();
        for sighting in &once {
            let Some(own) = views.get(sighting.node as usize) else { continue };
            looks.add(own.beams())?;
            let half_width_mm = 0.5 * own.width_mm(sighting.beam as usize, BODY_MM);
            let inside = own.behind(sighting.at, half_width_mm);
            let denier = views.iter().position(|view| view.denies(inside, half_width_mm));
            looks.add(denier.unwrap_or(views.len()))?;
            if denier.is_some() {
                denied.entry(sighting.node).or_default().push(sighting);
            }
        }
        let mut things: BTreeMap<(i32, i32), Corner> = BTreeMap::new();
        let thin = |sighting: &Sighting| (cell_of(sighting.at, THIN_MM), sighting.at);
        things.extend(twice.into_iter().map(thin));
        for sighting in once {
            let denied = denied.get(&sighting.node).map_or(&[][..], Vec::as_slice);
            looks.add(denied.len())?;
            if denied.iter().all(|denied| distance(denied.at, sighting.at) > BODY_MM) {
                things.extend([thin(sighting)]);
            }
        }
        Ok(things.into_values().collect())
    }

    /// Leaves out some of what was seen where it stands in crowds, so that to ask for what is near
    /// takes no forever.
    pub(crate) fn thin_out(&mut self) {
        let sightings = &self.sightings;
        for square in self.squares.values_mut().filter(|square| square.len() > CROWD) {
            let by_cell: BTreeMap<(i32, i32), u32> =
                square.iter().rev().map(|&index| (cell_of(sightings[index as usize].at, THIN_MM), index)).collect();
            *square = by_cell.into_values().collect();
        }
    }

    /// What was seen within `room_mm` of the straight way between two places, by its number; the
    /// same may come several times.
    fn near(&self, ends: [Corner; 2], room_mm: f64) -> impl Iterator<Item = u32> {
        self.squares_along(ends, rings_of(room_mm)).flatten().copied().filter(move |&index| {
            let at = self.sightings[index as usize].at;
            let foot = between(ends, foot_share(ends, at).clamp(0.0, 1.0));
            distance(foot, at) < room_mm
        })
    }

    /// What was seen in the squares along a line and in so many rings of squares beside it; the
    /// same square may come several times.
    fn squares_along(&self, ends: [Corner; 2], rings: i32) -> impl Iterator<Item = &Vec<u32>> {
        let steps =
            if self.squares.is_empty() { 0.0 } else { (distance(ends[0], ends[1]) / SQUARE_MM).ceil().max(1.0) };
        let along = (0..=steps as usize).map(move |step| square_of(between(ends, step as f64 / steps.max(1.0))));
        along.flat_map(move |square| squares_around(square, rings)).filter_map(|square| self.squares.get(&square))
    }

    /// What was seen in the squares at a place and in so many rings around it.
    fn around(&self, place: Corner, rings: i32) -> impl Iterator<Item = &Sighting> {
        let squares = squares_around(square_of(place), rings).filter_map(|square| self.squares.get(&square));
        squares.flatten().map(|&index| &self.sightings[index as usize])
    }

    /// The walls that `views`, of which these are the ends, saw within `reach_mm` of a place: lines
    /// between ends of beams side by side. Where they are far apart and another node saw through
    /// between them there is none. In a fixed order.
    pub(crate) fn lines_around(&self, views: &[Visibility], place: Corner, reach_mm: f64) -> Vec<[Corner; 2]> {
        let is_open = |sighting: &Sighting, line: [Corner; 2]| {
            let middle = between(line, 0.5);
            let sees_through = |(node, view): (usize, &Visibility)| {
                node != sighting.node as usize
                    && distance(view.from, middle) < ASKED_MM
                    && view.denies(middle, THROUGH_MM)
            };
            distance(line[0], line[1]) > ONE_THING_MM && views.iter().enumerate().any(sees_through)
        };
        let line = |sighting: &Sighting| {
            let line = views.get(sighting.node as usize)?.wall_after(sighting.beam as usize)?;
            (distance(nearest_on(line, place), place) <= reach_mm && !is_open(sighting, line)).then_some(line)
        };
        self.around(place, rings_of(reach_mm + WALL_GAP_MM)).filter_map(line).take(MOST_LINES).collect()
    }

    /// How near the nearest point is, millimetres, if it is within `reach_mm`; else what is farther
    /// away, or infinite.
    pub(crate) fn clearance_mm(&self, place: Corner, reach_mm: f64) -> f64 {
        self.around(place, rings_of(reach_mm))
            .map(|sighting| distance(sighting.at, place))
            .fold(f64::INFINITY, f64::min)
    }

    /// Whether no point lies within `room_mm` of the straight way between two places.
    pub(crate) fn is_clear(&self, ends: [Corner; 2], room_mm: f64) -> bool {
        self.near(ends, room_mm).next().is_none()
    }
}

/// Rings of squares around that of a place, or of a place at most half a square away, in which all
/// lies that is within `reach_mm` of it.
fn rings_of(reach_mm: f64) -> i32 {
    if reach_mm <= SQUARE_MM { 1 } else { (reach_mm / SQUARE_MM + 0.5).ceil() as i32 }
}

fn squares_around((column, row): (i32, i32), rings: i32) -> impl Iterator<Item = (i32, i32)> {
    (row - rings..=row + rings).flat_map(move |row| (column - rings..=column + rings).map(move |column| (column, row)))
}
