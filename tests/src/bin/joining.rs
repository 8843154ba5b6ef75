//! A client joins over a thin link that breaks: see `fht_tests::slow_join`.

use clap::Parser;
use fht_demo::leave_nothing_behind;
use fht_program::Stop;
use fht_tests::maps::{explored, office};
use fht_tests::slow_join::{SlowJoin, SlowJoinConfig, run};
use fht_tests::thin_link::LinkShape;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

/// Tries how a client joins a map over a thin link, once while it holds and once while it is cut,
/// and how late live increments are.
///
/// Ends with 1 if 5 % or more of the bytes were fetched again, or a live increment was later than a
/// second.
#[derive(Debug, Parser)]
struct Args {
    /// `handoff`, which runs the server.
    #[arg(long, default_value = "target/release/handoff")]
    handoff: PathBuf,
    /// A world to be explored (once; it is kept): office, museum, a file. None: a drawn map as long
    /// as an explored office.
    #[arg(long)]
    world: Option<String>,
    /// The drawn map is so many times as long.
    #[arg(long, default_value_t = 1)]
    times: u32,
    /// Each way, millions of bits a second.
    #[arg(long, default_value_t = 8.0)]
    mbit: f64,
    /// Each way, milliseconds.
    #[arg(long, default_value_t = 50)]
    delay_ms: u64,
    /// The link is cut so many times.
    #[arg(long, default_value_t = 3)]
    cuts: u64,
    /// For so long each time, seconds.
    #[arg(long, default_value_t = 2.0)]
    cut_s: f64,
    /// Live increments a second.
    #[arg(long, default_value_t = 10.0)]
    live: f64,
    /// Write the figures to this file as JSON.
    #[arg(long, alias = "json", value_name = "FILE")]
    report: Option<PathBuf>,
}

fn main() -> ExitCode {
    let filter = tracing_subscriber::EnvFilter::try_from_default_env()
        .unwrap_or_else(|_| tracing_subscriber::EnvFilter::new("warn,zenoh=error"));
    let _ = tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr).try_init();
    match joining(&Args::parse()) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(message) => {
            eprintln!("joining: {message}");
            ExitCode::FAILURE
        }
    }
}

fn joining(args: &Args) -> Result<bool, String> {
    let text = |error: &dyn std::fmt::Display| error.to_string();
    let increments = match &args.world {
        None => office(args.times),
        Some(world) => explored(world)?,
    };
    let folder = tempfile::tempdir().map_err(|error| text(&error))?;
    leave_nothing_behind(&Stop::on_signal("joining").map_err(|error| text(&error))?, folder.path());
    let config = SlowJoinConfig {
        executable: args.handoff.clone(),
        data: folder.path().join("data"),
        shape: LinkShape { bits_per_s: args.mbit * 1e6, delay: Duration::from_millis(args.delay_ms) },
        cuts: args.cuts,
        cut_for: Duration::from_secs_f64(args.cut_s),
        every: Duration::from_secs_f64(1.0 / args.live.max(0.001)),
        after: Duration::from_secs(5),
    };
    let map = "office".parse().map_err(|error: fht_proto::model::ids::ParseIdError| text(&error))?;
    let report = run(&config, &map, &increments).map_err(|error| text(&error))?;
    println!(
        "map       {} increments, {} bytes; link of {} Mbit/s and {} ms each way",
        increments.len(),
        report.map_bytes,
        args.mbit,
        args.delay_ms
    );
    let row = |name: &str, joining: &SlowJoin| {
        let SlowJoin { seconds, fetched_bytes, link_bytes, cuts, live_s } = joining;
        let at = |share: f64| {
            live_s.get((live_s.len().saturating_sub(1) as f64 * share) as usize).copied().unwrap_or(f64::NAN)
        };
        println!(
            "{name:<9} {seconds:.2} s, {cuts} cuts, {fetched_bytes} bytes fetched, {link_bytes} on the link; {} live increments: {:.3} s median, {:.3} s 99 %, {:.3} s at most",
            live_s.len(),
            at(0.5),
            at(0.99),
            at(1.0)
        );
    };
    row("whole", &report.whole);
    row("cut", &report.cut);
    println!(
        "again     {:.2} % of the bytes were fetched again; {:.2} % more on the link, with new connections and what was under way",
        report.refetched() * 100.0,
        report.sent_again() * 100.0
    );
    if let Some(file) = &args.report {
        let json = serde_json::to_string(&report).map_err(|error| text(&error))?;
        std::fs::write(file, json).map_err(|error| format!("{} cannot be written: {error}", file.display()))?;
    }
    let is_soon = [&report.whole, &report.cut].iter().all(|joining| joining.live_s.last().is_some_and(|s| *s <= 1.0));
    Ok(report.refetched() < 0.05 && is_soon && report.cut.cuts == args.cuts as usize)
}
