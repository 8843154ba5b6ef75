//! Shortest paths over graphs of up to a million nodes: the time of a query beside Dijkstra's
//! algorithm on the same graph in the same run, the time to build and to change the structures, and
//! their size.
//!
//! `cargo bench --bench paths [NAME]` measures what has NAME in its name. Figures are those of
//! 1,000 pairs of nodes (Dijkstra's: of fewer on large graphs). It does not use divan, which times
//! one query again and again: here the distribution over different queries matters.

#[path = "graphs/mod.rs"]
mod graphs;

use fht_map::graph::astar::{AllOpen, Exceptions, Workspace, shortest_way};
use fht_map::graph::road_graph::RoadGraph;
use fht_map::graph::search_index::{SearchIndex, SearchIndexConfig};
use fht_proto::FixedPoint;
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

fn measure(name: &str, graph: &Graph, pairs: &[(&str, u32)]) {
    let begin = Instant::now();
    let mut roads = graph.roads();
    let roads_s = begin.elapsed().as_secs_f64();
    let begin = Instant::now();
    let mut guide = SearchIndex::build(&roads, SearchIndexConfig::default());
    let guide_s = begin.elapsed().as_secs_f64();
    for &(which, below) in pairs {
        queries(name, which, &roads, &guide, below);
    }
    let nodes = roads.nodes();
    let [roads_bytes, landmarks_bytes, cells_bytes] =
        [roads.bytes(), guide.bytes().0, guide.bytes().1].map(|bytes| bytes / nodes);
    println!("  built: roads {roads_s:.2} s, guide {guide_s:.2} s; of {} edges", roads.edges());
    println!("  bytes a node: roads {roads_bytes}, landmarks {landmarks_bytes}, cells {cells_bytes}");
    change(&mut roads, &mut guide, graph);
    queries(name, "changed", &roads, &guide, graph.positions.len() as u32);
    println!("  worn: {}", guide.is_worn());
}

/// Adds nodes, each with edges to four nodes near each other, and removes edges.
fn change(roads: &mut RoadGraph, guide: &mut SearchIndex, graph: &Graph) {
    const CHANGES: u32 = 100;
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    let (mut added, mut removed) = (Vec::new(), Vec::new());
    for number in 0..CHANGES {
        let begin = rng.random_range(0..graph.edges.len());
        let near = roads.number(id(graph.edges[begin].0)).expect("the node is there");
        let two = |from: u32| roads.steps(from).map(|(to, _)| to).collect::<Vec<_>>();
        let mut others: Vec<u32> = two(near).into_iter().flat_map(two).chain(two(near)).collect();
        others.sort_unstable();
        others.dedup();
        others.truncate(4);
        let place = roads.position(near).expect("the node is there");
        let place = FixedPoint { x_mm: place.x_mm + 300, ..place };
        let begin = Instant::now();
        let node = roads.put_node(id(u32::MAX - number), place);
        guide.node_added(node);
        for other in others {
            if roads.put_edge(node, other) {
                guide.edge_changed(roads, node, other);
            }
        }
        guide.tidy(roads);
        added.push(begin.elapsed().as_secs_f64() * 1e3);
        let ends = graph.edges[rng.random_range(0..graph.edges.len())];
        let ends = [ends.0, ends.1].map(|end| roads.number(id(end)).expect("the node is there"));
        let begin = Instant::now();
        if roads.remove_edge(ends[0], ends[1]) {
            guide.edge_removed(ends[0], ends[1]);
        }
        guide.tidy(roads);
        removed.push(begin.elapsed().as_secs_f64() * 1e3);
    }
    for (what, mut ms) in [("a node with four edges added", added), ("an edge removed", removed)] {
        ms.sort_by(f64::total_cmp);
        let mean = ms.iter().sum::<f64>() / ms.len() as f64;
        println!("  {what}: mean {mean:.3} ms, median {:.3}, max {:.3}", ms[ms.len() / 2], ms[ms.len() - 1]);
    }
}

fn queries(name: &str, which: &str, roads: &RoadGraph, guide: &SearchIndex, below: u32) {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut end = || roads.number(id(rng.random_range(0..below))).expect("the node is there");
    let pairs: Vec<(u32, u32)> = (0..PAIRS).map(|_| (end(), end())).collect();
    let mut work = Workspace::default();
    let mut time = |guide: Option<&SearchIndex>, pairs: &[(u32, u32)]| {
        let mut found = Vec::new();
        for &(from, to) in pairs {
            let begin = Instant::now();
            let way = shortest_way(roads, guide, &[(from, 0)], &[(to, 0)], &AllOpen, &mut work);
            let ms = begin.elapsed().as_secs_f64() * 1e3;
            found.push((ms, way.as_ref().map(|way| way.cost_um), way.map_or(0, |way| way.expanded)));
        }
        found
    };
    let closed = fast_with_closures(roads, guide, &pairs);
    let few = (20_000_000 / roads.nodes()).clamp(20, PAIRS);
    let plain = time(None, &pairs[..few]);
    let fast = time(Some(guide), &pairs);
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
    println!("  the same with ten edges of each way closed: mean {closed:.4} ms");
}

/// Mean time of queries for which ten edges of the shortest way are closed, milliseconds.
fn fast_with_closures(roads: &RoadGraph, guide: &SearchIndex, pairs: &[(u32, u32)]) -> f64 {
    let mut work = Workspace::default();
    let mut ms = 0.0;
    for &(from, to) in pairs {
        let way = shortest_way(roads, Some(guide), &[(from, 0)], &[(to, 0)], &AllOpen, &mut work);
        let nodes = way.map(|way| way.nodes).unwrap_or_default();
        let edges = nodes.windows(2).step_by(nodes.len() / 10 + 1).map(|pair| (pair[0], pair[1], None));
        let closed = Exceptions::new(edges);
        let begin = Instant::now();
        let _ = shortest_way(roads, Some(guide), &[(from, 0)], &[(to, 0)], &closed, &mut work);
        ms += begin.elapsed().as_secs_f64() * 1e3;
    }
    ms / pairs.len() as f64
}
