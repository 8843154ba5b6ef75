//! Rectangles and nodes follow what is seen.

use super::*;
use crate::haste::Haste;
use fht_perception::frame::LaserScan;
use fht_perception::grid::{Cell, CellBounds, CellState, GridConfig};
use fht_perception::pose::{Point2, pose};
use fht_proto::{AuthorId, EdgeKey, Signature};
use std::collections::BTreeSet;

/// A scan from the middle of a square room of side 6 m, with a post of 0.2 m at (1, 0) if `post`.
fn room(post: bool) -> LaserScan {
    LaserScan::all_round(2880, |cos, sin| {
        let is_post = post && cos > 0.0 && (sin / cos).abs() < 0.1;
        if is_post { 1.0 / cos } else { 3.0 / cos.abs().max(sin.abs()) }
    })
}

fn look(grid: &mut OccupancyGrid, scan: &LaserScan, times: usize) {
    (0..times).for_each(|_| grid.integrate(&Pose2::identity(), scan));
}

/// A map of two nodes in an empty room; the first has a rectangle of the whole room.
fn mapped() -> (Builder, Journal, OccupancyGrid, NodeId) {
    let mut grid = OccupancyGrid::new(GridConfig::default());
    look(&mut grid, &room(false), 6);
    let mut builder = Builder::new(BuilderConfig::default());
    let mut journal = Journal::new(AuthorId(1));
    let mut make = |place: Pose2| {
        let footing = Footing { anchored: Anchored { keyframe: 0, keyframe_from_base: place }, frame: None };
        let estimate = SlamEstimate { grid: &grid, poses: &[Pose2::identity()] };
        let (id, ops) = builder.make_node(footing, None, &mut journal, &estimate);
        journal.write(ops, 1);
        id
    };
    let first = make(pose(0.0, 0.0, 0.0));
    make(pose(-1.0, 1.0, 0.0));
    (builder, journal, grid, first)
}

fn free_around(journal: &Journal, id: NodeId) -> Option<fht_proto::Rect> {
    journal.state().node(id).and_then(|node| node.free_space)
}

#[test]
fn a_rectangle_that_something_stands_in_is_corrected_when_a_node_near_it_is_made_and_at_the_end() {
    for at_the_end in [false, true] {
        let (mut builder, mut journal, mut grid, first) = mapped();
        assert!(free_around(&journal, first).is_some_and(|rect| rect.east_mm > 2000));
        look(&mut grid, &room(true), 20);
        let ops = if at_the_end {
            builder.finish(&journal, &grid)
        } else {
            let anchored = Anchored { keyframe: 0, keyframe_from_base: pose(-1.0, -1.0, 0.0) };
            let estimate = SlamEstimate { grid: &grid, poses: &[Pose2::identity()] };
            builder.make_node(Footing { anchored, frame: None }, None, &mut journal, &estimate).1
        };
        journal.write(ops, 2);
        let rect = free_around(&journal, first).expect("still on free floor");
        assert!(rect.east_mm <= 1000 || rect.north_mm < 200 || rect.south_mm < 200, "{rect:?}");
        journal.write(builder.finish(&journal, &grid), 3);
        assert!(builder.finish(&journal, &grid).is_empty(), "nothing is left to correct");
    }
}

