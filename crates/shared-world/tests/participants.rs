//! Robots that share a world on one machine: they go on together, whoever dies is gone, and nothing
//! is left behind.
#![allow(clippy::unwrap_used)] // tests may panic

use fht_perception::frame::Twist;
use fht_perception::pose::pose;
use fht_perception::robot::{Robot, Sensors};
use fht_proto::SharedWorldName;
use fht_shared_world::{JoinError, Keeper, WorldExit, folder_of, seat};
use fht_sim::{SimConfig, SimSetup, Simulator, World, load};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, LazyLock};

static MUSEUM: LazyLock<Arc<World>> = LazyLock::new(|| Arc::new(load("museum", None, 1).unwrap()));

fn a_name() -> SharedWorldName {
    static NAMES: AtomicU32 = AtomicU32::new(0);
    format!("test-{}-{}", std::process::id(), NAMES.fetch_add(1, Ordering::Relaxed)).parse().unwrap()
}

/// A robot that stands so far ahead of the museum's start, and looks the same way.
fn robot(name: &SharedWorldName, robot: &str, ahead_m: f64, people: u16) -> Result<(Simulator, WorldExit), JoinError> {
    let config = SimConfig { camera_every: 0, ..SimConfig::default() };
    let start = MUSEUM.start() * pose(ahead_m, 0.0, 0.0);
    let setup = SimSetup { shared_world: Some(name.clone()), people, ..SimSetup::of("museum") };
    seat(Simulator::new(Arc::clone(&MUSEUM), config, start, 1), &setup, robot)
}

fn run<T>(future: impl Future<Output = T>) -> T {
    tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap().block_on(future)
}

const SLOWLY: Twist = Twist { linear_mps: 0.1, angular_radps: 0.0 };

#[test]
fn robots_go_on_together_and_see_each_other_and_the_same_people() {
    let name = a_name();
    let (mut one, _) = robot(&name, "one", 0.0, 12).unwrap();
    let (mut two, _) = robot(&name, "two", 1.0, 0).unwrap();
    run(async {
        one.sense().await.unwrap();
        two.sense().await.unwrap();
        one.drive(SLOWLY).await.unwrap();
        for _ in 0..10 {
            let (first, second) = tokio::try_join!(one.sense(), two.sense()).unwrap();
            assert_eq!(first.time_us, second.time_us);
            let gap_m = two.truth().translation.x - one.truth().translation.x;
            let seen_m = f64::from(first.scan.ranges_m[0]) + one.config().lidar_mount_m[0];
            assert!((seen_m - (gap_m - 0.105)).abs() < 0.06, "{seen_m} {gap_m}");
            let behind_m = f64::from(second.scan.ranges_m[180]) - one.config().lidar_mount_m[0];
            assert!((behind_m - (gap_m - 0.105)).abs() < 0.06, "{behind_m} {gap_m}");
            assert_eq!(one.people(), two.people());
        }
    });
    assert_eq!(one.people().len(), 12);
    assert!((one.driven_m() - 0.2).abs() < 1e-9 && two.driven_m() == 0.0, "{}", one.driven_m());
    drop((one, two));
    assert!(!folder_of(&name).exists());
}

#[test]
fn nobody_waits_for_a_robot_that_leaves_or_is_dropped() {
    let name = a_name();
    let (mut one, _) = robot(&name, "one", 0.0, 0).unwrap();
    let (mut two, exit) = robot(&name, "two", 1.0, 0).unwrap();
    let (mut three, _) = robot(&name, "three", -1.0, 0).unwrap();
    run(async {
        let _ = tokio::try_join!(one.sense(), two.sense(), three.sense()).unwrap();
        let _ = tokio::try_join!(one.sense(), two.sense(), three.sense()).unwrap();
        assert_eq!(one.robots().len(), 2);
        exit.leave();
        drop(three);
        one.sense().await.unwrap();
        assert!(one.robots().is_empty());
        assert!(two.sense().await.is_err(), "it has left");
    });
    assert!(folder_of(&name).exists());
    drop(one);
    assert!(!folder_of(&name).exists());
}

#[test]
fn a_dropped_look_is_gone_on_with() {
    let name = a_name();
    let (mut one, _) = robot(&name, "one", 0.0, 0).unwrap();
    let (mut two, _) = robot(&name, "two", 1.0, 0).unwrap();
    run(async {
        let _ = tokio::try_join!(one.sense(), two.sense()).unwrap();
        let wait = std::time::Duration::from_millis(30);
        assert!(tokio::time::timeout(wait, one.sense()).await.is_err(), "the other has said nothing");
        one.drive(SLOWLY).await.unwrap();
        assert!(tokio::time::timeout(wait, one.sense()).await.is_err());
        let (first, _) = tokio::try_join!(one.sense(), two.sense()).unwrap();
        assert_eq!(first.time_us, 200_000);
    });
    assert!((one.driven_m() - 0.02).abs() < 1e-9, "it drove by its last word: {}", one.driven_m());
}

#[test]
fn who_does_not_belong_there_is_refused_in_words() {
    let name = a_name();
    let (one, _) = robot(&name, "one", 0.0, 3).unwrap();
    let taken = robot(&name, "one", 1.0, 3).err().unwrap();
    assert!(taken.is_input() && taken.to_string().contains("a robot called one is in the shared world"), "{taken}");
    let other = robot(&name, "two", 1.0, 4).err().unwrap();
    assert!(other.is_input() && other.to_string().contains("it has 3 people, and 4 were asked for"), "{other}");
    drop(one);
    assert!(!folder_of(&name).exists());
}

#[test]
fn a_kept_world_keeps_its_people_and_what_the_dead_have_left_counts_for_nothing() {
    let name = a_name();
    let keeper = Keeper::of(&name).unwrap();
    let people = || {
        let (mut robot, _) = robot(&name, "one", 0.0, 5).unwrap();
        run(async {
            for _ in 0..20 {
                robot.sense().await.unwrap();
            }
        });
        robot.people()
    };
    let (first, second) = (people(), people());
    let moved = first.iter().zip(&second).map(|(one, other)| (one.position - other.position).norm());
    assert!(first != second && moved.fold(0.0, f64::max) < 6.0, "they go on");
    drop(keeper);
    assert!(!folder_of(&name).exists());
    assert_eq!(people(), first, "and begin anew where nobody was");
    // Somebody who was killed has left his files.
    std::fs::create_dir(folder_of(&name)).unwrap();
    for file in ["world", "robot-one", "robot-gone", "keeper-1-0"] {
        std::fs::write(folder_of(&name).join(file), b"FHTWORL1 and what was no state").unwrap();
    }
    assert_eq!(people(), first);
    assert!(!folder_of(&name).exists());
}

#[test]
fn a_damaged_world_is_said_to_be_one() {
    let name = a_name();
    let (mut one, _) = robot(&name, "one", 0.0, 0).unwrap();
    run(one.sense()).unwrap();
    let file = folder_of(&name).join("world");
    let mut bytes = std::fs::read(&file).unwrap();
    let last = bytes.len() - 1;
    bytes[last] ^= 0x55;
    std::fs::write(&file, bytes).unwrap();
    let said = run(one.sense()).err().unwrap().to_string();
    assert!(said.contains("is damaged; end all robots of this world"), "{said}");
    let said = robot(&name, "two", 1.0, 0).err().unwrap().to_string();
    assert!(said.contains("is damaged"), "{said}");
    drop(one);
    assert!(!folder_of(&name).exists());
}
