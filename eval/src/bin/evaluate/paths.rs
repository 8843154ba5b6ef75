//! `evaluate paths`: paths that each system plans on its map, against the shortest ways on the true
//! plan.

use crate::files::Files;
use crate::maps::{MapArgs, Variant, cases, short_name};
use crate::output::{OutputArgs, say};
use crate::systems::System;
use crate::systems::storage::StorageFigures;
use crate::trials::figures::{mean, quantile};
use clap::Args;
use fht_eval::systems::topo_map::{TopoMap, TopoMapConfig};
use fht_eval::{Ledger, Survey};
use fht_map::plan::node_route::NodeRouteConfig;
use fht_map::plan::shortest_path;
use fht_map::{FreeSpace, SpaceConfig};
use fht_navigation::planning::{PlanConfig, Traversable, UnknownCells, path_length_m};
use fht_perception::drivable_line::DrivableLineConfig;
use fht_perception::pose::Point2;
use fht_proto::FixedPoint;
use fht_sim::SimConfig;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use std::time::Instant;

#[derive(Debug, Args)]
pub struct PathsArgs {
    #[command(flatten)]
    pub maps: MapArgs,
    #[command(flatten)]
    pub pairs: PairArgs,
    /// Systems, separated by commas; those that share a map and a planner share the result.
    #[arg(long, value_enum, value_delimiter = ',', default_value = "ours,main-only,mr-topomap,amcl")]
    pub systems: Vec<System>,
    #[command(flatten)]
    pub output: OutputArgs,
}

/// Which paths.
#[derive(Debug, Args)]
pub struct PairArgs {
    /// Pairs of places, drawn uniformly from where the robot fits; the authors' own come on top.
    #[arg(long, default_value_t = 1000)]
    pub pairs: usize,
}

/// The key of a result.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
struct PathKey {
    world: String,
    map: String,
    system: System,
    parameters: String,
    pairs: usize,
    seed: u64,
}

/// Paths of one system in one world.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PathFigures {
    pub world: String,
    pub system: System,
    pub pairs: usize,
    /// Pairs to which the planner gave no path.
    pub refused: usize,
    /// Paths on which the robot would touch something.
    pub paths_blocked: usize,
    /// Length over that of the shortest on the true plan.
    pub c_path_mean: Option<f64>,
    pub c_path_p95: Option<f64>,
    pub c_path_max: Option<f64>,
    /// Mean and greatest of the authors' own pairs, and how many there are.
    pub authors_c_path: Option<[f64; 2]>,
    pub authors_pairs: usize,
    pub plan_ms_mean: f64,
    pub storage_bytes: usize,
    /// All ratios, in order of size.
    pub ratios: Vec<f32>,
}

impl PathFigures {
    /// For people.
    pub fn line(&self) -> String {
        let Self { world, system, pairs, refused, paths_blocked, plan_ms_mean, storage_bytes, .. } = self;
        let number = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |value| format!("{value:.3}"));
        let authors = self.authors_c_path.map_or_else(String::new, |[mean, max]| {
            format!(" (authors' {} pairs: {mean:.3}, {max:.3})", self.authors_pairs)
        });
        format!(
            "{world}, {}: {pairs} pairs, {refused} refused, {paths_blocked} touch something; length over the shortest: mean \
             {}, 95 % {}, greatest {}{authors}; {plan_ms_mean:.2} ms a path; {storage_bytes} B of map",
            system.title(),
            number(self.c_path_mean),
            number(self.c_path_p95),
            number(self.c_path_max)
        )
    }
}

impl PathsArgs {
    /// What it reads and writes.
    pub fn files(&self) -> Files {
        Files::of(&self.output).in_worlds(&self.maps.worlds)
    }
}

pub fn run(args: &PathsArgs) -> Result<(), String> {
    let all = measure(&args.maps, &args.pairs, &args.systems, &args.output)?;
    for figures in &all {
        say(&figures.line())?;
    }
    args.output.write(&all)
}

