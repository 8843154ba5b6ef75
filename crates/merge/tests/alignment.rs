//! Maps of drawn buildings laid on each other: where they overlap they fit, and where they do not
//! they are refused, with the reason.
#![allow(clippy::unwrap_used)] // tests may panic

mod drawn;

use drawn::{Building, ROOMS, Room, worst_m};
use fht_map::MapState;
use fht_merge::{MergeConfig, MergeRefusal, lay};
use fht_perception::pose::{Point2, pose};
use proptest::prelude::*;

fn config() -> MergeConfig {
    MergeConfig::default()
}

#[test]
fn a_third_in_common_and_turned_by_137_degrees() {
    let building = Building::wing(&ROOMS);
    let (world_from_a, world_from_b) = (pose(1.5, 1.0, 0.0), pose(20.0, 1.2, 137.0_f64.to_radians()));
    let a = building.seen_within(0.0..20.0).mapped(&world_from_a, "explorer", 1);
    let b = building.seen_within(14.0..40.0).mapped(&world_from_b, "explorer", 2);
    let laid = lay(&a, &b, &config()).unwrap_or_else(|refusal| panic!("{refusal}"));
    let worst = worst_m(&laid, &b, &world_from_a, &world_from_b);
    assert!(worst < 0.1, "{worst} m; {:?}", laid.figures);
    let off = laid.a_from_b.inverse() * (world_from_a.inverse() * world_from_b);
    assert!(off.translation.vector.norm() < 0.1 && off.rotation.angle().abs() < 0.01, "{off}");
    assert!(laid.figures.matched >= 4 && laid.figures.overlap_share < 0.7, "{:?}", laid.figures);
}

#[test]
fn furniture_may_have_moved() {
    let empty = Building::wing(&ROOMS);
    let before = empty.clone().with_box((1.0, 3.4), 0.6).with_box((5.0, 4.5), 0.8).with_box((12.5, 3.0), 0.7);
    let after = empty.with_box((2.0, 4.2), 0.6).with_box((4.2, 3.2), 0.8).with_box((27.0, 3.2), 0.7);
    let (world_from_a, world_from_b) = (pose(1.5, 1.0, 0.0), pose(20.0, 1.2, -2.0));
    let a = before.mapped(&world_from_a, "one", 1);
    let b = after.mapped(&world_from_b, "other", 2);
    let laid = lay(&a, &b, &config()).unwrap_or_else(|refusal| panic!("{refusal}"));
    let worst = worst_m(&laid, &b, &world_from_a, &world_from_b);
    assert!(worst < 0.05, "{worst} m; {:?}", laid.figures);
}

fn refused(a: &MapState, b: &MapState) -> MergeRefusal {
    match lay(a, b, &config()) {
        Ok(laid) => panic!("laid: {:?}", laid.figures),
        Err(refusal) => refusal,
    }
}

#[test]
fn another_building_is_refused() {
    let others: [&[Room]; 2] = [
        &[(4.0, 3.0, 2.0), (3.3, 4.0, 0.4), (5.2, 2.6, 1.0), (2.8, 3.8, 1.4), (4.6, 4.4, 3.3), (3.0, 3.1, 0.2)],
        &[(2.4, 5.0, 0.3), (2.4, 5.0, 1.2), (6.0, 3.0, 4.0), (6.0, 3.0, 0.9), (3.0, 3.0, 1.0)],
    ];
    let a = Building::wing(&ROOMS).mapped(&pose(0.0, 0.0, 0.0), "one", 1);
    for rooms in others {
        let b = Building::wing(rooms).mapped(&pose(3.0, 1.0, 1.0), "other", 2);
        let _ = refused(&a, &b);
        let _ = refused(&b, &a);
    }
    let mirrored: Vec<Room> =
        ROOMS.iter().rev().map(|&(width, depth, door)| (width, depth, width - door - 0.9)).collect();
    let b = Building::wing(&mirrored).mapped(&pose(3.0, 1.0, 1.0), "other", 2);
    let _ = refused(&a, &b);
}

