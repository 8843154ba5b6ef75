//! Shortest paths over graphs of up to a million nodes: what a query takes beside Dijkstra's algorithm on the same graph in
//! the same run, what it takes to build and to change the structures, and how large they are.
//!
//! `cargo bench --bench paths [NAME]` measures what has NAME in its name. Figures are those of 1,000 pairs of nodes
//! (Dijkstra's: of fewer on large graphs). Not divan: it says how long one query takes again and again, and
//! the question is how the times of different ones are distributed.

#[path = "graphs/mod.rs"]
mod graphs;

use fht_map::cells::CellsConfig;
use fht_map::guide::{Guide, GuideConfig};
use fht_map::landmarks::LandmarksConfig;
use fht_map::roads::Roads;
use fht_map::shortest::{AllOpen, Workspace, shortest_way};
use graphs::{Graph, buildings, disturbed, grid, id};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::time::Instant;

const PAIRS: usize = 1000;

fn main() {
    let wanted: Vec<String> = std::env::args().skip(1).filter(|argument| !argument.starts_with("--")).collect();
    let is_wanted = |name: &str| wanted.is_empty() || wanted.iter().any(|part| name.contains(part.as_str()));
    println!("| graph | nodes | pairs | mean ms | median | max | expanded | Dijkstra mean ms | ratio |");
    println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    let sides = [10, 100, 300, 500, 1000];
    for side in sides {
        let name = format!("grid-{}", side * side);
        if is_wanted(&name) {
            measure("grid", &grid(side), &[("any", side * side), ("first row", side)]);
        }
    }
    for side in sides {
        let name = format!("disturbed-{}", side * side);
        if is_wanted(&name) {
            measure("disturbed", &disturbed(side), &[("any", side * side)]);
        }
    }
    for count in [1, 10] {
        if is_wanted(&format!("buildings-{count}")) {
            let graph = buildings(count);
            measure("buildings", &graph, &[("any", graph.positions.len() as u32)]);
        }
    }
}

fn env(name: &str, or: usize) -> usize {
    std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(or)
}

fn measure(name: &str, graph: &Graph, pairs: &[(&str, u32)]) {
    let begin = Instant::now();
    let roads = graph.roads();
    let roads_s = begin.elapsed().as_secs_f64();
    let begin = Instant::now();
    let config = GuideConfig {
        landmarks: LandmarksConfig { slots: env("SLOTS", 16), ..LandmarksConfig::default() },
        cells: CellsConfig { most_nodes: env("CELL", 1024) },
    };
    let landmarks = Guide::build(&roads, config);
    let landmarks_s = begin.elapsed().as_secs_f64();
    for &(which, below) in pairs {
        queries(name, which, &roads, &landmarks, below);
    }
    let per_node = |bytes: usize| bytes / roads.nodes();
    println!(
        "  {} nodes, {} edges: roads built in {roads_s:.2} s, {} B a node; guide in {landmarks_s:.2} s, {} + {} B a node",
        roads.nodes(),
        roads.edges(),
        per_node(roads.bytes()),
        per_node(landmarks.bytes().0),
        per_node(landmarks.bytes().1)
    );
}

fn queries(name: &str, which: &str, roads: &Roads, landmarks: &Guide, below: u32) {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut end = || roads.number(id(rng.random_range(0..below))).expect("the node is there");
    let pairs: Vec<(u32, u32)> = (0..PAIRS).map(|_| (end(), end())).collect();
    let mut work = Workspace::default();
    let mut time = |landmarks: Option<&Guide>, pairs: &[(u32, u32)]| {
        let mut found = Vec::new();
        for &(from, to) in pairs {
            let begin = Instant::now();
            let way = shortest_way(roads, landmarks, &[(from, 0)], &[(to, 0)], &AllOpen, &mut work);
            let ms = begin.elapsed().as_secs_f64() * 1e3;
            found.push((ms, way.as_ref().map(|way| way.cost_um), way.map_or(0, |way| way.expanded)));
        }
        found
    };
    let few = (20_000_000 / roads.nodes()).clamp(20, PAIRS).min(env("FEW", PAIRS));
    let plain = time(None, &pairs[..few]);
    let fast = time(Some(landmarks), &pairs);
    assert!(plain.iter().zip(&fast).all(|(plain, fast)| plain.1 == fast.1), "the ways have the same lengths");
    let mean = |found: &[(f64, Option<u64>, usize)]| found.iter().map(|one| one.0).sum::<f64>() / found.len() as f64;
    let expanded = fast.iter().map(|one| one.2).sum::<usize>() / fast.len();
    let mut times: Vec<f64> = fast.iter().map(|one| one.0).collect();
    times.sort_by(f64::total_cmp);
    println!(
        "| {name} | {} | {which} | {:.4} | {:.4} | {:.4} | {expanded} | {:.3} | {:.0} |",
        roads.nodes(),
        mean(&fast),
        times[times.len() / 2],
        times[times.len() - 1],
        mean(&plain),
        mean(&plain) / mean(&fast[..few])
    );
}
