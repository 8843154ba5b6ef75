//! The truth about a simulated robot, for scoring. The robot itself never sees it.

use crate::commons::RobotContacts;
use crate::people::Contacts;
use fht_perception::pose::{Point2, Pose2};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The truth at the newest frame.
#[derive(Clone, Debug, Default)]
pub(crate) struct TruthNow {
    pub(crate) world_from_base: Pose2,
    pub(crate) driven_m: f64,
    pub(crate) collisions: u64,
    pub(crate) people: Vec<(Point2, f64)>,
    pub(crate) robots: Vec<(Point2, f64)>,
    pub(crate) contacts: Contacts,
    pub(crate) robot_contacts: RobotContacts,
}

/// The truth about one simulated robot at its newest frame. Clones refer to the same robot.
#[derive(Clone, Debug)]
pub struct Truth(Arc<Mutex<TruthNow>>);

impl Truth {
    pub(crate) fn at(world_from_base: Pose2) -> Self {
        Self(Arc::new(Mutex::new(TruthNow { world_from_base, ..TruthNow::default() })))
    }

    pub(crate) fn set(&self, now: TruthNow) {
        *self.lock() = now;
    }

    fn lock(&self) -> MutexGuard<'_, TruthNow> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The true pose of the robot, `world_from_base`.
    #[must_use]
    pub fn world_from_base(&self) -> Pose2 {
        self.lock().world_from_base
    }

    /// Distance driven so far, metres.
    #[must_use]
    pub fn driven_m(&self) -> f64 {
        self.lock().driven_m
    }

    /// How many times its body has hit a thing so far: walls and furniture, not people.
    #[must_use]
    pub fn collisions(&self) -> u64 {
        self.lock().collisions
    }

    /// Where people are, world frame, and the radius of each, metres.
    #[must_use]
    pub fn people(&self) -> Vec<(Point2, f64)> {
        self.lock().people.clone()
    }

    /// How often people and the robot have touched so far.
    #[must_use]
    pub fn contacts(&self) -> Contacts {
        self.lock().contacts
    }

    /// Where the other robots of a shared world are, world frame, and the radius of each, metres.
    #[must_use]
    pub fn robots(&self) -> Vec<(Point2, f64)> {
        self.lock().robots.clone()
    }

    /// How often other robots and this one have touched so far.
    #[must_use]
    pub fn robot_contacts(&self) -> RobotContacts {
        self.lock().robot_contacts
    }
}
