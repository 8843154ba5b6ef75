//! A world that several robots share: where they are, what they do next, and the people among
//! them.
//!
//! All robots move together, one scan's period at a time, once each has told its command. A core
//! without I/O and without a clock: whoever carries it from one robot to another ([`SharedWorld`])
//! decides who is waited for. The same robots with the same commands give the same world, whoever
//! computes it.
//!
//! | module | idea |
//! | --- | --- |
//! | `state` | all of it as plain data ([`CommonsState`]) |
//! | `encounters` | robots that run into each other |

mod encounters;
mod state;

pub use encounters::RobotContacts;
pub use state::CommonsState;

use crate::chassis::{Chassis, Roll, SUBSTEPS};
use crate::people::crowd::{Crowd, NumberedRobot};
use crate::people::{Body, BodyKind, Contacts, PeopleConfig};
use crate::world::World;
use encounters::Encounters;
use fht_perception::frame::Twist;
use fht_perception::pose::{Point2, Pose2, pose};
use fht_perception::robot::RobotError;
use nalgebra::Vector2;
use state::RobotState;
use std::collections::BTreeMap;
use std::future::Future;
use std::pin::Pin;
use std::sync::Arc;

/// Left between a robot that enters and one that is there, metres.
const ENTRY_GAP_M: f64 = 0.1;

/// What a [`SharedWorld`] promises.
pub type Going<'a> = Pin<Box<dyn Future<Output = Result<Turn, RobotError>> + Send + 'a>>;

/// A robot's seat in a world that it shares with others. Whoever implements this brings the I/O.
/// The futures may be dropped before they are ready: what was told stays told, and the next call
/// goes on.
pub trait SharedWorld: Send {
    /// The robot appears where it starts.
    fn enter(&mut self) -> Going<'_>;

    /// The robot drives by `command` for one period. Ready when the world has gone on by that.
    fn go_on(&mut self, command: Twist) -> Going<'_>;
}

/// What has become of a robot, and who is about.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Turn {
    /// How many of its commands the robot has carried out.
    pub done: u64,
    /// Where it truly is.
    pub world_from_base: Pose2,
    /// Distance driven since it entered, metres.
    pub driven_m: f64,
    /// How many times it has hit a wall or a thing.
    pub collisions: u64,
    /// What its wheels turned in the newest period, step by step: metres ahead, radians.
    pub rolls: Vec<(f64, f64)>,
    /// Where people are.
    pub people: Vec<Body>,
    /// Where other robots are.
    pub robots: Vec<Body>,
    /// How people and this robot have touched.
    pub contacts: Contacts,
    /// How other robots and this one have touched.
    pub robot_contacts: RobotContacts,
}

/// A robot that enters a shared world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entrant {
    /// Where.
    pub start: Pose2,
    /// Radius of its body, metres.
    pub radius_m: f64,
    /// Height of its body, metres.
    pub height_m: f64,
}

/// Why a robot is not in a shared world, or cannot go on in it.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CommonsError {
    /// Another building.
    #[error("it is another building: the robots of a shared world need the same --world and --world-seed")]
    OtherBuilding,
    /// Scanners of different periods.
    #[error("its scanners give a frame every {there_us} µs and this one's every {here_us} µs; they must be equal")]
    OtherPeriod {
        /// Of the robots that are there.
        there_us: u64,
        /// Of this one.
        here_us: u64,
    },
    /// Other people.
    #[error("it has {there} people, and {here} were asked for; leave --people out, or give it as the first robot did")]
    OtherPeople {
        /// How many there are.
        there: usize,
        /// How many were asked for.
        here: usize,
    },
    /// A state that cannot be.
    #[error("what is stored of it cannot be")]
    Unsound,
    /// Another robot is where one wants to appear.
    #[error("robot {0} is where this one starts")]
    Occupied(String),
}

/// A world that several robots share.
pub struct Commons {
    world: Arc<World>,
    building: u64,
    period_us: u64,
    people: PeopleConfig,
    crowd: Option<Crowd>,
    robots: BTreeMap<String, Participant>,
    encounters: Encounters,
    next_number: u32,
}

/// A robot in it.
#[derive(Clone, Debug)]
struct Participant {
    number: u32,
    chassis: Chassis,
    height_m: f64,
    velocity: Vector2<f64>,
    /// What it does next, if it has told.
    command: Option<Twist>,
    /// Whether the others wait for its command.
    is_waited_for: bool,
    done: u64,
    rolls: Vec<Roll>,
    contacts: RobotContacts,
}

impl Participant {
    fn body(&self) -> Body {
        Body {
            position: self.chassis.position(),
            velocity: self.velocity,
            radius_m: self.chassis.radius_m,
            height_m: self.height_m,
            kind: BodyKind::Robot,
        }
    }
}

