//! Where people walk: a coarse net over the free floor, and for each place where they meet the way
//! there from everywhere.

use super::config::PeopleConfig;
use crate::plan::FloorPlan;
use fht_perception::pose::Point2;
use nalgebra::Vector2;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Side of the net's squares, metres.
const SQUARE_M: f64 = 0.2;
/// Kept between a body and a wall by the net, metres.
const SPARE_M: f64 = 0.04;
/// Walking nearer to walls than this costs up to three times as much, metres.
const COMFORT_M: f64 = 0.6;
/// Somebody looks along the way for so many squares.
const LOOK_AHEAD: usize = 8;
/// Cost of a square's side and of its diagonal.
const COSTS: (u32, u32) = (100, 141);

/// The way to one place: cost from each square, or none.
type Field = Vec<u32>;

/// The net, and the places where people meet.
pub(super) struct Walkways {
    origin: Point2,
    width: usize,
    height: usize,
    /// The roomiest spot of each square where a body fits, and its clearance, metres.
    spots: Vec<Option<(Point2, f64)>>,
    places: Vec<(Point2, Field)>,
}

impl Walkways {
    /// The net over the floor that hangs together with `start`.
    pub(super) fn new(plan: &FloorPlan, start: Point2, config: &PeopleConfig, rng: &mut ChaCha8Rng) -> Self {
        let per = (SQUARE_M / plan.resolution_m()).round().max(1.0) as usize;
        let (width, height) = (plan.width().div_ceil(per), plan.height().div_ceil(per));
        let spot = |index: usize| {
            let (column, row) = (index % width * per, index / width * per);
            let cells = (row..(row + per).min(plan.height()))
                .flat_map(|j| (column..(column + per).min(plan.width())).map(move |i| (i, j)));
            let centres = cells.map(|(i, j)| plan.centre_of(i, j));
            let roomiest = centres.map(|at| (at, plan.clearance_m(at))).reduce(|a, b| if b.1 > a.1 { b } else { a })?;
            (roomiest.1 >= config.radius_m + SPARE_M).then_some(roomiest)
        };
        let spots: Vec<_> = (0..width * height).map(spot).collect();
        let mut net = Self { origin: plan.origin(), width, height, spots, places: Vec::new() };
        let Some(from) = net.square_near(start, plan) else {
            net.spots.fill(None);
            return net;
        };
        let reached = net.field(from);
        for (spot, cost) in net.spots.iter_mut().zip(&reached) {
            *spot = spot.filter(|_| *cost != u32::MAX);
        }
        net.choose_places(config, rng);
        net
    }

    fn choose_places(&mut self, config: &PeopleConfig, rng: &mut ChaCha8Rng) {
        let squares: Vec<usize> = (0..self.spots.len()).filter(|&index| self.spots[index].is_some()).collect();
        let area_m2 = squares.len() as f64 * SQUARE_M * SQUARE_M;
        let wanted = ((area_m2 / config.place_m2) as usize).clamp(6, 32);
        for _ in 0..wanted * 30 {
            if squares.is_empty() || self.places.len() >= wanted {
                return;
            }
            let index = squares[rng.random_range(0..squares.len())];
            let Some((at, room_m)) = self.spots[index] else { continue };
            let is_apart = self.places.iter().all(|(other, _)| (other - at).norm() > 2.0 * config.place_room_m);
            if room_m >= config.place_room_m && is_apart {
                let field = self.field(index);
                self.places.push((at, field));
            }
        }
    }

    /// How many places there are.
    pub(super) fn places(&self) -> usize {
        self.places.len()
    }

    /// Where a place is.
    pub(super) fn place(&self, number: usize) -> Point2 {
        self.places[number].0
    }

    /// A spot drawn from all of the net.
    pub(super) fn any_spot(&self, rng: &mut ChaCha8Rng) -> Option<Point2> {
        let free: Vec<Point2> = self.spots.iter().flatten().map(|(at, _)| *at).collect();
        (!free.is_empty()).then(|| free[rng.random_range(0..free.len())])
    }

