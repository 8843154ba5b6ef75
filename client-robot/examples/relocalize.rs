//! Drops robots into a built-in world, mapped by the test fixture, and prints what became of them:
//! `cargo run --release -p client-robot --example relocalize -- museum 1-20 go 3.0 0.05` (world,
//! seeds, `go` or `find`, spacing of the main nodes, their error in metres, and the world mapped if
//! it is another).

#[path = "../tests/fixture/mod.rs"]
mod fixture;
#[path = "../tests/fixture/scored.rs"]
mod scored;

use client_robot::mission::{MissionConfig, MissionGoal, Services};
use client_robot::pilot::PilotConfig;
use fht_descriptor::DescriptorNet;
use fht_perception::frame::Panorama;
use fht_proto::Descriptor;
use fht_sim::{SimConfig, Simulator};
use scored::scored;
use std::error::Error;
use std::sync::Arc;
use std::time::Instant;

fn main() {
    if let Err(error) = run() {
        eprintln!("{error}"); // an error that main returns is printed with Debug
        std::process::exit(1);
    }
}

fn run() -> Result<(), Box<dyn Error>> {
    let filter = tracing_subscriber::EnvFilter::from_default_env();
    tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr).init();
    let mut args = std::env::args().skip(1);
    let world_name = args.next().unwrap_or_else(|| "museum".to_owned());
    let seeds: Vec<u64> = match args.next().unwrap_or_else(|| "10".to_owned()).split_once('-') {
        Some((first, last)) => (first.parse()?..=last.parse()?).collect(),
        None => (1..=10).collect(),
    };
    let goes = args.next().is_some_and(|word| word == "go");
    let number = |text: Option<String>, default: f64| text.map_or(Ok(default), |text| text.parse::<f64>());
    let spacing_m = number(args.next(), 3.0)?;
    let node_sigma_m = number(args.next(), 0.0)?;
    let mapped_name = args.next().unwrap_or_else(|| world_name.clone());
    let fixture = fixture::FixtureConfig { spacing_m, node_sigma_m, node_sigma_rad: 0.1 * node_sigma_m, light_seed: 1 };
    let world = Arc::new(fht_sim::load(&world_name, None, 0)?);
    let mut net = DescriptorNet::load(None).ok();
    eprintln!("descriptor: {}", if net.is_some() { "network" } else { "colour stand-in" });
    let mut describe = |panorama: &Panorama| -> Option<Descriptor> {
        match &mut net {
            Some(net) => Some(Descriptor::quantise(net.model().id, &net.describe(panorama).ok()?)),
            None => Some(fixture::colour_descriptor(panorama)),
        }
    };
    let began = Instant::now();
    let mapped = Arc::new(fht_sim::load(&mapped_name, None, 0)?);
    let map = fixture::map_of(&mapped, &fixture, &mut describe);
    eprintln!("{:?} mapped in {:.1} s", map.counts(), began.elapsed().as_secs_f64());
    println!(
        "seed  fix_m  err_m  err_deg ests/nodes worst_m | arrived end_m end_deg goal_m path short plan plans refix hits  sim_s wall_s failure"
    );
    for seed in seeds {
        let began = Instant::now();
        let sim = SimConfig { light_seed: 1000 + seed, ..SimConfig::default() };
        let start = world.random_free_pose(seed, 0.4);
        let simulator = Simulator::new(Arc::clone(&world), sim, start, seed);
        let goal = if goes { MissionGoal::FarNode(seed) } else { MissionGoal::None };
        let pilot = PilotConfig { seed, ..PilotConfig::default() };
        let config = MissionConfig { pilot, ..MissionConfig::default() };
        let mut paths = fixture::OwnPaths(&map);
        let mut services = Services { map: &map, paths: &mut paths, describe: &mut describe };
        let r = scored(simulator, config, &goal, &world.start(), &mut services);
        let n = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |v| format!("{v:.2}"));
        println!(
            "{seed:4} {:>6} {:>6} {:>6} {:?} {:>6} | {} {} {} {} {} {} {} {} {} {} {:.0} {:.1} {}",
            n(r.relocalization_distance_m),
            n(r.relocalization_error_m),
            n(r.relocalization_error_deg),
            r.relocalization_evidence.unwrap_or_default(),
            n(r.worst_error_m),
            r.arrived,
            n(r.final_error_m),
            n(r.final_error_deg),
            n(r.goal_distance_m),
            n(r.path_length_m),
            n(r.shortest_length_m),
            n(r.planned_length_m),
            r.plans,
            r.refixes,
            r.collisions,
            r.sim_s,
            began.elapsed().as_secs_f64(),
            r.failure.unwrap_or_default()
        );
    }
    Ok(())
}
