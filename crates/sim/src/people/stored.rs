//! People as plain data, so that somebody else can go on with them.

use super::body::{Body, BodyKind};
use super::person::{Contacts, Doing, Person};
use fht_perception::pose::Point2;
use nalgebra::Vector2;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// Everybody in a building.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct CrowdState {
    pub(super) people: Vec<PersonState>,
    /// How much was drawn of the random numbers.
    pub(super) drawn: u128,
    pub(super) time_s: f64,
    pub(super) looked_s: f64,
    /// By the number of the robot.
    pub(super) contacts: BTreeMap<u32, Contacts>,
}

impl CrowdState {
    /// Whether somebody can go on with it: `most` people at most, and all numbers are numbers.
    pub(crate) fn is_sound(&self, most: usize) -> bool {
        let times = [self.time_s].into_iter().all(f64::is_finite) && !self.looked_s.is_nan();
        times && self.people.len() <= most && self.people.iter().all(PersonState::is_sound)
    }
}

/// Somebody.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct PersonState {
    position: [f64; 2],
    velocity: [f64; 2],
    radius_m: f64,
    height_m: f64,
    speed_mps: f64,
    heading: [f64; 2],
    /// Until when he stands, seconds; none: he walks.
    standing_until_s: Option<f64>,
    /// Where he walks to: the place, the spot beside it, how near he came and since when.
    way: Option<(u32, [f64; 2], f64, f64)>,
    touches: BTreeSet<u32>,
}

impl PersonState {
    fn is_sound(&self) -> bool {
        let way = self.way.iter().flat_map(|(_, spot, _, since_s)| [spot[0], spot[1], *since_s]);
        let is_way_sound = self.way.is_none_or(|(_, _, nearest_m, _)| !nearest_m.is_nan());
        let numbers = [self.position, self.velocity, self.heading].into_iter().flatten();
        let numbers = numbers.chain([self.radius_m, self.height_m, self.speed_mps]).chain(way);
        let mut numbers = numbers.chain(self.standing_until_s);
        is_way_sound && numbers.all(|number| number.is_finite() && number.abs() < 1e9)
    }
}

impl From<&Person> for PersonState {
    fn from(person: &Person) -> Self {
        let Body { position, velocity, radius_m, height_m, .. } = person.body;
        let (standing_until_s, way) = match person.doing {
            Doing::Standing { until_s } => (Some(until_s), None),
            Doing::Walking { place, spot, nearest_m, since_s } => {
                (None, Some((u32::try_from(place).unwrap_or(u32::MAX), [spot.x, spot.y], nearest_m, since_s)))
            }
        };
        Self {
            position: [position.x, position.y],
            velocity: velocity.into(),
            radius_m,
            height_m,
            speed_mps: person.speed_mps,
            heading: person.heading.into(),
            standing_until_s,
            way,
            touches: person.touches.clone(),
        }
    }
}

impl From<&PersonState> for Person {
    fn from(state: &PersonState) -> Self {
        let doing = match state.way {
            Some((place, spot, nearest_m, since_s)) => {
                Doing::Walking { place: place as usize, spot: spot.into(), nearest_m, since_s }
            }
            None => Doing::Standing { until_s: state.standing_until_s.unwrap_or_default() },
        };
        let body = Body {
            position: Point2::from(state.position),
            velocity: Vector2::from(state.velocity),
            radius_m: state.radius_m,
            height_m: state.height_m,
            kind: BodyKind::Person,
        };
        let heading = Vector2::from(state.heading);
        Self { body, doing, speed_mps: state.speed_mps, heading, touches: state.touches.clone() }
    }
}
