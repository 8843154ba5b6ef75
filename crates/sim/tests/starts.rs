//! A robot is refused a start where it cannot stand, and is told the nearest place where it can.

#![allow(clippy::unwrap_used, reason = "helpers of tests, where a panic is the failure")]

use fht_perception::pose::{Point2, pose};
use fht_sim::{SimConfig, SimSetup, StartError, StartTrouble, World, check_start, load, start_near};

fn radius_m() -> f64 {
    SimConfig::default().radius_m
}

fn refused(world: &World, x: f64, y: f64) -> StartError {
    let error = check_start(world, &pose(x, y, 0.5), radius_m()).unwrap_err();
    let nearest = error.nearest.unwrap();
    println!("{error}");
    check_start(world, &nearest, radius_m()).unwrap();
    assert!((nearest.rotation.angle() - 0.5).abs() < 1e-9, "with the heading asked for");
    error
}

#[test]
fn walls_and_the_outside_are_no_place_to_start() {
    let museum = load("museum", None, 1).unwrap();
    let in_a_wall = refused(&museum, 2.0, 1.0);
    assert_eq!(in_a_wall.trouble, StartTrouble::NoFloor);
    let words = in_a_wall.to_string();
    assert!(words.contains("start at 2,1,28.648 in museum") && words.contains("the nearest free place is "), "{words}");
    let nearest = Point2::from(in_a_wall.nearest.unwrap().translation.vector);
    assert!((nearest - Point2::new(2.0, 1.0)).norm() < 0.6, "{words}");
    for (x, y) in [(500.0, 0.0), (-1e300, 3.0), (0.0, 1e9)] {
        assert_eq!(refused(&museum, x, y).trouble, StartTrouble::NoFloor);
    }
}

#[test]
fn nothing_that_stands_in_a_building_is_a_place_to_start_and_all_else_is() {
    let museum = load("museum", None, 1).unwrap();
    let plan = museum.plan();
    let (mut taken, mut narrow) = (0, 0);
    for row in (0..plan.height()).step_by(17) {
        for column in (0..plan.width()).step_by(17) {
            let centre = plan.centre_of(column, row);
            let outcome = check_start(&museum, &pose(centre.x, centre.y, 0.0), radius_m());
            match outcome.map_err(|error| error.trouble) {
                Ok(()) => assert!(!plan.is_occupied(centre.x, centre.y)),
                Err(StartTrouble::NoFloor) => taken += 1,
                Err(StartTrouble::NoRoom { clearance_m, .. }) => {
                    narrow += 1;
                    assert!(clearance_m < radius_m() && plan.clearance_m(centre) < radius_m() + 0.1);
                }
                Err(trouble @ (StartTrouble::CutOff | StartTrouble::NoWay { .. })) => {
                    panic!("the floor hangs together at {centre}: {trouble}")
                }
            }
        }
    }
    assert!(taken > 10 && narrow > 5, "{taken}, {narrow}");
}

#[test]
fn starts_that_are_drawn_are_free() {
    let museum = load("museum", None, 1).unwrap();
    for seed in 0..30 {
        let drawn =
            [museum.start(), museum.random_free_pose(seed, 0.4), start_near(&museum, &museum.start(), 3.0, seed)];
        for start in drawn {
            check_start(&museum, &start, radius_m()).unwrap();
        }
    }
}

#[test]
fn a_larger_robot_needs_more_room() {
    let museum = load("museum", None, 1).unwrap();
    let narrow = museum.random_free_pose(3, 0.2);
    let plan = museum.plan();
    let place = Point2::from(narrow.translation.vector);
    let large_m = plan.clearance_m(place) + 0.2;
    let setup = SimSetup { start: Some(narrow), ..SimSetup::of("museum") };
    assert_eq!(setup.start_in(&museum, radius_m()).unwrap(), Some(narrow));
    let error = setup.start_in(&museum, large_m).unwrap_err();
    assert!(matches!(error.trouble, StartTrouble::NoRoom { .. }), "{error}");
    assert_eq!(SimSetup::of("museum").start_in(&museum, radius_m()).unwrap(), None);
    // Nowhere, be the start asked for or the world's own.
    let own = SimSetup::of("museum").start_in(&museum, 50.0).unwrap_err();
    for giant in [check_start(&museum, &museum.start(), 50.0).unwrap_err(), own] {
        assert!(giant.nearest.is_none() && giant.to_string().contains("no place where it fits"), "{giant}");
    }
}

