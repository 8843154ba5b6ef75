//! `evaluate people`: missions among people. A robot is set down anywhere in an explored building,
//! finds out where it is, and drives to a place far off.

use crate::files::Files;
use crate::maps::{MapArgs, Variant, short_name};
use crate::output::{OutputArgs, say};
use crate::trials::figures::mean;
use clap::Args;
use client_robot::mission::{self, MissionConfig, MissionGoal, Services};
use client_robot::pilot::PilotConfig;
use client_robot::program::{MissionReport, MissionScore};
use fht_client::{FreeSpaceCache, PathSource, PlannedPath, rules_of_own};
use fht_descriptor::DescriptorNet;
use fht_eval::Survey;
use fht_map::MapState;
use fht_perception::frame::Panorama;
use fht_perception::pose::Point2;
use fht_proto::api::reply::ErrorReply;
use fht_proto::{Descriptor, FixedPoint};
use fht_sim::{PeopleConfig, SimConfig, Simulator};
use serde::Serialize;
use std::collections::BTreeSet;
use std::sync::Arc;

#[derive(Debug, Args)]
pub struct PeopleArgs {
    #[command(flatten)]
    pub maps: MapArgs,
    /// Missions in each building, from starts and to goals drawn by their numbers.
    #[arg(long, default_value_t = 100, value_parser = fht_program::flags::count)]
    pub starts: u64,
    /// By the scanner alone: several times faster.
    #[arg(long)]
    pub no_cameras: bool,
    #[command(flatten)]
    pub output: OutputArgs,
}

/// A robot of another day than the explorer's.
const OTHER_DAY: u64 = 1000;
/// Room around a start, metres.
const CLEARANCE_M: f64 = 0.25;

/// What missions in one building came to.
#[derive(Debug, Serialize)]
struct MissionFigures {
    world: String,
    people: u16,
    starts: usize,
    /// Knew the place, within 1 m and 5 degrees.
    right: usize,
    /// Declared another place first.
    wrong: usize,
    driven_mean_m: Option<f64>,
    driven_max_m: f64,
    arrived: usize,
    /// Driven from the fix to the goal over the shortest way.
    detour_mean: Option<f64>,
    people_touched_by_robot: u64,
    robot_touched_by_people: u64,
    collisions: u64,
    failures: Vec<String>,
}

impl MissionFigures {
    fn of(world: String, people: u16, reports: &[MissionReport]) -> Self {
        let contacts = || reports.iter().filter_map(|report| report.contacts);
        let is_right = |report: &&MissionReport| {
            report.relocalization_error_m.is_some_and(|metres| metres < 1.0)
                && report.relocalization_error_deg.is_some_and(|degrees| degrees < 5.0)
        };
        let driven: Vec<f64> = reports.iter().filter_map(|report| report.relocalization_distance_m).collect();
        let arrived = || reports.iter().filter(|report| report.arrived);
        let detours = arrived().filter_map(|report| Some(report.path_length_m? / report.shortest_length_m?.max(1.0)));
        let right = reports.iter().filter(is_right).count();
        Self {
            world,
            people,
            starts: reports.len(),
            right,
            wrong: reports.iter().filter(|report| report.localized).count() - right,
            driven_mean_m: known(mean(&driven)),
            driven_max_m: driven.iter().copied().fold(0.0, f64::max),
            arrived: arrived().count(),
            detour_mean: known(mean(&detours.collect::<Vec<f64>>())),
            people_touched_by_robot: contacts().map(|contacts| contacts.by_robot).sum(),
            robot_touched_by_people: contacts().map(|contacts| contacts.by_people).sum(),
            collisions: reports.iter().map(|report| report.collisions).sum(),
            failures: reports.iter().filter_map(|report| report.failure.clone()).collect(),
        }
    }

    fn line(&self) -> String {
        let number = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |value| format!("{value:.2}"));
        format!(
            "{}, {} people: {} starts, {} right, {} wrong, after {} m (at most {:.1} m); {} arrived, on {} times the \
             shortest way; the robot touched people {} times, people the robot {} times, and it hit {} things; failed: {:?}",
            self.world,
            self.people,
            self.starts,
            self.right,
            self.wrong,
            number(self.driven_mean_m),
            self.driven_max_m,
            self.arrived,
            number(self.detour_mean),
            self.people_touched_by_robot,
            self.robot_touched_by_people,
            self.collisions,
            self.failures
        )
    }
}

fn known(value: f64) -> Option<f64> {
    Some(value).filter(|value| value.is_finite())
}

impl PeopleArgs {
    /// What it reads and writes.
    pub fn files(&self) -> Files {
        Files::of(&self.output).in_worlds(&self.maps.worlds)
    }
}

pub fn run(args: &PeopleArgs) -> Result<(), String> {
    let mut net =
        (!args.no_cameras).then(|| DescriptorNet::load(None)).transpose().map_err(|error| error.to_string())?;
    let mut all = Vec::new();
    for world in &args.maps.worlds {
        let survey = args.maps.survey(world, Variant::Ours)?;
        let bar = args.output.progress_bar(args.starts, "{bar:40} {pos}/{len} missions, {elapsed} gone, {eta} to go");
        let mut paths = OwnPaths { map: &survey.map, space: FreeSpaceCache::default() };
        let mut reports = Vec::new();
        for start in 1..=args.starts {
            reports.push(one(&survey, args.maps.people, start, &mut paths, net.as_mut())?);
            bar.inc(1);
        }
        bar.finish_and_clear();
        let figures = MissionFigures::of(short_name(world), args.maps.people, &reports);
        say(&figures.line())?;
        all.push(figures);
    }
    args.output.write(&all)
}

/// Paths on the map at hand.
struct OwnPaths<'a> {
    map: &'a MapState,
    space: FreeSpaceCache,
}

impl PathSource for OwnPaths<'_> {
    fn plan(&mut self, from: Point2, to: Point2, blocked: &BTreeSet<FixedPoint>) -> Result<PlannedPath, ErrorReply> {
        self.space.plan(self.map, 0, from, to, &rules_of_own(blocked))
    }
}

fn one(
    survey: &Survey,
    people: u16,
    start: u64,
    paths: &mut OwnPaths<'_>,
    mut net: Option<&mut DescriptorNet>,
) -> Result<MissionReport, String> {
    let day = OTHER_DAY + start;
    let camera_every = if net.is_some() { SimConfig::default().camera_every } else { 0 };
    let config = SimConfig { light_seed: day, camera_every, ..SimConfig::default() };
    let pose = survey.world.random_free_pose(start, CLEARANCE_M);
    let simulator = Simulator::new(Arc::clone(&survey.world), config, pose, day);
    let simulator = simulator.among(PeopleConfig::of(people.into(), day));
    let mut describe = |panorama: &Panorama| -> Option<Descriptor> { net.as_mut()?.descriptor(panorama).ok() };
    let mut services = Services { map: &survey.map, paths, describe: &mut describe };
    let mut score = MissionScore::new(&simulator, &survey.world_from_map);
    let pilot = PilotConfig { seed: day, ..PilotConfig::default() };
    let mission = MissionConfig { pilot, ..MissionConfig::default() };
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    let runtime = runtime.map_err(|error| format!("the async runtime cannot be started: {error}"))?;
    let goal = MissionGoal::FarNode(start);
    let outcome = runtime.block_on(mission::run(simulator, mission, &goal, &mut services, &mut score));
    Ok(score.finish(&outcome.map_err(|error| error.to_string())?))
}
