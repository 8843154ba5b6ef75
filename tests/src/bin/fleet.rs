//! A fleet on one server, beside bare Zenoh queries: see `fht_tests::fleet`.

use clap::{Parser, Subcommand};
use fht_demo::{leave_nothing_behind, this_executable};
use fht_program::Stop;
use fht_program::stop::end_with_parent;
use fht_sim::SimSetup;
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
    #[arg(long, default_value_t = 500)]
    clients: usize,
    /// Each client's copy asks for the head this often, seconds. All clients share this machine:
    /// 2,000 that ask every 2 s take more than one processor.
    #[arg(long, value_name = "SECONDS", default_value_t = 2.0)]
    head_every: f64,
    /// Questions of each client, a second.
    #[arg(long, default_value_t = 20.0)]
    rate: f64,
    /// How long paths are asked for, and bare answers, seconds.
    #[arg(long, default_value_t = 60.0)]
    seconds: f64,
    /// They take turns of this length, seconds.
    #[arg(long, default_value_t = 10.0)]
    turn: f64,
    /// How long each is asked for before anything counts, seconds.
    #[arg(long, default_value_t = 10.0)]
    warm_up: f64,
    /// Questions of one client alone, of each kind.
    #[arg(long, default_value_t = 5000)]
    alone: usize,
    /// Increments written meanwhile, a second.
    #[arg(long, default_value_t = 1.0)]
    increments: f64,
    /// Seed of the places.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Write the figures to this file as JSON.
    #[arg(long, alias = "json", value_name = "FILE")]
    report: Option<PathBuf>,
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
    let cli = Cli::parse();
    fht_program::logging::init("warn,zenoh=error");
    let outcome = match cli.role {
        Some(_) if end_with_parent("fleet").is_err() => Err("no thread can be started".to_owned()),
        Some(RoleCommand::Server { data, listen, zenoh_config }) => {
            server::serve(data, listen, zenoh_config).map(|()| true).map_err(|error| error.to_string())
        }
        Some(RoleCommand::Clients(args)) => be_clients(args).map(|()| true),
        None => fleet(&cli.fleet),
    };
    match outcome {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(message) => {
            eprintln!("fleet: {message}");
            ExitCode::FAILURE
        }
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

fn fleet(args: &FleetArgs) -> Result<bool, String> {
    let text = |error: &dyn std::fmt::Display| error.to_string();
    let increments = if args.world == "hall" { hall(20, 20) } else { explored(&args.world)? };
    let folder = tempfile::tempdir().map_err(|error| text(&error))?;
    leave_nothing_behind(&Stop::on_signal("fleet").map_err(|error| text(&error))?, folder.path());
    let config = FleetTrialConfig {
        executable: this_executable().map_err(|error| text(&error))?,
        data: folder.path().join("data"),
        map: SimSetup::of(&args.world).map_name().map_err(|error| text(&error))?,
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
    let report = run(&config, &increments).map_err(|error| text(&error))?;
    print(&report);
    if let Some(file) = &args.report {
        let json = serde_json::to_string(&report).map_err(|error| text(&error))?;
        std::fs::write(file, json).map_err(|error| format!("{} cannot be written: {error}", file.display()))?;
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
