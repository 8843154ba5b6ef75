//! One simulated world for robots in processes of their own: they see each other, keep apart, and
//! are in nobody's map.

use crate::programs::{self, executable, start};
use fht_demo::{Crew, HandoffConfig, HandoffReport, Process, Role, free_endpoint, hand_off};
use fht_tests::museum_demo::museum_demo;
use mapper::program::ExploreReport;
use std::path::{Path, PathBuf};
use std::time::Duration;

const PATIENCE: Duration = Duration::from_secs(300);

/// A room of 8 m by 5 m with a cupboard in it, as a map of the ROS 2 map server.
fn room(folder: &Path) -> PathBuf {
    const CELL_M: f64 = 0.05;
    let (width, height) = (170, 110);
    let is_wall = |column: usize, row: usize| {
        let (x, y) = (column as f64 * CELL_M - 0.25, row as f64 * CELL_M - 0.25);
        let is_cupboard = (3.6..4.4).contains(&x) && (3.9..5.0).contains(&y);
        !(0.0..8.0).contains(&x) || !(0.0..5.0).contains(&y) || is_cupboard
    };
    let pixels = (0..width * height).map(|index| if is_wall(index % width, index / width) { 0 } else { 255 });
    let header = format!("P5\n{width} {height}\n255\n").into_bytes();
    let picture: Vec<u8> = header.into_iter().chain(pixels).collect();
    std::fs::write(folder.join("room.pgm"), picture).unwrap();
    // The picture's first row is the map's top row.
    let yaml = "image: room.pgm\nresolution: 0.05\norigin: [0, 0, 0]\noccupied_thresh: 0.65\nfree_thresh: 0.25\n";
    std::fs::write(folder.join("room.yaml"), yaml).unwrap();
    folder.join("room.yaml")
}

/// An explorer in a room that it shares.
struct Explorer {
    process: Process,
    report: PathBuf,
}

impl Explorer {
    fn start(folder: &Path, world: &Path, shared: &str, robot: &str, start: &str, more: &[&str]) -> Self {
        let report = folder.join(format!("{robot}.json"));
        let (world, file) = (world.to_str().unwrap(), report.to_str().unwrap());
        let flags = ["explore", "--world", world, "--offline", "--no-cameras", "--quiet", "--rate", "6"];
        let names = ["--shared-world", shared, "--robot", robot, "--start", start, "--report", file];
        let process = programs::start(Role::Mapper, [&flags[..], &names, more].concat());
        Self { process, report }
    }

    fn finish(self) -> ExploreReport {
        self.process.finish(PATIENCE).unwrap();
        serde_json::from_str(&std::fs::read_to_string(self.report).unwrap()).unwrap()
    }
}

/// The folders of shared worlds with this in their names.
fn left_behind(name: &str) -> Vec<String> {
    let entries = std::fs::read_dir(std::env::temp_dir()).unwrap();
    let names = entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    names.filter(|file| file.starts_with("fht-world-") && file.contains(name)).collect()
}

#[test]
fn two_robots_in_a_room_see_each_other_keep_apart_and_are_in_neither_map() {
    let folder = tempfile::tempdir().unwrap();
    let world = room(folder.path());
    let shared = format!("room-{}", std::process::id());
    // Face to face.
    let start = |robot: &str, start: &str| Explorer::start(folder.path(), &world, &shared, robot, start, &[]);
    let robots = [start("west", "1.5,2.5,0"), start("east", "6.5,2.5,180")];
    for report in robots.map(Explorer::finish) {
        let others = report.robots.unwrap_or_else(|| panic!("it was alone: {report:?}"));
        println!("{others:?}");
        assert_eq!((others.count, others.contacts.by_robot, report.collisions), (1, 0, 0), "{report:?}");
        assert!(others.returns_in_scans > 100, "it saw the other: {others:?}");
        assert!(others.nearest_m > 0.05, "{others:?}");
        assert!(others.returns_in_nodes * 100 <= others.returns, "the other is in its map: {others:?}");
        assert!(
            report.explored_fraction > Some(0.95) && report.trajectory_error.is_some_and(|error| error.mean_m < 0.05),
            "{report:?}"
        );
    }
    assert_eq!(left_behind(&shared), Vec::<String>::new());
}

#[test]
fn a_robot_whose_program_is_killed_is_gone_and_the_other_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let world = room(folder.path());
    let shared = format!("killed-{}", std::process::id());
    let start =
        |robot: &str, start: &str, more: &[&str]| Explorer::start(folder.path(), &world, &shared, robot, start, more);
    let mut dies = start("dies", "1.5,2.5,0", &["--progress-json"]);
    let lives = start("lives", "6.5,2.5,180", &[]);
    // Long enough for both to be there.
    dies.process.listen(|line| !line.contains("\"sim_s\":8"));
    dies.process.kill().unwrap();
    let report = lives.finish();
    assert!(report.robots.is_some_and(|others| others.count == 1), "{report:?}");
    assert!(report.explored_fraction > Some(0.95) && report.collisions == 0, "{report:?}");
    assert_eq!(left_behind(&shared), Vec::<String>::new());
}

#[test]
fn a_robot_that_does_not_belong_there_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let world = room(folder.path());
    let shared = format!("refused-{}", std::process::id());
    let _keeper = fht_shared_world::Keeper::of(&shared.parse().unwrap()).unwrap();
    let first = Explorer::start(folder.path(), &world, &shared, "first", "1.5,2.5,0", &["--people", "2"]);
    std::thread::sleep(Duration::from_secs(3));
    for (args, expected) in [
        (&["--world", "museum", "--robot", "second"][..], "it is another building"),
        (&["--world", world.to_str().unwrap(), "--robot", "third", "--people", "3"], "it has 2 people, and 3 were"),
        (&["--shared-world", "a/b", "--robot", "fourth"], "is not a name of a shared world"),
    ] {
        let shared = ["--shared-world", &shared];
        let shared = if args.contains(&"--shared-world") { &[][..] } else { &shared };
        let flags = [&["explore", "--offline", "--no-cameras", "--quiet"][..], shared, args].concat();
        let refused = start(Role::Mapper, flags).finish(PATIENCE).err().unwrap();
        let said = refused.to_string();
        assert!(said.contains(expected) && said.contains("exit status: 2"), "{args:?}: {said}");
    }
    let report = first.finish();
    assert!(report.people.is_some_and(|people| people.count == 2), "{report:?}");
}

#[test]
fn two_explorers_and_a_client_meet_the_same_people_in_one_museum() {
    let folder = tempfile::tempdir().unwrap();
    let config = HandoffConfig {
        people: 8,
        crew: Crew::Team(2),
        ..museum_demo(executable(), free_endpoint().unwrap(), folder.path())
    };
    let (report, _server): (HandoffReport, _) = hand_off(&config).unwrap();
    println!("{report}");
    let contacts = report.contacts.unwrap_or_else(|| panic!("they shared no world: {report:?}"));
    assert!(report.is_success() && report.explored_fraction > 0.98, "{report:?}");
    assert_eq!((contacts.people_by_robots, contacts.robots_by_robots, report.collisions), (0, 0, 0), "{report:?}");
    assert_eq!(left_behind(config.shared_world().unwrap().unwrap().as_str()), Vec::<String>::new());
}