/// Plans all paths that are not known yet.
pub fn measure(
    maps: &MapArgs,
    args: &PairArgs,
    systems: &[System],
    output: &OutputArgs,
) -> Result<Vec<PathFigures>, String> {
    let mut ledger: Ledger<PathKey, PathFigures> = maps.ledger("paths.jsonl")?;
    let mut planners: Vec<System> = systems.iter().map(|system| system.planner()).collect();
    planners.sort();
    planners.dedup();
    let mut all = Vec::new();
    for world in &maps.worlds {
        let explored = maps.survey(world, Variant::Ours)?;
        let mut ways = None;
        for &system in &planners {
            let main_only =
                (system.variant() == Variant::MainOnly).then(|| maps.survey(world, Variant::MainOnly)).transpose()?;
            let survey = main_only.as_ref().unwrap_or(&explored);
            let key = PathKey {
                world: world.clone(),
                map: survey.identity.clone(),
                system,
                parameters: system.parameters(),
                pairs: args.pairs,
                seed: maps.seed,
            };
            if !ledger.has(&key) && ways.is_none() {
                ways = Some(Ways::of(&explored, world, args.pairs, maps.seed, output)?);
            }
            let figures = ledger.get_or(key, || {
                let missing = || std::io::Error::other("the pairs are missing");
                plan_all(survey, short_name(world), system, ways.as_ref().ok_or_else(missing)?)
            });
            all.push(figures.map_err(|error| format!("{world}, {}: {error}", system.title()))?);
        }
    }
    Ok(all)
}

/// The quality of paths on our map, over `count` pairs.
pub fn quality(survey: &Survey, world: &str, count: usize, output: &OutputArgs) -> Result<PathFigures, String> {
    let ways = Ways::of(survey, world, count, 1, output)?;
    plan_all(survey, short_name(world), System::Ours, &ways).map_err(|error| format!("{world}: {error}"))
}

/// Two places and the shortest way between them on the true plan, world frame.
struct Way {
    from: Point2,
    to: Point2,
    shortest_m: f64,
}

/// The ways of a world: drawn, and the authors'.
struct Ways {
    drawn: Vec<Way>,
    authors: Vec<Way>,
}

impl Ways {
    fn of(survey: &Survey, world: &str, count: usize, seed: u64, output: &OutputArgs) -> Result<Self, String> {
        let radius_m = SimConfig::default().radius_m;
        let plan = survey.world.plan();
        let template = "{bar:40} {pos}/{len} shortest ways, {elapsed} gone, {eta} to go";
        let (drawn, authors) = (pairs(survey, radius_m, count, seed), cases::of(world)?.pairs);
        let bar = output.progress_bar((drawn.len() + authors.len()) as u64, template);
        let shortest = |(from, to): (Point2, Point2)| {
            bar.inc(1);
            let way = plan.shortest_path(from, to, radius_m)?;
            Some(Way { from, to, shortest_m: path_length_m(&way) })
        };
        let drawn = drawn.into_iter().filter_map(shortest).collect();
        let authors = authors.into_iter().filter_map(shortest).collect();
        bar.finish_and_clear();
        Ok(Self { drawn, authors })
    }
}

/// Pairs of places at least a metre apart, world frame, drawn uniformly from the cells that the
/// robot can reach.
fn pairs(survey: &Survey, radius_m: f64, count: usize, seed: u64) -> Vec<(Point2, Point2)> {
    let plan = survey.world.plan();
    let start = Point2::from(survey.world_from_map.translation.vector);
    let reachable = plan.reachable(start, radius_m);
    let cells: Vec<usize> = (0..reachable.cells().len()).filter(|&index| reachable.cells()[index]).collect();
    let has_room = |place: Point2| survey.world.is_clear(place, place, radius_m);
    if cells.len() < 1000 {
        return Vec::new(); // no building, and no two places a metre apart to be found in it
    }
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut draw = || {
        let index = cells[rng.random_range(0..cells.len())];
        plan.centre_of(index % plan.width(), index / plan.width())
    };
    let mut pairs = Vec::with_capacity(count);
    while pairs.len() < count {
        let (from, to) = (draw(), draw());
        if (to - from).norm() >= 1.0 && has_room(from) && has_room(to) {
            pairs.push((from, to));
        }
    }
    pairs
}

/// How a system plans: from and to in the map frame.
enum Planner<'a> {
    Nodes(&'a Survey, Box<FreeSpace>),
    Places(TopoMap),
    Cells(Box<Traversable>),
}

/// A goal too near to a wall of the grid is approached from the nearest place within this, metres.
const NUDGE_M: f64 = 0.5;

