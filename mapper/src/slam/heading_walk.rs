//! How far the wheels' heading walks off that of the scans, on straight stretches: a random walk
//! whose variance grows with the distance. Some wheels do no better than is taken for granted;
//! others do.

use fht_perception::pose::{Pose2, wrap_angle};
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

/// What has been learnt of the wheels' heading, and how well they know it now.
#[derive(Clone, Debug, Default)]
pub(super) struct HeadingWalk {
    stretch: Stretch,
    /// Squared differences per metre, rad²/m, oldest first.
    learnt: VecDeque<f64>,
    /// Variance of the heading relative to the submap before the newest motion, rad².
    pub variance: f64,
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

    /// Between the wheels' heading, which has become less certain by `growth` (rad²), and that of
    /// a scan, off by `off_rad` with variance `scan`: what of that is to be believed, radians. Of a
    /// scan beyond `most_sigmas` nothing is.
    pub fn weigh(&mut self, growth: f64, off_rad: f64, scan: f64, most_sigmas: f64) -> f64 {
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

#[cfg(test)]
mod tests {
    use super::*;
    use fht_perception::pose::pose;

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
