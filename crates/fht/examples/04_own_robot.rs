//! A robot of your own: it implements the port and drives to a place. This one is a toy in a room
//! of 8 m by 5 m with a box in it, of which it knows nothing: it finds its place on the map by its
//! scanner. Map the room first with `00_toy_room`.
//!
//! `cargo run --release -p fht --example 04_own_robot -- tcp/localhost:7447 toy 7,4`

use fht::{LaserScan, Map, Pose2, Robot, RobotError, SensorFrame, Sensors, Twist, pose};
use std::time::Duration;

/// Time from frame to frame, seconds; the toy lives ten times as fast.
const STEP_S: f64 = 0.2;

/// The toy, where it truly is.
pub struct Toy {
    pose: Pose2,
    start: Pose2,
    command: Twist,
    time_us: u64,
}

impl Toy {
    /// At a pose in the room's frame.
    pub fn at(start: Pose2) -> Self {
        Self { pose: start, start, command: Twist::default(), time_us: 0 }
    }

    /// What its scanner sees: walls all round, and a box. A ray crosses a rectangle from `enter` to
    /// `exit`.
    pub fn scan(&self) -> LaserScan {
        let cross = |dx: f64, dy: f64, [min_x, min_y, max_x, max_y]: [f64; 4]| {
            let (x, y) = (self.pose.translation.x, self.pose.translation.y);
            let (x1, x2, y1, y2) = ((min_x - x) / dx, (max_x - x) / dx, (min_y - y) / dy, (max_y - y) / dy);
            (x1.min(x2).max(y1.min(y2)), x1.max(x2).min(y1.max(y2)))
        };
        LaserScan::all_round(360, |cos, sin| {
            let ray = self.pose.rotation * fht::Point2::new(cos, sin);
            let (_, wall) = cross(ray.x, ray.y, [0.0, 0.0, 8.0, 5.0]);
            let (enter, exit) = cross(ray.x, ray.y, [5.0, 3.0, 6.0, 5.0]);
            if enter > 0.0 && enter < exit { enter } else { wall } // infinity, if there were no wall
        })
    }
}

impl Sensors for Toy {
    async fn sense(&mut self) -> Result<SensorFrame, RobotError> {
        tokio::time::sleep(Duration::from_secs_f64(0.1 * STEP_S)).await;
        let Twist { linear_mps, angular_radps } = self.command;
        self.pose *= pose(linear_mps * STEP_S, 0.0, angular_radps * STEP_S);
        self.time_us += (STEP_S * 1e6) as u64;
        let odom_from_base = self.start.inverse() * self.pose;
        Ok(SensorFrame { time_us: self.time_us, odom_from_base, scan: self.scan(), panorama: None })
    }
}

impl Robot for Toy {
    async fn drive(&mut self, command: Twist) -> Result<(), RobotError> {
        self.command = command;
        Ok(())
    }
}

#[tokio::main]
async fn main() {
    if let Err(error) = run().await {
        eprintln!("{error}"); // an error that main returns is printed with Debug
        std::process::exit(1);
    }
}

async fn run() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [endpoint, name, goal] = args.as_slice() else {
        return Err("give an endpoint, a map and a goal: tcp/localhost:7447 toy 7,4".into());
    };
    let map = Map::connect(endpoint, name).robot("toy").await?;
    let mut toy = Toy::at(pose(1.5, 2.2, 2.0));
    let arrived = map.go(&mut toy, goal.as_str()).await?;
    let (is, at) = (toy.pose.translation, arrived.pose.translation);
    println!("arrived: the toy is at ({:.2}, {:.2}) and thinks ({:.2}, {:.2})", is.x, is.y, at.x, at.y);
    Ok(())
}
