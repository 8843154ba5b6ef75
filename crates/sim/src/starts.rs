//! Where robots start.

use crate::plan::Mask;
use crate::simulator::SimConfig;
use crate::world::World;
use fht_perception::pose::{Point2, Pose2, pose};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::PI;
use std::fmt;

/// Clearance around a place where an explorer starts, metres.
const CLEARANCE_M: f64 = 0.3;
/// Explorers start at least this far apart, metres.
const LEAST_APART_M: f64 = 0.8;

/// Room that a proposed place has around the robot, metres: it can turn and drive off.
const SPARE_M: f64 = 0.1;
/// A robot that gets no farther than this from its start drives nowhere, metres.
const LEAST_WAY_M: f64 = 0.5;
/// A body this much deeper in a wall only touches it, metres.
const TOUCH_M: f64 = 1e-4;

/// What keeps a robot from standing somewhere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StartTrouble {
    /// It is in a wall, in furniture or outside of the building.
    NoFloor,
    /// Something is nearer than the robot's radius.
    NoRoom {
        /// Distance to the nearest thing, metres.
        clearance_m: f64,
        /// Radius of the robot, metres.
        radius_m: f64,
    },
    /// Nothing joins the place to the building's floor.
    CutOff,
    /// It can turn there, but drive nowhere.
    NoWay {
        /// The farthest that it gets, metres.
        reach_m: f64,
    },
}

impl fmt::Display for StartTrouble {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoFloor => write!(formatter, "that is in a wall, in furniture or outside of the building"),
            Self::NoRoom { clearance_m, radius_m } => {
                write!(
                    formatter,
                    "something stands {clearance_m:.2} m from there, and the robot's radius is {radius_m} m"
                )
            }
            Self::CutOff => write!(formatter, "no way leads from there to the building's floor"),
            Self::NoWay { reach_m } => write!(formatter, "it could drive no farther than {reach_m:.2} m from there"),
        }
    }
}

/// A robot cannot start where it was told to.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("the robot cannot start at {} in {world}: {trouble}{}", in_words(start), advice(trouble, nearest.as_ref()))]
pub struct StartError {
    /// The world's name.
    pub world: String,
    /// Where it was to start, `world_from_base`.
    pub start: Pose2,
    /// Why it cannot.
    pub trouble: StartTrouble,
    /// The nearest place where it can, with the same heading.
    pub nearest: Option<Pose2>,
}

/// As `--start` takes it: metres and degrees.
fn in_words(start: &Pose2) -> String {
    // The sum takes the sign from a zero.
    let short = |value: f64| round(value, 1000.0) + 0.0;
    // What is no place of any building is not written out with all its digits.
    let shown = |value: f64| if value.abs() < 1e7 { short(value).to_string() } else { format!("{value:e}") };
    let [x, y, yaw] = [start.translation.x, start.translation.y, start.rotation.angle().to_degrees()].map(shown);
    format!("{x},{y},{yaw}")
}

fn round(value: f64, parts: f64) -> f64 {
    (value * parts).round() / parts
}

fn advice(trouble: &StartTrouble, nearest: Option<&Pose2>) -> String {
    match (nearest, trouble) {
        (Some(place), _) => format!("; the nearest free place is {}", in_words(place)),
        (None, StartTrouble::NoWay { .. }) => String::new(),
        (None, _) => "; the world has no place where it fits".to_owned(),
    }
}

/// Checks that a robot of `radius_m` (metres), which turns on the spot, can stand and drive off at
/// `start` (`world_from_base`).
///
/// # Errors
/// [`StartError`], with the nearest place where it can.
pub fn check_start(world: &World, start: &Pose2, radius_m: f64) -> Result<(), StartError> {
    let plan = world.plan();
    // Any free cell counts here: whether the robot fits is a matter of the surfaces.
    let floor = plan.reachable(Point2::from(world.start().translation.vector), 0.0);
    let Some(trouble) = trouble_at(world, &floor, Point2::from(start.translation.vector), radius_m) else {
        return Ok(());
    };
    let nearest = nearest_start(world, &floor, start, radius_m);
    Err(StartError { world: world.name().to_owned(), start: *start, trouble, nearest })
}

