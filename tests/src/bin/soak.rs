//! A fleet for an hour: see `fht_tests::soak`.

use clap::Parser;
use fht_demo::{Role, leave_nothing_behind, run_role, this_executable};
use fht_program::Stop;
use fht_program::stop::end_with_parent;
use fht_tests::soak::{Minute, SoakConfig, SoakReport, robots, run};
use std::ffi::OsString;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

/// Runs a server and robots that come and go, while the map changes, zones are drawn and removed,
/// and robots report what is blocked. The server is killed every so often and starts again.
///
/// Ends with 1 if an acknowledged increment is lost, a copy differs from the server's map in the
/// end, or memory, open files or the store have grown by more than 15 %, over the hour or between
/// two restarts.
#[derive(Debug, Parser)]
struct Args {
    /// How long, minutes.
    #[arg(long, default_value_t = 60.0)]
    minutes: f64,
    /// How many robots.
    #[arg(long, default_value_t = 500)]
    robots: usize,
    /// The server is killed every so many seconds.
    #[arg(long, default_value_t = 600.0)]
    kill_every: f64,
    /// Paths that each robot asks for, a second.
    #[arg(long, default_value_t = 0.1)]
    rate: f64,
    /// Write the figures to this file as JSON.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

fn main() -> ExitCode {
    fht_program::logging::init("warn,zenoh=error");
    let args: Vec<OsString> = std::env::args_os().collect();
    if let [_, word, role, rest @ ..] = args.as_slice()
        && word == "role"
    {
        return match role.to_str() {
            Some(robots::NAME) => be_robots(rest),
            _ => run_role(Role::MapServer, rest.iter().filter(|arg| *arg != "--").cloned().collect()),
        };
    }
    match soak(&Args::parse()) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(message) => {
            eprintln!("soak: {message}");
            ExitCode::FAILURE
        }
    }
}

/// Endpoint, first number, count, questions a second.
fn be_robots(words: &[OsString]) -> ExitCode {
    let words: Vec<&str> = words.iter().filter_map(|word| word.to_str()).collect();
    let [endpoint, first, count, rate] = words[..] else { return ExitCode::from(2) };
    let (Ok(first), Ok(count), Ok(rate)) = (first.parse(), count.parse(), rate.parse()) else {
        return ExitCode::from(2);
    };
    let ended = end_with_parent("robots").map_err(|error| error.to_string());
    match ended.and_then(|()| robots::run(endpoint, first, count, rate).map_err(|error| error.to_string())) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("robots: {error}");
            ExitCode::FAILURE
        }
    }
}

fn soak(args: &Args) -> Result<bool, String> {
    let text = |error: &dyn std::fmt::Display| error.to_string();
    let folder = tempfile::tempdir().map_err(|error| text(&error))?;
    leave_nothing_behind(&Stop::on_signal("soak").map_err(|error| text(&error))?, folder.path());
    let executable = this_executable().map_err(|error| text(&error))?;
    let config = SoakConfig {
        robots: args.robots,
        duration: Duration::from_secs_f64(args.minutes * 60.0),
        kill_every: Duration::from_secs_f64(args.kill_every),
        questions_per_s: args.rate,
        ..SoakConfig::new(executable, folder.path().to_owned())
    };
    let report = run(&config, tell).map_err(|error| text(&error))?;
    sum_up(&report);
    if let Some(file) = &args.json {
        let json = serde_json::to_vec_pretty(&report).map_err(|error| text(&error))?;
        std::fs::write(file, json).map_err(|error| format!("{} cannot be written: {error}", file.display()))?;
    }
    Ok(report.is_fine())
}

fn mib(bytes: f64) -> f64 {
    bytes / f64::from(1 << 20)
}

fn tell(minute: &Minute) {
    let Minute { at_s, server_bytes, open_files, stored_bytes, asked, refused, unanswered, replaced, .. } = minute;
    eprintln!(
        "{at_s:6.0} s  {:6.1} MiB, {open_files} files, {:6.2} MiB stored; {asked} asked, {refused} refused, {unanswered} \
         unanswered, median {:.2} ms, 99 % {:.1} ms; {replaced} robots replaced{}",
        mib(*server_bytes as f64),
        mib(*stored_bytes as f64),
        minute.median_ms,
        minute.p99_ms,
        if minute.is_killed { "; the server was killed" } else { "" }
    );
}

fn sum_up(report: &SoakReport) {
    let asked: u64 = report.minutes.iter().map(|minute| minute.asked).sum();
    let replaced: u64 = report.minutes.iter().map(|minute| minute.replaced).sum();
    let kills = report.minutes.iter().filter(|minute| minute.is_killed).count();
    println!("robots        {} at a time, {replaced} replaced; the server was killed {kills} times", report.robots);
    println!(
        "increments    {} acknowledged, {} lost; {} given up; a copy {}",
        report.acknowledged,
        report.lost,
        report.not_acknowledged,
        if report.agree { "agrees" } else { "DIFFERS" }
    );
    println!("questions     {asked} asked, {} failed in minutes without a kill", report.failures());
    let row = |name: &str, unit: &str, of: &dyn Fn(&Minute) -> f64| {
        let [first, last] = report.first_and_last(of);
        println!("{name:<14}{first:.1} {unit} at most in the first third, {last:.1} in the last");
    };
    row("memory", "MiB", &|minute| mib(minute.server_bytes as f64));
    let [first, last] = report.first_and_last_between_restarts(|minute| minute.server_bytes as f64);
    println!("              between two restarts at most from {:.1} to {:.1} MiB", mib(first), mib(last));
    row("files", "open", &|minute| minute.open_files as f64);
    row("store", "MiB", &|minute| mib(minute.stored_bytes as f64));
    row("median", "ms", &|minute| minute.median_ms);
    row("99 %", "ms", &|minute| minute.p99_ms);
}
