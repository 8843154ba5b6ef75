//! `evaluate paths`: paths planned on the map alone, against the shortest ways on the true plan.

use clap::Args;
use fht_map::route::RouteConfig;
use fht_map::{FreeSpace, SpaceConfig, taut};
use fht_proto::FixedPoint;
use fht_robot::planning::path_length_m;
use fht_robot::pose::Point2;
use fht_sim::{FloorPlan, SimConfig};
use fht_tests::survey::{Survey, SurveyTask};
use indicatif::{ProgressBar, ProgressStyle};
use mapper::mapping::MapperConfig;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use std::io::{self, Write};
use std::path::PathBuf;
use std::time::Instant;

#[derive(Debug, Args)]
pub struct PathsArgs {
    /// Buildings: museum, office, or paths of map.yaml and .world files.
    #[arg(long, value_delimiter = ',', default_value = "museum,office")]
    worlds: Vec<String>,
    /// Pairs of places, drawn uniformly from where the robot fits.
    #[arg(long, default_value_t = 1000)]
    pairs: usize,
    /// Seed of the pairs and of the exploration.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Where explored maps are kept.
    #[arg(long, value_name = "FOLDER", default_value = "target/evaluation")]
    kept: PathBuf,
    /// Write the figures to this file.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// No progress bar.
    #[arg(long, short)]
    quiet: bool,
}

/// Figures of one world.
#[derive(Debug, Serialize)]
pub struct PathFigures {
    world: String,
    pairs: usize,
    /// Pairs to which the planner gave no path.
    refused: usize,
    /// Paths on which the robot would touch something.
    paths_blocked: usize,
    c_path_mean: f64,
    c_path_p95: f64,
    c_path_max: f64,
    storage_bytes: usize,
    plan_ms_mean: f64,
    triangles: usize,
    mesh_ms: f64,
}

pub fn run(args: &PathsArgs) -> Result<(), String> {
    let mut all = Vec::new();
    for world in &args.worlds {
        let task = SurveyTask {
            world: world.clone(),
            textures: None,
            seed: args.seed,
            drift: 1.0,
            variant: "ours".to_owned(),
            mapper: MapperConfig::default(),
        };
        let survey = Survey::of(&task, &args.kept).map_err(|error| error.to_string())?;
        let figures = measure(&survey, args);
        say(&figures)?;
        all.push(figures);
    }
    if let Some(path) = &args.json {
        let json = serde_json::to_string_pretty(&all).map_err(|error| error.to_string())?;
        std::fs::write(path, json).map_err(|error| format!("{} cannot be written: {error}", path.display()))?;
    }
    Ok(())
}

fn say(figures: &PathFigures) -> Result<(), String> {
    let PathFigures { world, pairs, refused, paths_blocked, .. } = figures;
    writeln!(
        io::stdout(),
        "{world}: {pairs} pairs, {refused} refused, {paths_blocked} touch something; length over the shortest: mean {:.4}, \
         95 % {:.3}, greatest {:.3}; {:.2} ms a path, the mesh of {} triangles made in {:.0} ms; {} B of map",
        figures.c_path_mean,
        figures.c_path_p95,
        figures.c_path_max,
        figures.plan_ms_mean,
        figures.triangles,
        figures.mesh_ms,
        figures.storage_bytes
    )
    .map_err(|error| format!("the figures cannot be printed: {error}"))
}

fn measure(survey: &Survey, args: &PathsArgs) -> PathFigures {
    let radius_m = SimConfig::default().radius_m;
    let plan = survey.world.plan();
    let bar = if args.quiet { ProgressBar::hidden() } else { progress_bar(args.pairs as u64) };
    let begin = Instant::now();
    let space = FreeSpace::of(&survey.map, &SpaceConfig::default());
    let mesh_ms = begin.elapsed().as_secs_f64() * 1e3;
    let mut ratios = Vec::new();
    let (mut refused, mut blocked, mut plan_s) = (0, 0, 0.0);
    for (from, to) in pairs(survey, radius_m, args) {
        bar.inc(1);
        let Some(shortest) = plan.shortest_path(from, to, radius_m) else { continue };
        let begin = Instant::now();
        let map_from_world = survey.world_from_map.inverse();
        let fixed = |point: Point2| {
            let place = map_from_world * point;
            FixedPoint::from_metres(place.x, place.y)
        };
        let route = taut::plan(&survey.map, &space, fixed(from), fixed(to), &RouteConfig::default());
        plan_s += begin.elapsed().as_secs_f64();
        let Ok(route) = route else {
            refused += 1;
            continue;
        };
        let points: Vec<Point2> = route
            .waypoints
            .iter()
            .map(|waypoint| survey.world_from_map * Point2::new(waypoint.point.x(), waypoint.point.y()))
            .collect();
        if let Some(at) = touch(plan, &points, radius_m) {
            blocked += 1;
            tracing::debug!(?from, ?to, ?at, "the path touches something");
        }
        ratios.push(route.length_m / path_length_m(&shortest).max(1e-3));
    }
    bar.finish_and_clear();
    ratios.sort_by(f64::total_cmp);
    let quantile = |share: f64| ratios.get(((ratios.len() - 1) as f64 * share) as usize).copied().unwrap_or(f64::NAN);
    PathFigures {
        world: survey.world.name().to_owned(),
        pairs: args.pairs,
        refused,
        paths_blocked: blocked,
        c_path_mean: ratios.iter().sum::<f64>() / ratios.len().max(1) as f64,
        c_path_p95: quantile(0.95),
        c_path_max: quantile(1.0),
        storage_bytes: survey.increments.iter().map(Vec::len).sum(),
        plan_ms_mean: plan_s * 1e3 / args.pairs as f64,
        triangles: space.triangle_count(),
        mesh_ms,
    }
}

/// Pairs of places at least a metre apart, world frame, drawn uniformly from the cells that the robot can get to.
fn pairs(survey: &Survey, radius_m: f64, args: &PathsArgs) -> Vec<(Point2, Point2)> {
    let plan = survey.world.plan();
    let start = Point2::from(survey.world_from_map.translation.vector);
    let reachable = plan.reachable(start, radius_m);
    let cells: Vec<usize> = (0..reachable.cells().len()).filter(|&index| reachable.cells()[index]).collect();
    let mut rng = ChaCha8Rng::seed_from_u64(args.seed);
    let mut draw = || {
        let index = cells[rng.random_range(0..cells.len())];
        plan.centre_of(index % plan.width(), index / plan.width())
    };
    let mut pairs = Vec::with_capacity(args.pairs);
    while pairs.len() < args.pairs {
        let (from, to) = (draw(), draw());
        if (to - from).norm() >= 1.0 {
            pairs.push((from, to));
        }
    }
    pairs
}

/// The first place on a path where a disc of `radius_m` touches something.
fn touch(plan: &FloorPlan, points: &[Point2], radius_m: f64) -> Option<Point2> {
    points.windows(2).find(|pair| !plan.is_clear(pair[0], pair[1], radius_m)).map(|pair| pair[0])
}

fn progress_bar(pairs: u64) -> ProgressBar {
    let style = ProgressStyle::with_template("{bar:40} {pos}/{len} pairs, {elapsed} gone, {eta} to go")
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    ProgressBar::new(pairs).with_style(style)
}
