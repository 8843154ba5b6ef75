//! What a path costs on the maps of three buildings, as a server plans it: 1,000 pairs of places in
//! free space. `nodes`, the shortest way over nodes and edges for the same pairs (between the
//! nearest nodes), is the machine's yardstick.
//!
//! Needs the test data beside the repository. Explored maps are kept in `target/evaluation`; a
//! building that is not there yet is left out.

use divan::{Bencher, black_box};
use fht_eval::{Survey, SurveyTask};
use fht_map::graph::dijkstra;
use fht_map::index::lookup;
use fht_map::plan::shortest_path;
use fht_map::{FreeSpace, MapState, NodeRouteConfig, SpaceConfig};
use fht_proto::{FixedPoint, NodeId};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::cell::Cell;
use std::path::Path;
use std::sync::OnceLock;
use std::time::Instant;

fn main() {
    // Benches run in their package's folder, but kept maps are named by the path of their world
    // from the repository's root.
    let repository = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    std::env::set_current_dir(repository).expect("the repository is there");
    divan::main();
}

const PAIRS: usize = 1000;
const BUILDINGS: [&str; 3] = ["museum", "office", "hospital"];
const WORLDS: [&str; 3] = [
    "../shared/data/maps/museum.yaml",
    "../shared/data/maps/large_indoor.yaml",
    "../shared/data/worlds/hospital/worlds/hospital.world",
];

struct Building {
    map: MapState,
    space: FreeSpace,
    pairs: Vec<(FixedPoint, FixedPoint)>,
    nodes: Vec<(NodeId, NodeId)>,
}

fn building(name: &str) -> Option<&'static Building> {
    static BUILT: [OnceLock<Option<Building>>; 3] = [const { OnceLock::new() }; 3];
    let index = BUILDINGS.iter().position(|it| *it == name)?;
    BUILT[index].get_or_init(|| load(name, WORLDS[index])).as_ref()
}

fn load(name: &str, world: &str) -> Option<Building> {
    let task = SurveyTask::usual(world);
    let folder = Path::new("target/evaluation");
    if !Survey::is_kept(&task, folder) {
        eprintln!("{name}: no map in target/evaluation; `evaluate paths --worlds {world}` makes it");
        return None;
    }
    let map = Survey::of(&task, folder).inspect_err(|error| eprintln!("{name}: {error}")).ok()?.map;
    let space = FreeSpace::of(&map, &SpaceConfig::default());
    let pairs = pairs(&map, &space);
    let nearest = |place| lookup::nearest(&map, None, place, 100.0).first().map(|(node, _)| node.id);
    let nodes = pairs.iter().filter_map(|(from, to)| Some((nearest(*from)?, nearest(*to)?))).collect();
    eprintln!("{name}: {} nodes, {} triangles", map.nodes().count(), space.triangle_count());
    Some(Building { map, space, pairs, nodes })
}

/// Pairs of places in free space, drawn uniformly.
fn pairs(map: &MapState, space: &FreeSpace) -> Vec<(FixedPoint, FixedPoint)> {
    let places: Vec<FixedPoint> = map.nodes().map(|node| node.pose.position).collect();
    let range = |axis: fn(&FixedPoint) -> i32| {
        let (low, high) = (places.iter().map(axis).min(), places.iter().map(axis).max());
        low.unwrap_or_default() - 5000..high.unwrap_or_default() + 5000
    };
    let (x, y) = (range(|place| place.x_mm), range(|place| place.y_mm));
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut draw = || {
        loop {
            let place = FixedPoint { x_mm: rng.random_range(x.clone()), y_mm: rng.random_range(y.clone()) };
            if space.contains(place) {
                return place;
            }
        }
    };
    (0..PAIRS).map(|_| (draw(), draw())).collect()
}

/// The time of all pairs, one after the other. Also prints how pairs differ, by the least time of
/// each.
#[divan::bench(args = BUILDINGS, sample_count = 20, sample_size = 1)]
fn taut_paths(bencher: Bencher<'_, '_>, name: &str) {
    let Some(Building { map, space, pairs, .. }) = building(name) else { return };
    let config = NodeRouteConfig::default();
    let least_us = vec![Cell::new(f64::INFINITY); pairs.len()];
    bencher.counter(divan::counter::ItemsCount::new(pairs.len())).bench_local(|| {
        for ((from, to), least_us) in pairs.iter().zip(&least_us) {
            let begin = Instant::now();
            let _ = black_box(shortest_path::plan(map, space, *from, *to, &config));
            least_us.set(least_us.get().min(begin.elapsed().as_secs_f64() * 1e6));
        }
    });
    let mut least_us: Vec<f64> = least_us.iter().map(Cell::get).collect();
    least_us.sort_by(f64::total_cmp);
    let mean = least_us.iter().sum::<f64>() / least_us.len() as f64;
    let share = |share: f64| least_us[(share * least_us.len() as f64) as usize];
    eprintln!(
        "{name}: mean {mean:.1} us, median {:.1}, 99 % {:.1}, {:.1} at most",
        share(0.5),
        share(0.99),
        share(0.9999)
    );
}

/// The same places, located in the mesh only.
#[divan::bench(args = BUILDINGS)]
fn points_found(bencher: Bencher<'_, '_>, name: &str) {
    let Some(Building { space, pairs, .. }) = building(name) else { return };
    bencher
        .counter(divan::counter::ItemsCount::new(2 * pairs.len()))
        .bench_local(|| pairs.iter().filter(|(from, to)| space.contains(*from) && space.contains(*to)).count());
}

/// The yardstick: the shortest ways over nodes and edges.
#[divan::bench(args = BUILDINGS, sample_count = 5, sample_size = 1)]
fn nodes(bencher: Bencher<'_, '_>, name: &str) {
    let Some(Building { map, nodes, .. }) = building(name) else { return };
    bencher.counter(divan::counter::ItemsCount::new(nodes.len())).bench_local(|| {
        for (from, to) in nodes {
            black_box(dijkstra::shortest_path(map, *from, *to));
        }
    });
}

/// The mesh itself.
#[divan::bench(args = BUILDINGS, sample_count = 7, sample_size = 1)]
fn mesh(bencher: Bencher<'_, '_>, name: &str) {
    let Some(Building { map, .. }) = building(name) else { return };
    bencher.bench_local(|| FreeSpace::of(map, &SpaceConfig::default()));
}
