//! Everybody in a building, step by step.

use super::body::{Body, BodyKind};
use super::config::PeopleConfig;
use super::person::{Contacts, Doing, Person};
use super::social_force::{drive, repulsion, wall};
use super::stored::{CrowdState, PersonState};
use super::walkways::Walkways;
use crate::plan::FloorPlan;
use fht_perception::pose::Point2;
use nalgebra::Vector2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::collections::{BTreeMap, BTreeSet};

/// Who comes no nearer for so long looks for another place to go, seconds.
const PATIENCE_S: f64 = 8.0;
/// Who is this near to where he wants to stand has arrived, metres.
const ARRIVED_M: f64 = 0.3;
/// People stand around a place, from this far to this much farther, metres.
const RING_M: (f64, f64) = (0.5, 0.7);
/// The way is looked at anew after this long, seconds.
const LOOK_EVERY_S: f64 = 0.2;
/// A robot that comes nearer by less than this drives past, metres per second.
pub(crate) const TOWARDS_MPS: f64 = 0.01;

/// A robot among people: its number, and its body.
pub(crate) type NumberedRobot = (u32, Body);

/// Everybody in a building.
pub(crate) struct Crowd {
    config: PeopleConfig,
    walkways: Walkways,
    people: Vec<Person>,
    rng: ChaCha8Rng,
    time_s: f64,
    looked_s: f64,
    /// By the number of the robot.
    contacts: BTreeMap<u32, Contacts>,
}