#[test]
fn corridors_that_are_alike_are_ambiguous() {
    // Ten rooms that are all alike; of a map that knows five of them nobody can tell which.
    let building = Building::wing(&[(3.0, 3.0, 1.0); 10]);
    let a = building.seen_within(0.0..30.0).mapped(&pose(0.0, 0.0, 0.0), "one", 1);
    let b = building.seen_within(9.0..21.0).mapped(&pose(10.0, 1.0, 0.5), "other", 2);
    let refusal = refused(&a, &b);
    assert!(matches!(refusal, MergeRefusal::Ambiguous { .. }), "{refusal}");
}

#[test]
fn a_building_that_is_its_own_turn_is_ambiguous() {
    // Two wings back to back, so that half a turn makes no difference.
    let wing = Building::wing(&ROOMS[..4]);
    let turn = |(x, y): (f64, f64)| (-x, -0.3 - y);
    let mut building = wing.clone();
    building.walls.extend(wing.walls.iter().map(|wall| wall.map(turn)));
    // The wall between both corridors has a door, in the middle of the turn.
    building.walls.remove(0);
    building.walls.push([(0.0, 0.0), (15.1, 0.0)]);
    building.places.extend(wing.places.iter().copied().map(turn));
    let a = building.mapped(&pose(0.0, 0.0, 0.0), "one", 1);
    let b = wing.mapped(&pose(2.0, 1.0, 2.0), "other", 2);
    let refusal = refused(&a, &b);
    assert!(matches!(refusal, MergeRefusal::Ambiguous { .. }), "{refusal}");
}

#[test]
fn what_cannot_be_compared_is_refused() {
    let building = Building::wing(&ROOMS);
    let a = building.mapped(&pose(0.0, 0.0, 0.0), "one", 1);
    let shares = refused(&a, &a.clone());
    assert!(matches!(shares, MergeRefusal::SameMap { shared: 27 }), "{shares}");
    let nothing = refused(&a, &MapState::new());
    assert!(matches!(nothing, MergeRefusal::NothingSeen { map: "the second map" }), "{nothing}");
    let small = MergeConfig { most_main_nodes: 10, ..config() };
    assert!(matches!(
        lay(&a, &building.mapped(&pose(1.0, 0.0, 0.0), "other", 2), &small),
        Err(MergeRefusal::TooLarge { .. })
    ));
    // One room is too little.
    let b = building.seen_within(0.0..3.1).mapped(&pose(1.0, 0.0, 1.0), "other", 2);
    let little = refused(&a, &b);
    let is_little = matches!(little, MergeRefusal::TooFewMatches { .. } | MergeRefusal::TooLittleOverlap { .. });
    assert!(is_little, "{little}");
}

#[test]
fn another_storey_looks_different() {
    let building = Building::wing(&ROOMS);
    let one_hot = |index: usize| {
        let mut values = vec![0.05_f32; 8];
        values[index % 8] = 1.0;
        Some(values)
    };
    let ground = |at: Point2| one_hot((at.x / 4.0) as usize);
    let first = |at: Point2| one_hot((at.x / 4.0) as usize + 3);
    let a = building.mapped_with_looks(&pose(0.0, 0.0, 0.0), "one", 1, ground);
    let storey = building.mapped_with_looks(&pose(5.0, 1.0, 1.0), "other", 2, first);
    let refusal = refused(&a, &storey);
    assert!(matches!(refusal, MergeRefusal::LooksDifferent { .. }), "{refusal}");
    let again = building.mapped_with_looks(&pose(5.0, 1.0, 1.0), "other", 2, ground);
    assert!(lay(&a, &again, &config()).is_ok());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 8, ..ProptestConfig::default() })]
    #[test]
    fn frames_do_not_matter(x in -50.0..50.0_f64, y in -50.0..50.0_f64, yaw in -3.2..3.2_f64, seed in 2..1000_u32) {
        let building = Building::wing(&ROOMS[..6]);
        let (world_from_a, world_from_b) = (pose(3.0, 1.0, 0.3), pose(x, y, yaw));
        let a = building.mapped(&world_from_a, "one", 1);
        let b = building.seen_within(4.0..40.0).mapped(&world_from_b, "other", seed);
        let laid = lay(&a, &b, &config());
        prop_assert!(laid.is_ok(), "{:?}", laid.err());
        let worst = laid.map(|laid| worst_m(&laid, &b, &world_from_a, &world_from_b)).unwrap();
        prop_assert!(worst < 0.05, "{} m", worst);
    }
}
