//! What is written when two maps are merged: one map that hangs together, with what operators
//! wrote, and the same every time.
#![allow(clippy::unwrap_used)] // tests may panic

mod drawn;

use drawn::{Building, ROOMS};
use fht_map::MapState;
use fht_map::plan::rules::Rules;
use fht_map::{FreeSpace, NodeRouteConfig};
use fht_merge::{MergeConfig, MergeOptions, MergedOperations, join, lay};
use fht_perception::pose::{Point2, pose};
use fht_proto::{AuthorId, Datum, EdgeKey, FixedPoint, FixedPose, Increment, NodeId, Op, PlanImage, Zone, ZoneRule};
use std::collections::BTreeSet;

fn order() -> MergeOptions<'static> {
    MergeOptions { author: AuthorId::of_robot("operator"), suffix: "second", only_map: false }
}

/// Merges, and applies what comes of it.
fn merged(a: &MapState, b: &MapState, order: &MergeOptions<'_>) -> (MapState, MergedOperations) {
    let config = MergeConfig::default();
    let laid = lay(a, b, &config).unwrap_or_else(|refusal| panic!("{refusal}"));
    let joined = join(a, b, &laid, order, &config).unwrap_or_else(|refusal| panic!("{refusal}"));
    let mut both = a.clone();
    for (number, ops) in (1..).zip(joined.batches.clone()) {
        both.apply(&Increment { author: order.author, number, hlc_us: both.max_hlc_us() + 1, ops });
    }
    (both, joined)
}

fn parts(map: &MapState) -> usize {
    let mut open: BTreeSet<NodeId> = map.nodes().map(|node| node.id).collect();
    let mut count = 0;
    while let Some(first) = open.pop_first() {
        count += 1;
        let mut waiting = vec![first];
        while let Some(here) = waiting.pop() {
            waiting.extend(map.neighbours(here).map(|node| node.id).filter(|id| open.remove(id)));
        }
    }
    count
}

/// The west and the east of a building, with a third in common; two robots of one name.
fn halves() -> (MapState, MapState) {
    let building = Building::wing(&ROOMS);
    let a = building.seen_within(0.0..20.0).mapped(&pose(1.5, 1.0, 0.0), "explorer", 1);
    let b = building.seen_within(14.0..40.0).mapped(&pose(20.0, 1.2, 1.0), "explorer", 2);
    (a, b)
}

fn write(map: &mut MapState, ops: Vec<Op>) {
    let author = AuthorId::of_robot("warden");
    map.apply(&Increment { author, number: 1, hlc_us: map.max_hlc_us() + 1, ops });
}

#[test]
fn halves_become_one_map_with_ways_through_it() {
    let (a, b) = halves();
    let (both, joined) = merged(&a, &b, &order());
    assert_eq!(parts(&both), 1);
    assert!(joined.figures.main_nodes >= 5, "{:?}", joined.figures);
    assert!(joined.figures.main_nodes < b.counts().main_nodes, "{:?}", joined.figures);
    assert!(joined.figures.joining_edges > 0 && joined.figures.left_out == 0, "{:?}", joined.figures);
    let rules = Rules::of(&both, Vec::new());
    let space = FreeSpace::of(&both, &rules.space_config());
    // From the first corridor to the last, in the frame of the first map.
    let (from, to) = (FixedPoint::from_metres(0.0, 0.0), FixedPoint::from_metres(29.5, 0.0));
    let route =
        rules.plan(&both, &space, from, to, &NodeRouteConfig::default()).unwrap_or_else(|error| panic!("{error}"));
    let back =
        rules.plan(&both, &space, to, from, &NodeRouteConfig::default()).unwrap_or_else(|error| panic!("{error}"));
    for route in [route, back] {
        assert!(route.waypoints.iter().all(|waypoint| (-0.9..0.9).contains(&waypoint.point.y())), "{route:?}");
    }
}

#[test]
fn the_same_maps_give_the_same_operations() {
    let (a, b) = halves();
    let (one, other) = (merged(&a, &b, &order()), merged(&a, &b, &order()));
    assert_eq!(one.1.batches, other.1.batches);
    assert_eq!(one.0.digest(), other.0.digest());
}

#[test]
fn merged_again_there_is_nothing_new() {
    let (a, b) = halves();
    let (both, _) = merged(&a, &b, &order());
    let (_, again) = merged(&both, &b, &order());
    assert_eq!((again.figures.main_nodes, again.figures.left_out), (0, 0), "{:?}", again.figures);
    // Nodes that were taken over keep their numbers to themselves.
    let author = order().author;
    let used: BTreeSet<NodeId> = both.nodes().map(|node| node.id).filter(|id| id.author == author).collect();
    let puts = again.batches.iter().flatten().filter_map(|op| match op {
        Op::PutNode { id, .. } => Some(*id),
        _ => None,
    });
    assert!(puts.into_iter().all(|id| !used.contains(&id)));
}

