//! Several explorers in one building, in simulated time and without a network. What each writes
//! reaches the others a second later. Runs repeat exactly; the demo runs the same as processes.

use crate::survey::ExplorationError;
use fht_descriptor::DescriptorNet;
use fht_map::MapState;
use fht_perception::frame::SensorFrame;
use fht_perception::grid::{CellState, OccupancyGrid};
use fht_perception::pose::{Point2, Pose2};
use fht_proto::{AuthorId, Increment, SeenArea};
use fht_sim::scoring::explored_by;
use fht_sim::{SimConfig, Simulator, World};
use mapper::JoinConfig;
use mapper::explore::{Ending, Teammate};
use mapper::program::main_node_errors;
use mapper::{Mapper, MapperConfig, MapperStep};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;

/// Frames until increments reach the others: a second.
const DELAY_FRAMES: u64 = 5;
/// How often a robot tells what it has seen, seconds.
const TELL_EVERY_S: f64 = 5.0;

/// One explorer.
#[derive(Clone)]
pub struct Member {
    /// Where it starts, world frame.
    pub start: Pose2,
    /// When it starts, seconds after the first one.
    pub begins_s: f64,
    /// When it dies, seconds after the first one began, if it does.
    pub dies_s: Option<f64>,
    /// The building that this one finds, if it has changed since the first one started.
    pub world: Option<Arc<World>>,
    /// Whether it looks at everything again.
    pub looks_again: bool,
}

impl Member {
    /// One that starts with the first and does not die.
    #[must_use]
    pub fn at(start: Pose2) -> Self {
        Self { start, begins_s: 0.0, dies_s: None, world: None, looks_again: false }
    }
}

/// A building and its explorers. The first member begins the map; the others join it.
#[derive(Clone)]
pub struct TeamTask {
    /// Who.
    pub members: Vec<Member>,
    /// Seed of noise and wheels; each member has another one.
    pub seed: u64,
    /// Whether nodes carry descriptors.
    pub cameras: bool,
    /// The mapper's parameters.
    pub mapper: MapperConfig,
    /// The run is given up after this time, seconds.
    pub most_s: f64,
}

/// Figures of one explorer.
#[derive(Clone, Debug, Serialize)]
pub struct MemberReport {
    /// How it ended; none if it died.
    pub ending: Option<Ending>,
    /// When, seconds after the first one began.
    pub ended_s: f64,
    /// Seconds and metres after which it knew its place in the map; none if it never did.
    pub joined: Option<[f64; 2]>,
    /// Driven, metres.
    pub driven_m: f64,
    /// How often it touched something.
    pub collisions: u64,
    /// Greatest error of a main node that it made, against the truth in the first one's frame,
    /// metres.
    pub node_error_max_m: f64,
    /// Mean of the same.
    pub node_error_mean_m: f64,
    /// Main nodes that it made and that still exist at the end.
    pub main_nodes: usize,
}

/// Figures of a team.
#[derive(Clone, Debug, Serialize)]
pub struct TeamReport {
    /// When the last one ended, seconds after the first began.
    pub time_s: f64,
    /// Share of the visible free area that some robot has seen.
    pub explored_fraction: f64,
    /// Connected parts of the map: one, if all is well.
    pub parts: usize,
    /// Share of the nodes in the largest part.
    pub largest_part: f64,
    /// Main nodes, support nodes, edges.
    pub counts: [usize; 3],
    /// Each of them.
    pub members: Vec<MemberReport>,
}

/// A team's map.
pub struct TeamRun {
    /// The figures.
    pub report: TeamReport,
    /// The map.
    pub map: MapState,
    /// What it is made of, in the order in which it was delivered.
    pub increments: Vec<Increment>,
    /// The grid of the explorer that ended last, map frame.
    pub grid: OccupancyGrid,
    /// Where the map's frame lies in the world.
    pub world_from_map: Pose2,
}

struct Robot {
    author: AuthorId,
    member: Member,
    mapper: Mapper,
    simulator: Simulator,
    frame: Option<SensorFrame>,
    truth: Vec<Pose2>,
    joined: Option<[f64; 2]>,
    /// Whether it has been given the map.
    has_map: bool,
    /// How it ended, and when.
    ended: Option<(Option<Ending>, f64)>,
}

/// What all have written, and when it reaches the others.
#[derive(Default)]
struct Exchange {
    map: MapState,
    under_way: VecDeque<(u64, Increment)>,
    delivered: Vec<Increment>,
    /// What each has last told of what it has seen.
    offered: BTreeMap<AuthorId, SeenArea>,
    /// The same, once everything that it had written by then was delivered.
    seen: BTreeMap<AuthorId, SeenArea>,
    told_s: Option<f64>,
}

impl Exchange {
    fn put(&mut self, frame: u64, increments: Vec<Increment>) {
        self.under_way.extend(increments.into_iter().map(|increment| (frame + DELAY_FRAMES, increment)));
    }

    /// Up to which number everything of an author was delivered.
    fn acknowledged(&self, author: AuthorId) -> u64 {
        let last = self.delivered.iter().rev().find(|increment| increment.author == author);
        last.map_or(0, |increment| increment.number)
    }

