//! `evaluate paths`: paths planned on the map alone, against the shortest ways on the true plan.

use crate::maps::MapArgs;
use crate::output::{OutputArgs, say};
use clap::Args;
use fht_map::route::RouteConfig;
use fht_map::{FreeSpace, SpaceConfig, taut};
use fht_proto::FixedPoint;
use fht_robot::planning::path_length_m;
use fht_robot::pose::Point2;
use fht_sim::{FloorPlan, SimConfig};
use fht_tests::survey::Survey;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use std::time::Instant;

#[derive(Debug, Args)]
pub struct PathsArgs {
    #[command(flatten)]
    maps: MapArgs,
    /// Pairs of places, drawn uniformly from where the robot fits.
    #[arg(long, default_value_t = 1000)]
    pairs: usize,
    #[command(flatten)]
    output: OutputArgs,
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
    for survey in args.maps.surveys() {
        let survey = survey?;
        let figures = measure(&survey, args);
        say(&line(&figures))?;
        all.push(figures);
    }
    args.output.write(&all)
}

fn line(figures: &PathFigures) -> String {
    let PathFigures { world, pairs, refused, paths_blocked, .. } = figures;
    format!(
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
}

fn measure(survey: &Survey, args: &PathsArgs) -> PathFigures {
    let radius_m = SimConfig::default().radius_m;
    let plan = survey.world.plan();
    let bar = args.output.progress_bar(args.pairs as u64, "{bar:40} {pos}/{len} pairs, {elapsed} gone, {eta} to go");
    let begin = Instant::now();
    let space = FreeSpace::of(&survey.map, &SpaceConfig::default());
    let mesh_ms = begin.elapsed().as_secs_f64() * 1e3;
    let map_from_world = survey.world_from_map.inverse();
    let mut ratios = Vec::new();
    let (mut refused, mut blocked, mut plan_s) = (0, 0, 0.0);
    for (from, to) in pairs(survey, radius_m, args) {
        bar.inc(1);
        let Some(shortest) = plan.shortest_path(from, to, radius_m) else { continue };
        let begin = Instant::now();
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
    let mut rng = ChaCha8Rng::seed_from_u64(args.maps.seed);
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