impl Commons {
    /// `world` with `people` and without robots; a scan takes `period_us` microseconds.
    #[must_use]
    pub fn new(world: Arc<World>, people: PeopleConfig, period_us: u64) -> Self {
        Self {
            building: state::building(&world),
            world,
            period_us,
            people,
            crowd: None,
            robots: BTreeMap::new(),
            encounters: Encounters::default(),
            next_number: 0,
        }
    }

    /// A robot appears, for the first time or again. Somebody who stands there is somewhere else at
    /// that moment.
    ///
    /// # Errors
    /// [`CommonsError::Occupied`] while another robot is there.
    pub fn enter(&mut self, name: &str, entrant: &Entrant) -> Result<(), CommonsError> {
        let chassis = Chassis::at(entrant.start, entrant.radius_m);
        let here = chassis.position();
        let is_in_the_way =
            |other: &Chassis| (other.position() - here).norm() < other.radius_m + entrant.radius_m + ENTRY_GAP_M;
        let others = || self.robots.iter().filter(|(other, _)| *other != name);
        if let Some((other, _)) = others().find(|(_, other)| is_in_the_way(&other.chassis)) {
            return Err(CommonsError::Occupied(other.clone()));
        }
        if let Some(crowd) = &mut self.crowd {
            crowd.make_room(here);
        } else if self.people.count > 0 {
            self.crowd = Some(self.gather(here));
        }
        let participant = Participant {
            number: self.next_number,
            chassis,
            height_m: entrant.height_m,
            velocity: Vector2::zeros(),
            command: None,
            is_waited_for: true,
            done: 0,
            rolls: Vec::new(),
            contacts: RobotContacts::default(),
        };
        self.next_number = self.next_number.wrapping_add(1);
        self.robots.insert(name.to_owned(), participant);
        Ok(())
    }

    /// People as they are at first, none of them near to `here`.
    fn gather(&self, here: Point2) -> Crowd {
        let start = Point2::from(self.world.start().translation.vector);
        Crowd::new(self.world.plan(), start, here, self.people.clone())
    }

    /// A robot is gone.
    pub fn leave(&mut self, name: &str) {
        if let Some(gone) = self.robots.remove(name) {
            self.encounters.forget(gone.number);
        }
    }

    /// The robots that are there.
    pub fn robots(&self) -> impl Iterator<Item = &str> {
        self.robots.keys().map(String::as_str)
    }

    /// A robot tells what it does next; it is waited for from now on.
    pub fn command(&mut self, name: &str, command: Twist) {
        if let Some(robot) = self.robots.get_mut(name) {
            (robot.command, robot.is_waited_for) = (Some(command), true);
        }
    }

    /// Whose command is waited for.
    pub fn missing(&self) -> impl Iterator<Item = &str> {
        let is_missing = |robot: &Participant| robot.is_waited_for && robot.command.is_none();
        self.robots.iter().filter(move |(_, robot)| is_missing(robot)).map(|(name, _)| name.as_str())
    }

    /// A robot is not waited for until it tells a command: it stands meanwhile.
    pub fn pass_over(&mut self, name: &str) {
        if let Some(robot) = self.robots.get_mut(name) {
            robot.is_waited_for = false;
        }
    }

    /// Time goes on by a period: all robots drive by their commands, and people walk.
    pub fn advance(&mut self) {
        let step_s = self.period_us as f64 * 1e-6 / f64::from(SUBSTEPS);
        for robot in self.robots.values_mut().filter(|robot| robot.command.is_some()) {
            robot.rolls.clear();
        }
        for _ in 0..SUBSTEPS {
            self.small_step(step_s);
        }
        for robot in self.robots.values_mut() {
            robot.done += u64::from(robot.command.take().is_some());
        }
    }

    /// Everybody moves for `step_s` seconds, the robots one after the other.
    fn small_step(&mut self, step_s: f64) {
        let mut bodies: Vec<NumberedRobot> = self.robots.values().map(|robot| (robot.number, robot.body())).collect();
        for (index, robot) in self.robots.values_mut().enumerate() {
            let Some(command) = robot.command else {
                robot.velocity = Vector2::zeros();
                bodies[index].1.velocity = robot.velocity;
                continue;
            };
            let mut step = robot.chassis.step(&self.world, command.linear_mps * step_s, command.angular_radps * step_s);
            if let Some(crowd) = &mut self.crowd {
                step.to = crowd.stop_robot(robot.number, step.from, step.to, robot.chassis.radius_m);
            }
            step.to = self.encounters.stop(index, (step.from, step.to), &bodies);
            let (moved, roll) = robot.chassis.take(&step);
            robot.velocity = moved / step_s;
            robot.rolls.push(roll);
            bodies[index].1 = robot.body();
        }
        for robot in self.robots.values_mut() {
            robot.contacts += self.encounters.take(robot.number);
        }
        if let Some(crowd) = &mut self.crowd {
            crowd.step(self.world.plan(), &bodies, step_s);
        }
    }

