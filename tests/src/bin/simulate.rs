//! Fleets on bad networks, by the thousand: see `fht_tests::simulation`.

use clap::Parser;
use fht_tests::simulation::{SimulationConfig, SimulationOutcome, run};
use indicatif::{ProgressBar, ProgressStyle};
use std::process::ExitCode;

/// Simulates explorers, an operator, servers and clients over a network that loses, delays,
/// repeats, reorders and parts, with machines that fail at durable writes.
///
/// Ends with 1 at the first seed after which copies differ, an acknowledged increment is lost, or a
/// release has changed.
#[derive(Debug, Parser)]
struct Args {
    /// How many seeds.
    #[arg(long, default_value_t = 2000, value_parser = fht_program::flags::count)]
    seeds: u64,
    /// The first seed.
    #[arg(long, default_value_t = 1)]
    first: u64,
    /// Servers that stand on replicated storages; 0: one with a disk.
    #[arg(long, default_value_t = 0)]
    servers: usize,
    /// Share of killed explorers that come back within seconds.
    #[arg(long, value_name = "SHARE", default_value_t = 0.8, value_parser = share)]
    returning: f64,
    /// Share of explorers without a spool on a disk [default: 0.5, and 0 with --servers: once in
    /// some thousand fleets one without undoes there what a run of its own had put before].
    #[arg(long, value_name = "SHARE", value_parser = share)]
    forgetful: Option<f64>,
    /// No progress bar.
    #[arg(long)]
    quiet: bool,
}

fn share(text: &str) -> Result<f64, String> {
    let share = text.parse().map_err(|_| format!("'{text}' is not a number"))?;
    if (0.0..=1.0).contains(&share) { Ok(share) } else { Err(format!("{share} is not between 0 and 1")) }
}

fn main() -> ExitCode {
    let args = Args::parse();
    let bar = if args.quiet { ProgressBar::hidden() } else { ProgressBar::new(args.seeds) };
    if let Ok(style) = ProgressStyle::with_template("[{bar:40}] {pos}/{len} seeds, {eta} left") {
        bar.set_style(style);
    }
    let (servers, returning, forgetful) = (args.servers, args.returning, args.forgetful);
    let config = SimulationConfig { servers, returning, forgetful, ..SimulationConfig::default() };
    let mut sum = SimulationOutcome::default();
    for seed in args.first..args.first.saturating_add(args.seeds) {
        match run(seed, &config) {
            Ok(outcome) => sum += outcome,
            Err(violation) => {
                bar.finish_and_clear();
                eprintln!("simulate: seed {seed}: {violation}");
                return ExitCode::FAILURE;
            }
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    println!(
        "{} seeds, {} simulated hours: {} increments, {} of {} messages lost, {} crashes at durable writes, {} partitions, \
         {} returns of explorers ({} runs ended because their numbers were taken), {} releases, \
         {} foldings: all copies one, nothing that was acknowledged lost, no release changed",
        args.seeds,
        sum.seconds / 3600,
        sum.increments,
        sum.lost,
        sum.sent,
        sum.crashes,
        sum.partitions,
        sum.returns,
        sum.told,
        sum.releases,
        sum.compactions
    );
    ExitCode::SUCCESS
}
