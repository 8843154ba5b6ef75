//! The truth about a simulated robot, for scoring. The robot itself never sees it.

use fht_perception::pose::Pose2;
use std::sync::{Arc, Mutex, PoisonError};

/// The truth at the newest frame.
#[derive(Clone, Copy, Debug)]
struct TruthNow {
    world_from_base: Pose2,
    driven_m: f64,
    collisions: u64,
}

/// The truth about one simulated robot at its newest frame. Clones refer to the same robot.
#[derive(Clone, Debug)]
pub struct Truth(Arc<Mutex<TruthNow>>);

impl Truth {
    pub(crate) fn at(world_from_base: Pose2) -> Self {
        Self(Arc::new(Mutex::new(TruthNow { world_from_base, driven_m: 0.0, collisions: 0 })))
    }

    pub(crate) fn set(&self, world_from_base: Pose2, driven_m: f64, collisions: u64) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = TruthNow { world_from_base, driven_m, collisions };
    }

    fn now(&self) -> TruthNow {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The true pose of the robot, `world_from_base`.
    #[must_use]
    pub fn world_from_base(&self) -> Pose2 {
        self.now().world_from_base
    }

    /// Distance driven so far, metres.
    #[must_use]
    pub fn driven_m(&self) -> f64 {
        self.now().driven_m
    }

    /// How many times its body has hit something so far.
    #[must_use]
    pub fn collisions(&self) -> u64 {
        self.now().collisions
    }
}
