//! The search against a slow one: every corner of the mesh sees every other, or does not.

use super::*;
use crate::crdt::state::MapState;
use crate::navmesh::free_space::{FreeSpace, SpaceConfig};
use crate::navmesh::plane::cross;
use fht_proto::{AuthorId, FixedPoint, FixedPose, Increment, NodeId, NodeKind, Op, Rect};
use proptest::prelude::*;

/// Free space of rectangles: least x and y, width and height, millimetres. Then of squares that are
/// blocked, by their middles.
fn space(rectangles: &[[i32; 4]], blocked: &[[i32; 2]]) -> FreeSpace {
    let mut ops = Vec::new();
    for (number, &[x_mm, y_mm, width, height]) in (0..).zip(rectangles) {
        let id = NodeId { author: AuthorId(1), number };
        let pose = FixedPose { position: FixedPoint { x_mm, y_mm }, ..FixedPose::default() };
        let rect = Rect { west_mm: 0, south_mm: 0, east_mm: width as u16, north_mm: height as u16 };
        ops.push(Op::PutNode { id, kind: NodeKind::Support, pose });
        ops.push(Op::SetFreeSpace { id, rect: Some(rect) });
    }
    let mut map = MapState::new();
    map.apply(&Increment { author: AuthorId(1), number: 1, hlc_us: 1, ops });
    let blocked = blocked.iter().map(|&[x_mm, y_mm]| FixedPoint { x_mm, y_mm }).collect();
    FreeSpace::of(&map, &SpaceConfig { blocked, blocked_radius_mm: 120, ..SpaceConfig::default() })
}

/// Whether the straight way between two places lies in the mesh: what of it lies in triangles, put
/// together, is all of it.
fn sees(mesh: &Mesh, ends: [Corner; 2]) -> bool {
    let length = distance(ends[0], ends[1]);
    let mut spans: Vec<(f64, f64)> = Vec::new();
    for triangle in &mesh.triangles {
        let (mut first, mut last) = (0.0_f64, 1.0_f64);
        for side in 0..3 {
            let (a, b) = (triangle.places[side], triangle.places[(side + 1) % 3]);
            // How far inside of the side either end is, millimetres.
            let [from, to] = ends.map(|end| cross(a, b, end) / distance(a, b) + 1e-7);
            match (from >= 0.0, to >= 0.0) {
                (true, true) => {}
                (false, false) => last = -1.0,
                (true, false) => last = last.min(from / (from - to)),
                (false, true) => first = first.max(from / (from - to)),
            }
        }
        if first <= last {
            spans.push((first, last));
        }
    }
    spans.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut reached = 0.0;
    for (first, last) in spans {
        if (first - reached) * length > 1e-3 {
            return false;
        }
        reached = f64::max(reached, last);
    }
    (1.0 - reached) * length <= 1e-3
}

/// The length of the shortest way over corners that see each other.
fn slowly(mesh: &Mesh, from: &Spot, to: &Spot) -> Option<f64> {
    let of_part = mesh.triangles.iter().filter(|triangle| triangle.part == from.part);
    let mut corners: Vec<Corner> = of_part.flat_map(|triangle| triangle.places).collect();
    corners.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    corners.dedup();
    let places: Vec<Corner> = [from.place, to.place].into_iter().chain(corners).collect();
    let mut lengths = vec![f64::INFINITY; places.len()];
    let mut is_done = vec![false; places.len()];
    lengths[0] = 0.0;
    loop {
        let open = (0..places.len()).filter(|&place| !is_done[place]);
        let here = open.min_by(|&a, &b| lengths[a].total_cmp(&lengths[b]))?;
        if lengths[here].is_infinite() {
            return None;
        }
        if here == 1 {
            return Some(lengths[1]);
        }
        is_done[here] = true;
        for next in 0..places.len() {
            let length = lengths[here] + distance(places[here], places[next]);
            if !is_done[next] && length < lengths[next] && sees(mesh, [places[here], places[next]]) {
                lengths[next] = length;
            }
        }
    }
}

fn length_of(way: &[Corner]) -> f64 {
    way.windows(2).map(|pair| distance(pair[0], pair[1])).sum()
}

fn rectangles() -> impl Strategy<Value = Vec<[i32; 4]>> {
    let rectangle = (0..9000, 0..7000, 500..5000, 500..5000).prop_map(|(x, y, width, height)| [x, y, width, height]);
    // On a raster many corners lie on one line.
    let on_raster =
        (0..18, 0..14, 1..10, 1..10).prop_map(|(x, y, width, height)| [x, y, width, height].map(|it: i32| it * 500));
    prop_oneof![prop::collection::vec(rectangle, 1..9), prop::collection::vec(on_raster, 1..9)]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]
    #[test]
    fn no_way_over_corners_is_shorter(rectangles in rectangles(), blocked in prop::collection::vec(prop::array::uniform2(0..9000), 0..4),
                                      places in prop::collection::vec((0..9_usize, 0..100, 0..100), 12)) {
        let space = space(&rectangles, &blocked);
        let mesh = &space.mesh;
        let spots: Vec<Spot> = places.iter().filter_map(|&(number, x, y)| {
            let [low_x, low_y, width, height] = rectangles[number % rectangles.len()];
            let place = [f64::from(low_x + width * x / 100), f64::from(low_y + height * y / 100)];
            Some(mesh.spot(mesh.triangle_at(place)?, place))
        }).collect();
        for pair in spots.windows(2) {
            let way = shortest_way(mesh, &pair[0], &pair[1]);
            prop_assert_eq!(&way, &shortest_way(mesh, &pair[0], &pair[1]), "a search leaves nothing behind");
            let slowly = slowly(mesh, &pair[0], &pair[1]);
            prop_assert_eq!(way.is_some(), slowly.is_some());
            if let (Some(way), Some(slowly)) = (way, slowly) {
                prop_assert!((length_of(&way) - slowly).abs() < 0.01, "{} and {slowly}: {way:?}", length_of(&way));
                for step in way.windows(2) {
                    prop_assert!(sees(mesh, [step[0], step[1]]), "{step:?}");
                }
            }
        }
    }
}
