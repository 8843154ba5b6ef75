//! Wheels that have proven themselves hold the heading.
//!
//! On a straight stretch the heading of the wheels walks off that of the scans: a random walk whose
//! variance grows with the distance. How far it walks is learnt. Some wheels do no better than is
//! taken for granted, and then scans alone say where the robot heads. Others are *proven*: where a
//! scan turns such a robot by more than they let it, as bushes do that fit in many ways, the wheels
//! are right; and where it does not, both are heard.

use super::Slam;
use super::submap::Submap;
use fht_perception::matching::{Prior, ScanMatch, refine_with_prior};
use fht_perception::pose::{Point2, Pose2, pose, wrap_angle};
use std::collections::VecDeque;

/// Length of a stretch, metres: a submap grows for about as long, and its heading is one.
const STRETCH_M: f64 = 5.0;
/// A stretch that turns by more than this says more of the turn's scale than of the walk, radians.
const STRAIGHT_RAD: f64 = 0.1;
/// Stretches that are remembered, half a kilometre: wheels that were proven on one floor may slip
/// on the next.
const STRETCHES: usize = 100;
/// Stretches before anything is said.
const LEAST_STRETCHES: usize = 10;
/// The median of the square of a standard normal variable.
const MEDIAN_OF_SQUARE: f64 = 0.4549;
/// Half the normal quantile of 95 %: so many times the root of their number, the rank of the
/// number that is beyond the median with that certainty lies above the middle.
const RANKS_ABOVE: f64 = 0.82;
/// Wheels are proven when the variance of their walk is less than this share of what is taken for
/// granted: those that are just as good are now and then learnt to be a little better.
const PROVEN_SHARE: f64 = 0.5;
/// Information of a heading that no scan moves, rad⁻².
const HELD_INFORMATION: f64 = 1e12;
/// A heading that is held by less than this is not worth another match, radians: 1 cm at 10 m.
const LEAST_HELD_RAD: f64 = 0.001;

/// What has been learnt of the wheels' heading, and how well they know it now.
#[derive(Clone, Debug, Default)]
pub(super) struct HeadingWalk {
    stretch: Stretch,
    /// Squared differences per metre, rad²/m, oldest first.
    learnt: VecDeque<f64>,
    /// Variance of the heading relative to the submap before the newest motion, rad².
    variance: f64,
}

/// The stretch that is being driven.
#[derive(Clone, Copy, Debug, Default)]
struct Stretch {
    driven_m: f64,
    turned_rad: f64,
    /// What the scans say that the wheels do not.
    off_rad: f64,
}

impl HeadingWalk {
    /// Learns from a motion: by the wheels' word, and by that of a scan that fits well, if there is
    /// one.
    pub fn learn(&mut self, by_wheels: &Pose2, by_scan: Option<&Pose2>) {
        let stretch = &mut self.stretch;
        stretch.driven_m += by_wheels.translation.vector.norm();
        stretch.turned_rad += by_wheels.rotation.angle();
        let Some(by_scan) = by_scan.filter(|_| stretch.turned_rad.abs() <= STRAIGHT_RAD) else {
            self.stretch = Stretch::default();
            return;
        };
        stretch.off_rad += wrap_angle(by_scan.rotation.angle() - by_wheels.rotation.angle());
        if stretch.driven_m >= STRETCH_M {
            self.learnt.push_back(stretch.off_rad * stretch.off_rad / stretch.driven_m);
            if self.learnt.len() > STRETCHES {
                self.learnt.pop_front();
            }
            self.stretch = Stretch::default();
        }
    }

    /// The variance of the walk, rad²/m, that is not exceeded with 95 % certainty; what the scans
    /// do not know of it is counted in. Of the median, so that a bush or a slip does not matter.
    /// `None` while too little was driven straight.
    pub fn variance_per_m(&self) -> Option<f64> {
        let count = self.learnt.len();
        if count < LEAST_STRETCHES {
            return None;
        }
        let mut sorted: Vec<f64> = self.learnt.iter().copied().collect();
        sorted.sort_by(f64::total_cmp);
        let rank = 0.5 * count as f64 + RANKS_ABOVE * (count as f64).sqrt();
        Some(sorted[(rank as usize).min(count - 1)] / MEDIAN_OF_SQUARE)
    }

    /// Between the wheels' heading, which has become less certain by `growth` (rad²), and that of a
    /// scan, off by `off_rad` with variance `scan`: what of that is to be believed, radians. Of a
    /// scan beyond `most_sigmas` nothing is.
    fn weigh(&mut self, growth: f64, off_rad: f64, scan: f64, most_sigmas: f64) -> f64 {
        self.variance += growth;
        let both = self.variance + scan;
        if off_rad * off_rad > most_sigmas * most_sigmas * both {
            return 0.0;
        }
        let gain = self.variance / both;
        self.variance *= 1.0 - gain;
        gain * off_rad
    }
}

