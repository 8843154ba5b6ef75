//! Shortest paths, routes between places, lookups.
#![allow(clippy::unwrap_used)] // tests may panic

use fht_map::graph::dijkstra::{distances_from, shortest_path};
use fht_map::index::lookup::{most_similar, nearest};
use fht_map::plan::node_route::{RoutePoint, plan};
use fht_map::{FreeSpace, MapState, NodeRouteConfig, PlanError, RouteError, Rules};
use fht_proto::{
    AuthorId, Descriptor, EdgeKey, FixedPoint, FixedPose, Increment, ModelId, NodeId, NodeKind, Op, Rect, ScanRecord,
    Signature, Zone, ZoneRule,
};
use proptest::prelude::*;
use std::collections::BTreeSet;

fn id(number: u32) -> NodeId {
    NodeId { author: AuthorId(1), number }
}

fn at(x: f64, y: f64) -> FixedPoint {
    FixedPoint::from_metres(x, y)
}

/// A map of support nodes at places in metres, with square rectangles of so many metres each way,
/// joined by edges.
fn map(nodes: &[(f64, f64, f64)], edges: &[(u32, u32)]) -> MapState {
    let mut ops = Vec::new();
    for (number, &(x, y, reach)) in (0..).zip(nodes) {
        let (id, pose) = (id(number), FixedPose::from_metres(x, y, 0.0));
        ops.push(Op::PutNode { id, kind: NodeKind::Support, pose });
        if reach > 0.0 {
            let rect = Rect::around(pose.position, (x - reach, y - reach), (x + reach, y + reach));
            ops.push(Op::SetFreeSpace { id, rect: Some(rect) });
        }
    }
    ops.extend(edges.iter().map(|&(a, b)| Op::PutEdge { edge: EdgeKey::new(id(a), id(b)) }));
    let mut state = MapState::new();
    state.apply(&Increment { author: AuthorId(1), number: 1, hlc_us: 1, ops });
    state
}

fn nodes_of(points: &[RoutePoint]) -> Vec<u32> {
    points.iter().filter_map(|point| point.node).map(|id| id.number).collect()
}

#[test]
fn the_shorter_way_round_is_taken() {
    // A square of 4 m with one side missing, and a node that nothing joins.
    let square = map(
        &[(0.0, 0.0, 0.0), (4.0, 0.0, 0.0), (4.0, 4.0, 0.0), (0.0, 4.0, 0.0), (9.0, 9.0, 0.0)],
        &[(0, 1), (1, 2), (2, 3)],
    );
    let (length, path) = shortest_path(&square, id(0), id(3)).unwrap();
    assert_eq!((length, path), (12.0, vec![id(0), id(1), id(2), id(3)]));
    assert_eq!(shortest_path(&square, id(0), id(0)).unwrap(), (0.0, vec![id(0)]));
    assert_eq!(shortest_path(&square, id(0), id(4)), None);
    assert_eq!(shortest_path(&square, id(0), id(99)), None);
    let distances = distances_from(&square, id(0));
    assert_eq!(
        distances.into_iter().map(|(id, m)| (id.number, m)).collect::<Vec<_>>(),
        [(0, 0.0), (1, 4.0), (2, 8.0), (3, 12.0)]
    );
    assert!(distances_from(&square, id(99)).is_empty());
}

#[test]
fn routes_over_nodes_keep_off_what_is_closed() {
    let corners = [(0.0, 0.0, 1.0), (4.0, 0.0, 1.0), (4.0, 4.0, 1.0), (0.0, 4.0, 1.0)];
    let square = map(&corners, &[(0, 1), (1, 2), (2, 3), (0, 3)]);
    let between = |rules: &Rules, from: u32, to: u32| {
        let space = FreeSpace::of(&square, &rules.space_config());
        let route = rules.plan_between_nodes(&square, &space, [id(from), id(to)])?;
        let (a, b) = (square.node(id(from)).unwrap().pose.position, square.node(id(to)).unwrap().pose.position);
        let of_places = rules.plan_over_nodes(&square, &space, a, b, &NodeRouteConfig::default())?;
        // Between places of one rectangle there are no nodes.
        let nodes = if from == to { Vec::new() } else { nodes_of(&route.waypoints) };
        assert_eq!((of_places.length_m, nodes_of(&of_places.waypoints)), (route.length_m, nodes));
        Ok::<_, PlanError>((nodes_of(&route.waypoints), route.length_m))
    };
    let mut rules = Rules::default();
    assert_eq!(between(&rules, 0, 1).unwrap(), (vec![0, 1], 4.0));
    assert_eq!(between(&rules, 0, 0).unwrap(), (vec![0], 0.0));
    rules.closed.insert(EdgeKey::new(id(0), id(1)));
    assert_eq!(between(&rules, 0, 1).unwrap(), (vec![0, 3, 2, 1], 12.0));
    let zone = |x: f64, y: f64| Zone {
        rule: ZoneRule::KeepOut,
        corners: [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)].map(|(dx, dy)| at(x + dx, y + dy)).to_vec(),
    };
    rules.keep_out.push(("stairs".parse().unwrap(), zone(2.0, 4.0)));
    assert!(matches!(between(&rules, 0, 1), Err(PlanError::Closed { .. })), "{:?}", between(&rules, 0, 1));
    rules.keep_out = vec![("stairs".parse().unwrap(), zone(4.0, 0.0))];
    assert!(matches!(between(&rules, 0, 1), Err(PlanError::GoalKeptOut { .. })), "{:?}", between(&rules, 0, 1));
}