impl Crowd {
    /// People on the floor of `plan` that hangs together with `start`, none of them near to
    /// `robot`.
    pub(crate) fn new(plan: &FloorPlan, start: Point2, robot: Point2, config: PeopleConfig) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(config.seed);
        let walkways = Walkways::new(plan, start, &config, &mut rng);
        let mut crowd = Self {
            walkways,
            people: Vec::new(),
            rng,
            time_s: 0.0,
            looked_s: f64::NEG_INFINITY,
            contacts: BTreeMap::new(),
            config,
        };
        for _ in 0..crowd.config.count * 50 {
            if crowd.people.len() >= crowd.config.count {
                break;
            }
            crowd.place_somebody(robot);
        }
        crowd
    }

    fn place_somebody(&mut self, robot: Point2) {
        let Some(position) = self.walkways.any_spot(&mut self.rng) else { return };
        let is_apart = |other: Point2, apart_m: f64| (other - position).norm() >= apart_m;
        let apart_m = 2.5 * self.config.radius_m;
        let is_free = is_apart(robot, self.config.start_apart_m)
            && self.people.iter().all(|other| is_apart(other.body.position, apart_m));
        if !is_free {
            return;
        }
        let deviation: f64 = StandardNormal.sample(&mut self.rng);
        let speed_mps = (self.config.speed_mps + self.config.speed_sigma_mps * deviation).max(0.4);
        let height_m = self.rng.random_range(1.55..1.9);
        let body = Body {
            position,
            velocity: Vector2::zeros(),
            radius_m: self.config.radius_m,
            height_m,
            kind: BodyKind::Person,
        };
        let doing = Doing::Standing { until_s: self.rng.random_range(0.0..self.config.stay_s.1) };
        self.people.push(Person { body, doing, speed_mps, heading: Vector2::zeros(), touches: BTreeSet::new() });
    }

    /// A robot is set down at `robot`: who stands too near is somewhere else at that moment.
    pub(crate) fn make_room(&mut self, robot: Point2) {
        let (near, far): (Vec<_>, Vec<_>) = std::mem::take(&mut self.people)
            .into_iter()
            .partition(|person| (person.body.position - robot).norm() < self.config.start_apart_m);
        self.people = far;
        let wanted = self.people.len() + near.len();
        for _ in 0..near.len() * 50 {
            if self.people.len() >= wanted {
                break;
            }
            self.place_somebody(robot);
        }
    }

    /// Where everybody is.
    pub(crate) fn bodies(&self) -> Vec<Body> {
        self.people.iter().map(|person| person.body).collect()
    }

    /// How they and a robot have touched.
    pub(crate) fn contacts(&self, robot: u32) -> Contacts {
        self.contacts.get(&robot).copied().unwrap_or_default()
    }

    /// How many there are, and what they do by.
    pub(crate) fn config(&self) -> &PeopleConfig {
        &self.config
    }

    /// Where everybody is, and what he is about.
    pub(crate) fn state(&self) -> CrowdState {
        CrowdState {
            people: self.people.iter().map(PersonState::from).collect(),
            drawn: self.rng.get_word_pos(),
            time_s: self.time_s,
            looked_s: self.looked_s,
            contacts: self.contacts.clone(),
        }
    }

    /// Everybody is where `state` says, which must be one of these people in this building.
    pub(crate) fn restore(&mut self, state: &CrowdState) {
        self.people = state.people.iter().map(Person::from).collect();
        self.rng = ChaCha8Rng::seed_from_u64(self.config.seed);
        self.rng.set_word_pos(state.drawn);
        (self.time_s, self.looked_s) = (state.time_s, state.looked_s);
        self.contacts.clone_from(&state.contacts);
    }

    /// Everybody moves for `step_s` seconds. `robots` are in their way.
    pub(crate) fn step(&mut self, plan: &FloorPlan, robots: &[NumberedRobot], step_s: f64) {
        self.time_s += step_s;
        if self.time_s - self.looked_s >= LOOK_EVERY_S - 1e-9 {
            self.looked_s = self.time_s;
            (0..self.people.len()).for_each(|number| self.decide(number, plan));
        }
        let all: Vec<Body> =
            self.people.iter().map(|person| person.body).chain(robots.iter().map(|(_, body)| *body)).collect();
        for number in 0..self.people.len() {
            let velocity = self.next_velocity(number, plan, &all, step_s);
            self.walk(number, velocity, plan, robots, step_s);
        }
    }

    /// A robot wants to go from one place to another: where it gets, which is no farther if it
    /// would run into somebody. That is a contact.
    pub(crate) fn stop_robot(&mut self, robot: u32, from: Point2, to: Point2, radius_m: f64) -> Point2 {
        let mut is_stopped = false;
        for person in &mut self.people {
            let keep_m = person.body.radius_m + radius_m;
            let before_m = (person.body.position - from).norm();
            let after_m = (person.body.position - to).norm();
            if after_m < keep_m && after_m < before_m {
                let is_new = person.touches.insert(robot);
                self.contacts.entry(robot).or_default().by_robot += u64::from(is_new);
                is_stopped = true;
            } else if after_m > keep_m + 0.02 {
                person.touches.remove(&robot);
            }
        }
        if is_stopped { from } else { to }
    }

    /// What somebody does next, and where the way leads.
    fn decide(&mut self, number: usize, plan: &FloorPlan) {
        let person = &self.people[number];
        let here = person.body.position;
        match person.doing {
            Doing::Standing { until_s } if self.time_s < until_s => {}
            Doing::Standing { .. } => self.set_off(number, plan),
            Doing::Walking { place, spot, nearest_m, since_s } => {
                let beside_m = (spot - here).norm();
                let is_in_sight = beside_m < 3.0 && plan.is_clear(here, spot, self.config.radius_m * 0.9);
                let way = self.walkways.way(here, place, plan, self.config.radius_m);
                let (heading, left_m) = match way {
                    _ if is_in_sight => ((spot - here) / beside_m.max(1e-6), beside_m),
                    Some(way) => way,
                    None => (Vector2::zeros(), f64::INFINITY),
                };
                let is_nearer = left_m < nearest_m - 0.1;
                let is_late = self.time_s - since_s > PATIENCE_S;
                let person = &mut self.people[number];
                person.heading = heading;
                if beside_m < ARRIVED_M || (is_late && !is_nearer) {
                    let until_s = self.time_s + self.stay_s();
                    let person = &mut self.people[number];
                    person.doing = Doing::Standing { until_s };
                    person.heading = Vector2::zeros();
                } else if is_nearer {
                    person.doing = Doing::Walking { place, spot, nearest_m: left_m, since_s: self.time_s };
                }
            }
        }
    }

    fn stay_s(&mut self) -> f64 {
        let is_long = self.rng.random_range(0.0..1.0) < self.config.linger_share;
        let (least, most) = if is_long { self.config.linger_s } else { self.config.stay_s };
        self.rng.random_range(least..most)
    }

    /// Somebody sets off to a place drawn at random, to stand beside it.
    fn set_off(&mut self, number: usize, plan: &FloorPlan) {
        if self.walkways.places() == 0 {
            return;
        }
        let place = self.rng.random_range(0..self.walkways.places());
        let angle: f64 = self.rng.random_range(0.0..std::f64::consts::TAU);
        let reach = RING_M.0 + self.rng.random_range(0.0..RING_M.1);
        let middle = self.walkways.place(place);
        let beside = middle + Vector2::new(angle.cos(), angle.sin()) * reach;
        let spot = if plan.is_clear(middle, beside, self.config.radius_m + 0.1) { beside } else { middle };
        let doing = Doing::Walking { place, spot, nearest_m: f64::INFINITY, since_s: self.time_s };
        self.people[number].doing = doing;
    }

    fn next_velocity(&self, number: usize, plan: &FloorPlan, all: &[Body], step_s: f64) -> Vector2<f64> {
        let (config, person) = (&self.config, &self.people[number]);
        let Body { position, velocity, .. } = person.body;
        let mut force = drive(person.heading * person.speed_mps, velocity, config);
        for (other, body) in all.iter().enumerate().filter(|(other, _)| *other != number) {
            let push = repulsion(position - body.position, body, person.heading, config);
            // Who stands only makes room when somebody nearly touches him, or he would wander off.
            let is_near = (position - body.position).norm() < 2.0 * (person.body.radius_m + body.radius_m);
            let is_felt = person.heading != Vector2::zeros() || is_near || other >= self.people.len();
            force += if is_felt { push } else { Vector2::zeros() };
        }
        force += wall(away_from_walls(plan, position), plan.clearance_m(position), config);
        let next = velocity + force * step_s;
        next.cap_magnitude(config.hurry * person.speed_mps)
    }

    /// Somebody walks for a step: not into walls, not into others, and not into a robot.
    fn walk(&mut self, number: usize, velocity: Vector2<f64>, plan: &FloorPlan, robots: &[NumberedRobot], step_s: f64) {
        let radius_m = self.config.radius_m;
        let Body { position, .. } = self.people[number].body;
        let room_now_m = plan.clearance_m(position);
        let has_room = |at: Point2| {
            let room_m = plan.clearance_m(at);
            room_m >= radius_m || room_m > room_now_m
        };
        let is_apart = |at: Point2, other: &Body| {
            let apart_m = (other.position - at).norm();
            apart_m >= radius_m + other.radius_m || apart_m >= (other.position - position).norm()
        };
        let others = self.people.iter().enumerate().filter(|(other, _)| *other != number);
        let others: Vec<Body> = others.map(|(_, person)| person.body).collect();
        let steps = [velocity, Vector2::new(velocity.x, 0.0), Vector2::new(0.0, velocity.y)];
        let fits = |velocity: &&Vector2<f64>| {
            let at = position + **velocity * step_s;
            has_room(at) && others.iter().all(|other| is_apart(at, other))
        };
        let mut velocity = steps.iter().find(fits).copied().unwrap_or_else(Vector2::zeros);
        let at = position + velocity * step_s;
        if let Some((robot, body)) = robots.iter().find(|(_, body)| !is_apart(at, body)) {
            let is_pushing = body.velocity.dot(&(position - body.position).normalize()) > TOWARDS_MPS;
            if self.people[number].touches.insert(*robot) {
                let contacts = self.contacts.entry(*robot).or_default();
                contacts.by_robot += u64::from(is_pushing);
                contacts.by_people += u64::from(!is_pushing);
            }
            velocity = Vector2::zeros();
        }
        let body = &mut self.people[number].body;
        body.position += velocity * step_s;
        body.velocity = velocity;
    }
}

