//! The handoff demo, and the programs that it starts (`handoff role NAME -- ARGS`).

use fht_demo::run_role;
use fht_demo::{Crew, HandoffConfig, hand_off};
use fht_demo::{HandoffArgs, HandoffCommand, leave_nothing_behind, shared_world, this_executable};
use fht_picture::default_file;
use fht_program::flags::{output_file, parse_args};
use fht_program::{ProgramFailure, Stop, print_line, write_output};
use fht_shared_world::folder_of;
use fht_sim::SimSetup;
use std::process::ExitCode;

fn main() -> ExitCode {
    fht_program::zenoh_threads::one_thread_for_tls(std::env::args_os());
    let cli: HandoffArgs = match parse_args(std::env::args_os()) {
        Ok(cli) => cli,
        Err(code) => return code,
    };
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
            return ProgramFailure::of_run(format!("signals cannot be handled: {error}")).tell("handoff");
        }
    };
    match demo(&cli, &stop) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        // What was killed failed.
        Err(_) if stop.is_set() => stop.leave(),
        Err(failure) => failure.tell("handoff"),
    }
}

fn demo(cli: &HandoffArgs, stop: &Stop) -> Result<bool, ProgramFailure> {
    let text = |error: &dyn std::fmt::Display| ProgramFailure::of_run(error);
    if std::net::TcpStream::connect(cli.listen.trim_start_matches("tcp/")).is_ok() {
        let taken = format!("something listens on {} already; choose another --listen", cli.listen);
        return Err(ProgramFailure::of_run(taken));
    }
    let folder = tempfile::tempdir().map_err(|error| text(&error))?;
    let world = shared_world(folder.path()).map_err(ProgramFailure::of_run)?;
    leave_nothing_behind(stop, folder.path());
    leave_nothing_behind(stop, &folder_of(&world));
    let map = SimSetup::of(&cli.world).map_name().map_err(ProgramFailure::of_input)?;
    let picture = cli.picture.clone().unwrap_or_else(|| default_file("handoff", map.as_str(), Some(cli.seed)));
    // One that was given was looked at with the arguments.
    if cli.picture.is_none() {
        output_file(&picture.to_string_lossy())
            .map_err(|error| ProgramFailure::of(error.is_input(), format!("{}: {error}", picture.display())))?;
    }
    let config = HandoffConfig {
        executable: this_executable().map_err(|error| text(&error))?,
        world: cli.world.clone(),
        textures: cli.textures.clone(),
        seed: cli.seed,
        people: cli.people,
        crew: match cli.explorers {
            _ if cli.succeed => Crew::Succession,
            0 | 1 => Crew::One,
            several => Crew::Team(several.into()),
        },
        ros: cli.ros,
        endpoint: cli.listen.clone(),
        folder: folder.path().to_owned(),
        picture: picture.clone(),
        fetch: !cli.no_fetch,
        progress: !cli.quiet,
    };
    let (report, server) = hand_off(&config).map_err(|error| ProgramFailure::of(error.is_input(), error))?;
    // From here on only the server still runs, and it ends below.
    let _order = stop.in_order();
    print!("{report}");
    if report.picture_failure.is_none() {
        print_line!("picture       {}", picture.display());
    }
    if let Some(file) = &cli.report {
        let json = serde_json::to_string_pretty(&report).map_err(|error| text(&error))?;
        let written = write_output(file, json.as_bytes());
        written.map_err(|error| ProgramFailure::of_run(format!("{} cannot be written: {error}", file.display())))?;
    }
    if cli.keep {
        print_line!("\nThe server stays up on {}. Ask it, from another terminal:", cli.listen);
        print_line!("  pip install zenoh-cli");
        for question in ["path?from=0,0;to=5,3", "nodes?near=0,0;radius=3", "head"] {
            print_line!("  zenoh --connect {} get -s 'fht/{map}/{question}' --decoder json", cli.listen);
        }
        print_line!("Ctrl-C ends it.");
        let runtime =
            tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(|error| text(&error))?;
        runtime.block_on(stop.requested());
    }
    drop(server);
    match &report.picture_failure {
        Some(reason) => Err(ProgramFailure::of_run(format!("there is no picture of the map: {reason}"))),
        None => Ok(report.is_success()),
    }
}