    /// The direction from `here` to a place, a unit vector, and how far it is there, metres with
    /// the cost of narrow ways.
    pub(super) fn way(
        &self,
        here: Point2,
        place: usize,
        plan: &FloorPlan,
        radius_m: f64,
    ) -> Option<(Vector2<f64>, f64)> {
        let (_, field) = self.places.get(place)?;
        let start = self.square_near(here, plan)?;
        let left_m = f64::from(field[start]) * SQUARE_M / f64::from(COSTS.0);
        let mut along = vec![start];
        while let Some(&last) = along.last() {
            let next = self.beside(last).filter(|&(square, _)| field[square] < field[last]);
            let Some((next, _)) = next.min_by_key(|&(square, _)| field[square]) else { break };
            if along.len() > LOOK_AHEAD {
                break;
            }
            along.push(next);
        }
        let spots = along.iter().rev().filter_map(|&square| self.spots[square]).map(|(spot, _)| spot);
        let mut far = spots.filter(|spot| (spot - here).norm() > 0.05);
        let clear = far.clone().find(|spot| plan.is_clear(here, *spot, radius_m * 0.9));
        let aim = clear.or_else(|| far.next_back())?;
        Some(((aim - here).normalize(), left_m))
    }

    /// The square with a spot that a place belongs to.
    fn square_near(&self, at: Point2, plan: &FloorPlan) -> Option<usize> {
        let cell = |metres: f64, least: f64| ((metres - least) / SQUARE_M).floor() as isize;
        let (i, j) = (cell(at.x, self.origin.x), cell(at.y, self.origin.y));
        let around = (-3..=3_isize).flat_map(|dj| (-3..=3_isize).map(move |di| (i + di, j + dj)));
        let inside = around.filter(|&(i, j)| i >= 0 && j >= 0 && i < self.width as isize && j < self.height as isize);
        let near = inside.map(|(i, j)| j as usize * self.width + i as usize).filter_map(|index| {
            let (spot, _) = self.spots[index]?;
            Some((index, spot, (spot - at).norm()))
        });
        let mut near: Vec<_> = near.collect();
        near.sort_by(|a, b| a.2.total_cmp(&b.2).then(a.0.cmp(&b.0)));
        let clear = near.iter().find(|(_, spot, _)| plan.is_clear(at, *spot, 0.0));
        clear.or(near.first()).map(|(index, ..)| *index)
    }

    /// The squares beside one that a body can get to, and what that costs.
    fn beside(&self, square: usize) -> impl Iterator<Item = (usize, u32)> + '_ {
        let (i, j) = ((square % self.width) as isize, (square / self.width) as isize);
        let at = move |di: isize, dj: isize| {
            let (i, j) = (i + di, j + dj);
            let is_inside = i >= 0 && j >= 0 && i < self.width as isize && j < self.height as isize;
            let index = if is_inside { j as usize * self.width + i as usize } else { return None };
            self.spots[index].map(|(_, room_m)| (index, room_m))
        };
        const AROUND: [(isize, isize); 8] = [(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)];
        AROUND.into_iter().filter_map(move |(di, dj)| {
            let (index, room_m) = at(di, dj)?;
            let is_diagonal = di != 0 && dj != 0;
            // Not past a corner.
            if is_diagonal && (at(di, 0).is_none() || at(0, dj).is_none()) {
                return None;
            }
            let base = if is_diagonal { COSTS.1 } else { COSTS.0 };
            let narrow = ((COMFORT_M - room_m) / COMFORT_M).clamp(0.0, 1.0);
            Some((index, (f64::from(base) * (1.0 + 2.0 * narrow)) as u32))
        })
    }

    /// What the way to a square costs from everywhere.
    fn field(&self, to: usize) -> Field {
        let mut costs = vec![u32::MAX; self.spots.len()];
        let mut open = BinaryHeap::from([Reverse((0_u32, to))]);
        costs[to] = 0;
        while let Some(Reverse((cost, square))) = open.pop() {
            if cost > costs[square] {
                continue;
            }
            for (next, step) in self.beside(square) {
                let sum = cost.saturating_add(step);
                if sum < costs[next] {
                    costs[next] = sum;
                    open.push(Reverse((sum, next)));
                }
            }
        }
        costs
    }
}
