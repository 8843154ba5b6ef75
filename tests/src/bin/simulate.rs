//! Fleets on bad networks, by the thousand: see `fht_tests::simulation`.

use clap::Parser;
use fht_tests::simulation::{Outcome, SimulationConfig, run};
use indicatif::{ProgressBar, ProgressStyle};
use std::process::ExitCode;

/// Simulates explorers, an operator, servers and clients over a network that loses, delays, repeats, reorders and parts, with machines
/// that fail at durable writes.
///
/// Ends with 1 at the first seed after which copies differ, an acknowledged increment is lost, or a release has changed.
#[derive(Debug, Parser)]
struct Args {
    /// How many seeds.
    #[arg(long, default_value_t = 2000)]
    seeds: u64,
    /// The first seed.
    #[arg(long, default_value_t = 1)]
    first: u64,
    /// Servers that stand on replicated storages; 0: one with a disk.
    #[arg(long, default_value_t = 0)]
    servers: usize,
    /// That a number means two increments after an explorer has come back is a violation, not only counted.
    #[arg(long)]
    strict: bool,
    /// No progress bar.
    #[arg(long)]
    quiet: bool,
}

fn main() -> ExitCode {
    let args = Args::parse();
    let bar = if args.quiet { ProgressBar::hidden() } else { ProgressBar::new(args.seeds) };
    if let Ok(style) = ProgressStyle::with_template("[{bar:40}] {pos}/{len} seeds, {eta} left") {
        bar.set_style(style);
    }
    let config = SimulationConfig { servers: args.servers, is_strict: args.strict, ..SimulationConfig::default() };
    let mut sum = Outcome::default();
    for seed in args.first..args.first.saturating_add(args.seeds) {
        match run(seed, &config) {
            Ok(outcome) => {
                sum.increments += outcome.increments;
                sum.crashes += outcome.crashes;
                sum.partitions += outcome.partitions;
                sum.returns += outcome.returns;
                sum.told += outcome.told;
                sum.mistaken += outcome.mistaken;
                sum.replaced += outcome.replaced;
                sum.lost += outcome.lost;
                sum.sent += outcome.sent;
                sum.releases += outcome.releases;
                sum.folded += outcome.folded;
                sum.seconds += outcome.seconds;
            }
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
         {} returns of explorers ({} runs ended because their numbers were taken, {} increments mistaken for acknowledged, {} that a head covered replaced), {} releases, \
         {} foldings: all copies one, nothing else that was acknowledged lost, no release changed",
        args.seeds,
        sum.seconds / 3600,
        sum.increments,
        sum.lost,
        sum.sent,
        sum.crashes,
        sum.partitions,
        sum.returns,
        sum.told,
        sum.mistaken,
        sum.replaced,
        sum.releases,
        sum.folded
    );
    ExitCode::SUCCESS
}
