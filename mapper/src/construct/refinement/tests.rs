use super::*;
use crate::construct::plan_config;
use fht_perception::grid::{Cell, CellState, GridConfig};
use fht_perception::pose::{pose, to_fixed};
use fht_proto::{AuthorId, Increment, NodeKind, Op};
use proptest::prelude::*;
use std::collections::BTreeSet;

/// Half of the hall's sides, metres.
const HALF: [f64; 2] = [40.0, 8.0];

/// A hall around the origin with boxes in it: their centres and half of their sides, metres.
fn hall(boxes: &[[f64; 4]]) -> OccupancyGrid {
    let config = GridConfig::default();
    let grid = OccupancyGrid::new(config.clone());
    let corner = Point2::new(HALF[0], HALF[1]);
    let bounds = CellBounds { min: grid.cell_of(-corner), max: grid.cell_of(corner) };
    let state = |cell: Cell| {
        let at = grid.centre(cell);
        let is_in = |[x, y, half_x, half_y]: &[f64; 4]| (at.x - x).abs() <= *half_x && (at.y - y).abs() <= *half_y;
        if boxes.iter().any(is_in) { CellState::Occupied } else { CellState::Free }
    };
    let cells = bounds.width() * bounds.height();
    OccupancyGrid::from_states(config, bounds, (0..cells).map(|index| state(bounds.cell(index))))
}

fn id(number: u32) -> NodeId {
    NodeId { author: AuthorId(1), number }
}

fn roadmap(places: &[(f64, f64)], edges: impl IntoIterator<Item = (u32, u32)>) -> Roadmap {
    let mut roadmap = Roadmap::default();
    for (number, (x, y)) in (0..).zip(places) {
        roadmap.add_node(id(number), FixedPoint::from_metres(*x, *y));
    }
    edges.into_iter().filter(|(a, b)| a != b).for_each(|(a, b)| roadmap.add_edge(EdgeKey::new(id(a), id(b))));
    roadmap
}

/// Shortcuts from node 0 by all ways through the whole grid, those by the part around it, and that
/// part.
fn both(roadmap: &Roadmap, grid: &OccupancyGrid) -> ([Vec<Shortcut>; 2], OccupancyGrid) {
    let (config, plan) = (RefinementConfig::default(), plan_config(0.14, grid));
    let space = Traversable::new(grid, &plan);
    let field = space.distances_from(point(roadmap.position(id(0)).unwrap()));
    let all = candidates(roadmap, id(0), &config);
    let by_all = shortcuts_in(Cow::Borrowed(roadmap), all, &space, &field, id(0), &config);
    let part = grid_around(id(0), roadmap, grid, &plan, &config);
    let by_part = shortcuts(roadmap, &Traversable::new(&part, &plan), id(0), &config);
    ([by_all, by_part], part)
}

#[test]
fn a_door_is_a_shortcut_and_is_looked_for_near_by_only() {
    // A wall with a door of 1 m between two nodes, which the map joins by a third.
    let grid = hall(&[[0.0, 4.25, 0.1, 3.75], [0.0, -4.25, 0.1, 3.75]]);
    let roadmap = roadmap(&[(-1.0, 0.0), (1.0, 0.0), (0.0, 4.0), (-24.0, 0.0)], [(0, 2), (2, 1), (0, 3)]);
    let ([whole, near], part) = both(&roadmap, &grid);
    assert_eq!(whole, [Shortcut { from: id(0), to: id(1), between: Vec::new() }]);
    assert_eq!(near, whole);
    assert!(part.bounds().width() < grid.bounds().width(), "{:?}", part.bounds());
}

#[test]
fn where_there_can_be_no_shortcut_none_is_looked_for() {
    let roadmap = roadmap(&[(0.0, 0.0), (3.0, 0.0), (6.0, 0.0)], [(0, 1), (1, 2)]);
    let ([whole, near], part) = both(&roadmap, &hall(&[]));
    assert_eq!((whole, near, part.bounds()), (Vec::new(), Vec::new(), CellBounds::EMPTY));
}

#[test]
fn a_way_that_begins_beside_a_node_is_shorter_than_the_straight_line_and_is_found() {
    // A robot fits only 0.55 m beside node 0, which stands in a slot.
    let grid = hall(&[[-4.8, 4.1, 5.2, 4.0], [-4.8, -4.1, 5.2, 4.0]]);
    let roadmap = roadmap(&[(0.0, 0.0), (1.9, 0.0), (0.95, 0.733)], [(0, 2), (2, 1)]);
    let ([whole, near], _) = both(&roadmap, &grid);
    let ends: Vec<(NodeId, NodeId)> = whole.iter().map(|shortcut| (shortcut.from, shortcut.to)).collect();
    assert_eq!(ends, [(id(0), id(1))]);
    assert_eq!(near, whole);
}

