//! Flags that several programs have. All of them go before what the configuration file says.

mod file_clash;
mod output_file;
mod wrong_value;

pub use file_clash::{FileClash, NamedFile, check_files};
pub use output_file::{OutputFileError, folder, new_file, output_file, png_file};

use crate::config::{ConfigError, Configuration, load_over, print};
use clap::error::ErrorKind;
use clap::{Args, CommandFactory, Parser};
use fht_session::SessionConfig;
use serde::Serialize;
use std::error::Error as _;
use std::ffi::OsString;
use std::net::SocketAddr;
use std::ops::RangeInclusive;
use std::path::PathBuf;
use std::process::ExitCode;

/// Parses the arguments, the program's name first. Help and version go to standard output with exit
/// code 0, a wrong argument to standard error with 2; a disk without room for a file that is asked
/// for ends in 1.
///
/// # Errors
/// The code to exit with.
pub fn parse_args<C: Parser>(args: impl IntoIterator<Item = impl Into<OsString> + Clone>) -> Result<C, ExitCode> {
    let mut command = with_negative_numbers(C::command());
    let given = command.try_get_matches_from_mut(args);
    let mut given = given.map_err(|error| refuse(&wrong_value::in_words(error, &command)))?;
    C::from_arg_matches_mut(&mut given).map_err(|error| refuse(&error.format(&mut command)))
}

/// The same, but a number below zero is a value, and is judged as one: clap would take it for a
/// flag, and advise to write `-- -1`.
fn with_negative_numbers(command: clap::Command) -> clap::Command {
    let command = command.mut_args(|arg| {
        let takes_more = arg.is_allow_hyphen_values_set() || arg.is_allow_negative_numbers_set();
        if !takes_more && arg.get_action().takes_values() { arg.allow_negative_numbers(true) } else { arg }
    });
    command.mut_subcommands(with_negative_numbers)
}

/// Prints what clap says, and returns the code to exit with.
#[must_use]
pub fn refuse(error: &clap::Error) -> ExitCode {
    let printed = error.print();
    if !error.use_stderr() {
        crate::output::written(printed);
    }
    let of_file = error.source().and_then(|source| source.downcast_ref::<OutputFileError>());
    match (error.use_stderr(), of_file.is_none_or(OutputFileError::is_input)) {
        (false, _) => ExitCode::SUCCESS,
        (true, true) => ExitCode::from(2),
        (true, false) => ExitCode::FAILURE,
    }
}

/// Says that a command is needed, and which there are; returns the code to exit with.
#[must_use]
pub fn missing_command<C: CommandFactory>() -> ExitCode {
    let mut command = C::command();
    let names: Vec<_> = command.get_subcommands().map(|command| command.get_name().to_owned()).collect();
    refuse(&command.error(ErrorKind::MissingSubcommand, format!("a command is needed: {}", names.join(", "))))
}

/// The configuration file.
#[derive(Clone, Debug, Default, Args)]
pub struct ConfigArgs {
    /// Read this configuration file (TOML). Flags go before it; --print-config shows all of its
    /// keys.
    #[arg(long, global = true, help_heading = "The configuration file", value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Print the configuration with the documentation of every key, and end. With --config: as that
    /// file has it.
    #[arg(long, global = true, help_heading = "The configuration file")]
    pub print_config: bool,
}

impl ConfigArgs {
    /// The file over `defaults`, if there is one.
    ///
    /// # Errors
    /// [`ConfigError`].
    pub fn over<T: Configuration>(&self, defaults: T) -> Result<T, ConfigError> {
        match &self.config {
            Some(file) => load_over(&defaults, file),
            None => Ok(defaults),
        }
    }

    /// What `program` is to run with: `read`. With `--print-config` that is printed, and the
    /// program has nothing else to do.
    ///
    /// # Errors
    /// The code to exit with: 0 when it was printed; 2 when it is wrong, which was said.
    pub fn settle<T: Configuration>(&self, program: &str, read: Result<T, ConfigError>) -> Result<T, ExitCode> {
        let wrong = |error: &dyn std::fmt::Display| {
            crate::tell_line!("{program}: {error}");
            ExitCode::from(2)
        };
        let config = read.map_err(|error| wrong(&error))?;
        if self.print_config {
            crate::print_line!("{}", print(&config).map_err(|error| wrong(&error))?.trim_end());
            return Err(ExitCode::SUCCESS);
        }
        Ok(config)
    }
}