#[test]
fn merged_again_what_got_another_name_is_there() {
    let (mut a, mut b) = halves();
    let dock = |x: f64, yaw| {
        let pose = Some(FixedPose::from_metres(x, 0.0, yaw));
        Op::SetPlace { name: "dock".parse().unwrap(), pose }
    };
    let wet = |x: f64| {
        let corners = [(x, 0.0), (x + 1.0, 0.0), (x + 1.0, 1.0)].map(|(x, y)| FixedPoint::from_metres(x, y)).to_vec();
        Op::SetZone { name: "wet".parse().unwrap(), zone: Some(Zone { rule: ZoneRule::KeepOut, corners }) }
    };
    write(&mut a, vec![dock(1.0, 0.5), wet(5.0)]);
    write(&mut b, vec![dock(2.0, 0.5), wet(1.0)]);
    let (both, first) = merged(&a, &b, &order());
    assert_eq!((first.figures.renamed.len(), first.figures.annotations), (2, 2), "{:?}", first.figures);
    let (_, again) = merged(&both, &b, &order());
    assert_eq!((again.figures.renamed.len(), again.figures.annotations), (0, 0), "{:?}", again.figures);
    // What has been turned round since, or lies elsewhere, is something else.
    let author = AuthorId::of_robot("warden");
    let ops = vec![dock(2.0, 2.0), wet(2.0)];
    b.apply(&Increment { author, number: 2, hlc_us: b.max_hlc_us() + 1, ops });
    let (_, other) = merged(&both, &b, &order());
    assert_eq!((other.figures.renamed.len(), other.figures.annotations), (2, 2), "{:?}", other.figures);
    assert!(other.figures.renamed.iter().all(|[_, new]| new.ends_with("-second-2")), "{:?}", other.figures);
}

#[test]
fn what_operators_wrote_comes_along() {
    let (mut a, mut b) = halves();
    let dock = |x: f64| Op::SetPlace { name: "dock".parse().unwrap(), pose: Some(FixedPose::from_metres(x, 0.0, 0.5)) };
    write(&mut a, vec![dock(1.0)]);
    let closed = b.edges().last().unwrap();
    let corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)].map(|(x, y)| FixedPoint::from_metres(x, y)).to_vec();
    let zone = Zone { rule: ZoneRule::SpeedLimit(300), corners };
    write(
        &mut b,
        vec![
            dock(2.0),
            Op::SetZone { name: "wet".parse().unwrap(), zone: Some(zone) },
            Op::SetClosed { edge: closed, closed: true },
            Op::SetFloorPlan {
                plan: Some(PlanImage {
                    image: "hall.png".to_owned(),
                    um_per_pixel: 50_000,
                    map_from_image: FixedPose::from_metres(2.0, 0.0, 0.5),
                }),
            },
            Op::SetDatum { datum: Some(Datum::from_degrees(52.5, 13.4, 0.25)) },
        ],
    );
    let (both, joined) = merged(&a, &b, &order());
    assert_eq!(joined.figures.renamed, [["dock".to_owned(), "dock-second".to_owned()]]);
    assert_eq!((joined.figures.annotations, joined.figures.closed_edges), (4, 1), "{:?}", joined.figures);
    // Where it lies in the first map's frame: the frames are known.
    let a_from_b = pose(1.5, 1.0, 0.0).inverse() * pose(20.0, 1.2, 1.0);
    let truth = a_from_b * Point2::new(2.0, 0.0);
    let found = both.annotations().place(&"dock-second".parse().unwrap()).unwrap();
    assert!((found.position.x() - truth.x).hypot(found.position.y() - truth.y) < 0.05, "{found:?} {truth}");
    assert!((found.yaw() - 1.5).abs() < 0.02, "{found:?}");
    assert_eq!(both.annotations().zones().count(), 1);
    // The plan lies where the place does, and the same point is at the same latitude and longitude.
    assert_eq!(both.annotations().floor_plan().unwrap().map_from_image, found);
    let [told, there] = [
        both.annotations().datum().unwrap().locate(truth.x, truth.y),
        b.annotations().datum().unwrap().locate(2.0, 0.0),
    ];
    assert!(told.iter().zip(there).all(|(a, b)| (a - b).abs() < 1e-6), "{told:?} {there:?}");
    let ends = |edge: EdgeKey| [edge.low(), edge.high()].map(|id| both.node(id).unwrap().pose.position);
    let edge = both.closed_edges().next().unwrap();
    let moved = [closed.low(), closed.high()].map(|id| {
        let at = b.node(id).unwrap().pose.position;
        a_from_b * Point2::new(at.x(), at.y())
    });
    for at in ends(edge) {
        assert!(moved.iter().any(|truth| (truth.x - at.x()).hypot(truth.y - at.y()) < 0.05), "{at:?} {moved:?}");
    }
    let (bare, joined) = merged(&a, &b, &MergeOptions { only_map: true, ..order() });
    assert_eq!((joined.figures.annotations, joined.figures.closed_edges), (0, 0));
    assert_eq!((bare.closed_edges().count(), bare.annotations().zones().count()), (0, 0));
}