#[test]
fn increments_add_to_a_roadmap_what_they_add_to_the_map() {
    let put = |number, x, y| Op::PutNode { id: id(number), kind: NodeKind::Support, pose: to_fixed(&pose(x, y, 0.0)) };
    let edge = |a, b| Op::PutEdge { edge: EdgeKey::new(a, b) };
    let other = NodeId { author: AuthorId(2), number: 7 };
    let foreign = Op::PutNode { id: other, kind: NodeKind::Support, pose: to_fixed(&pose(1.0, 2.0, 0.0)) };
    let (mut map, mut roadmap) = (MapState::default(), Roadmap::default());
    for (author, ops) in [
        (AuthorId(2), vec![foreign]),
        (AuthorId(1), vec![put(0, 0.0, 0.0), put(1, 3.0, 0.5), edge(id(0), id(1)), edge(id(1), other)]),
        (AuthorId(1), vec![put(2, 5.0, 0.0), edge(id(0), id(1)), edge(id(2), id(0))]),
    ] {
        let increment = Increment { author, number: map.max_hlc_us() + 1, hlc_us: map.max_hlc_us() + 1, ops };
        map.apply(&increment);
        roadmap.add_put_by(&increment);
    }
    let of_map = Roadmap::of(&map);
    let all: BTreeSet<NodeId> = of_map.nodes().map(|(id, _)| id).collect();
    assert_eq!(all.len(), 4);
    assert!(roadmap.nodes().eq(of_map.nodes()));
    for from in &all {
        assert_eq!(roadmap.distances_from(*from, &all), of_map.distances_from(*from, &all));
    }
}

#[test]
fn ways_lead_along_edges_to_those_asked_for_that_can_be_reached() {
    let roadmap = roadmap(&[(0.0, 0.0), (3.0, 0.0), (3.0, 4.0), (9.0, 9.0)], [(0, 1), (1, 2), (0, 2)]);
    let asked = BTreeSet::from([id(0), id(2), id(3)]);
    assert_eq!(roadmap.distances_from(id(0), &asked), BTreeMap::from([(id(0), 0.0), (id(2), 5.0)]));
    assert_eq!(roadmap.distances_from(id(0), &BTreeSet::new()), BTreeMap::new());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn ways_are_as_long_as_trying_all_of_them_says(
        places in prop::collection::vec((-12.0..12.0, -3.0..3.0), 12),
        edges in prop::collection::vec((0..12_u32, 0..12_u32), 0..20),
        asked in prop::collection::btree_set(0..12_u32, 0..12),
    ) {
        let roadmap = roadmap(&places, edges.clone());
        let at = |number: u32| roadmap.position(id(number)).unwrap();
        // Floyd and Warshall, micrometres.
        let mut shortest = [[None::<u64>; 12]; 12];
        (0..12).for_each(|index| shortest[index][index] = Some(0));
        for (a, b) in edges.into_iter().filter(|(a, b)| a != b) {
            let length_um = (at(a).distance(at(b)) * 1e6).round() as u64;
            shortest[a as usize][b as usize] = Some(length_um);
            shortest[b as usize][a as usize] = Some(length_um);
        }
        for index in 0..12 * 12 * 12 {
            let (by, from, to) = (index / 144, index / 12 % 12, index % 12);
            let Some(way) = shortest[from][by].zip(shortest[by][to]).map(|(a, b)| a + b) else { continue };
            shortest[from][to] = Some(shortest[from][to].map_or(way, |known| known.min(way)));
        }
        let reached = asked.iter().filter_map(|to| Some((id(*to), shortest[0][*to as usize]? as f64 / 1e6)));
        let expected: BTreeMap<NodeId, f64> = reached.collect();
        prop_assert_eq!(roadmap.distances_from(id(0), &asked.into_iter().map(id).collect()), expected);
    }

    #[test]
    fn the_part_around_a_node_says_what_the_whole_grid_says(
        boxes in prop::collection::vec((-20.0..20.0, -8.0..8.0, 0.1..2.0, 0.1..2.0), 0..16),
        mut places in prop::collection::vec((-12.0..12.0, -3.0..3.0), 4..12),
        edges in prop::collection::vec((0..12_u32, 0..12_u32), 0..4),
        is_whole in prop::bool::ANY,
    ) {
        let boxes: Vec<[f64; 4]> = boxes.into_iter().map(|(x, y, half_x, half_y)| [x, y, half_x, half_y]).collect();
        let count = places.len() as u32;
        // Joined in the order of x, so that the map's ways are not much longer than they must be.
        places[1..].sort_by(|a: &(f64, f64), b| a.0.total_cmp(&b.0));
        let chain = (1..count).filter(|number| is_whole || *number != 2).map(|number| (number - 1, number));
        let edges = edges.into_iter().map(|(a, b)| (a % count, b % count)).chain(chain);
        let grid = hall(&boxes);
        let ([whole, near], _) = both(&roadmap(&places, edges), &grid);
        prop_assert_eq!(near, whole);
    }
}
