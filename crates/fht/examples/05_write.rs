//! Writes to a map: an author of one's own names a place, draws a zone, and asks for a path that
//! obeys it.
//!
//! `cargo run --release -p fht --example 05_write -- tcp/localhost:7447 toy`

use fht::{Map, ZoneRule, pose};
use std::time::Duration;

#[tokio::main]
async fn main() {
    if let Err(error) = run().await {
        eprintln!("{error}"); // an error that main returns is printed with Debug
        std::process::exit(1);
    }
}

async fn run() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [endpoint, name] = args.as_slice() else {
        return Err("give an endpoint and a map: tcp/localhost:7447 toy".into());
    };
    let map = Map::connect(endpoint, name).robot("writer").await?;

    // Every author has a name of its own; the same name is the same author after a restart.
    let author = map.author("my-software");
    // Each call returns when the server has stored it: the head tells which version contains it.
    let head = author.set_place("dock", pose(7.0, 4.0, 0.0)).await?;
    println!("'dock' is on the map since version {}", head.version);
    let corners = [(4.5, 0.0), (5.0, 0.0), (5.0, 3.0), (4.5, 3.0)];
    author.set_zone("doorway", ZoneRule::SpeedLimit(300), &corners).await?;

    let path = map.path((1.0, 1.0), "dock").await?;
    println!("to the dock: {:.2} m, slowly on {} parts of it", path.length_m, path.speed_limits.len());

    // What is blocked for a while only is a robot's report: everybody plans around it until it is
    // over.
    map.report_blocked(&[], &[(5.5, 1.5)], Duration::from_secs(2))?;

    // The own copy has it all, too.
    let mut changes = map.changes();
    while map.places().is_empty() {
        changes.changed().await?;
    }
    println!("places: {:?}", map.places().iter().map(|place| place.name.as_str()).collect::<Vec<_>>());
    Ok(())
}
