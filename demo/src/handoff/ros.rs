//! The demo over ROS topics: each robot is a simulated one that speaks ROS 2, at a router of its
//! own, and explorer and client drive it by its topics. What came of it is judged by what is said
//! on the graphs.

use super::client::{ClientReport, drive};
use super::config::{HandoffConfig, HandoffError};
use super::explorers::{Explored, Line, Witness};
use super::judge::{Judge, Moment, driven_m, mean_error_m};
use super::programs::{Bars, read_report};
use super::report::{ContactFigures, ExplorerFigures, RosFigures};
use crate::process::{Process, Role, free_endpoint};
use client_robot::program::AT_GOAL_M;
use fht_perception::pose::{Point2, Pose2};
use fht_proto::{MapName, SharedWorldName};
use fht_ros_robot::IntakeReport;
use fht_ros_sim::SimRobotReport;
use fht_sim::SimConfig;
use fht_sim::scoring::pose_error;
use mapper::program::RosExploreReport;
use nalgebra::Vector2;
use serde::Deserialize;
use std::ffi::OsString;
use std::path::PathBuf;
use std::time::Duration;

/// How long a router may take to listen, and a robot to end.
const PATIENCE: Duration = Duration::from_secs(20);

/// A simulated robot that speaks ROS 2, with its router.
struct RosRig {
    endpoint: String,
    router: Process,
    robot: Process,
    report: PathBuf,
    judge: Judge,
}

impl RosRig {
    fn start(config: &HandoffConfig, shared: Option<&SharedWorldName>, place: Place) -> Result<Self, HandoffError> {
        let endpoint = free_endpoint()?;
        let mut router = Process::start(&config.executable, Role::Sim, ["router", "--listen", &endpoint])?;
        router.wait_until_listening(&endpoint, PATIENCE)?;
        let judge = Judge::start(&endpoint)?;
        let report = config.folder.join(format!("robot-of-{}.json", place.name));
        let mut args: Vec<OsString> = ["robot", "--ros", &endpoint, "--in-step", "--quiet"].map(Into::into).into();
        let mut add = |name: &str, value: OsString| args.extend([name.into(), value]);
        add("--world", config.world.as_str().into());
        add("--world-seed", config.seed.to_string().into());
        add("--seed", place.seed.to_string().into());
        add("--people", config.people.to_string().into());
        add("--robot", place.name.into());
        add("--report", report.clone().into());
        if let Some(name) = shared {
            add("--shared-world", name.as_str().into());
        }
        if place.is_anywhere {
            args.push("--anywhere".into());
        }
        let robot = Process::start(&config.executable, Role::Sim, args)?;
        Ok(Self { endpoint, router, robot, report, judge })
    }

    /// Ends robot and router, and returns what was said and what truly happened.
    fn finish(self, world_from_map: &Pose2) -> Result<(Vec<Moment>, SimRobotReport, f64), HandoffError> {
        let cpu_s = self.robot.cpu_s() + self.router.cpu_s();
        self.robot.ask_to_end();
        self.robot.finish(PATIENCE)?;
        Ok((self.judge.moments(world_from_map), read_report(&self.report)?, cpu_s))
    }
}

/// Where a robot begins.
struct Place {
    name: &'static str,
    seed: u64,
    is_anywhere: bool,
}

/// Explores with a ROS robot.
pub(super) fn explore(
    config: &HandoffConfig,
    map: &MapName,
    bars: &Bars,
    shared: Option<&SharedWorldName>,
) -> Result<(Explored, RosFigures), HandoffError> {
    let world = fht_sim::load(&config.world, config.textures.as_deref(), config.seed)?;
    let witness = Witness::start(config, map)?;
    let place = Place { name: "explorer", seed: config.seed, is_anywhere: false };
    let rig = RosRig::start(config, shared, place)?;
    let report = config.folder.join("explorer.json");
    let mut args: Vec<OsString> =
        ["explore", "--ros", &rig.endpoint, "--progress-json", "--use-sim-time"].map(Into::into).into();
    args.extend(["--map", map.as_str(), "--connect", &config.endpoint].map(Into::into));
    args.extend(["--report".into(), report.clone().into_os_string()]);
    let bar = bars.add("explorer".to_owned());
    Process::start(&config.executable, Role::Mapper, args)?.follow(|line| {
        if let Ok(line) = serde_json::from_str::<Line>(line) {
            line.show(&bar);
        }
    })?;
    bar.finish_with_message("done");
    let explored: RosExploreReport = read_report(&report)?;
    let world_from_map = world.start();
    let (moments, truth, cpu_s) = rig.finish(&world_from_map)?;
    let (free_area_m2, explored_fraction) = witness.explored(&world);
    let at = world_from_map.translation;
    let explorer = ExplorerFigures {
        robot: "explorer".to_owned(),
        ending: explored.map.ending.to_string(),
        joined: None,
        driven_m: Some(truth.driven_m),
        sim_s: Some(explored.robot_s),
    };
    let figures = RosFigures::of(&explored.intake, cpu_s);
    Ok((
        Explored {
            world_from_map: [at.x, at.y, world_from_map.rotation.angle()],
            free_area_m2,
            explored_fraction,
            main_nodes: explored.map.main_nodes,
            support_nodes: explored.map.support_nodes,
            edges: explored.map.edges,
            map_bytes: explored.map.map_bytes,
            wire_bytes: explored.map.wire_bytes,
            error_mean_m: mean_error_m(&moments),
            driven_m: truth.driven_m,
            collisions: truth.collisions,
            contacts: ContactFigures::of(truth.people, truth.robots),
            sim_s: explored.robot_s,
            state: explored.map.vector.map(|vector| (vector, explored.map.digest)),
            explorers: vec![explorer],
        },
        figures,
    ))
}

