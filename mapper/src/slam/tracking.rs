//! Whether the robot is where it thinks it is: matches that are believed, scans that contradict the
//! map, and a robot that is lost and found again.

use super::closure::Found;
use super::estimate::Lost;
use super::submap::Submap;
use super::wheels_word::{discounted, in_light_of};
use super::witness::{WheelsWord, Witnesses};
use super::{Active, Anchored, Latest, Slam, Tracking};
use fht_perception::frame::LaserScan;
use fht_perception::grid::{Cell, CellState};
use fht_perception::matching::{Prior, ScanMatch, SearchWindow, alignments, refine_with_prior};
use fht_perception::pose::{Point2, Pose2};
use fht_perception::shared_view::Verdict;
use std::sync::Arc;

/// A beam that ends this far behind a wall of the grid has gone through it, metres.
const HIDDEN_BY_M: f64 = 0.3;
/// Of a beam only this much is held against walls: where it ends it may graze one for long.
const HIDDEN_SHARE: f64 = 0.7;

impl Slam {
    /// Matches a scan to the active submap: from where the wheels say, and if that fits badly,
    /// anywhere near.
    pub(super) fn match_to(&self, submap: &Submap, points: &[Point2], prior: &Prior) -> Option<ScanMatch> {
        let config = &self.config;
        let near = refine_with_prior(submap.cloud(), points, prior, &config.matching);
        let score = near.as_ref().map_or(0.0, |found| found.score);
        let best = if score < config.good_score {
            let window = SearchWindow {
                centre: prior.reference_from_moving,
                half_x_m: config.rescue_m,
                half_y_m: config.rescue_m,
                half_yaw_rad: config.rescue_rad,
            };
            // Another place must be better by what it explains and by what it does not contradict.
            let balance = |found: &ScanMatch| submap.judge(points, &found.reference_from_moving).balance();
            let needed = near.as_ref().map_or(0, balance) + (config.rescue_gain * points.len() as f64) as i64;
            let elsewhere = alignments(submap.cloud(), points, &window, &config.matching).into_iter();
            let better = elsewhere
                .filter(|found| found.score > score + config.rescue_gain)
                .map(|found| (balance(&found), found));
            let best = better.filter(|(balance, _)| *balance > needed).max_by_key(|(balance, _)| *balance);
            best.and_then(|(_, found)| in_light_of(found, prior)).or(near)
        } else {
            near
        };
        // What the submap did not see, the rest of the map may have.
        let is_contradiction = |found: &ScanMatch| {
            let in_submap = submap.judge(points, &found.reference_from_moving).contradicted;
            let here = Anchored { keyframe: submap.first(), keyframe_from_base: found.reference_from_moving };
            let contradicted = in_submap.max(self.contradicted_by_grid(points, &self.locate(&here)));
            contradicted as f64 > config.lost_contradiction * points.len() as f64
        };
        let found = best.filter(|found| found.score >= config.min_score)?;
        if found.score >= config.good_score || !is_contradiction(&found) {
            return Some(found);
        }
        self.is_doubtless().then(|| discounted(found, prior, config.wheels_sigmas)).flatten()
    }

    /// Whether nothing speaks against the robot being where the wheels say.
    pub(super) fn is_doubtless(&self) -> bool {
        !(self.is_contradicted || self.was_lost || self.is_found_again)
    }

    /// Whether the robot is where it is thought to be, after a scan that was matched with `score`
    /// or not at all.
    pub(super) fn judge_tracking(
        &mut self,
        score: Option<f64>,
        driven_m: f64,
        submap: &Submap,
        points: &[Point2],
        latest: &Latest,
        scan: &LaserScan,
    ) {
        self.next_job.lost = None;
        let was_contradicted = std::mem::take(&mut self.is_contradicted);
        // A match that explains little may be of another place.
        let is_good = score.is_some_and(|score| score >= self.config.good_score);
        let (word, step) = if is_good {
            (WheelsWord::Confirmed, Verdict::Agree)
        } else {
            self.hear_witnesses(scan, &latest.odom_from_base)
        };
        self.remember(scan, &latest.odom_from_base, word);
        if score.is_some() {
            return self.believe(Tracking::Matched);
        }
        if word == WheelsWord::Confirmed && !self.is_found_again {
            // The robot is where the wheels say: what contradicts the map has changed, or is no
            // wall at all.
            return self.believe(Tracking::Wheels);
        }
        // New rooms and endless halls are no contradiction: nobody looked there.
        let here = Anchored { keyframe: submap.first(), keyframe_from_base: latest.submap_from_base };
        let map_from_base = self.locate(&here);
        let in_submap = submap.judge(points, &latest.submap_from_base).contradicted;
        let contradicted = in_submap.max(self.contradicted_by_grid(points, &map_from_base)) as f64;
        let is_against_map = contradicted > self.config.lost_contradiction * points.len() as f64
            && points.len() >= self.config.matching.min_points;
        self.is_contradicted =
            is_against_map && (was_contradicted || self.is_found_again || word == WheelsWord::Refuted);
        if self.is_contradicted {
            self.contradicted_m += driven_m;
        }
        let is_lost = self.is_contradicted || self.was_lost;
        if is_lost && self.contradicted_m >= self.config.lost_after_m && !self.has_given_up() {
            self.tracking = Tracking::Lost;
            self.was_lost = true;
            // One of two scans that contradict each other was taken in a bush or in a crowd: it
            // shows no place.
            let asked = Lost { points: points.to_vec(), odom_from_base: latest.odom_from_base };
            self.next_job.lost = Some(asked).filter(|_| step != Verdict::Contradict);
        } else {
            self.tracking = Tracking::Wheels;
        }
    }

