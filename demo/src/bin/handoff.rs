//! The handoff demo, and the programs that it starts (`handoff role NAME -- ARGS`).

use clap::{Parser, Subcommand};
use fht_demo::run_role;
use fht_demo::{Crew, HandoffConfig, HandoffReport, hand_off, map_name};
use fht_demo::{Role, this_executable};
use std::ffi::OsString;
use std::path::PathBuf;
use std::process::ExitCode;

/// Shows the whole loop: a robot maps a building, a server keeps the map, and a second robot,
/// dropped somewhere unknown, finds out where it is and drives to a goal on a path that the server
/// gave it.
///
/// Server, explorer and client are processes of their own that talk over Zenoh on this machine.
#[derive(Debug, Parser)]
#[command(
    name = "handoff",
    version,
    args_conflicts_with_subcommands = true,
    after_help = "Examples:
  handoff                                  the built-in museum
  handoff --world office --seed 3
  handoff --explorers 2                    two explorers at once
  handoff --succeed                        an explorer dies half-way, another one finishes the job
  handoff --world floor/map.yaml --textures pictures/
  handoff --keep                           the server stays up, for `zenoh get`"
)]
struct Cli {
    #[command(subcommand)]
    role: Option<RoleCommand>,
    /// museum, office, or the path of a Nav2 map.yaml or a Gazebo .world.
    #[arg(long, default_value = "museum")]
    world: String,
    /// Folder of pictures to paint the walls of a Nav2 map with.
    #[arg(long)]
    textures: Option<PathBuf>,
    /// Seed of the drawing, the noise, the light, start and goal.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// So many explorers at once: they begin in one room, and divide the building among them.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=8), conflicts_with = "succeed")]
    explorers: u8,
    /// The explorer dies half-way (SIGKILL), and another one finishes the job.
    #[arg(long)]
    succeed: bool,
    /// Where the server listens.
    #[arg(long, default_value = "tcp/127.0.0.1:7447")]
    listen: String,
    /// Leave the server running at the end, until Ctrl-C.
    #[arg(long)]
    keep: bool,
    /// Where the picture goes [default: handoff-WORLD-SEED.png].
    #[arg(long)]
    picture: Option<PathBuf>,
    /// Write the figures to this file as JSON.
    #[arg(long)]
    json: Option<PathBuf>,
    /// No progress bars.
    #[arg(long, short)]
    quiet: bool,
}

#[derive(Debug, Subcommand)]
enum RoleCommand {
    /// Runs one of the programs: map-server, mapper or client-robot.
    Role {
        /// Which.
        role: Role,
        /// Its arguments.
        #[arg(last = true)]
        args: Vec<OsString>,
    },
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    if let Some(RoleCommand::Role { role, args }) = cli.role {
        return run_role(role, args);
    }
    match demo(&cli) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(message) => {
            eprintln!("handoff: {message}");
            ExitCode::FAILURE
        }
    }
}

fn demo(cli: &Cli) -> Result<bool, String> {
    let text = |error: &dyn std::fmt::Display| error.to_string();
    if std::net::TcpStream::connect(cli.listen.trim_start_matches("tcp/")).is_ok() {
        return Err(format!("something listens on {} already; choose another --listen", cli.listen));
    }
    let folder = tempfile::tempdir().map_err(|error| text(&error))?;
    let map = map_name(&cli.world).map_err(|error| text(&error))?;
    let picture = cli.picture.clone().unwrap_or_else(|| format!("handoff-{map}-{}.png", cli.seed).into());
    let config = HandoffConfig {
        executable: this_executable().map_err(|error| text(&error))?,
        world: cli.world.clone(),
        textures: cli.textures.clone(),
        seed: cli.seed,
        crew: match cli.explorers {
            _ if cli.succeed => Crew::Succession,
            0 | 1 => Crew::One,
            several => Crew::Team(several.into()),
        },
        endpoint: cli.listen.clone(),
        folder: folder.path().to_owned(),
        picture: picture.clone(),
        progress: !cli.quiet,
    };
    let (report, server) = hand_off(&config).map_err(|error| text(&error))?;
    print_report(&report);
    println!("picture       {}", picture.display());
    if let Some(file) = &cli.json {
        let json = serde_json::to_string_pretty(&report).map_err(|error| text(&error))?;
        std::fs::write(file, json).map_err(|error| format!("{} cannot be written: {error}", file.display()))?;
    }
    if cli.keep {
        println!("\nThe server stays up on {}. Ask it, from another terminal:", cli.listen);
        println!("  pip install zenoh-cli");
        for question in ["path?from=0,0;to=5,3", "nodes?near=0,0;radius=3", "head"] {
            println!("  zenoh --connect {} get -s 'fht/{map}/{question}' --decoder json", cli.listen);
        }
        println!("Ctrl-C ends it.");
        let runtime =
            tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(|error| text(&error))?;
        runtime.block_on(tokio::signal::ctrl_c()).map_err(|error| text(&error))?;
    }
    drop(server);
    Ok(report.is_success())
}

fn print_report(report: &HandoffReport) {
    let metres = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |value| format!("{value:.2} m"));
    let place = |value: Option<[f64; 2]>| value.map_or_else(|| "-".to_owned(), |[x, y]| format!("({x:.2}, {y:.2})"));
    println!("world         {} (seed {})", report.world, report.seed);
    println!(
        "explored      {:.1} % of {:.0} m² in {:.0} m of driving, {:.3} m mean pose error",
        report.explored_fraction * 100.0,
        report.free_area_m2,
        report.explorer_driven_m,
        report.mapping_error_m
    );
    for explorer in report.explorers.iter().filter(|_| report.explorers.len() > 1) {
        let joined = explorer.joined.filter(|[seconds, _]| *seconds > 0.0);
        println!(
            "  {:<12}{}{}{:.0} s of robot time: {}",
            explorer.robot,
            joined.map_or_else(String::new, |[s, m]| format!("joined the map after {s:.0} s and {m:.1} m, ")),
            explorer.driven_m.map_or_else(String::new, |metres| format!("{metres:.0} m, ")),
            explorer.sim_s,
            explorer.ending
        );
    }
    println!(
        "map           {} main nodes, {} support nodes, {} edges",
        report.main_nodes, report.support_nodes, report.edges
    );
    println!(
        "bytes         {:.1} KB of map, {:.1} KB put on the wire; digests {}",
        report.map_bytes as f64 / 1000.0,
        report.wire_bytes as f64 / 1000.0,
        if report.digests_agree { "agree" } else { "DIFFER" }
    );
    if report.localized {
        println!(
            "relocalized   after {} of driving, off by {} and {:.2}°",
            metres(report.relocalization_distance_m),
            metres(report.relocalization_error_m),
            report.relocalization_error_deg.unwrap_or(f64::NAN)
        );
    } else {
        println!("relocalized   no");
    }
    println!(
        "client        truly at {}, thought {}, goal {} away: {}",
        place(report.end_true),
        place(report.end_estimated),
        metres(report.goal_distance_m),
        match (&report.failure, report.arrived) {
            (_, true) => "arrived".to_owned(),
            (Some(reason), false) => format!("did not arrive: {reason}"),
            (None, false) => "did not arrive".to_owned(),
        }
    );
    println!(
        "path          {} driven, {} was the shortest possible",
        metres(report.path_length_m),
        metres(report.shortest_length_m)
    );
    println!("time          {:.0} s, of which {:.0} s exploring", report.wall_s, report.explore_wall_s);
}
