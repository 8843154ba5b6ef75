//! Where main nodes saw walls: what a way into the mesh must keep away from, and what stands in free space after all.

use crate::plane::{Corner, between, distance, foot_share};
use crate::view::View;
use std::collections::{BTreeMap, HashMap};

/// Side of a square in which points are gathered, millimetres.
const SQUARE_MM: f64 = 250.0;

/// Two nodes saw the same when they saw it within this, millimetres.
const SAME_MM: f64 = 60.0;
/// Who stands where a beam went through stands in all that was seen within this, millimetres.
const BODY_MM: f64 = 300.0;
/// Of what was seen this near together, one place is enough, millimetres.
const THIN_MM: f64 = 5.0;

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
    pub(crate) fn of(views: &[View]) -> Self {
        let mut walls = Self::default();
        for (node, view) in (0_u32..).zip(views) {
            for (beam, at) in view.ends() {
                walls.squares.entry(square_of(at)).or_default().push(walls.sightings.len() as u32);
                walls.sightings.push(Sighting { at, node, beam: beam as u32 });
            }
        }
        walls
    }

    /// Where something stands in what should be free: places for which `is_inside` holds, or within `room_mm` of a line (at most
    /// the side of a square). Two nodes saw it within `SAME_MM`, a thin pole, say; or one node saw it and no beam of another
    /// went through it. What others see through may have been somebody who passed. In a fixed order.
    pub(crate) fn things(
        &self,
        views: &[View],
        is_inside: impl Fn(Corner) -> bool,
        lines: impl Iterator<Item = [Corner; 2]>,
        room_mm: f64,
    ) -> Vec<Corner> {
        let mut is_in_the_way: Vec<bool> = self.sightings.iter().map(|sighting| is_inside(sighting.at)).collect();
        for line in lines {
            for index in self.near(line, room_mm) {
                is_in_the_way[index as usize] = true;
            }
        }
        let found = self.sightings.iter().zip(is_in_the_way).filter(|(_, is_in_the_way)| *is_in_the_way);
        let (twice, once): (Vec<&Sighting>, Vec<&Sighting>) =
            found.map(|(sighting, _)| sighting).partition(|sighting| {
                let mut around = self.around(sighting.at);
                around.any(|other| other.node != sighting.node && distance(other.at, sighting.at) < SAME_MM)
            });
        let is_denied = |sighting: &&&Sighting| {
            let Some(own) = views.get(sighting.node as usize) else { return false };
            let half_width_mm = 0.5 * own.width_mm(sighting.beam as usize, BODY_MM);
            let inside = own.behind(sighting.at, half_width_mm);
            views.iter().any(|view| view.denies(inside, half_width_mm))
        };
        let denied: Vec<&Sighting> = once.iter().filter(is_denied).copied().collect();
        let is_there = |sighting: &&Sighting| {
            let is_same = |denied: &&&Sighting| denied.node == sighting.node;
            denied.iter().filter(is_same).all(|denied| distance(denied.at, sighting.at) > BODY_MM)
        };
        let things = twice.into_iter().chain(once.into_iter().filter(is_there));
        let thinned: BTreeMap<(i32, i32), Corner> =
            things.map(|sighting| (cell_of(sighting.at, THIN_MM), sighting.at)).collect();
        thinned.into_values().collect()
    }

    /// What was seen within `room_mm` (at most the side of a square) of the straight way between two places, by its number; the
    /// same may come several times.
    fn near(&self, ends: [Corner; 2], room_mm: f64) -> impl Iterator<Item = u32> {
        let steps =
            if self.squares.is_empty() { 0.0 } else { (distance(ends[0], ends[1]) / SQUARE_MM).ceil().max(1.0) };
        let along = (0..=steps as usize).map(move |step| square_of(between(ends, step as f64 / steps.max(1.0))));
        let squares = along.flat_map(squares_around).filter_map(|square| self.squares.get(&square));
        squares.flatten().copied().filter(move |&index| {
            let at = self.sightings[index as usize].at;
            let foot = between(ends, foot_share(ends, at).clamp(0.0, 1.0));
            distance(foot, at) < room_mm
        })
    }

    /// What was seen in the squares at and around a place.
    fn around(&self, place: Corner) -> impl Iterator<Item = &Sighting> {
        let squares = squares_around(square_of(place)).filter_map(|square| self.squares.get(&square));
        squares.flatten().map(|&index| &self.sightings[index as usize])
    }

    /// How near the nearest point is, millimetres; infinite if none is within the side of a square.
    pub(crate) fn clearance_mm(&self, place: Corner) -> f64 {
        self.around(place).map(|sighting| distance(sighting.at, place)).fold(f64::INFINITY, f64::min)
    }

    /// Whether no point lies within `room_mm` (at most the side of a square) of the straight way between two places.
    pub(crate) fn is_clear(&self, ends: [Corner; 2], room_mm: f64) -> bool {
        self.near(ends, room_mm).next().is_none()
    }
}

fn squares_around((column, row): (i32, i32)) -> impl Iterator<Item = (i32, i32)> {
    (row - 1..=row + 1).flat_map(move |row| (column - 1..=column + 1).map(move |column| (column, row)))
}
