//! A shared world as plain data: one robot's program stores it, another's goes on with it.

use super::encounters::RobotContacts;
use crate::people::PeopleConfig;
use crate::people::stored::CrowdState;
use crate::world::World;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// No world has more robots, or more rolls of their wheels in a period.
const MOST: usize = 256;
/// No number is greater: a world has a few hundred metres.
const GREATEST: f64 = 1e9;

/// A shared world at one moment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CommonsState {
    pub(super) building: u64,
    pub(super) period_us: u64,
    pub(super) people: PeopleConfig,
    pub(super) crowd: Option<CrowdState>,
    pub(super) robots: BTreeMap<String, RobotState>,
    pub(super) touching: BTreeSet<(u32, u32)>,
    pub(super) next_number: u32,
}

/// A robot in it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct RobotState {
    pub(super) number: u32,
    /// x, y, heading, world frame, metres and radians.
    pub(super) at: [f64; 3],
    pub(super) radius_m: f64,
    pub(super) height_m: f64,
    pub(super) driven_m: f64,
    pub(super) collisions: u64,
    pub(super) is_touching: bool,
    pub(super) velocity: [f64; 2],
    pub(super) command: Option<[f64; 2]>,
    pub(super) is_waited_for: bool,
    pub(super) done: u64,
    pub(super) rolls: Vec<[f64; 2]>,
    pub(super) contacts: RobotContacts,
}

impl CommonsState {
    /// A robot is gone.
    pub fn forget(&mut self, name: &str) {
        if let Some(gone) = self.robots.remove(name) {
            self.touching.retain(|(one, other)| ![*one, *other].contains(&gone.number));
        }
    }

    /// Whether robots can go on with it.
    pub(super) fn is_sound(&self) -> bool {
        let is_crowd_sound = self.crowd.as_ref().is_none_or(|crowd| crowd.is_sound(self.people.count));
        let are_people_sound = self.people.is_sound() && (self.crowd.is_none() || self.people.count > 0);
        let are_robots_sound = self.robots.values().all(RobotState::is_sound);
        is_crowd_sound && are_people_sound && are_robots_sound && self.robots.len() <= MOST
    }
}

impl RobotState {
    fn is_sound(&self) -> bool {
        let numbers = self.at.into_iter().chain(self.velocity).chain(self.command.into_iter().flatten());
        let mut numbers = numbers.chain(self.rolls.iter().copied().flatten()).chain([self.driven_m]);
        let is_body = |metres: f64| (1e-3..=10.0).contains(&metres);
        is_body(self.radius_m)
            && is_body(self.height_m)
            && self.rolls.len() <= MOST
            && numbers.all(|number| number.abs() <= GREATEST)
    }
}

/// A number that buildings of the same floor have in common (FNV-1a).
pub(super) fn building(world: &World) -> u64 {
    let plan = world.plan();
    let header = [plan.resolution_m(), plan.origin().x, plan.origin().y, plan.width() as f64, plan.height() as f64];
    let bytes = header.into_iter().flat_map(f64::to_le_bytes).chain(plan.cells().iter().map(|cell| u8::from(*cell)));
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash: u64, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}
