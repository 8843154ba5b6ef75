//! The handoff demo, and the programs that it starts (`handoff role NAME -- ARGS`).

use fht_demo::run_role;
use fht_demo::{Crew, HandoffConfig, HandoffReport, hand_off};
use fht_demo::{HandoffArgs, HandoffCommand, leave_nothing_behind, shared_world, this_executable};
use fht_picture::default_file;
use fht_program::flags::{check_files, output_file, parse_args};
use fht_program::{ProgramFailure, Stop, exit_code, print_line, write_output};
use fht_proto::MapName;
use fht_shared_world::folder_of;
use fht_sim::SimSetup;
use std::path::PathBuf;
use std::process::ExitCode;

fn main() -> ExitCode {
    exit_code(handoff())
}

fn handoff() -> ExitCode {
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
    let (map, picture) = map_and_picture(cli)?;
    if std::net::TcpStream::connect(cli.listen.trim_start_matches("tcp/")).is_ok() {
        let taken = format!("something listens on {} already; choose another --listen", cli.listen);
        return Err(ProgramFailure::of_run(taken));
    }
    let folder = tempfile::tempdir().map_err(|error| text(&error))?;
    let world = shared_world(folder.path()).map_err(ProgramFailure::of_run)?;
    leave_nothing_behind(stop, folder.path());
    leave_nothing_behind(stop, &folder_of(&world));
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
    print_line!("{}", report.to_string().trim_end());
    if report.picture_failure.is_none() {
        print_line!("picture       {}", picture.display());
    }
    let picture_failure = report.picture_failure.as_ref();
    let no_picture = picture_failure.map_or(Ok(()), |reason| Err(format!("there is no picture of the map: {reason}")));
    // All is told, and before somebody ends what stays up.
    let is_kept = told(no_picture) & told(write_report(cli, &report));
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
    Ok(report.is_success() && is_kept)
}

/// Whether it came about; says why, if not.
fn told(outcome: Result<(), String>) -> bool {
    outcome.inspect_err(|reason| _ = ProgramFailure::of_run(reason).tell("handoff")).is_ok()
}

/// The map's name and the picture's file. No output of the demo destroys what it reads, or another
/// output.
fn map_and_picture(cli: &HandoffArgs) -> Result<(MapName, PathBuf), ProgramFailure> {
    let setup = SimSetup { textures: cli.textures.clone(), ..SimSetup::of(&cli.world) };
    let map = setup.map_name().map_err(ProgramFailure::of_input)?;
    let picture = cli.picture.clone().unwrap_or_else(|| default_file("handoff", map.as_str(), Some(cli.seed)));
    // One that was given was looked at with the arguments.
    if cli.picture.is_none() {
        output_file(&picture.to_string_lossy())
            .map_err(|error| ProgramFailure::of(error.is_input(), format!("{}: {error}", picture.display())))?;
    }
    let world = setup.files();
    let inputs = world.iter().map(|file| ("the world", Some(file.as_path())));
    check_files(inputs, [("--picture", Some(picture.as_path())), ("--report", cli.report.as_deref())])
        .map_err(ProgramFailure::of_input)?;
    Ok((map, picture))
}

/// Writes the figures to the file that was asked for.
fn write_report(cli: &HandoffArgs, report: &HandoffReport) -> Result<(), String> {
    let Some(file) = &cli.report else { return Ok(()) };
    let json = serde_json::to_string_pretty(report).map_err(|error| error.to_string())?;
    write_output(file, json.as_bytes()).map_err(|error| format!("{} cannot be written: {error}", file.display()))
}
