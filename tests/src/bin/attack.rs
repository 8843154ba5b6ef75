//! A site with mutual TLS and access control under attack: see `fht_tests::site`.

use clap::Parser;
use fht_demo::{Role, leave_nothing_behind, run_role, this_executable};
use fht_program::Stop;
use fht_program::stop::end_with_parent;
use fht_program::zenoh_threads::one_thread;
use fht_tests::site::{STRANGERS, SiteConfig, attack, run};
use std::ffi::OsString;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

/// Questions that are answered in time, of all; at least so many must be.
const IN_TIME: f64 = 0.999;

/// Runs a site of three routers and three servers with the files of deploy/, while robots write and
/// ask. Two strangers with certificates of the site that are in no list, and one client that is,
/// attack it all the time: they draw what goes between routers, fail handshakes, fill the routers'
/// doors with silent connections, take the servers' ids, and invent names. One router and one
/// server are killed every so often.
///
/// Ends with 1 if an acknowledged increment is lost, servers differ in the end, or fewer than
/// 99.9 % of the questions are answered in time.
#[derive(Debug, Parser)]
struct Args {
    /// How long, minutes.
    #[arg(long, default_value_t = 5.0)]
    minutes: f64,
    /// Which attacks: 1 draws what goes between routers, 2
    /// fails handshakes, 3 is silent at the door, 4 takes servers' ids, 7 reports everything as
    /// blocked, 8 asks long questions, 9 invents names.
    #[arg(long, value_delimiter = ',', default_value = "1,2,3,4,7,8,9", value_name = "NUMBERS",
          value_parser = clap::value_parser!(u32).range(1..=9))]
    attacks: Vec<u32>,
    /// One router and one server are killed every so many seconds.
    #[arg(long, default_value_t = 60.0)]
    kill_every: f64,
    /// A question must be answered within so many seconds.
    #[arg(long, default_value_t = 2.0)]
    limit: f64,
    /// Write the figures to this file as JSON.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

fn main() -> ExitCode {
    one_thread(std::env::args_os());
    // One executable has all roles, as `site` has.
    let args: Vec<OsString> = std::env::args_os().collect();
    if let [_, word, role, rest @ ..] = args.as_slice()
        && word == "role"
    {
        let program = std::iter::once(role).chain(rest.iter().filter(|arg| *arg != "--")).cloned();
        if role == STRANGERS {
            return be_strangers(rest);
        }
        return match role.to_str() {
            Some("router") => fht_tests::router::main_with_args(program.collect()),
            _ => run_role(Role::MapServer, program.skip(1).collect()),
        };
    }
    fht_program::logging::init("warn,zenoh=error");
    let args = Args::parse();
    let stop = Stop::on_signal("attack");
    let outcome = tempfile::tempdir().map_err(Into::into).and_then(|folder| {
        leave_nothing_behind(&stop?, folder.path());
        let seconds = Duration::from_secs_f64;
        let config = SiteConfig {
            duration: seconds(args.minutes * 60.0),
            kill_every: seconds(args.kill_every),
            limit: seconds(args.limit),
            attacks: args.attacks.clone(),
            ..SiteConfig::new(this_executable()?, folder.path().to_owned())
        };
        run(&config, |what| eprintln!("{what}"))
    });
    let report = match outcome {
        Ok(report) => report,
        Err(error) => {
            eprintln!("attack: {error}");
            return ExitCode::FAILURE;
        }
    };
    let in_time = 1.0 - report.late as f64 / (report.questions as f64).max(1.0);
    println!("increments    {} written, {} acknowledged, {} lost", report.written, report.acknowledged, report.lost);
    println!("questions     {} asked, {:.2} % within {} s", report.questions, 100.0 * in_time, args.limit);
    println!("              {} answered that a client reports the way as blocked", report.closed);
    println!(
        "              median {:.1} ms, 99 % {:.1} ms, greatest {:.0} ms",
        report.median_ms, report.p99_ms, report.greatest_ms
    );
    println!("killed        {} routers and servers", report.kills);
    println!("digests       {}", if report.agree && report.agree_anew { "agree" } else { "DIFFER" });
    if let Some(file) = &args.json {
        let json = serde_json::to_vec_pretty(&report).map_err(|error| error.to_string());
        if let Err(error) = json.and_then(|json| std::fs::write(file, json).map_err(|error| error.to_string())) {
            eprintln!("attack: {}: {error}", file.display());
            return ExitCode::FAILURE;
        }
    }
    let is_fine = report.lost == 0 && report.agree && report.agree_anew && in_time >= IN_TIME;
    if is_fine { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// Folder of the certificates, endpoints of the routers.
fn be_strangers(words: &[OsString]) -> ExitCode {
    let mut words = words.iter().filter(|word| *word != "--").filter_map(|word| word.to_str()).map(str::to_owned);
    let (Some(attacks), Some(folder)) = (words.next(), words.next()) else { return ExitCode::from(2) };
    if let Err(error) = end_with_parent(STRANGERS) {
        eprintln!("{STRANGERS}: {error}");
        return ExitCode::FAILURE;
    }
    attack(&attacks, folder.into(), words.collect());
    ExitCode::SUCCESS
}
