//! How well the visual descriptor finds places again, on photographs and in simulated worlds. Also
//! writes the pooled features that a model's mean and projection are fitted to.

mod pictures;
mod score;
mod visits;

use clap::{Args, Parser, Subcommand};
use fht_descriptor::DescriptorNet;
use score::{Score, score};
use serde::Serialize;
use std::error::Error;
use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use visits::{VisitConfig, Visits, days, panorama};

/// Measures the visual descriptor: recall, false matches and the ROC.
#[derive(Debug, Parser)]
#[command(
    name = "recall",
    version,
    after_help = "Examples:
  recall corridor data/places/corridor
  recall world museum --seed 1
  recall world floor/map.yaml --textures pictures/ --json
  recall features office --seeds 101,102,103 > features.jsonl"
)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    /// ONNX model with its description beside it [default: the built-in one].
    #[arg(long, global = true)]
    model: Option<PathBuf>,
    /// Print JSON.
    #[arg(long, global = true)]
    json: bool,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// A corridor photographed twice: `ref/` and `query/` hold the pictures of one walk each.
    Corridor {
        /// The folder.
        folder: PathBuf,
    },
    /// Places of a simulated world, visited again in another light, from aside, with another
    /// heading.
    World {
        #[command(flatten)]
        world: WorldArgs,
        /// Seed of the drawing, and of places, headings and light.
        #[arg(long, default_value_t = 1)]
        seed: u64,
    },
    /// Pooled features before mean and projection, one JSON object a line: what
    /// `models/fit_projection.py` reads.
    Features {
        #[command(flatten)]
        world: WorldArgs,
        /// Seeds of the drawings, separated by commas.
        #[arg(long, value_delimiter = ',', required = true)]
        seeds: Vec<u64>,
    },
}

#[derive(Debug, Args)]
struct WorldArgs {
    /// museum, office, or the path of a Nav2 map.yaml or a Gazebo .world.
    #[arg(default_value = "museum")]
    world: String,
    /// Folder of pictures to paint the walls of a Nav2 map with.
    #[arg(long)]
    textures: Option<PathBuf>,
    /// Most places.
    #[arg(long, default_value_t = VisitConfig::default().places)]
    places: usize,
    /// Later visits to each.
    #[arg(long, default_value_t = VisitConfig::default().visits)]
    visits: usize,
}

impl WorldArgs {
    fn load(&self, seed: u64) -> Result<(Arc<fht_sim::World>, VisitConfig), fht_sim::WorldError> {
        let config = VisitConfig { places: self.places, visits: self.visits, seed, ..VisitConfig::default() };
        Ok((Arc::new(fht_sim::load(&self.world, self.textures.as_deref(), seed)?), config))
    }
}

#[derive(Debug, Serialize)]
struct Report {
    model: String,
    data: String,
    #[serde(flatten)]
    score: Score,
    /// Least and mean cosine of a place to itself at another heading.
    #[serde(skip_serializing_if = "Option::is_none")]
    heading: Option<[f64; 2]>,
}

impl Report {
    fn print(&self, json: bool) -> Result<(), Box<dyn Error>> {
        if json {
            println!("{}", serde_json::to_string_pretty(self)?);
            return Ok(());
        }
        let Score { queries, references, recall_at_1, recall_at_4, .. } = &self.score;
        println!("{} on {}: {queries} queries, {references} references", self.model, self.data);
        println!("  recall at 1: {recall_at_1:.3}, at 4: {recall_at_4:.3}");
        println!("  mean cosine: same {:.3}, different {:.3}", self.score.mean_same, self.score.mean_different);
        println!(
            "  at the threshold: found among the best 4 {:.3}, best is a different place {:.3}",
            self.score.found_at_threshold, self.score.false_best_at_threshold
        );
        for (point, note) in std::iter::once((&self.score.at_threshold, " (the model's threshold)"))
            .chain(self.score.roc.iter().map(|point| (point, "")))
        {
            println!(
                "  from cosine {:.3}: true matches {:.3}, false matches {:.4}{note}",
                point.threshold, point.true_positive_rate, point.false_positive_rate
            );
        }
        if let Some([least, mean]) = self.heading {
            println!("  same position, other heading: cosine {mean:.3} on average, at least {least:.3}");
        }
        Ok(())
    }
}

#[derive(Debug, Serialize)]
struct FeatureLine<'a> {
    place: &'a str,
    features: Vec<f32>,
}

fn write_features(net: &mut DescriptorNet, world: &WorldArgs, seeds: &[u64]) -> Result<(), Box<dyn Error>> {
    let mut out = std::io::BufWriter::new(std::io::stdout().lock());
    for &seed in seeds {
        let (loaded, config) = world.load(seed)?;
        let visits = Visits::draw(&loaded, &config);
        let [first_day, later_day] = days(seed);
        for (number, (place, later)) in visits.places.iter().zip(&visits.later).enumerate() {
            let name = format!("{}-{seed}-{number}", loaded.name());
            let all = std::iter::once((*place, first_day)).chain(later.iter().map(|&pose| (pose, later_day)));
            for (pose, light) in all {
                let features = net.pooled(&panorama(&loaded, pose, light, seed))?;
                serde_json::to_writer(&mut out, &FeatureLine { place: &name, features })?;
                writeln!(out)?;
            }
        }
    }
    Ok(())
}

fn run(cli: &Cli) -> Result<(), Box<dyn Error>> {
    let mut net = DescriptorNet::load(cli.model.as_deref())?;
    let (rows, data, heading) = match &cli.command {
        Command::Corridor { folder } => (pictures::corridor(&mut net, folder)?, "corridor".to_owned(), None),
        Command::World { world, seed } => {
            let (loaded, config) = world.load(*seed)?;
            let visits = Visits::draw(&loaded, &config);
            let heading = visits.heading_invariance(&loaded, &mut net, &config)?;
            (visits.rows(&loaded, &mut net, &config)?, format!("{} {seed}", world.world), Some(heading))
        }
        Command::Features { world, seeds } => return write_features(&mut net, world, seeds),
    };
    let threshold = f32::from(net.model().match_threshold_e3) / 1000.0;
    let score = score(rows, threshold).ok_or("there are no pairs of one place and of different places to compare")?;
    Report { model: net.model().name.clone(), data, score, heading }.print(cli.json)
}

fn main() -> ExitCode {
    match run(&Cli::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            fht_program::tell_line!("recall: {error}");
            ExitCode::FAILURE
        }
    }
}
