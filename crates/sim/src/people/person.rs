//! Somebody in a building.

use super::body::Body;
use fht_perception::pose::Point2;
use nalgebra::Vector2;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// How often people and a robot have touched: who moved towards the other decides whose doing it
/// was, and a robot that does has always done it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Contacts {
    /// The robot moved towards somebody.
    pub by_robot: u64,
    /// Somebody walked into a robot that stood or went away.
    pub by_people: u64,
}

/// What somebody is about.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Doing {
    /// Stands until then, seconds.
    Standing { until_s: f64 },
    /// Walks to a place, to stand at this spot beside it.
    Walking { place: usize, spot: Point2, nearest_m: f64, since_s: f64 },
}

/// Somebody.
pub(super) struct Person {
    pub(super) body: Body,
    pub(super) doing: Doing,
    pub(super) speed_mps: f64,
    /// Where he wants to go, a unit vector; nothing where he stands.
    pub(super) heading: Vector2<f64>,
    /// The robots that he touches.
    pub(super) touches: BTreeSet<u32>,
}