/// How a server is reached.
#[derive(Clone, Debug, Default, Args)]
pub struct ConnectArgs {
    /// Where the map server (or a Zenoh router) listens (repeatable) [default: tcp/127.0.0.1:7447,
    /// unless --zenoh-config is given].
    #[arg(long, help_heading = "The way to the server", value_name = "ENDPOINT")]
    pub connect: Vec<String>,
    /// A Zenoh configuration file (JSON5): endpoints, TLS, credentials. --connect goes before what
    /// it says.
    #[arg(long, help_heading = "The way to the server", value_name = "FILE")]
    pub zenoh_config: Option<PathBuf>,
    /// Wait so long, from the start on, for the server, and for the map and the place that it is
    /// asked for; 'inf' is for ever. What is waited for is said every five seconds [default: a
    /// robot that maps or drives waits for ever to be connected, and everything else 10 seconds for
    /// the server; what the server does not have is not waited for].
    #[arg(long, help_heading = "The way to the server", value_name = "SECONDS", value_parser = wait)]
    pub wait: Option<f64>,
}

impl ConnectArgs {
    /// These flags over what the configuration file says. `--connect` keeps the file's
    /// `zenoh_config`, which may hold credentials; `--zenoh-config` alone brings endpoints of its
    /// own.
    #[must_use]
    pub fn over(&self, file: &SessionConfig) -> SessionConfig {
        let Self { connect, zenoh_config, .. } = self.clone();
        match (connect.is_empty(), zenoh_config) {
            (true, None) => file.clone(),
            (true, given) => SessionConfig { connect, zenoh_config: given },
            (false, given) => SessionConfig { connect, zenoh_config: given.or_else(|| file.zenoh_config.clone()) },
        }
    }
}

/// Where the figures of a run go.
#[derive(Clone, Debug, Default, Args)]
pub struct ReportArgs {
    /// Write the figures to this file as JSON.
    #[arg(long, value_name = "FILE", value_parser = output_file)]
    pub report: Option<PathBuf>,
    /// Print the figures as JSON.
    #[arg(long)]
    pub json: bool,
}

impl ReportArgs {
    /// Prints `report`, as JSON or as `in_words` does, and writes it to the file that was asked
    /// for.
    ///
    /// # Errors
    /// What to tell the user, who has seen the report.
    pub fn give<T: Serialize>(&self, report: &T, in_words: impl FnOnce(&T)) -> Result<(), String> {
        let json = serde_json::to_string_pretty(report).map_err(|error| error.to_string())?;
        if self.json {
            crate::print_line!("{json}");
        } else {
            in_words(report);
        }
        let Some(file) = &self.report else { return Ok(()) };
        crate::write_output(file, json.as_bytes())
            .map_err(|error| format!("{} cannot be written: {error}", file.display()))
    }
}

/// Completions for a shell.
#[derive(Clone, Debug, Args)]
#[command(after_help = COMPLETIONS)]
pub struct CompletionsArgs {
    /// The shell.
    shell: clap_complete::Shell,
}

/// All programs have this subcommand; the examples are those of one.
const COMPLETIONS: &str = "\
Examples:
  map-server completions bash > /etc/bash_completion.d/map-server
  mapper completions zsh > ~/.zfunc/_mapper
  client-robot completions fish > ~/.config/fish/completions/client-robot.fish
  handoff completions bash";

impl CompletionsArgs {
    /// Prints the completions of a program.
    pub fn print<C: CommandFactory>(&self) {
        let mut command = C::command();
        let name = command.get_name().to_owned();
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut command, name, &mut script);
        crate::print_line!("{}", String::from_utf8_lossy(&script).trim_end());
    }
}

/// What servers and planners say to who asks by keys and parameters, for who has commands and
/// flags.
#[must_use]
pub fn with_flags(message: &str) -> String {
    let message = message.replace("to_nearest=true", "--to-nearest");
    let with_command = || {
        let (before, after) = message.split_once("/fleet answers which robots there are")?;
        let (before, map) = before.rsplit_once("fht/")?;
        Some(format!("{before}map-server robots {map} says which robots there are{after}"))
    };
    with_command().unwrap_or(message)
}

/// `text` as how many: a whole number of at least 1.
///
/// # Errors
/// A sentence that says what is wrong.
pub fn count(text: &str) -> Result<u64, String> {
    match text.parse::<u64>() {
        Ok(0) => Err("it must be at least 1".to_owned()),
        Ok(count) => Ok(count),
        Err(error) => Err(wrong_value::no_whole_number(text, &error)),
    }
}