/// The direction in which walls are farther, a unit vector; nothing in the middle between two.
fn away_from_walls(plan: &FloorPlan, at: Point2) -> Vector2<f64> {
    let step_m = 2.0 * plan.resolution_m();
    let room_m = |dx: f64, dy: f64| plan.clearance_m(at + Vector2::new(dx, dy));
    let slope = Vector2::new(room_m(step_m, 0.0) - room_m(-step_m, 0.0), room_m(0.0, step_m) - room_m(0.0, -step_m))
        / (2.0 * step_m);
    slope.cap_magnitude(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A hall of 10 m by 10 m.
    fn hall() -> FloorPlan {
        let is_wall = |index: usize| [index % 200, index / 200].iter().any(|&cell| cell == 0 || cell == 199);
        FloorPlan::new(0.05, Point2::origin(), 200, 200, (0..200 * 200).map(is_wall).collect())
    }

    #[test]
    fn a_robot_that_runs_into_somebody_is_stopped_and_counted_once() {
        let (plan, middle) = (hall(), Point2::new(5.0, 5.0));
        let mut crowd = Crowd::new(&plan, middle, middle, PeopleConfig::of(1, 1));
        let at = crowd.bodies()[0].position;
        let (from, to) = (at - Vector2::new(0.31, 0.0), at - Vector2::new(0.3, 0.0));
        assert_eq!((crowd.stop_robot(0, from, to, 0.105), crowd.stop_robot(0, from, to, 0.105)), (from, from));
        assert_eq!(crowd.contacts(0), Contacts { by_robot: 1, by_people: 0 });
        assert_eq!(crowd.stop_robot(0, to, from, 0.105), from, "away from him it may go");
    }

    #[test]
    fn what_is_stored_of_people_goes_on_as_they_would() {
        let (plan, middle) = (hall(), Point2::new(5.0, 5.0));
        let crowd = || Crowd::new(&plan, middle, middle, PeopleConfig::of(8, 3));
        let (mut these, mut those) = (crowd(), crowd());
        (0..500).for_each(|_| these.step(&plan, &[], 0.02));
        those.restore(&these.state());
        (0..1500).for_each(|_| these.step(&plan, &[], 0.02));
        (0..1500).for_each(|_| those.step(&plan, &[], 0.02));
        assert_eq!(these.bodies(), those.bodies());
    }

    #[test]
    fn nobody_stands_where_a_robot_is_set_down() {
        let (plan, middle) = (hall(), Point2::new(5.0, 5.0));
        let mut crowd = Crowd::new(&plan, middle, middle, PeopleConfig::of(30, 2));
        let here = crowd.bodies()[4].position;
        crowd.make_room(here);
        assert_eq!(crowd.bodies().len(), 30);
        assert!(crowd.bodies().iter().all(|body| (body.position - here).norm() >= 1.5));
    }

    #[test]
    fn who_walks_into_a_robot_that_stands_did_it_himself() {
        let (plan, middle) = (hall(), Point2::new(5.0, 5.0));
        let mut crowd = Crowd::new(&plan, middle, middle, PeopleConfig::of(1, 1));
        let at = crowd.bodies()[0].position;
        let robot = Body {
            position: at + Vector2::new(0.31, 0.0),
            velocity: Vector2::zeros(),
            radius_m: 0.105,
            height_m: 0.19,
            kind: BodyKind::Robot,
        };
        crowd.walk(0, Vector2::new(1.0, 0.0), &plan, &[(0, robot)], 0.02);
        assert_eq!(crowd.contacts(0), Contacts { by_robot: 0, by_people: 1 });
        assert_eq!(crowd.bodies()[0].position, at);
    }
}