#[test]
fn nodes_follow_their_keyframes_and_an_edge_that_then_leads_through_a_post_is_replaced() {
    let (mut builder, mut journal, mut grid, first) = mapped();
    let second = NodeId { author: AuthorId(1), number: 1 };
    let estimate = |shift: Pose2| [shift];
    let still = estimate(pose(0.002, 0.0, 0.001));
    let (ops, moved) = builder.follow(&journal, &SlamEstimate { grid: &grid, poses: &still });
    assert!(ops.is_empty() && moved.is_empty(), "millimetres are not worth an increment");

    // The keyframe turns by 90°: the second node goes from (-1, 1) to (-1, -1), and so does the
    // post's shadow.
    let turned = estimate(pose(0.0, 0.0, std::f64::consts::FRAC_PI_2));
    let (ops, moved) = builder.follow(&journal, &SlamEstimate { grid: &grid, poses: &turned });
    assert_eq!(moved.len(), 2, "the first turns on the spot");
    journal.write(ops, 2);
    let place = |journal: &Journal, id| journal.state().node(id).map(|node| point(node.pose.position));
    assert_eq!(place(&journal, second), Some(Point2::new(-1.0, -1.0)));
    assert_eq!(place(&journal, first), Some(Point2::new(0.0, 0.0)));

    // Something stands between the two by now.
    let edge = EdgeKey::new(first, second);
    assert!(journal.state().edges().any(|there| there == edge));
    let mut post = room(false);
    post.ranges_m.fill(0.11);
    (0..20).for_each(|_| grid.integrate(&pose(-0.5, -0.5, 0.0), &post));
    let (ops, cut) = builder.mend(&moved, &journal, &grid);
    assert!(ops.contains(&Op::RemoveEdge { edge }) && cut == BTreeSet::from([first, second]), "{ops:?}");
    journal.write(ops, 3);
    assert!(builder.mend(&moved, &journal, &grid).0.is_empty(), "nothing is left to mend");
}

#[test]
fn a_node_that_something_stands_on_has_no_free_space() {
    let (builder, mut journal, mut grid, first) = mapped();
    let mut blocked = room(false);
    blocked.ranges_m.fill(0.11);
    // From beside the node, a ring of hits lies over it.
    (0..20).for_each(|_| grid.integrate(&pose(0.13, 0.02, 0.0), &blocked));
    journal.write(builder.finish(&journal, &grid), 2);
    assert_eq!(free_around(&journal, first), None);
}

#[test]
fn ground_in_a_gap_too_narrow_for_an_edge_is_covered_from_outside() {
    // A room of 3 m by 3 m, and out of the middle of its right wall a niche, 0.3 m wide and 1 m
    // deep.
    let bounds = CellBounds { min: Cell { i: -30, j: -30 }, max: Cell { i: 52, j: 31 } };
    let is_free = |cell: Cell| {
        (cell.i.abs() < 30 && cell.j.abs() < 30) || (cell.i < 50 && (-3..3).contains(&cell.j) && cell.i > -30)
    };
    let state = |index| if is_free(bounds.cell(index)) { CellState::Free } else { CellState::Occupied };
    let cells = bounds.width() * bounds.height();
    let grid = OccupancyGrid::from_states(GridConfig::default(), bounds, (0..cells).map(state));
    let mut builder = Builder::new(BuilderConfig::default());
    let mut journal = Journal::new(AuthorId(1));
    let estimate = SlamEstimate { grid: &grid, poses: &[Pose2::identity()] };
    let anchored = Anchored { keyframe: 0, keyframe_from_base: pose(0.0, -1.0, 0.0) };
    let (_, ops) = builder.make_node(Footing { anchored, frame: None }, None, &mut journal, &estimate);
    journal.write(ops, 1);
    let ops = builder.cover(&mut journal, &estimate, &Haste::none());
    journal.write(ops, 2);
    let in_niche = |node: &fht_map::NodeRef<'_>| {
        node.free_space.is_some_and(|rect| {
            let (min, max) = (rect.min(node.pose.position), rect.max(node.pose.position));
            min.0 < 1.5 && max.0 > 2.4 && min.1 < -0.1 && max.1 > 0.1
        })
    };
    let node = journal.state().nodes().find(in_niche).expect("a rectangle reaches into the niche");
    assert!(node.pose.position.x() < 1.5, "it stands where an edge leads: {:?}", node.pose);
    assert!(journal.state().edges().any(|edge| [edge.low(), edge.high()].contains(&node.id)));
    let before = journal.state().nodes().count();
    journal.write(builder.finish(&journal, &grid), 3);
    assert!(
        builder
            .cover(&mut journal, &SlamEstimate { grid: &grid, poses: &[Pose2::identity()] }, &Haste::none())
            .is_empty(),
        "{before} nodes cover it"
    );
}

