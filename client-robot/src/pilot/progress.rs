//! Whether the robot comes nearer to its goal. A path that leads through a wall sends it round and
//! round the building: the way on its own grid always seems open where it has not looked yet.

use fht_perception::pose::Point2;
use serde::{Deserialize, Serialize};

/// When a robot that drives counts as not getting anywhere.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct ProgressConfig {
    /// The way ahead counts as blocked when what is left of the path has not become shorter for
    /// this long, seconds. Default 20.
    pub patience_s: f64,
    /// Shorter by this much, metres. Default 0.05.
    pub step_m: f64,
    /// The task fails when that has happened so often. Default 2.
    pub stalls: u32,
    /// The task fails when the way was found blocked so often. Default 8.
    pub blocked_ways: u32,
    /// Both counts begin anew when the robot is nearer than it ever stalled by this much, metres.
    /// Default 1.
    pub forget_m: f64,
}

impl Default for ProgressConfig {
    fn default() -> Self {
        Self { patience_s: 20.0, step_m: 0.05, stalls: 2, blocked_ways: 8, forget_m: 1.0 }
    }
}

/// Where the robot was nearest to its goal.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Nearest {
    left_m: f64,
    at: Point2,
    when_us: u64,
}

/// The robot has stalled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stall {
    /// Left of the path where it was nearest, metres.
    pub(super) left_m: f64,
    /// Where that was, odometry frame.
    pub(super) at: Point2,
    /// Time since then, seconds.
    pub(super) seconds: f64,
    /// Whether it is time to give up.
    pub(super) is_final: bool,
}

/// Watches what is left of the path.
#[derive(Clone, Debug, Default)]
pub(super) struct ProgressWatch {
    nearest: Option<Nearest>,
    stalls: u32,
    blocked: u32,
    /// Least of what was left when either was counted, metres.
    least_m: f64,
}

impl ProgressWatch {
    /// Another way is tried, or the robot was not driving: counts from here.
    pub(super) fn restart(&mut self) {
        self.nearest = None;
    }

    /// The path to the same goal was planned anew: what is left changed from `before_m` to
    /// `after_m` although the robot stands where it stood.
    pub(super) fn replanned(&mut self, before_m: f64, after_m: f64) {
        if let Some(nearest) = &mut self.nearest {
            nearest.left_m += after_m - before_m;
        }
    }

    /// The way ahead was found blocked where `left_m` of the path were left: how often that was, if
    /// it is time to give up.
    pub(super) fn blocked(&mut self, left_m: f64, config: &ProgressConfig) -> Option<u32> {
        self.count_from(left_m, config);
        self.blocked += 1;
        (self.blocked >= config.blocked_ways).then_some(self.blocked)
    }

    /// Something is counted where `left_m` are left.
    fn count_from(&mut self, left_m: f64, config: &ProgressConfig) {
        let is_first = self.stalls + self.blocked == 0;
        if is_first || left_m < self.least_m - config.forget_m {
            (self.stalls, self.blocked, self.least_m) = (0, 0, left_m);
        }
        self.least_m = self.least_m.min(left_m);
    }

    /// The robot is at `here` (odometry frame), and `left_m` of its path are left.
    pub(super) fn observe(&mut self, here: Point2, left_m: f64, now_us: u64, config: &ProgressConfig) -> Option<Stall> {
        let nearest = match &mut self.nearest {
            Some(nearest) if left_m > nearest.left_m - config.step_m => nearest,
            nearest => {
                *nearest = Some(Nearest { left_m, at: here, when_us: now_us });
                return None;
            }
        };
        let seconds = now_us.saturating_sub(nearest.when_us) as f64 / 1e6;
        if seconds <= config.patience_s {
            return None;
        }
        let Nearest { left_m, at, .. } = *nearest;
        self.count_from(left_m, config);
        self.stalls += 1;
        self.nearest = None;
        Some(Stall { left_m, at, seconds, is_final: self.stalls >= config.stalls })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: u64 = 1_000_000;

    /// What a robot with so much of its path left, second by second, is told.
    fn stalls(watch: &mut ProgressWatch, from_s: u64, left_m: impl IntoIterator<Item = f64>) -> Vec<(u64, Stall)> {
        let config = ProgressConfig::default();
        let seconds = (from_s..).zip(left_m);
        let look = |(second, left_m): (u64, f64)| {
            let stall = watch.observe(Point2::new(left_m, 0.0), left_m, second * SECOND, &config);
            stall.map(|stall| (second, stall))
        };
        seconds.filter_map(look).collect()
    }

    #[test]
    fn a_robot_that_comes_nearer_however_slowly_is_left_alone() {
        let creeping = (0..600).map(|second| 10.0 - 0.003 * f64::from(second));
        assert_eq!(stalls(&mut ProgressWatch::default(), 0, creeping), []);
        let around_a_table = (0..60).map(f64::from).map(|second| match second {
            ..10.0 => 80.0 - 0.5 * second,
            10.0..20.0 => 75.0 + 0.3 * (second - 10.0),
            _ => 78.0 - 0.5 * (second - 20.0),
        });
        assert_eq!(stalls(&mut ProgressWatch::default(), 0, around_a_table), []);
    }

    #[test]
    fn a_robot_that_tours_is_told_where_it_was_nearest_and_gives_up_the_second_time() {
        let mut watch = ProgressWatch::default();
        let tour = |second: i32| if second < 5 { f64::from(10 - 2 * second) } else { f64::from(second) };
        let found = stalls(&mut watch, 0, (0..60).map(tour));
        let told: Vec<_> = found.iter().map(|(second, stall)| (*second, stall.left_m, stall.is_final)).collect();
        assert_eq!(told, [(25, 2.0, false), (47, 26.0, true)]);
        assert_eq!(found[0].1.at, Point2::new(2.0, 0.0));
    }

    #[test]
    fn doors_that_are_found_shut_in_turn_are_not_tried_for_ever() {
        let (config, mut watch) = (ProgressConfig::default(), ProgressWatch::default());
        let blocked = |watch: &mut ProgressWatch, left_m| watch.blocked(left_m, &config);
        assert!((0..7).all(|_| blocked(&mut watch, 20.0).is_none()));
        assert_eq!(blocked(&mut watch, 18.0), None, "it has come a good deal nearer");
        assert!((0..6).all(|door| blocked(&mut watch, if door % 2 == 0 { 30.0 } else { 18.0 }).is_none()));
        assert_eq!(blocked(&mut watch, 18.0), Some(8));
    }

    #[test]
    fn another_path_is_no_progress_and_being_much_nearer_is() {
        let mut watch = ProgressWatch::default();
        assert_eq!(stalls(&mut watch, 0, [5.0; 15]), []);
        watch.replanned(5.0, 50.0);
        assert_eq!(stalls(&mut watch, 15, [50.0; 10]).len(), 1);
        let nearer = stalls(&mut watch, 25, std::iter::once(40.0).chain([3.0; 30]));
        assert!(nearer.iter().all(|(_, stall)| !stall.is_final), "{nearer:?}");
    }
}