    /// Whether a match may end a robot's doubts about where it is.
    pub(super) fn is_convincing(&self, submap: &Submap, points: &[Point2], found: &ScanMatch) -> bool {
        let closure = &self.config.closure;
        let verdict = submap.judge(points, &found.reference_from_moving);
        let here = Anchored { keyframe: submap.first(), keyframe_from_base: found.reference_from_moving };
        let contradicted = self.contradicted_by_grid(points, &self.locate(&here)) as f64;
        verdict.agreement() >= closure.lost_agreement
            && verdict.overlap() >= closure.min_overlap
            && contradicted <= (1.0 - closure.lost_agreement) * points.len() as f64
    }

    /// How many points cannot have been seen from here: they lie where the grid is free and no wall
    /// is near, or behind a wall.
    fn contradicted_by_grid(&self, points: &[Point2], map_from_base: &Pose2) -> usize {
        let here = Point2::from(map_from_base.translation.vector);
        let is_clear = |place: Point2| {
            let cell = self.grid.cell_of(place);
            let around = (-2..=2).flat_map(|j| (-2..=2).map(move |i| Cell { i: cell.i + i, j: cell.j + j }));
            self.grid.state(cell) == CellState::Free
                && around.into_iter().all(|cell| self.grid.state(cell) != CellState::Occupied)
        };
        let is_hidden = |place: Point2| {
            let way = place - here;
            let seen = (way.norm() - HIDDEN_BY_M).min(HIDDEN_SHARE * way.norm());
            seen > 0.0 && !self.grid.is_corridor_unoccupied(here, here + way.normalize() * seen, 0.0)
        };
        let is_contradicted = |point: &&Point2| {
            let place = map_from_base * *point;
            is_clear(place) || is_hidden(place)
        };
        points.iter().filter(is_contradicted).count()
    }

    /// Whether a robot that is lost maps on as if in a new building, since it is at no place that
    /// was mapped, or none was found for so long.
    pub(super) fn has_given_up(&self) -> bool {
        self.was_lost && (self.is_nowhere() || self.contradicted_m >= self.config.give_up_m)
    }

    /// Whether a robot that is lost fits no place that was mapped.
    pub(super) fn is_nowhere(&self) -> bool {
        self.was_lost && self.searches_in_vain >= self.config.give_up_searches
    }

    /// Goes on where a lost robot was found: in a finished submap, which grows no more, so the next
    /// keyframe begins a new one.
    pub(super) fn resume(&mut self, found: &Found, odom_from_base: &Pose2) {
        let Some((active, _)) = self.active.take() else { return };
        tracing::info!("found again in the submap of keyframe {}", found.submap.first());
        let since = self.calibration.correct(&(found.odom_from_base.inverse() * odom_from_base));
        if !self.is_found_again {
            self.left = Some(Arc::new(active.older));
        }
        let submap_from_map = self.poses[found.submap.first()].inverse();
        let newest = self.poses[self.poses.len() - 1];
        let latest = Latest {
            submap_from_base: found.submap_from_base * since,
            odom_from_base: *odom_from_base,
            submap_from_keyframe: submap_from_map * newest,
        };
        self.active = Some((Active { older: Submap::clone(&found.submap), newer: None }, latest));
        self.believe(Tracking::Wheels);
        (self.is_found_again, self.witnesses) = (true, Witnesses::default());
    }
}
