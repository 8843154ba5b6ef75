//! How well the descriptor tells places apart, and how its mean is fitted.

use clap::{Parser, Subcommand};
use fht_robot::descriptor::{Appearance, DescriptorNet};
use fht_tests::appearance::{PairConfig, describe_view, separation, visit_twice};
use image::RgbImage;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;

/// Measures the descriptor on simulated worlds and on photographs, or fits the mean that it subtracts.
#[derive(Debug, Parser)]
#[command(name = "recall", version)]
struct Cli {
    /// Another model than the built-in one.
    #[arg(long, global = true)]
    model: Option<PathBuf>,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Pairs of panoramas of a world: one place on two days, up to a metre apart, at any heading.
    World {
        /// museum, office, or a Nav2 map.yaml.
        #[arg(long = "world", default_value = "museum")]
        worlds: Vec<String>,
        /// Pictures for the walls of a map.yaml.
        #[arg(long)]
        textures: Option<PathBuf>,
        /// Seed of the world's drawing.
        #[arg(long, default_value_t = 1)]
        world_seed: u64,
        /// Places.
        #[arg(long, default_value_t = 80)]
        places: u64,
    },
    /// Recall at 1 of single photographs: a folder with ref/ and query/, the i-th query showing the i-th reference.
    Photographs {
        /// The folder.
        folder: PathBuf,
        /// A query counts as found when the reference is at most this many photographs off.
        #[arg(long, default_value_t = 0)]
        tolerance: usize,
    },
    /// Prints the mean pooled vector of panoramas of drawn worlds (JSON), for a model's description.
    Fit {
        /// Seeds of the museums and offices that are visited.
        #[arg(long = "world-seed", required = true)]
        world_seeds: Vec<u64>,
        /// Places in each.
        #[arg(long, default_value_t = 40)]
        places: u64,
    },
}

fn main() -> ExitCode {
    match run(Cli::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("recall: {message}");
            ExitCode::FAILURE
        }
    }
}

fn run(cli: Cli) -> Result<(), String> {
    let mut net = DescriptorNet::load(cli.model.as_deref()).map_err(|error| error.to_string())?;
    let threshold = f64::from(net.model().match_threshold_e3) / 1000.0;
    match cli.command {
        Command::World { worlds, textures, world_seed, places } => {
            let config = PairConfig { places, ..PairConfig::default() };
            for name in worlds {
                let world = fht_sim::load(&name, textures.as_deref(), world_seed).map_err(|error| error.to_string())?;
                let pairs = visit_twice(&Arc::new(world), &config, |simulator| describe_view(&mut net, simulator))
                    .map_err(|error| error.to_string())?;
                let scores = separation(&pairs, &config, threshold);
                println!("{}", serde_json::json!({ "world": name, "places": places, "scores": scores }));
            }
        }
        Command::Photographs { folder, tolerance } => {
            let references = describe_folder(&mut net, &folder.join("ref"))?;
            let queries = describe_folder(&mut net, &folder.join("query"))?;
            let cosine = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f32>();
            let found = queries.iter().enumerate().filter(|(index, query)| {
                let best =
                    references.iter().enumerate().max_by(|a, b| cosine(query, a.1).total_cmp(&cosine(query, b.1)));
                best.is_some_and(|(best, _)| best.abs_diff(*index) <= tolerance)
            });
            let recall = found.count() as f64 / queries.len().max(1) as f64;
            println!(
                "{}",
                serde_json::json!({ "queries": queries.len(), "tolerance": tolerance, "recall_at_1": recall })
            );
        }
        Command::Fit { world_seeds, places } => {
            let mut sum = vec![0.0_f64; usize::from(net.model().dimension)];
            let mut count = 0_u32;
            let config = PairConfig { places, ..PairConfig::default() };
            for seed in world_seeds {
                for name in ["museum", "office"] {
                    let world = fht_sim::load(name, None, seed).map_err(|error| error.to_string())?;
                    let pairs = visit_twice(&Arc::new(world), &PairConfig { seed, ..config.clone() }, |simulator| {
                        let frame = simulator.sense_first();
                        net.pooled(frame.panorama.as_ref().map_or(&[], |panorama| &panorama.views[..]))
                    });
                    for pair in pairs.map_err(|error| error.to_string())? {
                        for descriptor in [pair.descriptors.0, pair.descriptors.1] {
                            sum.iter_mut().zip(&descriptor).for_each(|(sum, value)| *sum += f64::from(*value));
                            count += 1;
                        }
                    }
                }
            }
            let mean: Vec<f64> = sum.iter().map(|sum| (sum / f64::from(count.max(1)) * 1e5).round() / 1e5).collect();
            println!("{}", serde_json::json!(mean));
        }
    }
    Ok(())
}

/// Descriptors of the pictures of a folder, in the order of their names.
fn describe_folder(net: &mut DescriptorNet, folder: &Path) -> Result<Vec<Vec<f32>>, String> {
    let entries = std::fs::read_dir(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    let mut paths: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    paths.sort();
    let describe = |path: &PathBuf| {
        let picture: RgbImage = image::open(path).map_err(|error| format!("{}: {error}", path.display()))?.to_rgb8();
        let appearance: Appearance = net.appearance(&[picture]).map_err(|error| error.to_string())?;
        Ok(appearance.components)
    };
    paths.iter().map(describe).collect()
}