    /// What has become of a robot; none if it is not there.
    #[must_use]
    pub fn turn(&self, name: &str) -> Option<Turn> {
        let robot = self.robots.get(name)?;
        let others = self.robots.iter().filter(|(other, _)| *other != name);
        Some(Turn {
            done: robot.done,
            world_from_base: robot.chassis.world_from_base,
            driven_m: robot.chassis.driven_m,
            collisions: robot.chassis.collisions,
            rolls: robot.rolls.clone(),
            people: self.crowd.as_ref().map_or_else(Vec::new, Crowd::bodies),
            robots: others.map(|(_, other)| other.body()).collect(),
            contacts: self.crowd.as_ref().map_or_else(Contacts::default, |crowd| crowd.contacts(robot.number)),
            robot_contacts: robot.contacts,
        })
    }

    /// All of it as plain data.
    #[must_use]
    pub fn state(&self) -> CommonsState {
        CommonsState {
            building: self.building,
            period_us: self.period_us,
            people: self.people.clone(),
            crowd: self.crowd.as_ref().map(Crowd::state),
            robots: self.robots.iter().map(|(name, robot)| (name.clone(), RobotState::from(robot))).collect(),
            touching: self.encounters.touching.clone(),
            next_number: self.next_number,
        }
    }

    /// Goes on from a state that somebody else has stored. A world that has people has them for
    /// whoever asks for none.
    ///
    /// # Errors
    /// [`CommonsError`]; nothing has changed then.
    pub fn restore(&mut self, state: &CommonsState) -> Result<(), CommonsError> {
        if state.building != self.building {
            return Err(CommonsError::OtherBuilding);
        }
        if state.period_us != self.period_us {
            return Err(CommonsError::OtherPeriod { there_us: state.period_us, here_us: self.period_us });
        }
        if self.people.count > 0 && self.people.count != state.people.count {
            return Err(CommonsError::OtherPeople { there: state.people.count, here: self.people.count });
        }
        if !state.is_sound() {
            return Err(CommonsError::Unsound);
        }
        self.people.clone_from(&state.people);
        // The ways that they walk are a function of the building and of their seed.
        let known = self.crowd.take().filter(|crowd| *crowd.config() == self.people);
        self.crowd = state.crowd.as_ref().map(|people| {
            let mut crowd = known.unwrap_or_else(|| self.gather(Point2::origin()));
            crowd.restore(people);
            crowd
        });
        self.robots = state.robots.iter().map(|(name, robot)| (name.clone(), Participant::from(robot))).collect();
        self.encounters = Encounters { touching: state.touching.clone(), ..Encounters::default() };
        self.next_number = state.next_number;
        Ok(())
    }
}

impl From<&Participant> for RobotState {
    fn from(robot: &Participant) -> Self {
        let at = robot.chassis.world_from_base;
        Self {
            number: robot.number,
            at: [at.translation.x, at.translation.y, at.rotation.angle()],
            radius_m: robot.chassis.radius_m,
            height_m: robot.height_m,
            driven_m: robot.chassis.driven_m,
            collisions: robot.chassis.collisions,
            is_touching: robot.chassis.is_touching,
            velocity: robot.velocity.into(),
            command: robot.command.map(|command| [command.linear_mps, command.angular_radps]),
            is_waited_for: robot.is_waited_for,
            done: robot.done,
            rolls: robot.rolls.iter().map(|(forward_m, turn_rad)| [*forward_m, *turn_rad]).collect(),
            contacts: robot.contacts,
        }
    }
}

impl From<&RobotState> for Participant {
    fn from(state: &RobotState) -> Self {
        let [x, y, yaw] = state.at;
        let RobotState { radius_m, driven_m, collisions, is_touching, .. } = *state;
        let chassis = Chassis { world_from_base: pose(x, y, yaw), radius_m, driven_m, collisions, is_touching };
        let twist = |[linear_mps, angular_radps]: [f64; 2]| Twist { linear_mps, angular_radps };
        Self {
            number: state.number,
            chassis,
            height_m: state.height_m,
            velocity: state.velocity.into(),
            command: state.command.map(twist),
            is_waited_for: state.is_waited_for,
            done: state.done,
            rolls: state.rolls.iter().map(|[forward_m, turn_rad]| (*forward_m, *turn_rad)).collect(),
            contacts: state.contacts,
        }
    }
}
