//! An index that follows its map finds what one built anew finds, and what plain searches find.
#![allow(clippy::unwrap_used)] // tests may panic

use fht_map::graph::alt::LandmarksConfig;
use fht_map::graph::astar::{AllOpen, Exceptions, Workspace, shortest_way};
use fht_map::graph::dijkstra::shortest_path;
use fht_map::graph::overlay_cells::CellsConfig;
use fht_map::graph::search_index::SearchIndexConfig;
use fht_map::index::lookup::{most_similar, nearest};
use fht_map::plan::node_route::{IndexedGraph, NodeRoute, plan};
use fht_map::{IndexConfig, MapIndex, MapState, NodeRouteConfig};
use fht_proto::{
    AuthorId, Descriptor, EdgeKey, FixedPoint, FixedPose, Increment, ModelId, NodeId, NodeKind, Op, Rect, ScanRecord,
    Signature,
};
use proptest::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

const NODES: u32 = 14;

fn id() -> impl Strategy<Value = NodeId> {
    (0..NODES).prop_map(id_of)
}

fn id_of(number: u32) -> NodeId {
    NodeId { author: AuthorId(number % 2), number }
}

/// Few places, so that nodes meet; some at the ends of the world, where edges are too long to be
/// stored.
fn point() -> impl Strategy<Value = FixedPoint> {
    let mm = || prop_oneof![6 => (0..4_i32).prop_map(|m| m * 1000), 3 => 0..4000_i32, 1 => Just(-100_000_000)];
    (mm(), mm()).prop_map(|(x_mm, y_mm)| FixedPoint { x_mm, y_mm })
}

fn pose() -> impl Strategy<Value = FixedPose> {
    point().prop_map(|position| FixedPose { position, yaw_e4: 0 })
}

fn descriptor() -> impl Strategy<Value = Descriptor> {
    let values = prop_oneof![prop::collection::vec(-2..3_i8, 3), prop::collection::vec(any::<i8>(), 20)];
    (0..2_u32, values).prop_map(|(model, values)| Descriptor { model: ModelId(model), scale: 1.0, values })
}

fn edge() -> impl Strategy<Value = EdgeKey> {
    (id(), id()).prop_filter("two ends", |(a, b)| a != b).prop_map(|(a, b)| EdgeKey::new(a, b))
}

fn op() -> impl Strategy<Value = Op> {
    let rect = (0..1500_u16, 0..1500_u16).prop_map(|(east_mm, north_mm)| Rect { east_mm, north_mm, ..Rect::default() });
    let kind = prop_oneof![Just(NodeKind::Main), Just(NodeKind::Support)];
    let signature = prop::option::of(descriptor()).prop_map(|descriptor| Signature {
        descriptor,
        scan: ScanRecord {
            base_from_sensor: FixedPose::default(),
            angle_min: 0.0,
            angle_increment: 0.1,
            ranges_mm: vec![1000; 4],
        },
    });
    prop_oneof![
        6 => (id(), kind, pose()).prop_map(|(id, kind, pose)| Op::PutNode { id, kind, pose }),
        2 => id().prop_map(|id| Op::RemoveNode { id }),
        3 => (id(), pose()).prop_map(|(id, pose)| Op::SetPose { id, pose }),
        2 => (id(), prop::option::of(rect)).prop_map(|(id, rect)| Op::SetFreeSpace { id, rect }),
        2 => (id(), signature).prop_map(|(id, signature)| Op::SetSignature { id, signature }),
        10 => edge().prop_map(|edge| Op::PutEdge { edge }),
        3 => edge().prop_map(|edge| Op::RemoveEdge { edge }),
    ]
}

/// Increments of one author; clocks go back at times.
fn increments() -> impl Strategy<Value = Vec<Increment>> {
    let one = (0..3_u64, prop::collection::vec(op(), 1..12));
    prop::collection::vec(one, 1..14).prop_map(|drawn| {
        let increment = |(number, (late, ops)): (u64, (u64, Vec<Op>))| Increment {
            author: AuthorId(1),
            number,
            hlc_us: 10 + number - late,
            ops,
        };
        (1..).zip(drawn).map(increment).collect()
    })
}

/// Few landmarks and many, mending that gives up soon and late.
fn config() -> impl Strategy<Value = IndexConfig> {
    let repair_nodes = prop_oneof![0..4_usize, Just(1000)];
    let rebuild_nodes = prop_oneof![3 => Just(0), 1 => Just(1000_usize)];
    (0..20_usize, repair_nodes, 0..4_usize, 0..12_usize, rebuild_nodes).prop_map(
        |(slots, repair_nodes, shortcuts, most_nodes, rebuild_nodes)| IndexConfig {
            guide: SearchIndexConfig {
                landmarks: LandmarksConfig { slots, repair_nodes, shortcuts, ..LandmarksConfig::default() },
                cells: CellsConfig { most_nodes },
            },
            rebuild_nodes,
        },
    )
}

/// Nodes with their places, edges with their lengths.
type Contents = (BTreeMap<NodeId, FixedPoint>, BTreeMap<EdgeKey, u64>);

