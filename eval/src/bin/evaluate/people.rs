//! `evaluate people`: missions among people. A robot is set down anywhere in an explored building,
//! finds out where it is, and drives to a place far off.

use crate::files::Files;
use crate::maps::{MapArgs, Variant, short_name};
use crate::missions::{Missions, is_right};
use crate::output::{OutputArgs, say};
use crate::trials::figures::mean;
use clap::Args;
use client_robot::mission::MissionGoal;
use client_robot::pilot::PilotConfig;
use client_robot::program::MissionReport;
use fht_descriptor::DescriptorNet;
use serde::Serialize;

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
        let driven: Vec<f64> = reports.iter().filter_map(|report| report.relocalization_distance_m).collect();
        let arrived = || reports.iter().filter(|report| report.arrived);
        let detours = arrived().filter_map(|report| Some(report.path_length_m? / report.shortest_length_m?.max(1.0)));
        let right = reports.iter().filter(|report| is_right(report)).count();
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
        let mut missions = Missions::new(&survey, args.maps.people);
        let mut reports = Vec::new();
        for start in 1..=args.starts {
            let goal = MissionGoal::FarNode(start);
            reports.push(missions.run(start, &goal, PilotConfig::default(), net.as_mut())?);
            bar.inc(1);
        }
        bar.finish_and_clear();
        let figures = MissionFigures::of(short_name(world), args.maps.people, &reports);
        say(&figures.line())?;
        all.push(figures);
    }
    args.output.write(&all)
}