/// Checks that a robot of `radius_m` (metres) that can stand at `start` can also drive somewhere.
///
/// # Errors
/// [`StartError`], without a place where it can.
pub(crate) fn check_way(world: &World, start: &Pose2, radius_m: f64) -> Result<(), StartError> {
    let (plan, place) = (world.plan(), Point2::from(start.translation.vector));
    let reached = plan.reachable(place, radius_m);
    let centre_of = |index: usize| plan.centre_of(index % plan.width(), index / plan.width());
    let reached = reached.cells().iter().enumerate().filter(|(_, is_reached)| **is_reached);
    let reach_m = reached.map(|(index, _)| (centre_of(index) - place).norm()).fold(0.0, f64::max);
    if reach_m >= LEAST_WAY_M {
        return Ok(());
    }
    let trouble = StartTrouble::NoWay { reach_m };
    Err(StartError { world: world.name().to_owned(), start: *start, trouble, nearest: None })
}

fn trouble_at(world: &World, floor: &Mask, place: Point2, radius_m: f64) -> Option<StartTrouble> {
    let plan = world.plan();
    let cell = plan.cell_of(place).filter(|_| !plan.is_occupied(place.x, place.y));
    let Some((column, row)) = cell else { return Some(StartTrouble::NoFloor) };
    let clearance_m = world.body_clearance_m(place);
    if clearance_m < radius_m - TOUCH_M {
        return Some(StartTrouble::NoRoom { clearance_m, radius_m });
    }
    (!floor.contains(column, row)).then_some(StartTrouble::CutOff)
}

/// The nearest place where the robot fits and has some room to spare, on whole centimetres.
fn nearest_start(world: &World, floor: &Mask, start: &Pose2, radius_m: f64) -> Option<Pose2> {
    let (plan, wanted) = (world.plan(), Point2::from(start.translation.vector));
    let room_m = radius_m + SPARE_M;
    let cells = (0..plan.height()).flat_map(|row| (0..plan.width()).map(move |column| (column, row)));
    let roomy = cells
        .filter(|&(column, row)| floor.contains(column, row))
        .map(|(column, row)| plan.centre_of(column, row))
        .filter(|centre| plan.clearance_m(*centre) >= room_m);
    let mut places: Vec<Point2> =
        roomy.map(|centre| Point2::new(round(centre.x, 100.0), round(centre.y, 100.0))).collect();
    places.sort_by(|a, b| (a - wanted).norm_squared().total_cmp(&(b - wanted).norm_squared()));
    let place = places.into_iter().find(|place| trouble_at(world, floor, *place, radius_m).is_none())?;
    Some(pose(place.x, place.y, start.rotation.angle()))
}

/// A start pose for another explorer: in sight of `from`, at most `reach_m` (metres) away, with a
/// random heading. Anywhere in the building if `reach_m` is infinite.
#[must_use]
pub fn start_near(world: &World, from: &Pose2, reach_m: f64, seed: u64) -> Pose2 {
    if reach_m.is_infinite() {
        return world.random_free_pose(seed, CLEARANCE_M);
    }
    let here = Point2::from(from.translation.vector);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut draw = || {
        let (bearing, apart_m) = (rng.random_range(-PI..PI), rng.random_range(LEAST_APART_M.min(reach_m)..=reach_m));
        pose(here.x + apart_m * bearing.cos(), here.y + apart_m * bearing.sin(), rng.random_range(-PI..PI))
    };
    let is_free = |place: &Pose2| {
        let there = Point2::from(place.translation.vector);
        world.plan().clearance_m(there) >= CLEARANCE_M && world.is_clear(here, there, SimConfig::default().radius_m)
    };
    (0..10_000).map(|_| draw()).find(is_free).unwrap_or(*from)
}
