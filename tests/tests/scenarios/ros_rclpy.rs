//! A robot whose nodes speak DDS: real rclpy from PyPI behind the Eclipse project's plugin for
//! Zenoh, both unmodified. Its scans become a map, which it hears.

use crate::programs::executable;
use fht_demo::{Process, Role, free_endpoint};
use fht_tests::foreign_ros;
use fht_tests::packages::environment;
use serde::Deserialize;
use std::io::{BufRead, BufReader, Lines};
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Stdio};
use std::time::Duration;

const PATIENCE: Duration = Duration::from_secs(180);
const PACKAGES: [&str; 4] =
    ["ros-rclpy[fastrtps]==9.1.2", "ros-sensor-msgs==5.5.1", "ros-nav-msgs==5.5.1", "ros-geometry-msgs==5.5.1"];
/// How DDS finds its like. Between the two kinds of DDS it takes multicast.
const DISCOVERY: [(&str, &str); 3] =
    [("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET"), ("ROS_DISTRO", "kilted"), ("RMW_IMPLEMENTATION", "rmw_fastrtps_cpp")];
/// So long the robot drives, seconds.
const DRIVEN_S: u32 = 20;

/// A foreign program, and what it prints.
struct Foreign {
    child: Child,
    lines: Lines<BufReader<ChildStdout>>,
}

impl Foreign {
    fn start(mut command: Command) -> Self {
        command.env_remove("ZENOH_CONFIG_OVERRIDE").envs(DISCOVERY);
        let mut child = command.stdout(Stdio::piped()).spawn().unwrap();
        let lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let mut foreign = Self { child, lines };
        foreign.line("ready");
        foreign
    }

    /// The rest of the next line that begins like this.
    fn line(&mut self, beginning: &str) -> String {
        let found =
            self.lines.by_ref().map(Result::unwrap).find_map(|line| Some(line.strip_prefix(beginning)?.to_owned()));
        found.unwrap_or_else(|| panic!("it has ended without a line that begins with {beginning}"))
    }
}

impl Drop for Foreign {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A grid as rclpy has it.
#[derive(Deserialize)]
struct Grid {
    frame: String,
    width: usize,
    height: usize,
    resolution: f64,
    x: f64,
    y: f64,
    cells: Vec<i8>,
}

impl Grid {
    /// The greatest of what the cells within `reach_m` of a place say; -1 is unknown.
    fn most(&self, (x, y): (f64, f64), reach_m: f64) -> i8 {
        let near = |cell: &usize| {
            let centre = |index: usize, origin: f64| origin + (index as f64 + 0.5) * self.resolution;
            let (cx, cy) = (centre(cell % self.width, self.x), centre(cell / self.width, self.y));
            (cx - x).hypot(cy - y) <= reach_m
        };
        (0..self.cells.len()).filter(near).map(|cell| self.cells[cell]).max().unwrap_or(-1)
    }
}

#[test]
fn rclpys_scans_become_a_map_that_it_hears() {
    // Ports of DDS follow from the domain; those up to 101 are free of what systems lend.
    let domain = (1 + std::process::id() % 100).to_string();
    let endpoint = free_endpoint().unwrap();
    let mut bridge = Command::new(foreign_ros::program("dds-bridge"));
    bridge.args([&endpoint, &domain]);
    let _bridge = Foreign::start(bridge);

    let venv = Path::new(env!("CARGO_TARGET_TMPDIR")).join("ros-rclpy");
    let mut robot = Command::new(environment(&venv, &PACKAGES).join("python"));
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/foreign_ros/robot.py");
    robot.arg(script).args([&domain, &DRIVEN_S.to_string()]);
    let mut robot = Foreign::start(robot);

    let explore = ["explore", "--ros", &endpoint, "--ros-keys", "bridge", "--distribution", "kilted"];
    let listening = ["--drive", "others", "--end-after", "5", "--no-cameras", "--offline", "--json", "--quiet"];
    let mapper = Process::start(executable(), Role::Mapper, [&explore[..], &listening].concat()).unwrap();
    robot.line("heard");
    let mut grids = Vec::new();
    for line in robot.lines.by_ref().map(Result::unwrap) {
        match line.strip_prefix("map ") {
            Some(grid) => grids.push(serde_json::from_str::<Grid>(grid).unwrap()),
            None if line == "silent" => break,
            None => {}
        }
    }
    let report: serde_json::Value = serde_json::from_str(&mapper.finish(PATIENCE).unwrap()).unwrap();
    assert!(report["frames"].as_u64().unwrap() > 100, "{report}");

    let grid = grids.last().expect("rclpy has heard a map");
    assert_eq!((grid.frame.as_str(), grid.cells.len()), ("map", grid.width * grid.height));
    for wall in [(4.0, 0.0), (-2.0, 0.0), (1.0, 2.0), (1.0, -2.0), (4.0, 1.5), (-2.0, -1.5)] {
        assert!(grid.most(wall, 0.1) > 50, "no wall at {wall:?}");
    }
    for free in [(0.0, 0.0), (3.0, 1.0), (-1.5, -1.5), (1.0, 1.5)] {
        assert_eq!(grid.most(free, 0.1), 0, "{free:?} is not free");
    }
    for outside in [(4.5, 0.0), (1.0, -2.5)] {
        assert_eq!(grid.most(outside, 0.05), -1, "{outside:?} is known");
    }
}
