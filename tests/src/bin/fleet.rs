//! A fleet on one server, beside bare Zenoh queries: see `fht_tests::fleet`.

use clap::{Parser, Subcommand};
use fht_demo::{leave_nothing_behind, this_executable};
use fht_program::flags::{how_many, number, output_file, parse_args, seconds};
use fht_program::stop::end_with_parent;
use fht_program::{ProgramFailure, Stop, write_output};
use fht_sim::{SimSetup, check_world};
use fht_tests::fleet::clients::{self, ClientsConfig, Outcome};
use fht_tests::fleet::{Computed, FleetReport, FleetTrialConfig, run, server};
use fht_tests::maps::{explored, hall};
use std::path::PathBuf;
use std::process::ExitCode;

/// Tries a fleet: clients with a live copy of the map each, 250 in a process, which ask for paths
/// at a steady rate, and for as many bytes from a bare queryable of the same server, in turns.
///
/// Ends with 1 if a question failed, a copy is not the server's map in the end, or the server's
/// memory has grown.
#[derive(Debug, Parser)]
#[command(name = "fleet", version, args_conflicts_with_subcommands = true)]
struct Cli {
    #[command(subcommand)]
    role: Option<RoleCommand>,
    #[command(flatten)]
    fleet: FleetArgs,
}

#[derive(Debug, clap::Args)]
struct FleetArgs {
    /// museum, office, or a file: explored once and kept in target/evaluation. `hall`: drawn, 20 by
    /// 20 nodes.
    #[arg(long, default_value = "museum")]
    world: String,
    /// How many clients.
    #[arg(long, default_value_t = 500, value_parser = how_many)]
    clients: usize,
    /// Each client's copy asks for the head this often, seconds. All clients share this machine:
    /// 2,000 that ask every 2 s take more than one processor.
    #[arg(long, value_name = "SECONDS", default_value_t = 2.0, value_parser = length)]
    head_every: f64,
    /// Questions of each client, a second.
    #[arg(long, default_value_t = 20.0, value_parser = rate)]
    rate: f64,
    /// How long paths are asked for, and bare answers, seconds.
    #[arg(long, default_value_t = 60.0, value_parser = length)]
    seconds: f64,
    /// They take turns of this length, seconds.
    #[arg(long, default_value_t = 10.0, value_parser = length)]
    turn: f64,
    /// How long each is asked for before anything counts, seconds.
    #[arg(long, default_value_t = 10.0, value_parser = seconds)]
    warm_up: f64,
    /// Questions of one client alone, of each kind.
    #[arg(long, default_value_t = 5000, value_parser = how_many)]
    alone: usize,
    /// Increments written meanwhile, a second.
    #[arg(long, default_value_t = 1.0, value_parser = changes)]
    increments: f64,
    /// Seed of the places.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Write the figures to this file as JSON.
    #[arg(long, alias = "json", value_name = "FILE", value_parser = output_file)]
    report: Option<PathBuf>,
}

/// A length of time that something is done in, seconds.
fn length(text: &str) -> Result<f64, String> {
    number(text, 0.1..=1e6)
}

/// How often the map is changed, a second; 0 is never.
fn changes(text: &str) -> Result<f64, String> {
    number(text, 0.0..=1e4)
}

/// How often something is done, a second.
fn rate(text: &str) -> Result<f64, String> {
    number(text, 0.01..=1e4)
}

#[derive(Debug, Subcommand)]
enum RoleCommand {
    /// The fleet's server.
    #[command(hide = true)]
    Server {
        #[arg(long)]
        data: PathBuf,
        #[arg(long)]
        listen: String,
        #[arg(long)]
        zenoh_config: PathBuf,
    },
    /// The fleet's clients.
    #[command(hide = true)]
    Clients(ClientsArgs),
}

#[derive(Debug, clap::Args)]
struct ClientsArgs {
    #[arg(long)]
    connect: String,
    #[arg(long)]
    zenoh_config: PathBuf,
    #[arg(long)]
    map: String,
    #[arg(long)]
    first: usize,
    #[arg(long)]
    clients: usize,
    #[arg(long)]
    head_every: f64,
    #[arg(long)]
    rate: f64,
    #[arg(long)]
    seconds: f64,
    #[arg(long)]
    turn: f64,
    #[arg(long)]
    warm_up: f64,
    #[arg(long)]
    alone: usize,
    #[arg(long)]
    seed: u64,
}

fn main() -> ExitCode {
    let cli: Cli = match parse_args(std::env::args_os()) {
        Ok(cli) => cli,
        Err(code) => return code,
    };
    fht_program::logging::init("warn,zenoh=error");
    let outcome = match cli.role {
        Some(_) if end_with_parent("fleet").is_err() => Err(ProgramFailure::of_run("no thread can be started")),
        Some(RoleCommand::Server { data, listen, zenoh_config }) => {
            server::serve(data, listen, zenoh_config).map(|()| true).map_err(ProgramFailure::of_run)
        }
        Some(RoleCommand::Clients(args)) => be_clients(args).map(|()| true).map_err(ProgramFailure::of_run),
        None => fleet(&cli.fleet),
    };
    match outcome {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(failure) => failure.tell("fleet"),
    }
}

