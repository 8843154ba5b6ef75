//! Three routers, three servers, and one of each killed every so often: see `fht_tests::site`.

use clap::Parser;
use fht_demo::{Role, leave_nothing_behind, run_role, this_executable};
use fht_program::Stop;
use fht_program::flags::{output_file, parse_args};
use fht_program::write_output;
use fht_tests::site::{SiteConfig, SiteReport, run};
use std::ffi::OsString;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

/// Runs a site of routers with replicated storages and stateless servers under load, and kills one
/// router and one server every so often.
///
/// Ends with 1 if an acknowledged increment is lost, a question is not answered in time, or servers
/// differ in the end.
#[derive(Debug, Parser)]
#[command(
    name = "site",
    max_term_width = 100,
    after_help = "Examples:
  site                                      three routers and three servers, for five minutes
  site --minutes 60 --kill-every 10         … for an hour, and worse
  site --servers 2 --writers 10 --readers 20
  site --report site.json                   the figures as JSON; --json FILE is the same flag

Exit code 0: nothing was lost, nobody waited, and all agree; 1: something of that is not so, or it
failed; 2: wrong usage."
)]
struct Args {
    /// How long, minutes.
    #[arg(long, default_value_t = 5.0)]
    minutes: f64,
    /// One router and one server are killed every so many seconds.
    #[arg(long, default_value_t = 20.0)]
    kill_every: f64,
    /// … and come back after so many.
    #[arg(long, default_value_t = 5.0)]
    back_after: f64,
    /// Decides who is killed.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Routers, each with a storage.
    #[arg(long, default_value_t = 3)]
    routers: usize,
    /// Servers.
    #[arg(long, default_value_t = 3)]
    servers: usize,
    /// Robots that write, each ten increments a second.
    #[arg(long, default_value_t = 3)]
    writers: usize,
    /// Robots that ask, each ten questions a second.
    #[arg(long, default_value_t = 4)]
    readers: usize,
    /// Write the figures to this file as JSON.
    #[arg(long, visible_alias = "json", value_name = "FILE", value_parser = output_file)]
    report: Option<PathBuf>,
}

fn print(report: &SiteReport) {
    let SiteReport { written, acknowledged, lost, kills, questions, late, repeated, .. } = report;
    println!("increments    {written} written, {acknowledged} acknowledged, {lost} lost");
    println!(
        "              acknowledged after {:.0} ms at most, bytes put {:.2} times",
        report.greatest_acknowledgement_ms, report.repetition
    );
    println!("questions     {questions} asked, {late} answered late, {repeated} put again");
    println!(
        "              median {:.1} ms, 99 % {:.1} ms, greatest {:.0} ms",
        report.median_ms, report.p99_ms, report.greatest_ms
    );
    println!("killed        {kills} routers and servers");
    let says = |agree: bool| if agree { "agree" } else { "DIFFER" };
    println!("digests       {}; read anew from the storages: {}", says(report.agree), says(report.agree_anew));
}

fn main() -> ExitCode {
    // One executable has all roles: see `handoff role`.
    let args: Vec<OsString> = std::env::args_os().collect();
    if let [_, word, role, rest @ ..] = args.as_slice()
        && word == "role"
    {
        let program = std::iter::once(role).chain(rest.iter().filter(|arg| *arg != "--")).cloned();
        return match role.to_str() {
            Some("router") => fht_tests::router::main_with_args(program.collect()),
            _ => run_role(Role::MapServer, program.skip(1).collect()),
        };
    }
    let args: Args = match parse_args(args) {
        Ok(args) => args,
        Err(code) => return code,
    };
    let stop = Stop::on_signal("site");
    let outcome = tempfile::tempdir().map_err(Into::into).and_then(|folder| {
        leave_nothing_behind(&stop?, folder.path());
        let seconds = Duration::from_secs_f64;
        let config = SiteConfig {
            duration: seconds(args.minutes * 60.0),
            kill_every: seconds(args.kill_every),
            back_after: seconds(args.back_after),
            seed: args.seed,
            routers: args.routers,
            servers: args.servers,
            writers: args.writers,
            readers: args.readers,
            ..SiteConfig::new(this_executable()?, folder.path().to_owned())
        };
        run(&config, |what| eprintln!("{what}"))
    });
    match outcome {
        Ok(report) => {
            print(&report);
            if let Some(file) = &args.report {
                let written = serde_json::to_vec_pretty(&report).map_err(|error| error.to_string());
                if let Err(error) =
                    written.and_then(|json| write_output(file, &json).map_err(|error| error.to_string()))
                {
                    eprintln!("site: {}: {error}", file.display());
                    return ExitCode::FAILURE;
                }
            }
            if report.is_success() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
        }
        Err(error) => {
            eprintln!("site: {error}");
            ExitCode::FAILURE
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_help_has_examples_that_the_program_takes() {
        let help = Args::command().render_long_help().to_string();
        let (_, examples) = help.split_once("Examples:\n").expect("examples");
        let lines: Vec<&str> = examples.lines().take_while(|line| !line.is_empty()).collect();
        assert!(lines.len() > 2, "{help}");
        for line in lines {
            let words = line.trim().split("  ").next().unwrap_or_default().split(' ');
            assert!(Args::try_parse_from(words).is_ok(), "{line}");
        }
        assert!(help.contains("[alias: --json]"), "{help}");
    }
}
