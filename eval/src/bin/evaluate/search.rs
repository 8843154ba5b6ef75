//! `evaluate search`: robots that are set down anywhere drive as they like until they know where
//! they are.

use crate::files::Files;
use crate::maps::{MapArgs, Variant, short_name};
use crate::missions::{Missions, is_right};
use crate::numbers::metres;
use crate::output::{OutputArgs, number, say};
use crate::trials::figures::mean;
use clap::Args;
use client_robot::mission::MissionGoal;
use client_robot::pilot::PilotConfig;
use client_robot::program::MissionReport;
use fht_descriptor::DescriptorNet;
use fht_navigation::disambiguation::DisambiguationConfig;
use serde::Serialize;

#[derive(Debug, Args)]
pub struct SearchArgs {
    #[command(flatten)]
    pub maps: MapArgs,
    /// Starts in each building, drawn by their numbers.
    #[arg(long, default_value_t = 100, value_parser = fht_program::flags::count)]
    pub starts: u64,
    /// Distance after which a robot gives up, metres.
    #[arg(long, default_value_t = 40.0, value_parser = metres)]
    pub drive_m: f64,
    /// Robots only wander, and do not drive to what tells places apart.
    #[arg(long)]
    pub wander: bool,
    /// By the scanner alone, the map as well.
    #[arg(long)]
    pub no_cameras: bool,
    #[command(flatten)]
    pub output: OutputArgs,
}

/// What became of one start.
#[derive(Debug, Serialize)]
struct SearchOutcome {
    start: u64,
    /// In the map frame: x, y, yaw.
    at: [f64; 3],
    /// Whether the declared place is right; none was declared otherwise.
    right: Option<bool>,
    driven_m: f64,
}

/// What searches in one building came to.
#[derive(Debug, Serialize)]
struct SearchFigures {
    world: String,
    starts: usize,
    /// Declared their place within 1 m and 5 degrees.
    right: usize,
    /// Declared another.
    wrong: usize,
    /// Declared none.
    none: usize,
    /// Driven until a right place was declared.
    driven_mean_m: f64,
    driven_max_m: f64,
    error_median_m: f64,
    collisions: u64,
    outcomes: Vec<SearchOutcome>,
}

impl SearchFigures {
    fn of(world: String, drive_m: f64, reports: &[MissionReport]) -> Self {
        let outcome = |(start, report): (u64, &MissionReport)| SearchOutcome {
            start,
            at: report.start,
            right: report.localized.then(|| is_right(report)),
            driven_m: report.relocalization_distance_m.unwrap_or(drive_m),
        };
        let outcomes: Vec<SearchOutcome> = (1..).zip(reports).map(outcome).collect();
        let count = |right: Option<bool>| outcomes.iter().filter(|outcome| outcome.right == right).count();
        let right = || outcomes.iter().filter(|outcome| outcome.right == Some(true));
        let driven: Vec<f64> = right().map(|outcome| outcome.driven_m).collect();
        let known = reports.iter().filter(|report| is_right(report));
        let mut errors: Vec<f64> = known.filter_map(|report| report.relocalization_error_m).collect();
        errors.sort_by(f64::total_cmp);
        Self {
            world,
            starts: reports.len(),
            right: count(Some(true)),
            wrong: count(Some(false)),
            none: count(None),
            driven_mean_m: mean(&driven),
            driven_max_m: driven.iter().copied().fold(0.0, f64::max),
            error_median_m: errors.get(errors.len() / 2).copied().unwrap_or(f64::NAN),
            collisions: reports.iter().map(|report| report.collisions).sum(),
            outcomes,
        }
    }

    fn line(&self) -> String {
        format!(
            "{}: {} starts, {} right, {} wrong, {} none; driven {} m on average, {} m at most; off by {} m (median); \
             {} collisions",
            self.world,
            self.starts,
            self.right,
            self.wrong,
            self.none,
            number(self.driven_mean_m, 2),
            number(self.driven_max_m, 1),
            number(self.error_median_m, 3),
            self.collisions
        )
    }
}

impl SearchArgs {
    /// What it reads and writes.
    pub fn files(&self) -> Files {
        Files::of(&self.output).in_worlds(&self.maps.worlds)
    }

    fn pilot(&self) -> PilotConfig {
        let usual = PilotConfig::default();
        let never = DisambiguationConfig { after_m: f64::INFINITY, ..usual.disambiguate.clone() };
        let disambiguate = if self.wander { never } else { usual.disambiguate.clone() };
        PilotConfig { disambiguate, max_search_m: self.drive_m, ..usual }
    }
}

pub fn run(args: &SearchArgs) -> Result<(), String> {
    let net = (!args.no_cameras).then(|| DescriptorNet::load(None)).transpose();
    let mut net = net.map_err(|error| error.to_string())?;
    let mut all = Vec::new();
    for world in &args.maps.worlds {
        let survey = args.maps.survey_with(world, Variant::Ours, !args.no_cameras)?;
        let bar = args.output.progress_bar(args.starts, "{bar:40} {pos}/{len} starts, {elapsed} gone, {eta} to go");
        let mut missions = Missions::new(&survey, args.maps.people);
        let mut reports = Vec::new();
        for start in 1..=args.starts {
            reports.push(missions.run(start, &MissionGoal::None, args.pilot(), net.as_mut())?);
            bar.inc(1);
        }
        bar.finish_and_clear();
        let figures = SearchFigures::of(short_name(world), args.drive_m, &reports);
        say(&figures.line())?;
        all.push(figures);
    }
    args.output.write(&all)
}