#[test]
fn places_in_one_rectangle_are_joined_straight() {
    let map = map(&[(0.0, 0.0, 3.0)], &[]);
    let route = plan(&map, at(-2.0, -2.0), at(1.0, 2.0), &NodeRouteConfig::default()).unwrap();
    assert_eq!((route.length_m, nodes_of(&route.waypoints)), (5.0, vec![]));
    let nowhere = plan(&map, at(1.0, 1.0), at(1.0, 1.0), &NodeRouteConfig::default()).unwrap();
    assert_eq!((nowhere.length_m, nowhere.waypoints.len()), (0.0, 1));
}

#[test]
fn all_rectangles_that_contain_a_place_compete() {
    // The start lies in the rectangles of 0 (nearest) and 1; only from 1 is the goal near.
    let nodes = [(0.0, 0.0, 2.0), (3.0, 0.0, 3.0), (0.0, 8.0, 1.0), (8.0, 0.0, 1.0)];
    let map = map(&nodes, &[(0, 2), (2, 3), (1, 3)]);
    let route = plan(&map, at(0.5, 0.0), at(8.5, 0.0), &NodeRouteConfig::default()).unwrap();
    assert_eq!((nodes_of(&route.waypoints), route.length_m), (vec![1, 3], 8.0));
}

#[test]
fn a_place_beside_the_map_enters_it_at_the_nearest_point() {
    let map = map(&[(0.0, 0.0, 1.0), (5.0, 0.0, 1.0)], &[(0, 1)]);
    let route = plan(&map, at(-2.0, 0.5), at(5.0, 0.5), &NodeRouteConfig::default()).unwrap();
    let points: Vec<_> = route.waypoints.iter().map(|point| (point.point, point.node.map(|id| id.number))).collect();
    assert_eq!(
        points,
        [
            (at(-2.0, 0.5), None),
            (at(-1.0, 0.5), None),
            (at(0.0, 0.0), Some(0)),
            (at(5.0, 0.0), Some(1)),
            (at(5.0, 0.5), None)
        ]
    );
    let error = plan(&map, at(-9.0, 0.0), at(5.0, 0.0), &NodeRouteConfig::default()).unwrap_err();
    assert!(matches!(error, RouteError::OutOfMap { nearest_m: Some(m), .. } if m == 8.0), "{error}");
    let error = plan(&MapState::new(), at(0.0, 0.0), at(5.0, 0.0), &NodeRouteConfig::default()).unwrap_err();
    assert!(matches!(error, RouteError::OutOfMap { nearest_m: None, .. }), "{error}");
}

#[test]
fn borders_of_rectangles_belong_to_them() {
    let node = FixedPoint { x_mm: 8043, y_mm: 2706 };
    let rect = Rect { west_mm: 2282, east_mm: 2282, south_mm: 2282, north_mm: 2282 };
    for (x_mm, y_mm) in [(8043, 4988), (8043, 424), (5761, 2706), (10_325, 2706)] {
        assert!(rect.contains(node, FixedPoint { x_mm, y_mm }), "({x_mm}, {y_mm})");
    }
    assert!(!rect.contains(node, FixedPoint { x_mm: 8043, y_mm: 4989 }));
}

#[test]
fn blocked_edges_are_gone_round() {
    let square = map(&[(0.0, 0.0, 0.5), (4.0, 0.0, 0.5), (4.0, 3.0, 0.5)], &[(0, 1), (1, 2), (0, 2)]);
    let mut config = NodeRouteConfig::default();
    let direct = plan(&square, at(0.0, 0.0), at(4.0, 3.0), &config).unwrap();
    assert_eq!((nodes_of(&direct.waypoints), direct.length_m), (vec![0, 2], 5.0));
    config.blocked.insert(EdgeKey::new(id(2), id(0)));
    let round = plan(&square, at(0.0, 0.0), at(4.0, 3.0), &config).unwrap();
    assert_eq!((nodes_of(&round.waypoints), round.length_m), (vec![0, 1, 2], 7.0));
    config.blocked.insert(EdgeKey::new(id(1), id(0)));
    let error = plan(&square, at(0.0, 0.0), at(4.0, 3.0), &config).unwrap_err();
    assert!(matches!(error, RouteError::NoPath { .. }), "{error}");
}

