//! Robots that run into each other.

use crate::people::crowd::{NumberedRobot, TOWARDS_MPS};
use fht_perception::pose::Point2;
use nalgebra::Vector2;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::AddAssign;

/// Two that are so much farther apart than their bodies reach no longer touch, metres.
const APART_M: f64 = 0.02;

/// How often other robots and this one have touched. Each counts for itself: what it did if it
/// moved towards the other at that moment, else what was done to it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct RobotContacts {
    /// This robot moved towards another.
    pub by_robot: u64,
    /// Another moved towards this one, which stood or went away.
    pub by_others: u64,
}

impl AddAssign for RobotContacts {
    fn add_assign(&mut self, more: Self) {
        self.by_robot += more.by_robot;
        self.by_others += more.by_others;
    }
}

/// Who touches whom.
#[derive(Clone, Debug, Default)]
pub(super) struct Encounters {
    /// Pairs of numbers, the lesser first.
    pub(super) touching: BTreeSet<(u32, u32)>,
    /// What is to be counted, by number.
    pub(super) counted: BTreeMap<u32, RobotContacts>,
}

impl Encounters {
    /// The robot at `index` of `robots` wants to go from one place to another: where it gets, which
    /// is no farther if it would run into another.
    pub(super) fn stop(&mut self, index: usize, (from, to): (Point2, Point2), robots: &[NumberedRobot]) -> Point2 {
        let (number, body) = robots[index];
        let mut is_stopped = false;
        for (other, there) in robots.iter().filter(|(other, _)| *other != number) {
            let keep_m = there.radius_m + body.radius_m;
            let (before_m, after_m) = ((there.position - from).norm(), (there.position - to).norm());
            let pair = (number.min(*other), number.max(*other));
            if after_m < keep_m && after_m < before_m {
                is_stopped = true;
                if self.touching.insert(pair) {
                    self.counted.entry(number).or_default().by_robot += 1;
                    let comes = is_towards(there.velocity, from - there.position);
                    let others = self.counted.entry(*other).or_default();
                    others.by_robot += u64::from(comes);
                    others.by_others += u64::from(!comes);
                }
            } else if after_m > keep_m + APART_M {
                self.touching.remove(&pair);
            }
        }
        if is_stopped { from } else { to }
    }

    /// What is to be counted of a robot since the last time.
    pub(super) fn take(&mut self, number: u32) -> RobotContacts {
        self.counted.remove(&number).unwrap_or_default()
    }

    /// A robot is gone.
    pub(super) fn forget(&mut self, number: u32) {
        self.touching.retain(|(one, other)| *one != number && *other != number);
    }
}

fn is_towards(velocity: Vector2<f64>, way: Vector2<f64>) -> bool {
    way.norm() > 1e-9 && velocity.dot(&way.normalize()) > TOWARDS_MPS
}
