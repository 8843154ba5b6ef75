//! `evaluate relocalize`: robots dropped anywhere, that do not know where they are.

use crate::maps::MapArgs;
use crate::output::{OutputArgs, say};
use clap::Args;
use client_robot::mission::{Goal, Services, run as run_mission};
use client_robot::paths::FreeSpaceCache;
use client_robot::pilot::{PathSource, PilotConfig};
use client_robot::report::Report;
use client_robot::route::PlannedPath;
use fht_map::MapState;
use fht_proto::query::ErrorReply;
use fht_proto::{Descriptor, FixedPoint};
use fht_robot::descriptor::DescriptorNet;
use fht_robot::frame::Panorama;
use fht_robot::pose::Point2;
use fht_sim::{SimConfig, Simulator};
use fht_tests::survey::Survey;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::sync::Arc;

#[derive(Debug, Args)]
pub struct RelocalizeArgs {
    #[command(flatten)]
    maps: MapArgs,
    /// Starts, drawn uniformly from where the robot has room, with any heading.
    #[arg(long, default_value_t = 100)]
    starts: u64,
    #[command(flatten)]
    output: OutputArgs,
}

/// Figures of one world.
#[derive(Debug, Serialize, Deserialize)]
pub struct RelocalizeFigures {
    world: String,
    trials: usize,
    /// Share of the starts after which the first declared pose was right: within 1 m and 5° (paper).
    success: f64,
    /// Its interval of 95 % confidence (Wilson).
    success_ci95: [f64; 2],
    /// Declared poses that were wrong.
    false_fixes: usize,
    /// Distance driven until the first right and declared pose, metres.
    l_reloca_mean_m: f64,
    error_median_m: f64,
    error_median_deg: f64,
}

/// A robot of another day: other light, other camera gain, other wheels than the explorer's.
const OTHER_DAY: u64 = 1000;
/// Room around a start, metres.
const CLEARANCE_M: f64 = 0.25;

pub fn run(args: &RelocalizeArgs) -> Result<(), String> {
    let mut net = DescriptorNet::load(None).map_err(|error| error.to_string())?;
    let mut all = Vec::new();
    for survey in args.maps.surveys() {
        let survey = survey?;
        let figures = measure(&survey, &mut net, args);
        say(&serde_json::to_string(&figures).map_err(|error| error.to_string())?)?;
        all.push(figures);
    }
    args.output.write(&all)
}

/// Paths on the map at hand.
struct OwnPaths<'a>(&'a MapState, FreeSpaceCache);

impl PathSource for OwnPaths<'_> {
    fn plan(&mut self, from: Point2, to: Point2, blocked: &BTreeSet<FixedPoint>) -> Result<PlannedPath, ErrorReply> {
        self.1.plan(self.0, 0, from, to, blocked)
    }
}

fn measure(survey: &Survey, net: &mut DescriptorNet, args: &RelocalizeArgs) -> RelocalizeFigures {
    let bar = args.output.progress_bar(args.starts, "{bar:40} {pos}/{len} starts, {elapsed} gone, {eta} to go");
    let mut reports = Vec::new();
    for start in 1..=args.starts {
        let report = relocalize_once(survey, net, start);
        bar.inc(1);
        if !is_right(&report) {
            tracing::info!(start, failure = report.failure, error_m = report.relocalization_error_m, "not right");
        }
        reports.push(report);
    }
    bar.finish_and_clear();
    let right: Vec<&Report> = reports.iter().filter(|report| is_right(report)).collect();
    let median = |mut values: Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
    };
    let of = |value: fn(&Report) -> Option<f64>| right.iter().filter_map(|report| value(report)).collect::<Vec<f64>>();
    let distances = of(|report| report.relocalization_distance_m);
    RelocalizeFigures {
        world: survey.world.name().to_owned(),
        trials: reports.len(),
        success: right.len() as f64 / reports.len().max(1) as f64,
        success_ci95: wilson(right.len(), reports.len()),
        false_fixes: reports.iter().filter(|report| report.localized && !is_right(report)).count(),
        l_reloca_mean_m: distances.iter().sum::<f64>() / distances.len().max(1) as f64,
        error_median_m: median(of(|report| report.relocalization_error_m)),
        error_median_deg: median(of(|report| report.relocalization_error_deg)),
    }
}

fn relocalize_once(survey: &Survey, net: &mut DescriptorNet, start: u64) -> Report {
    let pose = survey.world.random_free_pose(start, CLEARANCE_M);
    let seed = OTHER_DAY + start;
    let sim = SimConfig { light_seed: seed, ..SimConfig::default() };
    let mut simulator = Simulator::new(Arc::clone(&survey.world), sim, pose, seed);
    let mut paths = OwnPaths(&survey.map, FreeSpaceCache::default());
    let mut describe = |panorama: &Panorama| -> Option<Descriptor> { net.descriptor(panorama).ok() };
    let mut services =
        Services { map: &survey.map, paths: &mut paths, describe: &mut describe, on_frame: &mut |_, _| {} };
    let config = PilotConfig { seed, ..PilotConfig::default() };
    run_mission(&mut simulator, config, Goal::None, &survey.world_from_map, &mut services)
}

/// The paper's test of success.
fn is_right(report: &Report) -> bool {
    report.relocalization_error_m.is_some_and(|metres| metres < 1.0)
        && report.relocalization_error_deg.is_some_and(|degrees| degrees < 5.0)
}

/// Wilson's interval of 95 % confidence for a share.
fn wilson(successes: usize, trials: usize) -> [f64; 2] {
    let (n, z) = (trials.max(1) as f64, 1.96_f64);
    let share = successes as f64 / n;
    let centre = (share + z * z / (2.0 * n)) / (1.0 + z * z / n);
    let half = z / (1.0 + z * z / n) * (share * (1.0 - share) / n + z * z / (4.0 * n * n)).sqrt();
    [(centre - half).max(0.0), (centre + half).min(1.0)]
}