    /// Accepts what was delivered meanwhile. True if there was any.
    fn believe(&mut self) -> bool {
        let offered = std::mem::take(&mut self.offered);
        let (believed, rest) = offered.into_iter().partition(|(author, area)| self.acknowledged(*author) >= area.upto);
        let believed: BTreeMap<AuthorId, SeenArea> = believed;
        self.offered = rest;
        let is_news = !believed.is_empty();
        self.seen.extend(believed);
        is_news
    }

    fn deliver(&mut self, frame: u64) {
        while self.under_way.front().is_some_and(|(due, _)| *due <= frame) {
            let Some((_, increment)) = self.under_way.pop_front() else { break };
            self.map.apply(&increment);
            self.delivered.push(increment);
        }
    }
}

/// Runs a team to its end. `watch` gets the time and the free area about once a simulated minute.
///
/// # Errors
/// [`ExplorationError`].
pub fn explore_as_team(
    world: &Arc<World>,
    task: &TeamTask,
    mut watch: impl FnMut(f64, f64),
) -> Result<TeamRun, ExplorationError> {
    let mut robots = robots(world, task)?;
    let world_from_map = robots.first().ok_or(ExplorationError::Nobody)?.member.start;
    let mut exchange = Exchange::default();
    let mut seen_changes = 0;
    let mut frame = 0_u64;
    let frame_s = SimConfig::default().lidar_period_us as f64 * 1e-6;
    while robots.iter().any(|robot| robot.ended.is_none()) {
        let now_s = frame as f64 * frame_s;
        exchange.deliver(frame);
        if frame.is_multiple_of(DELAY_FRAMES) {
            let changes = exchange.delivered.len();
            let is_news = std::mem::replace(&mut seen_changes, changes) != changes;
            tell(&mut robots, &mut exchange, is_news, now_s);
        }
        for robot in &mut robots {
            robot.live(now_s, task, &mut exchange, frame)?;
        }
        if frame.is_multiple_of((60.0 / frame_s) as u64) {
            watch(now_s, robots.iter().map(|robot| robot.mapper.free_area_m2()).fold(0.0, f64::max));
        }
        frame += 1;
    }
    exchange.deliver(u64::MAX);
    let report = report(world, &robots, &exchange.map, &world_from_map);
    let last = robots.iter().max_by(|a, b| a.ended_s().total_cmp(&b.ended_s())).ok_or(ExplorationError::Nobody)?;
    Ok(TeamRun {
        report,
        grid: last.mapper.grid().clone(),
        map: exchange.map,
        increments: exchange.delivered,
        world_from_map,
    })
}

fn robots(world: &Arc<World>, task: &TeamTask) -> Result<Vec<Robot>, ExplorationError> {
    let net = || task.cameras.then(|| DescriptorNet::load(None)).transpose();
    let sim = SimConfig::default();
    let sim = SimConfig { camera_every: if task.cameras { sim.camera_every } else { 0 }, ..sim };
    let robot = |(number, member): (usize, &Member)| {
        let author = AuthorId::of_robot(&format!("explorer{}", number + 1));
        let join = JoinConfig { looks_again: member.looks_again, ..task.mapper.join.clone() };
        let config = MapperConfig { join, ..task.mapper.clone() };
        let mapper = if number == 0 {
            let mut mapper = Mapper::new(config, author, net()?)?;
            mapper.share(&MapState::new(), 0);
            mapper
        } else {
            Mapper::joining(config, author, net()?, net()?)?
        };
        let seed = task.seed + 1000 * number as u64;
        let world = member.world.as_ref().unwrap_or(world);
        let simulator = Simulator::new(world.clone(), sim.clone(), member.start, seed);
        let (truth, member) = (Vec::new(), member.clone());
        Ok(Robot { author, member, mapper, simulator, frame: None, truth, joined: None, has_map: false, ended: None })
    };
    task.members.iter().enumerate().map(robot).collect()
}

/// Delivers to each what the others told.
fn tell(robots: &mut [Robot], exchange: &mut Exchange, is_news: bool, now_s: f64) {
    let goals: Vec<(AuthorId, Option<Teammate>)> = robots
        .iter()
        .map(|robot| {
            let is_there = now_s >= robot.member.begins_s && !robot.is_dead(now_s);
            let goal = robot.mapper.goal().filter(|_| is_there);
            (robot.author, goal.map(|goal| Teammate::new(robot.author, &goal)))
        })
        .collect();
    if exchange.told_s.is_none_or(|told_s| now_s - told_s >= TELL_EVERY_S) {
        exchange.told_s = Some(now_s);
        for robot in robots.iter().filter(|robot| !robot.is_dead(now_s)) {
            exchange.offered.extend(robot.mapper.seen().map(|area| (robot.author, area)));
        }
    }
    let dead: BTreeSet<AuthorId> =
        robots.iter().filter(|robot| robot.is_dead(now_s)).map(|robot| robot.author).collect();
    let before = exchange.seen.len();
    exchange.seen.retain(|author, _| !dead.contains(author));
    exchange.offered.retain(|author, _| !dead.contains(author));
    let is_seen = exchange.believe() || exchange.seen.len() != before;
    for robot in robots.iter_mut().filter(|robot| robot.ended.is_none() && now_s >= robot.member.begins_s) {
        if is_seen {
            let others = exchange.seen.values().filter(|area| area.author != robot.author);
            robot.mapper.take_seen_areas(&others.cloned().collect::<Vec<_>>());
        }
        let others = goals.iter().filter(|(author, _)| *author != robot.author);
        robot.mapper.set_teammates(others.filter_map(|(_, mate)| mate.clone()).collect());
        if is_news || !std::mem::replace(&mut robot.has_map, true) {
            let acknowledged = exchange.acknowledged(robot.author);
            robot.mapper.take_shared_map(&exchange.map, acknowledged);
        }
    }
}