fn with_descriptor(number: u32, model: u32, values: Vec<i8>) -> [Op; 2] {
    let scan = ScanRecord {
        base_from_sensor: FixedPose::default(),
        angle_min: 0.0,
        angle_increment: 0.1,
        ranges_mm: vec![1000],
    };
    let descriptor = Some(Descriptor { model: ModelId(model), scale: 1.0, values });
    let pose = FixedPose::from_metres(f64::from(number), 0.0, 0.0);
    [
        Op::PutNode { id: id(number), kind: NodeKind::Main, pose },
        Op::SetSignature { id: id(number), signature: Signature { descriptor, scan } },
    ]
}

#[test]
fn nodes_are_found_by_place_and_by_appearance() {
    let mut state = MapState::new();
    let nodes = [
        with_descriptor(0, 1, vec![1, 0]),
        with_descriptor(1, 1, vec![3, 4]),
        with_descriptor(2, 2, vec![1, 0]),
        with_descriptor(3, 1, vec![0, 5]),
    ];
    state.apply(&Increment { author: AuthorId(1), number: 1, hlc_us: 1, ops: nodes.concat() });
    let asked = Descriptor { model: ModelId(1), scale: 0.1, values: vec![0, 7] };
    let similar: Vec<(u32, f32)> =
        most_similar(&state, &asked, 2).into_iter().map(|(id, cosine)| (id.number, cosine)).collect();
    assert_eq!(similar, [(3, 1.0), (1, 0.8)]);
    let near: Vec<u32> = nearest(&state, None, at(1.4, 0.0), 1.0).into_iter().map(|(node, _)| node.id.number).collect();
    assert_eq!(near, [1, 2]);
}

/// Equation 11 as it is written: the least over all pairs of nodes, with all shortest paths.
fn by_all_pairs(map: &MapState, from: FixedPoint, to: FixedPoint) -> Option<f64> {
    let containing = |point: FixedPoint| {
        map.nodes().filter(move |node| node.free_space.unwrap_or_default().contains(node.pose.position, point))
    };
    let share = containing(from).any(|a| containing(to).any(|b| a.id == b.id));
    if share {
        return Some(from.distance(to));
    }
    let pairs = containing(from).flat_map(|start| containing(to).map(move |goal| (start, goal)));
    let lengths = pairs.filter_map(|(start, goal)| {
        let (between, _) = shortest_path(map, start.id, goal.id)?;
        Some(from.distance(start.pose.position) + between + to.distance(goal.pose.position))
    });
    lengths.min_by(f64::total_cmp)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(500))]

    #[test]
    fn the_route_is_the_best_of_all_pairs(
        nodes in prop::collection::vec((0.0..10.0_f64, 0.0..10.0_f64, 0.5..3.0_f64), 2..12),
        edges in prop::collection::vec((0..12_u32, 0..12_u32), 0..24),
        picks in (any::<prop::sample::Index>(), any::<prop::sample::Index>()),
        offset in (-0.4..0.4_f64, -0.4..0.4_f64),
    ) {
        let count = nodes.len() as u32;
        let edges: BTreeSet<(u32, u32)> =
            edges.into_iter().map(|(a, b)| (a % count, b % count)).filter(|(a, b)| a != b).collect();
        let map = map(&nodes, &edges.into_iter().collect::<Vec<_>>());
        let place = |index: usize| at(nodes[index].0 + offset.0, nodes[index].1 + offset.1);
        let (from, to) = (place(picks.0.index(nodes.len())), place(picks.1.index(nodes.len())));
        match (plan(&map, from, to, &NodeRouteConfig::default()), by_all_pairs(&map, from, to)) {
            (Ok(route), Some(expected)) => {
                prop_assert!((route.length_m - expected).abs() < 1e-4, "{} and {expected}", route.length_m);
                prop_assert_eq!(route.waypoints.first().unwrap().point, from);
                prop_assert_eq!(route.waypoints.last().unwrap().point, to);
            }
            (Err(RouteError::NoPath { .. }), None) => {}
            other => prop_assert!(false, "{:?}", other),
        }
    }

    #[test]
    fn any_places_are_survived(x in any::<i32>(), y in any::<i32>(), edges in prop::collection::vec((0..3_u32, 0..3_u32), 0..4)) {
        let edges: Vec<_> = edges.into_iter().filter(|(a, b)| a != b).collect();
        let map = map(&[(0.0, 0.0, 1.0), (99_999.0, -99_999.0, 60.0), (1.0, 1.0, 0.0)], &edges);
        let _ = plan(&map, FixedPoint { x_mm: x, y_mm: y }, at(0.0, 0.0), &NodeRouteConfig::default());
    }
}
