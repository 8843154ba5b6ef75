//! Finds out where a recorded robot was, without a guess: frames from a bag (rosbag2 or MCAP), with
//! scans and odometry.
//!
//! `cargo run --release -p fht --features bag --example 03_relocalize -- tcp/localhost:7447 toy
//! run.mcap`

use fht::bag::{FrameConfig, Frames};
use fht::{LocalizerConfig, Map};

#[tokio::main]
async fn main() {
    if let Err(error) = run().await {
        eprintln!("{error}"); // an error that main returns is printed with Debug
        std::process::exit(1);
    }
}

async fn run() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [endpoint, name, bag] = args.as_slice() else {
        return Err("give an endpoint, a map and a bag: tcp/localhost:7447 toy run.mcap".into());
    };
    let map = Map::connect(endpoint, name).await?;
    let mut localizer = map.localizer(LocalizerConfig::default());

    for frame in Frames::open(bag.as_ref(), FrameConfig::default())? {
        let frame = frame?;
        // A frame that nothing can be made of is left out; the next may be better.
        let state = match localizer.update(&frame) {
            Ok(state) => state,
            Err(error) => {
                eprintln!("{error}");
                continue;
            }
        };
        if let Some(pose) = state.pose() {
            let (at, degrees) = (pose.translation, pose.rotation.angle().to_degrees());
            println!("localized: x {:.2} m, y {:.2} m, {degrees:.1} degrees", at.x, at.y);
            return Ok(());
        }
        let likeliest = state.candidates().first().map(|place| place.map_from_base.translation);
        let likeliest = likeliest.map(|at| (at.x, at.y));
        println!("{}, {:.0} %, likeliest {likeliest:?}", state.state(), 100.0 * state.confidence());
    }
    Err("the bag is over, and the place was not found".into())
}
