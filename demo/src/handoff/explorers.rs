//! The explorers of the demo: one, several at once, or one that dies half-way and another that
//! finishes the job.

use super::config::{Crew, HandoffConfig, HandoffError};
use super::programs::{Bars, read_report, session, world_args};
use super::report::{ContactFigures, ExplorerFigures};
use crate::process::{Process, Role, is_over};
use fht_perception::pose::Point2;
use fht_proto::api::keys::{RobotTopic, robots_of};
use fht_proto::{Digest, MapName, SeenArea, SharedWorldName, Square, VersionVector, decode};
use fht_sim::scoring::explored_by;
use fht_sim::{SimConfig, World, start_near};
use indicatif::ProgressBar;
use mapper::explore::SeenSquares;
use mapper::program::ExploreReport;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::sync::mpsc::Sender;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use zenoh::Wait;
use zenoh::pubsub::Subscriber;
use zenoh::sample::Sample;

/// The result of the exploration.
pub(super) struct Explored {
    pub(super) world_from_map: [f64; 3],
    pub(super) free_area_m2: f64,
    pub(super) explored_fraction: f64,
    pub(super) main_nodes: usize,
    pub(super) support_nodes: usize,
    pub(super) edges: usize,
    pub(super) map_bytes: u64,
    pub(super) wire_bytes: u64,
    pub(super) error_mean_m: f64,
    pub(super) driven_m: f64,
    pub(super) collisions: u64,
    pub(super) contacts: ContactFigures,
    pub(super) sim_s: f64,
    /// The explorer's own map, if it was alone: its increments and its digest. Of several, the last
    /// may have ended before the last increment of another arrived.
    pub(super) state: Option<(VersionVector, Digest)>,
    pub(super) explorers: Vec<ExplorerFigures>,
}

/// Robot seconds per second of explorers that work at once. Unpaced, they would not be equally
/// fast.
const TEAM_RATE: &str = "8";
/// The others start within this distance of the first, in its sight, metres.
const APART_M: f64 = 3.0;
/// Share of the building after which the explorer of a succession dies.
const DIES_AT: f64 = 0.5;

/// A line of an explorer's progress.
#[derive(Deserialize)]
pub(super) struct Line {
    sim_s: f64,
    free_area_m2: f64,
    nodes: usize,
    written: u64,
    acknowledged: u64,
    #[serde(default = "yes")]
    placed: bool,
}

/// A robot that begins a map knows its place.
fn yes() -> bool {
    true
}

impl Line {
    pub(super) fn show(&self, bar: &ProgressBar) {
        let Self { free_area_m2, nodes, acknowledged, written, sim_s, placed } = self;
        let place = if *placed { "" } else { "looking for its place, " };
        bar.set_message(format!(
            "{place}{free_area_m2:.0} m² free, {nodes} nodes on the map, {acknowledged} of {written} increments stored, \
             {sim_s:.0} s of robot time"
        ));
    }
}

/// Explores; `shared` is the world that the explorers share.
pub(super) fn explore(
    config: &HandoffConfig,
    map: &MapName,
    bars: &Bars,
    shared: Option<&SharedWorldName>,
) -> Result<Explored, HandoffError> {
    let world = fht_sim::load(&config.world, config.textures.as_deref(), config.seed)?;
    let job = Job { config, map, world: &world, bars, shared };
    match config.crew {
        Crew::One => {
            let report = job.run(0, false, None)?;
            let state = report.map.vector.clone().map(|vector| (vector, report.map.digest));
            Ok(Explored { state, ..sum(vec![(name(0), report)], None) })
        }
        Crew::Team(count) => {
            let witness = Witness::start(config, map)?;
            let job = &job;
            let outcomes = std::thread::scope(|scope| {
                // The first explorer sets the map's frame, so the others start after it has begun
                // the map.
                let (begun, is_begun) = std::sync::mpsc::channel();
                let first = scope.spawn(move || job.run_in_team(0, Some(begun)));
                // If the first one fails before that, there is nothing to join.
                let count = if is_begun.recv().is_ok() { count } else { 1 };
                let others = (1..count).map(|number| scope.spawn(move || job.run_in_team(number, None)));
                let threads: Vec<_> = std::iter::once(first).chain(others).collect();
                let joined = threads.into_iter().map(|thread| thread.join().map_err(|_| HandoffError::Thread));
                joined.collect::<Result<Vec<_>, HandoffError>>()
            })?;
            let (_, seen) = witness.explored(&world);
            let (mut reports, mut failures) = (Vec::new(), Vec::new());
            for (number, outcome) in outcomes.into_iter().enumerate() {
                match outcome {
                    Ok(report) => reports.push((name(number), report)),
                    Err(error) => failures.push((number, error)),
                }
            }
            // The others have explored what one that failed had not.
            if reports.is_empty() && !failures.is_empty() {
                return Err(failures.swap_remove(0).1);
            }
            let mut explored = sum(reports, Some(seen));
            for (number, error) in failures {
                explored.explorers.insert(number, failed(number, &error));
            }
            Ok(explored)
        }
        Crew::Succession => {
            let witness = Witness::start(config, map)?;
            let died_s = job.run_until_half()?;
            let report = job.run(1, false, None)?;
            let mut explored = sum(vec![(name(1), report)], Some(witness.explored(&world).1));
            let ending = "killed".to_owned();
            let dead = ExplorerFigures { robot: name(0), ending, joined: None, driven_m: None, sim_s: Some(died_s) };
            explored.explorers.insert(0, dead);
            explored.sim_s += died_s;
            Ok(explored)
        }
    }
}