impl<'a> Planner<'a> {
    fn of(survey: &'a Survey, system: System) -> std::io::Result<Self> {
        Ok(match system {
            System::MrTopomap => Self::Places(TopoMap::build(&survey.passes, &TopoMapConfig::default())),
            System::Amcl | System::AmclNav2 => {
                // The same distance from occupied cells that the map's edges keep.
                let robot_radius_m = DrivableLineConfig::default().half_width_m;
                let config = PlanConfig { robot_radius_m, unknown: UnknownCells::Obstacle, ..PlanConfig::shortest() };
                Self::Cells(Box::new(Traversable::new(&survey.grid.open()?, &config)))
            }
            _ => Self::Nodes(survey, Box::new(FreeSpace::of(&survey.map, &SpaceConfig::default()))),
        })
    }

    fn plan(&self, from: Point2, to: Point2) -> Option<Vec<Point2>> {
        match self {
            Self::Nodes(survey, space) => {
                let fixed = |point: Point2| FixedPoint::from_metres(point.x, point.y);
                let route =
                    shortest_path::plan(&survey.map, space, fixed(from), fixed(to), &NodeRouteConfig::default())
                        .ok()?;
                let point = |place: FixedPoint| Point2::new(place.x(), place.y());
                Some(route.waypoints.iter().map(|waypoint| point(waypoint.point)).collect())
            }
            Self::Places(map) => map.path(from, to),
            Self::Cells(space) => {
                let cell = space.nearest_passable(to, NUDGE_M)?;
                let end = if cell == space.cell_of(to) { to } else { space.centre(cell) };
                let mut points = space.shorten(&space.shortest_path(from, end)?.points);
                if end != to {
                    points.push(to);
                }
                Some(points)
            }
        }
    }
}

fn plan_all(survey: &Survey, world: String, system: System, ways: &Ways) -> std::io::Result<PathFigures> {
    let radius_m = SimConfig::default().radius_m;
    let map_from_world = survey.world_from_map.inverse();
    let planner = Planner::of(survey, system)?;
    let mut plan_s = 0.0;
    // Length over the shortest, and whether the robot touches nothing.
    let mut judge = |way: &Way| {
        let begin = Instant::now();
        let points = planner.plan(map_from_world * way.from, map_from_world * way.to);
        plan_s += begin.elapsed().as_secs_f64();
        let points: Vec<Point2> = points?.iter().map(|point| survey.world_from_map * point).collect();
        let touches = points.windows(2).position(|pair| !survey.world.is_clear(pair[0], pair[1], radius_m));
        if let Some(segment) = touches {
            let (from, to, of) = (points[segment], points[segment + 1], points.len() - 1);
            tracing::debug!(?from, ?to, segment, of, system = system.title(), "the path touches something");
        }
        let is_clear = touches.is_none();
        Some((path_length_m(&points) / way.shortest_m.max(1e-3), is_clear))
    };
    let authors: Vec<f64> = ways.authors.iter().filter_map(|way| Some(judge(way)?.0)).collect();
    let judged: Vec<(f64, bool)> = ways.drawn.iter().filter_map(judge).collect();
    let mut ratios: Vec<f64> = judged.iter().map(|(ratio, _)| *ratio).collect();
    ratios.sort_by(f64::total_cmp);
    let of = |value: f64| Some(value).filter(|value| value.is_finite());
    Ok(PathFigures {
        world,
        system,
        pairs: ways.drawn.len(),
        refused: ways.drawn.len() - judged.len(),
        paths_blocked: judged.iter().filter(|(_, is_clear)| !is_clear).count(),
        c_path_mean: of(mean(&ratios)),
        c_path_p95: of(quantile(ratios.clone(), 0.95)),
        c_path_max: of(quantile(ratios.clone(), 1.0)),
        authors_c_path: (!authors.is_empty()).then(|| [mean(&authors), quantile(authors.clone(), 1.0)]),
        authors_pairs: authors.len(),
        plan_ms_mean: plan_s * 1e3 / (ways.drawn.len() + ways.authors.len()).max(1) as f64,
        storage_bytes: StorageFigures::of(survey).map_err(std::io::Error::other)?.bytes_of(system),
        ratios: ratios.iter().map(|&ratio| ratio as f32).collect(),
    })
}
