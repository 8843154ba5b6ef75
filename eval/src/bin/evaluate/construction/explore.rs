//! `evaluate explore`: how accurate maps are after whole explorations of simulated buildings.

use crate::files::Files;
use crate::numbers::drift;
use crate::output::{OutputArgs, say};
use clap::Args;
use fht_program::flags::count;
use fht_proto::MapName;
use fht_sim::scoring::TrajectoryError;
use fht_sim::{SimConfig, SimSetup};
use mapper::explore::Ending;
use mapper::program::{ExploreReport, ExploreTask, explore};
use mapper::run::MappingTask;
use serde::Serialize;

#[derive(Debug, Args)]
pub struct ExploreArgs {
    /// Buildings: museum, office, or paths of Nav2 map.yaml or Gazebo .world files, separated
    /// by commas.
    #[arg(long, value_delimiter = ',', default_value = "museum,office")]
    worlds: Vec<String>,
    /// Seeds of noise and light, from 1 up to this.
    #[arg(long, default_value_t = 10, value_parser = count)]
    seeds: u64,
    /// Factors of the wheels' drift, separated by commas.
    #[arg(long, value_delimiter = ',', default_value = "1,2", value_parser = drift)]
    drifts: Vec<f64>,
    /// Numbers of people who walk about meanwhile, separated by commas.
    #[arg(long, value_delimiter = ',', default_value = "0")]
    people: Vec<u16>,
    /// Without cameras: several times faster, and loops are closed by geometry alone.
    #[arg(long)]
    no_cameras: bool,
    #[command(flatten)]
    output: OutputArgs,
}

/// One exploration.
#[derive(Debug, Serialize)]
struct Row {
    world: String,
    seed: u64,
    drift: f64,
    people: u16,
    report: ExploreReport,
}

impl ExploreArgs {
    /// What it reads and writes.
    pub fn files(&self) -> Files {
        Files::of(&self.output).in_worlds(&self.worlds)
    }
}

pub fn run(args: &ExploreArgs) -> Result<(), String> {
    let count = args.worlds.len() * args.drifts.len() * args.people.len() * args.seeds as usize;
    let bar = args.output.progress_bar(count as u64, "{bar:40} {pos}/{len} {msg}, {elapsed} gone, {eta} to go");
    say(
        "| world | drift | people | seed | as known then: mean, greatest | as known at the end | main nodes within 0.05 m | greatest | closures | ended, after | people touched by the robot, touched it | returns on people |",
    )?;
    say("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |")?;
    let mut rows = Vec::new();
    for world in &args.worlds {
        for &drift in &args.drifts {
            let runs = args.people.iter().flat_map(|&people| (1..=args.seeds).map(move |seed| (people, seed)));
            for (people, seed) in runs {
                bar.set_message(format!("{world}, drift {drift}, {people} people, seed {seed}"));
                let setup = SimSetup { seed, people, ..SimSetup::of(world) };
                let report = explore_once(setup, drift, !args.no_cameras)?;
                let row = Row { world: world.clone(), seed, drift, people, report };
                bar.suspend(|| say(&line(&row)))?;
                bar.inc(1);
                rows.push(row);
                // Written after each run, so that an interrupted evaluation is not lost.
                args.output.write(&rows)?;
            }
        }
    }
    bar.finish_and_clear();
    say(&summary(&rows))
}

fn explore_once(setup: SimSetup, drift: f64, cameras: bool) -> Result<ExploreReport, String> {
    let map: MapName = "evaluation".parse().map_err(|error| format!("{error}"))?;
    let name = format!("{}, drift {drift}, {} people, seed {}", setup.world, setup.people, setup.seed);
    let mapping = MappingTask { cameras, ..MappingTask::new(map, "explorer") };
    let sim = SimConfig { drift_factor: drift, ..SimConfig::default() };
    let task = ExploreTask { sim, ..ExploreTask::new(setup, mapping) };
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    let runtime = runtime.map_err(|error| format!("the async runtime cannot be started: {error}"))?;
    runtime.block_on(explore(task, |_| {})).map_err(|error| format!("{name}: {error}"))
}

fn line(row: &Row) -> String {
    let Row { world, seed, drift, people, report } = row;
    let met = report.people.unwrap_or_default();
    let error = |error: Option<TrajectoryError>| match error {
        Some(TrajectoryError { mean_m, mean_deg, max_m }) => format!("{mean_m:.3} m, {mean_deg:.2}°, {max_m:.3} m"),
        None => "none".to_owned(),
    };
    let (then, end) = (error(report.trajectory_error), error(report.corrected_trajectory_error));
    let within = report.main_nodes_within_5cm.map_or("none".to_owned(), |share| format!("{:.1} %", 100.0 * share));
    let most = report.main_node_error_max_m.map_or("none".to_owned(), |error_m| format!("{error_m:.3} m"));
    format!(
        "| {world} | {drift} | {people} | {seed} | {then} | {end} | {within} | {most} | {} + {} | {}, {:.0} s | {}, {} | {} |",
        report.map.closures[0],
        report.map.closures[1],
        report.map.ending,
        report.sim_s,
        met.contacts.by_robot,
        met.contacts.by_people,
        met.returns_in_nodes
    )
}

fn summary(rows: &[Row]) -> String {
    let worst =
        |value: fn(&ExploreReport) -> Option<f64>| rows.iter().filter_map(|row| value(&row.report)).fold(0.0, f64::max);
    let least = rows.iter().filter_map(|row| row.report.main_nodes_within_5cm).fold(1.0, f64::min);
    format!(
        "{} explorations, {} complete; worst mean error as known then {:.3} m and {:.2}°, at the end {:.3} m and {:.2}°; least \
         share of main nodes within 0.05 m: {:.1} %",
        rows.len(),
        rows.iter().filter(|row| row.report.map.ending == Ending::Complete).count(),
        worst(|report| report.trajectory_error.map(|error| error.mean_m)),
        worst(|report| report.trajectory_error.map(|error| error.mean_deg)),
        worst(|report| report.corrected_trajectory_error.map(|error| error.mean_m)),
        worst(|report| report.corrected_trajectory_error.map(|error| error.mean_deg)),
        100.0 * least
    )
}