fn name(number: usize) -> String {
    if number == 0 { "explorer".to_owned() } else { format!("explorer{}", number + 1) }
}

/// What all explorers are given.
struct Job<'a> {
    config: &'a HandoffConfig,
    map: &'a MapName,
    world: &'a World,
    bars: &'a Bars,
    shared: Option<&'a SharedWorldName>,
}

impl Job<'_> {
    /// The arguments of one explorer: the first starts at the world's start, the others near it.
    fn args(&self, number: usize, is_paced: bool) -> Vec<std::ffi::OsString> {
        let Self { config, map, world, .. } = self;
        let report = config.folder.join(format!("{}.json", name(number)));
        let mut args = vec!["explore".into()];
        args.extend(world_args(config, map, &report, self.shared));
        let seed = (config.seed + 1000 * number as u64).to_string();
        let robot = ["--light-seed", "0", "--progress-json", "--robot", &name(number)];
        args.extend(["--seed", &seed].into_iter().chain(robot).map(Into::into));
        if number > 0 {
            let start = start_near(world, &world.start(), APART_M, config.seed + number as u64);
            let start = format!("{},{},{}rad", start.translation.x, start.translation.y, start.rotation.angle());
            args.extend(["--start", &start].map(Into::into));
        }
        if is_paced {
            args.extend(["--rate", TEAM_RATE].map(Into::into));
        }
        args
    }

    fn start(&self, number: usize, is_paced: bool) -> Result<Process, HandoffError> {
        Ok(Process::start(&self.config.executable, Role::Mapper, self.args(number, is_paced))?)
    }

    /// Runs one explorer to its end. `begun` gets a message once the server has stored something of
    /// it.
    fn run(&self, number: usize, is_paced: bool, mut begun: Option<Sender<()>>) -> Result<ExploreReport, HandoffError> {
        let bar = self.bars.add(name(number));
        self.start(number, is_paced)?.follow(|line| {
            if let Ok(line) = serde_json::from_str::<Line>(line) {
                line.show(&bar);
                if line.acknowledged > 0
                    && let Some(begun) = begun.take()
                {
                    let _ = begun.send(()); // nobody waits for it twice
                }
            }
        })?;
        bar.finish_with_message("done");
        read_report(&self.config.folder.join(format!("{}.json", name(number))))
    }

    /// The same, beside others: if it fails, that is said at once.
    fn run_in_team(&self, number: usize, begun: Option<Sender<()>>) -> Result<ExploreReport, HandoffError> {
        /// Ctrl-C is sent to the explorers, too, and may reach them before this program.
        const TO_HEAR_OF_IT: Duration = Duration::from_millis(300);
        self.run(number, true, begun).inspect_err(|error| {
            std::thread::sleep(TO_HEAR_OF_IT);
            if !is_over() {
                self.bars.say(&format!("{}: {error}", name(number)));
            }
        })
    }

    /// Runs the first explorer until it has seen half of the building, and kills it. Returns how
    /// long it worked, robot seconds.
    fn run_until_half(&self) -> Result<f64, HandoffError> {
        let (world, plan) = (self.world, self.world.plan());
        let free = plan.reachable_free(Point2::from(world.start().translation.vector), SimConfig::default().radius_m);
        let enough_m2 = DIES_AT * plan.area_m2(&free);
        let bar = self.bars.add(name(0));
        let mut process = self.start(0, false)?;
        let mut died_s = 0.0;
        process.listen(|line| {
            let Ok(line) = serde_json::from_str::<Line>(line) else { return true };
            line.show(&bar);
            died_s = line.sim_s;
            line.free_area_m2 < enough_m2
        });
        process.kill()?;
        bar.finish_with_message(format!("killed half-way, after {died_s:.0} s of robot time"));
        Ok(died_s)
    }
}