fn be_clients(args: ClientsArgs) -> Result<(), String> {
    let config = ClientsConfig {
        endpoint: args.connect,
        zenoh_config: args.zenoh_config,
        map: args.map.parse().map_err(|error: fht_proto::model::ids::ParseIdError| error.to_string())?,
        first: args.first,
        clients: args.clients,
        head_every_s: args.head_every,
        rate_hz: args.rate,
        warm_up_s: args.warm_up,
        seconds: args.seconds,
        turn_s: args.turn,
        alone: args.alone,
        seed: args.seed,
    };
    let say = |event: &clients::Event| match serde_json::to_string(event) {
        Ok(line) => println!("{line}"),
        Err(error) => eprintln!("fleet: {error}"),
    };
    clients::run(&config, std::io::stdin().lock(), say).map_err(|error| error.to_string())
}

fn fleet(args: &FleetArgs) -> Result<bool, ProgramFailure> {
    let is_drawn = args.world == "hall";
    if !is_drawn {
        check_world(&args.world).map_err(ProgramFailure::of_input)?;
    }
    let map = SimSetup::of(&args.world).map_name().map_err(ProgramFailure::of_input)?;
    let increments = if is_drawn { hall(20, 20) } else { explored(&args.world).map_err(ProgramFailure::of_run)? };
    let folder = tempfile::tempdir().map_err(ProgramFailure::of_run)?;
    leave_nothing_behind(&Stop::on_signal("fleet").map_err(ProgramFailure::of_run)?, folder.path());
    let config = FleetTrialConfig {
        executable: this_executable().map_err(ProgramFailure::of_run)?,
        data: folder.path().join("data"),
        map,
        clients: args.clients,
        head_every_s: args.head_every,
        rate_hz: args.rate,
        seconds: args.seconds,
        turn_s: args.turn,
        warm_up_s: args.warm_up,
        alone: args.alone,
        increments_hz: args.increments,
        seed: args.seed,
    };
    let report = run(&config, &increments).map_err(ProgramFailure::of_run)?;
    print(&report);
    if let Some(file) = &args.report {
        let json = serde_json::to_string(&report).map_err(ProgramFailure::of_run)?;
        let written = write_output(file, json.as_bytes());
        written.map_err(|error| ProgramFailure::of_run(format!("{} cannot be written: {error}", file.display())))?;
    }
    Ok(report.failures() == 0 && report.copies_agree == report.clients && report.memory_is_steady())
}

fn print(report: &FleetReport) {
    println!(
        "fleet     {} clients, {} questions a second each, on {} processors (load {:.1}); all had the map after {:.1} s",
        report.clients, report.rate_hz, report.processors, report.load, report.joined_s
    );
    let row = |name: &str, outcome: &Outcome, computed: &Computed| {
        let Outcome { asked, errors, unanswered, latencies, late, bytes } = outcome;
        let answered = latencies.count().max(1);
        println!(
            "{name:<9} {asked} asked in {:.1} s ({:.0}/s), {errors} errors, {unanswered} unanswered, {:.0} B each; put late {:.2} ms (99 %)",
            computed.wall_s,
            *asked as f64 / computed.wall_s.max(1e-9),
            *bytes as f64 / answered as f64,
            late.quantile_ms(0.99)
        );
        println!(
            "          ms: {:.3} median, {:.3} 90 %, {:.3} 99 %, {:.3} 99.9 %, {:.3} at most; µs of processor each: server {:.0}, clients {:.0}",
            latencies.quantile_ms(0.5),
            latencies.quantile_ms(0.9),
            latencies.quantile_ms(0.99),
            latencies.quantile_ms(0.999),
            latencies.max_ms(),
            computed.server_s * 1e6 / answered as f64,
            computed.clients_s * 1e6 / answered as f64
        );
    };
    row("paths", &report.path, &report.path_computed);
    row("bare", &report.bare, &report.bare_computed);
    let (path, bare) = (&report.path_alone, &report.bare_alone);
    println!(
        "alone     one client, {} of each: path {:.3} ms median, {:.3} 99 %; bare {:.3} ms median, {:.3} 99 %; {:.2} times",
        path.count(),
        path.quantile_ms(0.5),
        path.quantile_ms(0.99),
        bare.quantile_ms(0.5),
        bare.quantile_ms(0.99),
        report.ratio_alone()
    );
    let mib = |bytes: u64| bytes as f64 / f64::from(1 << 20);
    println!(
        "memory    server: {:.1} MiB at most until warm, {:.1} MiB after, {:.1} MiB in the end: {}",
        mib(report.warm_bytes),
        mib(report.most_bytes),
        mib(report.last_bytes),
        if report.memory_is_steady() { "steady" } else { "GROWN" }
    );
    println!(
        "copies    {} of {} are the server's map in the end, after {} changes",
        report.copies_agree, report.clients, report.versions
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fleets_that_make_no_sense_are_refused() {
        for (flag, value) in [
            ("--clients", "0"),
            ("--rate", "0"),
            ("--turn", "0"),
            ("--turn", "nan"),
            ("--report", "nowhere/fleet.json"),
        ] {
            assert!(Cli::try_parse_from(["fleet", flag, value]).is_err(), "{flag} {value}");
        }
        assert!(Cli::try_parse_from(["fleet", "--clients", "1", "--increments", "0.5"]).is_ok());
    }
}