impl Robot {
    fn is_dead(&self, now_s: f64) -> bool {
        self.member.dies_s.is_some_and(|dies_s| now_s >= dies_s)
    }

    fn ended_s(&self) -> f64 {
        self.ended.map_or(0.0, |(_, at_s)| at_s)
    }

    /// One frame.
    fn live(
        &mut self,
        now_s: f64,
        task: &TeamTask,
        exchange: &mut Exchange,
        frame: u64,
    ) -> Result<(), ExplorationError> {
        if self.ended.is_some() || now_s < self.member.begins_s {
            return Ok(());
        }
        if self.is_dead(now_s) {
            self.ended = Some((None, now_s));
            return Ok(());
        }
        let sensed = match self.frame.take() {
            Some(sensed) => sensed,
            None => self.simulator.sense_first(),
        };
        self.truth.push(self.simulator.truth());
        let step = self.mapper.step(&sensed)?;
        self.mapper.check()?;
        if self.joined.is_none() && self.mapper.is_placed() {
            self.joined = Some([now_s - self.member.begins_s, self.simulator.driven_m()]);
        }
        let ending = match step {
            MapperStep::Drive(_) if now_s > task.most_s => Some(Ending::OutOfTime),
            MapperStep::Drive(twist) => {
                self.frame = Some(self.simulator.step(twist));
                None
            }
            MapperStep::Done(ending) => Some(ending),
        };
        if let Some(ending) = ending {
            self.mapper.finish();
            self.ended = Some((Some(ending), now_s));
        }
        exchange.put(frame, self.mapper.take_increments());
        Ok(())
    }
}

fn report(world: &World, robots: &[Robot], map: &MapState, world_from_map: &Pose2) -> TeamReport {
    let members = robots.iter().map(|robot| member_report(robot, map, world_from_map)).collect();
    let (parts, largest_part) = parts(map);
    let counts = map.counts();
    TeamReport {
        time_s: robots.iter().map(Robot::ended_s).fold(0.0, f64::max),
        explored_fraction: explored(world, robots, world_from_map),
        parts,
        largest_part,
        counts: [counts.main_nodes, counts.support_nodes, counts.edges],
        members,
    }
}

fn member_report(robot: &Robot, map: &MapState, world_from_map: &Pose2) -> MemberReport {
    let errors = main_node_errors(map, &robot.mapper, &robot.truth, world_from_map);
    MemberReport {
        ending: robot.ended.and_then(|(ending, _)| ending),
        ended_s: robot.ended_s(),
        joined: robot.joined,
        driven_m: robot.simulator.driven_m(),
        collisions: robot.simulator.collisions(),
        node_error_max_m: errors.iter().copied().fold(0.0, f64::max),
        node_error_mean_m: errors.iter().sum::<f64>() / errors.len().max(1) as f64,
        main_nodes: errors.len(),
    }
}

/// Share of the visible free area that some robot's grid knows.
fn explored(world: &World, robots: &[Robot], world_from_map: &Pose2) -> f64 {
    let placed: Vec<&OccupancyGrid> =
        robots.iter().filter(|robot| robot.mapper.is_placed()).map(|robot| robot.mapper.grid()).collect();
    let is_known = |place: Point2| placed.iter().any(|grid| grid.state_at(place) != CellState::Unknown);
    explored_by(world.plan(), world_from_map, SimConfig::default().radius_m, is_known).1
}

/// The number of connected parts of a map, and the share of the nodes in the largest.
#[must_use]
pub fn parts(map: &MapState) -> (usize, f64) {
    let mut left: BTreeSet<_> = map.nodes().map(|node| node.id).collect();
    let total = left.len().max(1);
    let mut sizes = Vec::new();
    while let Some(first) = left.pop_first() {
        let (mut waiting, mut size) = (vec![first], 0_usize);
        while let Some(id) = waiting.pop() {
            size += 1;
            waiting.extend(map.neighbours(id).map(|other| other.id).filter(|other| left.remove(other)));
        }
        sizes.push(size);
    }
    (sizes.len(), sizes.into_iter().max().unwrap_or(0) as f64 / total as f64)
}