/// What is known of an explorer that failed: not what it said before.
fn failed(number: usize, error: &HandoffError) -> ExplorerFigures {
    let ending = error.to_string().lines().next().unwrap_or_default().to_owned();
    ExplorerFigures { robot: name(number), ending, joined: None, driven_m: None, sim_s: None }
}

fn contacts_of(report: &ExploreReport) -> ContactFigures {
    let people = report.people.map(|people| people.contacts).unwrap_or_default();
    let robots = report.robots.map(|robots| robots.contacts).unwrap_or_default();
    ContactFigures::of(people, robots)
}

/// Sums up several reports. The map is the last one's, the frame the first one's.
fn sum(reports: Vec<(String, ExploreReport)>, explored_fraction: Option<f64>) -> Explored {
    let all = || reports.iter().map(|(_, report)| report);
    let errors = || all().filter_map(|report| report.trajectory_error);
    let most = |of: fn(&ExploreReport) -> usize| all().map(of).max().unwrap_or(0);
    let figures = |(robot, report): &(String, ExploreReport)| ExplorerFigures {
        robot: robot.clone(),
        ending: report.map.ending.to_string(),
        joined: report.joined,
        driven_m: Some(report.driven_m),
        sim_s: Some(report.sim_s),
    };
    Explored {
        world_from_map: all().map(|report| report.world_from_map).next().unwrap_or_default(),
        free_area_m2: all().map(|report| report.free_area_m2).fold(0.0, f64::max),
        explored_fraction: explored_fraction
            .unwrap_or_else(|| all().filter_map(|report| report.explored_fraction).fold(0.0, f64::max)),
        main_nodes: most(|report| report.map.main_nodes),
        support_nodes: most(|report| report.map.support_nodes),
        edges: most(|report| report.map.edges),
        map_bytes: all().map(|report| report.map.map_bytes).sum(),
        wire_bytes: all().map(|report| report.map.wire_bytes).sum(),
        error_mean_m: errors().map(|error| error.mean_m).fold(0.0, f64::max),
        driven_m: all().map(|report| report.driven_m).sum(),
        collisions: all().map(|report| report.collisions).sum(),
        contacts: all().map(contacts_of).fold(ContactFigures::default(), |sum, more| sum + more),
        sim_s: all().map(|report| report.sim_s).fold(0.0, f64::max),
        state: None,
        explorers: reports.iter().map(figures).collect(),
    }
}

/// What the explorers report to have seen.
pub(super) struct Witness {
    seen: Arc<Mutex<BTreeMap<String, SeenArea>>>,
    session: zenoh::Session,
    subscriber: Subscriber<()>,
    _runtime: tokio::runtime::Runtime,
}

impl Witness {
    pub(super) fn start(config: &HandoffConfig, map: &MapName) -> Result<Self, HandoffError> {
        let (runtime, session) = session(config)?;
        let seen: Arc<Mutex<BTreeMap<String, SeenArea>>> = Arc::default();
        let hearing = Arc::clone(&seen);
        let hear = move |sample: Sample| {
            if let Ok(area) = decode::<SeenArea>(&sample.payload().to_bytes()) {
                let mut seen = hearing.lock().unwrap_or_else(PoisonError::into_inner);
                seen.insert(sample.key_expr().to_string(), area);
            }
        };
        let subscriber = session.declare_subscriber(robots_of(map, RobotTopic::Seen)).callback(hear).wait()?;
        Ok(Self { seen, session, subscriber, _runtime: runtime })
    }

    /// The free area that a robot can reach, square metres, and the share of it that some explorer
    /// has seen.
    pub(super) fn explored(self, world: &World) -> (f64, f64) {
        /// Cell size in which squares are looked up, metres.
        const CELL_M: f64 = 0.05;
        let seen = self.seen.lock().unwrap_or_else(PoisonError::into_inner);
        let squares: Vec<SeenSquares> = seen.values().filter_map(|area| SeenSquares::new(area, CELL_M)).collect();
        let is_known = |place: Point2| squares.iter().any(|squares| squares.square_at(place) != Square::Unseen);
        let area_and_share = explored_by(world.plan(), &world.start(), SimConfig::default().radius_m, is_known);
        drop(seen);
        // A dropped session closes anyway, so errors do no harm.
        let _ = self.subscriber.undeclare().wait();
        let _ = self.session.close().wait();
        area_and_share
    }
}