fn contents(index: &MapIndex, map: &MapState) -> Contents {
    let roads = index.roads();
    let mut contents = Contents::default();
    for (id, number) in map.nodes().filter_map(|node| Some((node.id, roads.number(node.id)?))) {
        contents.0.insert(id, roads.position(number).unwrap());
        contents.1.extend(roads.steps(number).map(|(to, um)| (EdgeKey::new(id, roads.id(to).unwrap()), um)));
    }
    assert_eq!((contents.0.len(), contents.1.len()), (roads.nodes(), roads.edges()));
    contents
}

/// Lengths in whole micrometres, and which nodes are joined at all.
fn assert_finds_shortest(index: &MapIndex, map: &MapState, work: &mut Workspace) {
    let roads = index.roads();
    let shown: Vec<NodeId> = map.nodes().map(|node| node.id).collect();
    for &from in &shown {
        for &to in &shown {
            let (start, goal) = (roads.number(from).unwrap(), roads.number(to).unwrap());
            let way = shortest_way(roads, Some(index.guide()), &[(start, 0)], &[(goal, 0)], &AllOpen, work);
            let expected = shortest_path(map, from, to).map(|(m, _)| m);
            assert_eq!(way.as_ref().map(|way| way.cost_um as f64 / 1e6), expected, "{from} to {to}");
            let Some(way) = way else { continue };
            assert!(index.guide().at_least_um(roads, start, goal) <= way.cost_um, "{from} to {to}");
            let length = |pair: &[u32]| roads.steps(pair[0]).find(|(to, _)| *to == pair[1]).unwrap().1;
            assert_eq!(way.nodes.windows(2).map(length).sum::<u64>(), way.cost_um);
            assert_eq!((way.nodes.first(), way.nodes.last()), (Some(&start), Some(&goal)));
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn an_index_that_follows_is_one_built_anew(
        increments in increments(),
        config in config(),
        begin in 0..4_usize,
        at in point(),
        asked in descriptor(),
    ) {
        let (mut map, mut work) = (MapState::new(), Workspace::default());
        let begin = begin.min(increments.len());
        increments[..begin].iter().for_each(|increment| map.apply(increment));
        let mut index = MapIndex::new(&map, config.clone());
        // Several at once, as when one has waited for another.
        for some in increments[begin..].chunks(2) {
            some.iter().for_each(|increment| map.apply(increment));
            index.follow(&map, some);
            prop_assert_eq!(contents(&index, &map), contents(&MapIndex::new(&map, config.clone()), &map));
            assert_finds_shortest(&index, &map, &mut work);
            for radius_m in [0.0, 1.0, 2.5] {
                prop_assert_eq!(nearest(&map, Some(&index), at, radius_m), nearest(&map, None, at, radius_m));
            }
            for k in [1, 3, 100] {
                prop_assert_eq!(index.appearance().most_similar(&asked, k), most_similar(&map, &asked, k));
            }
        }
    }

    #[test]
    fn routes_are_as_long_as_without_an_index(
        increments in increments(),
        config in config(),
        ends in (point(), point()),
        blocked in prop::collection::btree_set(edge(), 0..6),
    ) {
        let (mut map, mut work) = (MapState::new(), Workspace::default());
        let mut index = MapIndex::new(&map, config);
        increments.iter().for_each(|increment| map.apply(increment));
        index.follow(&map, &increments);
        let config = NodeRouteConfig { blocked, ..NodeRouteConfig::default() };
        match (plan(IndexedGraph { index: &index, work: &mut work }, ends.0, ends.1, &config), plan(&map, ends.0, ends.1, &config)) {
            (Ok(fast), Ok(plain)) => {
                // The places; which of several nodes stands there is open.
                let ends_of = |route: &NodeRoute| [route.waypoints.first(), route.waypoints.last()].map(|end| end.unwrap().point);
                prop_assert_eq!(ends_of(&fast), ends_of(&plain));
                // Equally short for the search; off the map a metre counts ten, so lengths
                // themselves may differ.
                let all_inside = fast.length_m == plain.length_m
                    || [&fast, &plain].iter().any(|route| route.waypoints.iter().filter(|point| point.node.is_none()).count() > 2);
                prop_assert!(all_inside || (fast.length_m - plain.length_m).abs() < 1e-4, "{:?} and {:?}", fast, plain);
            }
            (fast, plain) => prop_assert_eq!(fast, plain),
        }
    }

    #[test]
    fn what_holds_for_one_query_needs_no_new_landmarks(
        increments in increments(),
        config in config(),
        factors in prop::collection::btree_map((0..NODES, 0..NODES), prop::option::of(0.5..20.0_f64), 0..20),
        starts in prop::collection::vec((0..NODES + 2, 0..3_000_000_u64), 1..4),
        goals in prop::collection::vec((0..NODES + 2, 0..3_000_000_u64), 1..4),
    ) {
        let (mut map, mut work) = (MapState::new(), Workspace::default());
        let mut index = MapIndex::new(&map, config);
        for increment in &increments {
            map.apply(increment);
            index.follow(&map, [increment]);
        }
        let roads = index.roads();
        let overlay = |from: u32, to: u32| factors.get(&(from, to)).copied().unwrap_or(Some(1.0));
        let fast = shortest_way(roads, Some(index.guide()), &starts, &goals, &overlay, &mut work);
        let plain = shortest_way(roads, None, &starts, &goals, &overlay, &mut work);
        prop_assert_eq!(fast.as_ref().map(|way| way.cost_um), plain.map(|way| way.cost_um));
        // The same both ways, and by a list.
        let listed = Exceptions::new(factors.iter().map(|(&(a, b), &factor)| (a, b, factor)));
        let fast_listed = shortest_way(roads, Some(index.guide()), &starts, &goals, &listed, &mut work);
        let plain_listed = shortest_way(roads, None, &starts, &goals, &listed, &mut work);
        prop_assert_eq!(fast_listed.map(|way| way.cost_um), plain_listed.map(|way| way.cost_um));
        if let Some(way) = fast {
            let least = |ends: &[(u32, u64)], node: u32| ends.iter().filter(|end| end.0 == node).map(|end| end.1).min().unwrap();
            let (first, last) = (way.nodes[0], way.nodes[way.nodes.len() - 1]);
            let counted = |pair: &[u32]| {
                let um = roads.steps(pair[0]).find(|(to, _)| *to == pair[1]).unwrap().1;
                ((um as f64 * overlay(pair[0], pair[1]).unwrap()).round() as u64).max(um)
            };
            let sum = way.nodes.windows(2).map(counted).sum::<u64>() + least(&starts, first) + least(&goals, last);
            prop_assert_eq!(sum, way.cost_um);
        }
    }

    #[test]
    fn landmarks_made_elsewhere_are_right_for_what_changed_meanwhile(increments in increments(), config in config()) {
        let (mut map, mut work) = (MapState::new(), Workspace::default());
        let mut index = MapIndex::new(&map, config);
        let (before, meanwhile) = increments.split_at(increments.len() / 2);
        before.iter().for_each(|increment| map.apply(increment));
        index.follow(&map, before);
        let guide = index.guide_job().run();
        for increment in meanwhile {
            map.apply(increment);
            index.follow(&map, [increment]);
        }
        index.adopt(guide);
        assert_finds_shortest(&index, &map, &mut work);
    }
}

/// A comb of many teeth: the way from tooth to tooth is long, until one edge joins their tips.
#[test]
fn a_shortcut_through_a_large_map_waits_and_is_used() {
    const TEETH: u32 = 20;
    const LENGTH: u32 = 50;
    let node = |tooth: u32, along: u32| NodeId { author: AuthorId(1), number: tooth * LENGTH + along };
    let mut ops = Vec::new();
    for tooth in 0..TEETH {
        for along in 0..LENGTH {
            let pose = FixedPose::from_metres(f64::from(tooth), f64::from(along), 0.0);
            ops.push(Op::PutNode { id: node(tooth, along), kind: NodeKind::Support, pose });
            let before =
                if along > 0 { Some(node(tooth, along - 1)) } else { tooth.checked_sub(1).map(|t| node(t, 0)) };
            ops.extend(before.map(|before| Op::PutEdge { edge: EdgeKey::new(before, node(tooth, along)) }));
        }
    }
    let mut map = MapState::new();
    map.apply(&Increment { author: AuthorId(1), number: 1, hlc_us: 1, ops });
    let landmarks = LandmarksConfig { repair_nodes: 10, ..LandmarksConfig::default() };
    let mut index = MapIndex::new(
        &map,
        IndexConfig { guide: SearchIndexConfig { landmarks, ..SearchIndexConfig::default() }, rebuild_nodes: 0 },
    );
    assert!(!index.is_worn());
    let (from, to) = (node(3, LENGTH - 1), node(12, LENGTH - 1));
    let edge = EdgeKey::new(from, to);
    let mut work = Workspace::default();
    let mut between = |index: &MapIndex, from: NodeId, to: NodeId| {
        let (from, to) = (index.roads().number(from).unwrap(), index.roads().number(to).unwrap());
        let way = shortest_way(index.roads(), Some(index.guide()), &[(from, 0)], &[(to, 0)], &AllOpen, &mut work);
        way.unwrap().cost_um / 1_000_000
    };
    assert_eq!(between(&index, from, to), 2 * 49 + 9);
    let put = Increment { author: AuthorId(1), number: 2, hlc_us: 2, ops: vec![Op::PutEdge { edge }] };
    map.apply(&put);
    index.follow(&map, [&put]);
    assert!(index.is_worn(), "the edge waits as a shortcut");
    assert_eq!((between(&index, from, to), between(&index, node(3, 39), node(12, 39))), (9, 29));
    let guide = index.guide_job().run();
    index.adopt(guide);
    assert!(!index.is_worn());
    assert_eq!((between(&index, from, to), between(&index, node(3, 39), node(12, 39))), (9, 29));
    let nodes: BTreeSet<NodeId> = map.nodes().map(|node| node.id).collect();
    assert_eq!(nodes.len(), index.places().len());
}