/// The map of [`mapped`], and a node in the middle that keeps a scan.
fn mapped_with(scan: &LaserScan) -> (Builder, Journal, OccupancyGrid, NodeId) {
    let (mut builder, mut journal, grid, _) = mapped();
    let estimate = SlamEstimate { grid: &grid, poses: &[Pose2::identity()] };
    let anchored = Anchored { keyframe: 0, keyframe_from_base: pose(0.0, 0.0, 0.0) };
    let signature = Signature { descriptor: None, scan: scan.to_record() };
    let (id, ops) = builder.make_node(Footing { anchored, frame: Some(7) }, Some(signature), &mut journal, &estimate);
    journal.write(ops, 2);
    (builder, journal, grid, id)
}

#[test]
fn who_stood_before_a_node_is_left_out_of_its_scan_once_the_floor_there_is_free() {
    let (mut builder, mut journal, grid, id) = mapped_with(&room(true));
    let nearest_mm = |journal: &Journal| {
        let node = journal.state().node(id).expect("the node");
        node.signature.and_then(|signature| signature.scan.ranges_mm.iter().copied().filter(|mm| *mm > 0).min())
    };
    assert_eq!(nearest_mm(&journal), Some(1000));
    journal.write(builder.finish(&journal, &grid), 3);
    assert_eq!(nearest_mm(&journal), Some(1000), "where nobody walks it is a post");
    builder.expect_people();
    journal.write(builder.finish(&journal, &grid), 4);
    assert_eq!(nearest_mm(&journal), Some(3000));
    assert!(builder.finish(&journal, &grid).is_empty(), "nothing is left to correct");
}

/// A scan from the middle of a room whose walls are so far off, with people at 1 m on the left and
/// on the right.
fn crowd(walls_m: f64) -> LaserScan {
    LaserScan::all_round(2880, |cos, sin| {
        let is_somebody = cos.abs() < 0.8;
        if is_somebody { 1.0 } else { walls_m / cos.abs().max(sin.abs()) }
    })
}

/// The returns of a node of `scan` after somebody has walked and the map is finished.
fn kept_of(scan: &LaserScan) -> Vec<u16> {
    let (mut builder, mut journal, grid, id) = mapped_with(scan);
    builder.expect_people();
    journal.write(builder.finish(&journal, &grid), 3);
    let signature = journal.state().node(id).expect("the node").signature.expect("its scan");
    signature.scan.ranges_mm.iter().copied().filter(|mm| *mm > 0).collect()
}

#[test]
fn a_crowd_that_stood_round_the_robot_is_left_out_if_the_rest_of_the_scan_still_fits() {
    let scan = crowd(3.0);
    let people = scan.ranges_m.iter().filter(|range_m| **range_m == 1.0).count();
    assert!((0.5..0.65).contains(&(people as f64 / scan.ranges_m.len() as f64)), "{people}");
    assert_eq!(kept_of(&scan).len(), scan.ranges_m.len() - people);
    assert!(kept_of(&scan).iter().all(|mm| *mm >= 3000));
}

#[test]
fn a_scan_whose_rest_does_not_fit_is_left_as_it_is() {
    // Walls where the floor is free; walls beyond those of the map; nothing but a ring.
    for scan in [crowd(2.0), crowd(5.0), LaserScan::all_round(2880, |_, _| 1.0)] {
        assert_eq!(kept_of(&scan).len(), scan.ranges_m.len(), "the map is what is wrong, or the node's place");
    }
    // Every second beam ahead and behind ends at somebody for himself: too few side by side to be
    // gone, and what is left does not fit.
    let mut torn = crowd(3.0);
    torn.ranges_m.iter_mut().step_by(2).for_each(|range_m| *range_m = 1.0);
    assert_eq!(kept_of(&torn).len(), torn.ranges_m.len());
}