#[test]
fn a_world_of_one_pit_is_no_place_to_start() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("pit.pgm"), "P2\n4 4\n255\n0 0 0 0\n0 254 254 0\n0 254 254 0\n0 0 0 0\n")
        .unwrap();
    let map = folder.path().join("pit.yaml");
    let yaml = "image: pit.pgm\nresolution: 0.05\norigin: [0, 0, 0]\noccupied_thresh: 0.65\nfree_thresh: 0.25\n";
    std::fs::write(&map, yaml).unwrap();
    let setup = SimSetup::of(map.to_str().unwrap());
    let error = setup.start_in(&setup.load().unwrap(), radius_m()).unwrap_err();
    assert!(matches!(error.trouble, StartTrouble::NoRoom { .. }) && error.nearest.is_none(), "{error}");
}

#[test]
fn a_closet_without_a_door_is_no_world_to_drive_in() {
    let folder = tempfile::tempdir().unwrap();
    // Square rooms with walls of 0.1 m, cells of 0.05 m.
    let map = |cells: usize| {
        let row = |y: usize| {
            let is_free = |x: usize| (2..cells + 2).contains(&x) && (2..cells + 2).contains(&y);
            (0..cells + 4).map(|x| if is_free(x) { "254 " } else { "0 " }).collect::<String>()
        };
        let rows: String = (0..cells + 4).map(|y| row(y) + "\n").collect();
        let (picture, map) = (format!("{cells}.pgm"), folder.path().join(format!("{cells}.yaml")));
        std::fs::write(folder.path().join(&picture), format!("P2\n{0} {0}\n255\n{rows}", cells + 4)).unwrap();
        let keys = "resolution: 0.05\norigin: [0, 0, 0]\noccupied_thresh: 0.65\nfree_thresh: 0.25\n";
        std::fs::write(&map, format!("image: {picture}\n{keys}")).unwrap();
        SimSetup::of(map.to_str().unwrap())
    };
    let closet = map(12);
    let error = closet.start_in(&closet.load().unwrap(), radius_m()).unwrap_err();
    assert!(matches!(error.trouble, StartTrouble::NoWay { reach_m } if reach_m > 0.1), "{error}");
    assert!(error.to_string().ends_with(" m from there"), "{error}");
    let chamber = map(40);
    chamber.start_in(&chamber.load().unwrap(), radius_m()).unwrap();
}

#[test]
fn a_room_without_a_door_is_cut_off() {
    let folder = tempfile::tempdir().unwrap();
    // Two rooms of 8 m x 4 m and 2 m x 4 m with a wall between, cells of 0.1 m.
    let (width, height) = (104, 44);
    let free = |x: usize, y: usize| (2..42).contains(&y) && ((2..80).contains(&x) || (82..102).contains(&x));
    let pixels: Vec<String> =
        (0..height).flat_map(|y| (0..width).map(move |x| if free(x, y) { "254" } else { "0" }.to_owned())).collect();
    std::fs::write(folder.path().join("rooms.pgm"), format!("P2\n{width} {height}\n255\n{}\n", pixels.join("\n")))
        .unwrap();
    let yaml = "image: rooms.pgm\nresolution: 0.1\norigin: [0.0, 0.0, 0.0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.25\n";
    let map = folder.path().join("rooms.yaml");
    std::fs::write(&map, yaml).unwrap();
    let world = load(map.to_str().unwrap(), None, 1).unwrap();
    check_start(&world, &pose(4.0, 2.0, 0.0), radius_m()).unwrap();
    let error = refused(&world, 9.2, 2.0);
    assert_eq!(error.trouble, StartTrouble::CutOff);
    assert!(error.nearest.unwrap().translation.x < 8.0, "{error}");
}