/// The part of the client's report that the demo shows.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct RosClientReport {
    #[serde(flatten)]
    intake: IntakeReport,
    goal: Option<[f64; 2]>,
    arrived: bool,
    failure: Option<String>,
    robot_s: f64,
}

/// Drops another robot somewhere, which finds its place and drives to a goal.
pub(super) fn client(
    config: &HandoffConfig,
    map: &MapName,
    explored: &Explored,
    bars: &Bars,
    shared: Option<&SharedWorldName>,
) -> Result<(ClientReport, RosFigures), HandoffError> {
    // Another day: other noise, other wheels.
    let seed = 1000 + config.seed;
    let rig = RosRig::start(config, shared, Place { name: "client", seed, is_anywhere: true })?;
    let report = config.folder.join("client.json");
    let mut args: Vec<OsString> =
        ["go", "--ros", &rig.endpoint, "--to", "random", "--quiet", "--use-sim-time"].map(Into::into).into();
    args.extend(["--seed", &seed.to_string(), "--map", map.as_str(), "--connect", &config.endpoint].map(Into::into));
    args.extend(["--report".into(), report.clone().into_os_string()]);
    let said: RosClientReport = drive(config, bars, args, &report)?;
    let [x, y, yaw] = explored.world_from_map;
    let world_from_map = fht_perception::pose::pose(x, y, yaw);
    let (moments, truth, cpu_s) = rig.finish(&world_from_map)?;
    let world = fht_sim::load(&config.world, config.textures.as_deref(), config.seed)?;
    let shortest = |from: &Pose2, to: [f64; 2]| {
        let from = Point2::from((world_from_map * from).translation.vector);
        let to = world_from_map * Point2::new(to[0], to[1]);
        let points = world.plan().shortest_path(from, to, SimConfig::default().radius_m)?;
        Some(points.windows(2).map(|pair| (pair[1] - pair[0]).norm()).sum())
    };
    let figures = RosFigures::of(&said.intake, cpu_s);
    Ok((judged(&said, &moments, &truth, shortest), figures))
}

/// The client's figures, as the truth has them.
fn judged(
    said: &RosClientReport,
    moments: &[Moment],
    truth: &SimRobotReport,
    shortest: impl Fn(&Pose2, [f64; 2]) -> Option<f64>,
) -> ClientReport {
    let at_fix = moments.iter().position(|moment| moment.belief.is_some());
    let error_of = |moment: &Moment| Some(pose_error(&moment.belief?, &moment.truth));
    let fix = at_fix.and_then(|index| error_of(&moments[index]));
    let last = moments.last();
    let goal_distance_m =
        said.goal.zip(last).map(|(goal, last)| (last.truth.translation.vector - Vector2::from(goal)).norm());
    let is_there = goal_distance_m.is_some_and(|metres| metres < AT_GOAL_M);
    let wrong = || "the robot says that it arrived, but it is not at its goal".to_owned();
    let place = |at: &Pose2| [at.translation.x, at.translation.y];
    let start = moments.first().map_or([0.0; 3], |first| {
        let [x, y] = place(&first.truth);
        [x, y, first.truth.rotation.angle()]
    });
    ClientReport {
        start,
        goal: said.goal,
        localized: at_fix.is_some(),
        relocalization_distance_m: at_fix.map(|index| driven_m(&moments[..=index])),
        relocalization_error_m: fix.map(|(metres, _)| metres),
        relocalization_error_deg: fix.map(|(_, degrees)| degrees),
        final_error_m: last.and_then(error_of).map(|(metres, _)| metres),
        arrived: said.arrived && is_there,
        goal_distance_m,
        failure: said.failure.clone().or_else(|| (said.arrived && !is_there).then(wrong)),
        path_length_m: at_fix.map(|index| driven_m(&moments[index..])),
        shortest_length_m: at_fix.zip(said.goal).and_then(|(index, goal)| shortest(&moments[index].truth, goal)),
        collisions: truth.collisions,
        contacts: truth.people,
        robot_contacts: truth.robots,
        sim_s: said.robot_s,
        trajectory: moments.iter().filter_map(|moment| Some(place(&moment.belief?))).collect(),
        true_trajectory: moments.iter().map(|moment| place(&moment.truth)).collect(),
    }
}