impl Slam {
    /// A match with the heading between what it says and what wheels that are proven say
    /// (`prior`, after `motion`).
    pub(super) fn hold_heading(
        &mut self,
        submap: &Submap,
        points: &[Point2],
        found: Option<ScanMatch>,
        prior: &Prior,
        motion: &Pose2,
    ) -> Option<ScanMatch> {
        let scan_variance = |found: &ScanMatch| found.covariance[(2, 2)] + self.config.closure.floor_rad.powi(2);
        let scan = found.as_ref().map_or(0.0, scan_variance);
        let granted = self.calibration.walk_variance_per_m();
        let proven = self.heading_walk.variance_per_m().filter(|variance| *variance < PROVEN_SHARE * granted);
        let Some(variance_per_m) = proven.filter(|_| self.is_doubtless()) else {
            self.heading_walk.variance = scan;
            return found;
        };
        let turn = self.calibration.turn_variance(motion.rotation.angle());
        let growth = variance_per_m * motion.translation.vector.norm() + turn;
        let Some(found) = found else {
            self.heading_walk.variance += growth;
            return None;
        };
        let predicted = &prior.reference_from_moving;
        let off_rad = wrap_angle(found.reference_from_moving.rotation.angle() - predicted.rotation.angle());
        let believed_rad = self.heading_walk.weigh(growth, off_rad, scan, self.config.wheels_sigmas);
        if (off_rad - believed_rad).abs() < LEAST_HELD_RAD {
            return Some(found);
        }
        let mut held = prior.clone();
        let heading_rad = predicted.rotation.angle() + believed_rad;
        held.reference_from_moving = pose(predicted.translation.x, predicted.translation.y, heading_rad);
        held.information[(2, 2)] += HELD_INFORMATION;
        let held = refine_with_prior(submap.cloud(), points, &held, &self.config.matching);
        let is_convincing = |found: &ScanMatch| self.is_convincing(submap, points, found);
        // Walls that fit as the scan says, and not where the wheels say: these have slipped.
        let has_slipped = is_convincing(&found) && !held.as_ref().is_some_and(is_convincing);
        let Some(mut held) = held.filter(|_| !has_slipped) else {
            self.heading_walk.variance = scan;
            return has_slipped.then_some(found);
        };
        held.covariance[(2, 2)] += self.heading_walk.variance;
        Some(held)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// So many metres straight on, in steps of 0.2 m, while the scans turn the robot by `off` per
    /// stretch.
    fn drive(walk: &mut HeadingWalk, metres: usize, off: impl Fn(usize) -> f64) {
        for step in 0..5 * metres {
            let off_rad = off(step / 25) / 25.0;
            walk.learn(&pose(0.2, 0.0, 0.0), Some(&pose(0.2, 0.0, off_rad)));
        }
    }

    #[test]
    fn a_walk_is_learnt_and_a_bush_does_not_matter() {
        let mut walk = HeadingWalk::default();
        drive(&mut walk, 45, |stretch| if stretch.is_multiple_of(2) { 0.005 } else { -0.005 });
        assert_eq!(walk.variance_per_m(), None, "so little says nothing");
        // Of forty stretches four are along bushes.
        drive(&mut walk, 155, |stretch| if stretch.is_multiple_of(10) { 0.3 } else { 0.005 });
        let expected = 0.005_f64.powi(2) / 5.0 / MEDIAN_OF_SQUARE;
        let learnt = walk.variance_per_m().unwrap_or_default();
        assert!((learnt / expected - 1.0).abs() < 0.1, "{learnt} {expected}");
    }

    #[test]
    fn turns_and_scans_that_do_not_fit_teach_nothing() {
        let mut walk = HeadingWalk::default();
        // Every 4 m a turn, or a scan that does not fit.
        for step in 0..2000 {
            let turn = if step % 40 == 0 { 0.15 } else { 0.0 };
            let motion = pose(0.2, 0.0, turn);
            walk.learn(&motion, Some(&motion).filter(|_| step % 40 != 20));
        }
        assert_eq!(walk.variance_per_m(), None);
    }

    #[test]
    fn a_scan_is_weighed_and_one_beyond_all_bounds_is_not() {
        let mut walk = HeadingWalk { variance: 1e-6, ..HeadingWalk::default() };
        let believed = walk.weigh(3e-6, 0.002, 4e-6, 3.0);
        assert!((believed - 0.001).abs() < 1e-12 && (walk.variance - 2e-6).abs() < 1e-12, "{believed} {walk:?}");
        let believed = walk.weigh(2e-6, 0.07, 4e-6, 3.0);
        assert!(believed == 0.0 && (walk.variance - 4e-6).abs() < 1e-12, "{believed} {walk:?}");
    }
}
