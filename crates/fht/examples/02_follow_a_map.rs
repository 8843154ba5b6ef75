//! Follows a map: prints what is on it whenever it changes, and what the robots do, for some
//! seconds.
//!
//! `cargo run --release -p fht --example 02_follow_a_map -- tcp/localhost:7447 toy 30`

use fht::{Map, RobotEvent};
use std::time::Duration;
use tokio::time::{Instant, sleep_until};

#[tokio::main]
async fn main() {
    if let Err(error) = run().await {
        eprintln!("{error}"); // an error that main returns is printed with Debug
        std::process::exit(1);
    }
}

async fn run() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [endpoint, name, seconds] = args.as_slice() else {
        return Err("give an endpoint, a map, and for how many seconds: tcp/localhost:7447 toy 30".into());
    };
    let end = Instant::now() + Duration::from_secs(seconds.parse()?);
    let map = Map::connect(endpoint, name).await?;

    // Both are subscriptions: nobody is asked again and again.
    let mut changes = map.changes();
    let mut robots = map.watch_robots().await?;
    show(&map);
    loop {
        tokio::select! {
            changed = changes.changed() => {
                changed?;
                show(&map);
            }
            event = robots.next() => match event {
                Some(RobotEvent::Came(robot)) => println!("{robot} is here"),
                Some(RobotEvent::Left(robot)) => println!("{robot} has left"),
                Some(RobotEvent::Pose(pose)) => println!("{}: {} at {:?}", pose.robot, pose.state, pose.map_from_base),
                Some(RobotEvent::Blocked { robot, report }) => println!("{robot} could not pass {:?}", report.places),
                Some(_) => {}
                None => return Err("the session was closed".into()),
            },
            () = sleep_until(end) => return Ok(()),
        }
    }
}

fn show(map: &Map) {
    let nodes = map.nodes();
    let edges = nodes.iter().map(|node| node.neighbours.len()).sum::<usize>() / 2;
    println!("{}: {} nodes, {edges} edges", map.name(), nodes.len());
    for place in map.places() {
        let at = place.pose.translation;
        println!("  {} at ({:.2}, {:.2})", place.name, at.x, at.y);
    }
}
