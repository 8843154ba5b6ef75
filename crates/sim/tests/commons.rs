//! A world that several robots share: they move together, run into each other and not through, and
//! whoever computes it comes to the same.
#![allow(clippy::unwrap_used)] // tests may panic

use fht_perception::frame::Twist;
use fht_perception::pose::{Pose2, pose};
use fht_sim::{Commons, CommonsError, Entrant, PeopleConfig, RobotContacts, World, load};
use proptest::prelude::*;
use std::sync::{Arc, LazyLock};

static MUSEUM: LazyLock<Arc<World>> = LazyLock::new(|| Arc::new(load("museum", None, 1).unwrap()));

const RADIUS_M: f64 = 0.105;
const STANDS: Twist = Twist { linear_mps: 0.0, angular_radps: 0.0 };
const AHEAD: Twist = Twist { linear_mps: 0.5, angular_radps: 0.0 };

fn commons(people: usize) -> Commons {
    Commons::new(Arc::clone(&MUSEUM), PeopleConfig::of(people, 3), 200_000)
}

fn entrant(start: Pose2) -> Entrant {
    Entrant { start, radius_m: RADIUS_M, height_m: 0.2 }
}

/// Two robots, a metre apart and face to face.
fn face_to_face(people: usize) -> Commons {
    let mut commons = commons(people);
    commons.enter("one", &entrant(MUSEUM.start())).unwrap();
    commons.enter("two", &entrant(MUSEUM.start() * pose(1.0, 0.0, std::f64::consts::PI))).unwrap();
    commons
}

fn apart_m(commons: &Commons) -> f64 {
    let turn = commons.turn("one").unwrap();
    (turn.robots[0].position.coords - turn.world_from_base.translation.vector).norm()
}

#[test]
fn robots_run_into_each_other_and_not_through_and_who_drove_did_it() {
    let mut commons = face_to_face(0);
    for _ in 0..20 {
        commons.command("one", AHEAD);
        commons.command("two", STANDS);
        assert_eq!(commons.missing().count(), 0);
        commons.advance();
    }
    assert!((2.0 * RADIUS_M..2.0 * RADIUS_M + 0.02).contains(&apart_m(&commons)), "{}", apart_m(&commons));
    let contacts = |name: &str| commons.turn(name).unwrap().robot_contacts;
    assert_eq!(contacts("one"), RobotContacts { by_robot: 1, by_others: 0 });
    assert_eq!(contacts("two"), RobotContacts { by_robot: 0, by_others: 1 });
    let one = commons.turn("one").unwrap();
    assert_eq!((one.done, one.rolls.len(), one.collisions), (20, 10, 0));
    assert!(one.rolls.iter().all(|(forward_m, _)| *forward_m == 0.0), "its wheels stall");
}

#[test]
fn of_two_that_meet_both_did_it() {
    let mut commons = face_to_face(0);
    for _ in 0..10 {
        commons.command("one", AHEAD);
        commons.command("two", AHEAD);
        commons.advance();
    }
    for name in ["one", "two"] {
        assert_eq!(commons.turn(name).unwrap().robot_contacts, RobotContacts { by_robot: 1, by_others: 0 });
    }
}

#[test]
fn who_says_nothing_is_waited_for_until_it_is_passed_over() {
    let mut commons = face_to_face(0);
    commons.command("one", AHEAD);
    assert_eq!(commons.missing().collect::<Vec<_>>(), ["two"]);
    commons.pass_over("two");
    assert_eq!(commons.missing().count(), 0);
    commons.advance();
    let [one, two] = ["one", "two"].map(|name| commons.turn(name).unwrap());
    assert_eq!((one.done, two.done, two.driven_m), (1, 0, 0.0));
    commons.command("two", AHEAD);
    assert_eq!(commons.missing().collect::<Vec<_>>(), ["one"], "it is one of them again");
    commons.leave("one");
    assert_eq!((commons.missing().count(), commons.turn("one")), (0, None));
    assert!(commons.turn("two").unwrap().robots.is_empty());
}

#[test]
fn no_robot_appears_in_another_one() {
    let mut commons = face_to_face(0);
    let refused = commons.enter("three", &entrant(MUSEUM.start() * pose(0.2, 0.0, 0.0)));
    assert_eq!(refused, Err(CommonsError::Occupied("one".to_owned())));
    commons.leave("one");
    assert_eq!(commons.enter("three", &entrant(MUSEUM.start() * pose(0.2, 0.0, 0.0))), Ok(()));
}

#[test]
fn a_robot_of_another_building_or_other_people_is_refused() {
    let here = face_to_face(4).state();
    let office = Arc::new(load("office", None, 1).unwrap());
    let refused = |people: usize, world: &Arc<World>, period_us: u64| {
        Commons::new(Arc::clone(world), PeopleConfig::of(people, 1), period_us).restore(&here)
    };
    assert_eq!(refused(4, &office, 200_000), Err(CommonsError::OtherBuilding));
    assert_eq!(refused(5, &MUSEUM, 200_000), Err(CommonsError::OtherPeople { there: 4, here: 5 }));
    assert_eq!(refused(4, &MUSEUM, 100_000), Err(CommonsError::OtherPeriod { there_us: 200_000, here_us: 100_000 }));
    assert_eq!(refused(0, &MUSEUM, 200_000), Ok(()), "who asks for nobody meets whoever is there");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]
    #[test]
    fn whoever_goes_on_comes_to_the_same(
        commands in prop::collection::vec(((-0.5_f64..0.5, -1.5_f64..1.5), (-0.5_f64..0.5, -1.5_f64..1.5)), 1..40),
        every in 1_usize..5,
    ) {
        let twist = |(linear_mps, angular_radps)| Twist { linear_mps, angular_radps };
        let (mut one, mut relay) = (face_to_face(10), [face_to_face(10), commons(0)]);
        for (number, (first, second)) in commands.into_iter().enumerate() {
            // Another process goes on with what this one has stored.
            if number % every == 0 {
                relay.swap(0, 1);
                let state = relay[1].state();
                relay[0].restore(&state).unwrap();
            }
            for commons in [&mut one, &mut relay[0]] {
                commons.command("one", twist(first));
                commons.command("two", twist(second));
                commons.advance();
            }
            for name in ["one", "two"] {
                let [alone, relayed] = [one.turn(name).unwrap(), relay[0].turn(name).unwrap()];
                let apart = alone.world_from_base.translation.vector - relayed.world_from_base.translation.vector;
                prop_assert!(apart.norm() < 1e-6, "{apart}");
                prop_assert_eq!(alone.people.len(), 10);
                prop_assert_eq!(alone.robot_contacts, relayed.robot_contacts);
            }
        }
        prop_assert!(apart_m(&one) > 2.0 * RADIUS_M - 1e-6);
    }
}
