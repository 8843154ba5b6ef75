//! Driving to places that tell candidates apart, one after the other.

use super::{Ambiguity, DisambiguationConfig, Surroundings, place_square, telling_place};
use fht_perception::pose::Point2;
use fht_perception::square::SquareIndex;
use std::collections::{BTreeSet, VecDeque};

/// A point of the way counts as reached within this distance, metres.
const REACH_M: f64 = 0.4;

/// After so many ways without a step on any, the robot wanders first.
const GIVE_UPS: usize = 3;

/// Which way the robot is on, and where it has been.
pub struct DisambiguationCourse {
    config: DisambiguationConfig,
    /// What is left of the way, odometry frame.
    way: VecDeque<Point2>,
    /// Squares that the robot was in, or could not get to.
    spent: BTreeSet<SquareIndex>,
    last: Option<Point2>,
    searched_m: f64,
    chosen_at_m: Option<f64>,
    /// Ways given up since the robot last got to a point of one.
    given_up: usize,
}

impl DisambiguationCourse {
    /// Has been nowhere.
    #[must_use]
    pub fn new(config: DisambiguationConfig) -> Self {
        let (way, spent) = (VecDeque::new(), BTreeSet::new());
        Self { config, way, spent, last: None, searched_m: 0.0, chosen_at_m: None, given_up: 0 }
    }

    /// The place is known, or the robot begins anew.
    pub fn end(&mut self) {
        *self = Self::new(self.config.clone());
    }

    /// The next point to drive to, odometry frame; `None` if no place is worth it, so that the
    /// robot may as well wander. Call it once a frame.
    pub fn next(&mut self, ambiguity: Option<&Ambiguity<'_>>, around: &Surroundings<'_>) -> Option<Point2> {
        let here = Point2::from(around.odom_from_base.translation.vector);
        self.searched_m += self.last.map_or(0.0, |last| (here - last).norm());
        self.last = Some(here);
        self.spent.insert(place_square(here));
        let had_way = !self.way.is_empty();
        while self.way.front().is_some_and(|point| (point - here).norm() < REACH_M) {
            self.way.pop_front();
            self.given_up = 0;
        }
        let has_arrived = had_way && self.way.is_empty();
        let is_due = self.chosen_at_m.is_none_or(|at| self.searched_m - at >= self.config.choose_every_m);
        if self.searched_m >= self.config.after_m
            && (has_arrived || is_due)
            && let Some(ambiguity) = ambiguity.filter(|ambiguity| ambiguity.candidates.len() > 1)
        {
            self.choose(ambiguity, around);
        }
        self.way.front().copied()
    }

    /// There is no way to where it was going.
    pub fn give_up(&mut self) {
        self.spent.extend(self.way.back().copied().map(place_square));
        self.way.clear();
        self.given_up += 1;
        if self.given_up < GIVE_UPS {
            self.chosen_at_m = None;
        }
    }

    fn choose(&mut self, ambiguity: &Ambiguity<'_>, around: &Surroundings<'_>) {
        self.chosen_at_m = Some(self.searched_m);
        let found = telling_place(ambiguity, around, |square| self.spent.contains(&square), &self.config);
        self.way = found.map_or_else(VecDeque::new, |found| found.way.into_iter().skip(1).collect());
    }
}
