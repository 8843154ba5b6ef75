//! Asks for a path between two places: each is `x,y` in metres, a node's id, or the name of a
//! place.
//!
//! `cargo run --release -p fht --example 01_path -- tcp/localhost:7447 toy 1,1 7,4`

use fht::{Map, PathError};

#[tokio::main]
async fn main() {
    if let Err(error) = run().await {
        eprintln!("{error}"); // an error that main returns is printed with Debug
        std::process::exit(1);
    }
}

async fn run() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [endpoint, name, from, to] = args.as_slice() else {
        return Err("give an endpoint, a map, and two places: tcp/localhost:7447 toy 1,1 7,4".into());
    };
    // Connecting fetches a copy of the map, which is kept up to date from then on.
    let map = Map::connect(endpoint, name).await?;

    // The server plans; were it silent, this program would plan on its own copy.
    match map.path(from.as_str(), to.as_str()).await {
        Ok(path) => {
            println!("{:.2} m, planned by the {:?}", path.length_m, path.planner);
            for point in &path.points {
                let node = point.node.map(|id| id.to_string()).unwrap_or_default();
                println!("{:8.3} {:8.3}  {node}", point.position.x, point.position.y);
            }
            for limit in &path.speed_limits {
                println!("at most {} m/s in zone {}", limit.max_mps, limit.zone);
            }
            Ok(())
        }
        // A refusal has a code for programs and a sentence for people.
        Err(PathError::Refused(refusal)) => Err(format!("{:?}: {}", refusal.code, refusal.message).into()),
        Err(error) => Err(error.into()),
    }
}
