//! The handoff demo, and the programs that it starts (`handoff role NAME -- ARGS`).

use clap::Parser;
use fht_demo::run_role;
use fht_demo::{Crew, HandoffConfig, HandoffReport, hand_off, map_name};
use fht_demo::{HandoffArgs, HandoffCommand, leave_nothing_behind, this_executable};
use fht_program::Stop;
use std::process::ExitCode;

fn main() -> ExitCode {
    let cli = HandoffArgs::parse();
    match cli.command {
        Some(HandoffCommand::Role { role, args }) => return run_role(role, args),
        Some(HandoffCommand::Completions(shell)) => {
            shell.print::<HandoffArgs>();
            return ExitCode::SUCCESS;
        }
        None => {}
    }
    let stop = match Stop::on_signal("handoff") {
        Ok(stop) => stop,
        Err(error) => {
            eprintln!("handoff: signals cannot be handled: {error}");
            return ExitCode::FAILURE;
        }
    };
    match demo(&cli, &stop) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        // What was killed failed.
        Err(_) if stop.is_set() => stop.leave(),
        Err(message) => {
            eprintln!("handoff: {message}");
            ExitCode::FAILURE
        }
    }
}

fn demo(cli: &HandoffArgs, stop: &Stop) -> Result<bool, String> {
    let text = |error: &dyn std::fmt::Display| error.to_string();
    if std::net::TcpStream::connect(cli.listen.trim_start_matches("tcp/")).is_ok() {
        return Err(format!("something listens on {} already; choose another --listen", cli.listen));
    }
    let folder = tempfile::tempdir().map_err(|error| text(&error))?;
    leave_nothing_behind(stop, folder.path());
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
    // From here on only the server still runs, and it ends below.
    let _order = stop.in_order();
    print_report(&report);
    println!("picture       {}", picture.display());
    if let Some(file) = &cli.report {
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
        runtime.block_on(stop.requested());
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
    println!(
        "time          {:.0} s, of which {:.0} s exploring, {:.0} s of robot time",
        report.wall_s, report.explore_wall_s, report.explore_sim_s
    );
}