/// The same for what is counted in memory.
///
/// # Errors
/// As [`count`].
pub fn how_many(text: &str) -> Result<usize, String> {
    usize::try_from(count(text)?).map_err(|_| format!("'{text}' is too large"))
}

/// Where a program listens that takes no Zenoh endpoint: `ADDRESS:PORT`.
///
/// # Errors
/// A sentence with an example.
pub fn socket_address(text: &str) -> Result<SocketAddr, String> {
    let example = || {
        let port = text.rsplit(':').next().and_then(|port| port.parse::<u16>().ok()).unwrap_or(8080);
        format!("'{text}' is no IP address with a port, such as 127.0.0.1:{port} or [::1]:{port}")
    };
    text.parse().map_err(|_| example())
}

/// `text` as a number within `range`.
///
/// # Errors
/// A sentence that names the range.
pub fn number(text: &str, range: RangeInclusive<f64>) -> Result<f64, String> {
    let value = text.parse::<f64>().ok().filter(|value| range.contains(value));
    value.ok_or_else(|| format!("'{text}' is not a number from {} to {}", range.start(), range.end()))
}

/// `text` as seconds to wait: from 0 to 10⁷, or `inf`.
///
/// # Errors
/// A sentence that names both.
pub fn wait(text: &str) -> Result<f64, String> {
    if text == "inf" { Ok(f64::INFINITY) } else { seconds(text).map_err(|error| format!("{error}, nor inf")) }
}

/// `text` as seconds, from 0 to 10⁷.
///
/// # Errors
/// As [`number`].
pub fn seconds(text: &str) -> Result<f64, String> {
    number(text, 0.0..=1e7)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn over(connect: &[&str], zenoh_config: Option<&str>) -> (Vec<String>, Option<PathBuf>) {
        let file = SessionConfig { connect: vec!["tcp/file:1".to_owned()], zenoh_config: Some("file.json5".into()) };
        let connect = connect.iter().map(ToString::to_string).collect();
        let SessionConfig { connect, zenoh_config } =
            ConnectArgs { connect, zenoh_config: zenoh_config.map(Into::into), wait: None }.over(&file);
        (connect, zenoh_config)
    }

    #[test]
    fn flags_go_before_the_file() {
        let (endpoint, credentials) = (vec!["tcp/file:1".to_owned()], Some(PathBuf::from("file.json5")));
        assert_eq!(over(&[], None), (endpoint, credentials.clone()));
        assert_eq!(over(&["tcp/flag:1"], None), (vec!["tcp/flag:1".to_owned()], credentials));
        assert_eq!(over(&[], Some("flag.json5")), (Vec::new(), Some("flag.json5".into())));
    }

    #[test]
    fn a_number_below_zero_is_judged_as_a_value() {
        #[derive(Debug, Parser)]
        struct Lamp {
            #[arg(long, value_parser = wait)]
            wait: Option<f64>,
        }
        let command = with_negative_numbers(Lamp::command());
        let said = command.try_get_matches_from(["lamp", "--wait", "-1"]).map_err(|error| error.to_string());
        assert!(said.as_ref().is_err_and(|said| said.contains("'-1' is not a number from 0")), "{said:?}");
    }

    #[test]
    fn who_has_flags_is_told_of_flags() {
        let said = with_flags("2.10 m from the goal: to_nearest=true asks for the path there");
        assert_eq!(said, "2.10 m from the goal: --to-nearest asks for the path there");
        let said = with_flags("fht/hall/robots/t/goal: nobody; fht/hall/fleet answers which robots there are");
        assert_eq!(said, "fht/hall/robots/t/goal: nobody; map-server robots hall says which robots there are");
    }

    #[test]
    fn a_count_is_at_least_one() {
        assert_eq!((count("1"), count("0")), (Ok(1), Err("it must be at least 1".to_owned())));
        assert_eq!(count("many"), Err("'many' is no whole number".to_owned()));
        assert_eq!((how_many("2"), how_many("0").is_err(), how_many("-1").is_err()), (Ok(2), true, true));
    }

    #[test]
    fn numbers_that_make_no_sense_are_refused() {
        assert_eq!((wait("inf"), wait("2"), wait("-1").is_err()), (Ok(f64::INFINITY), Ok(2.0), true));
        assert_eq!(seconds("1.5"), Ok(1.5));
        for text in ["nan", "inf", "-1", "1e300", "soon"] {
            assert_eq!(seconds(text), Err(format!("'{text}' is not a number from 0 to 10000000")));
        }
    }
}
