//! Who else is where a robot is.

use crate::commons::{RobotContacts, SharedWorld, Turn};
use crate::people::crowd::Crowd;
use crate::people::{Body, Contacts};

/// The number of a robot that is the only one.
pub(super) const ALONE: u32 = 0;

/// Who else is where a robot is.
pub(super) enum Company {
    /// The robot has the building for itself.
    Nobody,
    /// People who are there for this robot only.
    Own(Box<Crowd>),
    /// People and robots of a world that several robots share, as it was after the newest turn.
    Shared { world: Box<dyn SharedWorld>, now: Turn },
}

impl Company {
    pub(super) fn people(&self) -> Vec<Body> {
        match self {
            Self::Nobody => Vec::new(),
            Self::Own(crowd) => crowd.bodies(),
            Self::Shared { now, .. } => now.people.clone(),
        }
    }

    pub(super) fn robots(&self) -> Vec<Body> {
        match self {
            Self::Nobody | Self::Own(_) => Vec::new(),
            Self::Shared { now, .. } => now.robots.clone(),
        }
    }

    pub(super) fn contacts(&self) -> Contacts {
        match self {
            Self::Nobody => Contacts::default(),
            Self::Own(crowd) => crowd.contacts(ALONE),
            Self::Shared { now, .. } => now.contacts,
        }
    }

    pub(super) fn robot_contacts(&self) -> RobotContacts {
        match self {
            Self::Nobody | Self::Own(_) => RobotContacts::default(),
            Self::Shared { now, .. } => now.robot_contacts,
        }
    }
}
