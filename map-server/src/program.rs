//! The command line.
//!
//! | module | idea |
//! | --- | --- |
//! | `allocator` | where the memory of a program that serves comes from |
//! | `serve_arguments` | the flags for serving |
//! | `web_arguments` | … the operators' page |
//! | `warning_layer` | … of which the log's warnings are shown there |
//! | `trace_export` | traces of queries, sent to a collector |
//! | `settings` | what the program reads from the configuration file |
//! | `role_reload` | the list of roles, read anew while the server serves |
//! | `repair` | what can be done with a damaged store |
//! | `operator` | what operators do, talking to a running server |

mod allocator;
mod operator;
mod repair;
mod role_reload;
mod serve_arguments;
mod settings;
#[cfg(feature = "otel")]
mod trace_export;
#[cfg(feature = "web")]
mod warning_layer;
#[cfg(feature = "web")]
mod web_arguments;

use self::operator::{Operation, OperatorArgs, OperatorError};
use self::repair::Repair;
use self::role_reload::RoleReload;
use self::serve_arguments::ServeArgs;
use self::settings::{ServerFile, ServerSection};
#[cfg(feature = "web")]
use self::web_arguments::WebSection;
use crate::access::{AccessArgs, AccessCommandError, SiteArgs, denials_layer, door_layer};
use crate::config::{DEFAULT_LISTEN, QuorumConfig, ServerConfig, ServerEndpoints};
use crate::server::{ServerError, run_beside};
use clap::error::ErrorKind;
use clap::{CommandFactory, Parser};
#[cfg(feature = "web")]
use fht_map::WriterRole;
use fht_merge::MergeConfig;
use fht_program::flags::{CompletionsArgs, ConfigArgs, ConnectArgs, parse_args, refuse};
use fht_program::{ProgramFailure, Stop, Waiting, logging, print_line};
#[cfg(feature = "web")]
use fht_proto::AuthorId;
use fht_session::SessionConfig;
use std::ffi::OsString;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;

/// Keeps the maps of explorer robots and answers questions about them over Zenoh.
///
/// Explorers put increments; each is acknowledged once it is on the disk. Robots and people ask for
/// maps, paths and nodes.
#[derive(Debug, Parser)]
#[command(name = "map-server", version, max_term_width = 100, after_long_help = EXAMPLES)]
struct Cli {
    #[command(flatten)]
    config: ConfigArgs,
    #[command(flatten)]
    serve: ServeArgs,
    #[command(flatten)]
    link: LinkArgs,
    #[command(flatten)]
    operator: OperatorArgs,
    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(Debug, clap::Subcommand)]
enum Command {
    #[command(flatten)]
    Operate(Operation),
    AccessControl(AccessArgs),
    CheckSite(SiteArgs),
    #[command(flatten)]
    Repair(Repair),
    /// Writes completions for a shell to standard output.
    Completions(CompletionsArgs),
}

#[derive(Debug, clap::Args)]
struct LinkArgs {
    /// Connect to a Zenoh router, such as zenohd (repeatable). A server without --listen is its
    /// client; operators' commands go to tcp/127.0.0.1:7447 if nothing else is said.
    #[arg(long, global = true, help_heading = "The way to the server", value_name = "ENDPOINT")]
    connect: Vec<String>,
    /// A Zenoh configuration file (JSON5): endpoints, TLS, access control. --listen and --connect
    /// go before what it says. That of a server or router listens; operators' commands take one
    /// that only connects.
    #[arg(long, global = true, help_heading = "The way to the server", value_name = "FILE")]
    zenoh_config: Option<PathBuf>,
}

const EXAMPLES: &str = "\
Examples:
  map-server --data maps
      keeps maps in ./maps and listens on this machine only

  map-server --data maps --listen 0.0.0.0:7447 --roles roles.json5
      reached from other machines; who may write what is in the list of roles

  map-server --storages 3 --connect router-a:7447 --connect router-b:7447 --connect router-c:7447
      one of several servers of a site: the maps are kept by its routers

  pip install zenoh-cli
  zenoh --connect tcp/127.0.0.1:7447 get -s 'fht/maps' --decoder json
  zenoh --connect tcp/127.0.0.1:7447 get -s 'fht/museum/path?from=0,0;to=5,3' --decoder json
  zenoh --connect tcp/127.0.0.1:7447 get -s 'fht/museum/nodes?near=0,0;radius=3' --decoder json
      ask a running server

  map-server release create museum        a name for the state as it is now
  map-server release enable museum 2026-11-21.1
  map-server place museum dock 1.5,-2,90
  map-server zone museum wet-floor '1,1 3,1 3,2 1,2'
  map-server merge museum museum-2 --dry-run
  map-server robots museum --watch
      operate it, from any machine that reaches it (--connect)

Topics of a map: head, path?from=X,Y;to=NAME, nodes?near=X,Y;radius=R, since?vector=V,
snapshot?version=N, match, releases, diff?from=A;to=B, rules, fleet, journal

Exit code 0: done; 1: it failed; 2: wrong usage or bad input; 130, 143 or 129: it was interrupted.";

impl Cli {
    /// The flags over what the file says.
    ///
    /// # Errors
    /// [`AccessCommandError`]: the list of roles cannot be read.
    fn server(&self, file: ServerSection) -> Result<(ServerConfig, Option<RoleReload>), AccessCommandError> {
        let link = self.endpoints(&file);
        // A directory that was asked for goes before storages that the file names.
        let storages = self.serve.storages.or(file.storages.filter(|_| self.serve.data.is_none()));
        let confirm = self.serve.confirm.or(file.confirm);
        let quorum = |storages: u8| {
            let majority = QuorumConfig::majority(usize::from(storages));
            let confirm = confirm.map_or(majority.confirm, usize::from).min(majority.storages);
            QuorumConfig { confirm, ..majority }
        };
        // Other commands than serving need no roles.
        let roles = self.serve.roles.as_ref().or(file.roles.as_ref()).filter(|_| self.command.is_none());
        let (writers, reload) = roles.map(|file| RoleReload::of(file, &link)).transpose()?.unzip();
        let config = ServerConfig {
            data: self.serve.data.clone().unwrap_or(file.data),
            storages: storages.map(quorum),
            link,
            min_free_bytes: file.min_free_bytes,
            limits: self.serve.limits.over(file.limits),
            writers,
            quotas: file.quotas,
            open: self.serve.open || file.open,
            answers: file.answers,
            reports: file.reports,
            fleet: file.fleet,
            gaps: file.gaps,
            #[cfg(feature = "web")]
            web: None,
        };
        Ok((config, reload))
    }

    /// A Zenoh configuration file that was asked for brings endpoints of its own, in place of those
    /// that the file names.
    fn endpoints(&self, file: &ServerSection) -> ServerEndpoints {
        let LinkArgs { connect, zenoh_config } = &self.link;
        let or_file = |given: &[String], file: &[String]| {
            let file = if zenoh_config.is_none() { file } else { &[] };
            if given.is_empty() { file.to_vec() } else { given.to_vec() }
        };
        let mut listen = or_file(&self.serve.listen, &file.listen);
        let connect = or_file(connect, &file.connect);
        let zenoh_config = zenoh_config.clone().or_else(|| file.zenoh_config.clone());
        if listen.is_empty() && connect.is_empty() && zenoh_config.is_none() {
            listen.push(DEFAULT_LISTEN.to_owned());
        }
        // A server waits for its routers for ever, unless it is told otherwise.
        let patience = Waiting::new("map-server", self.operator.wait(), None).for_session();
        ServerEndpoints { listen, connect, zenoh_config, patience }
    }
}

#[cfg(feature = "web")]
impl Cli {
    /// The configuration with the page that flags and file ask for. Other commands than serving
    /// need none.
    fn with_page(&self, config: ServerConfig, file: WebSection) -> Result<ServerConfig, clap::Error> {
        let page = self.serve.web.over(file);
        let wrong = |text: String| Self::command().error(ErrorKind::ArgumentConflict, text);
        let page = page.map_err(wrong)?;
        let operator = page.as_ref().and_then(|page| page.operator.as_ref());
        if let Some((name, roles)) = operator.zip(config.writers.as_ref()) {
            let role = roles.now().role(AuthorId::of_robot(name.as_str()));
            if role != Some(WriterRole::Operator) {
                // The list goes before the name, and may be another one when it is read anew.
                tracing::warn!("--web-operator {name}: the list of roles has no operator of this name: it only looks");
            }
        }
        Ok(ServerConfig { web: page.filter(|_| self.command.is_none()), ..config })
    }
}

impl Cli {
    /// What clap cannot tell: what does not go together, of the flags and of the file with them.
    fn check(&self, config: &ServerConfig) -> Result<(), clap::Error> {
        let wrong = |text: &str| Err(Self::command().error(ErrorKind::ArgumentConflict, text));
        if self.command.is_some() {
            return if self.serve.is_for_serving() {
                wrong(
                    "--data, --storages, --confirm, --listen, --roles, --open and limits are for serving: leave them out, \
                     or the command",
                )
            } else {
                Ok(())
            };
        }
        match (&config.storages, &self.serve.confirm) {
            (None, Some(_)) => wrong("--confirm goes with --storages: a disk of one's own needs no others"),
            (Some(quorum), Some(confirm)) if usize::from(*confirm) > quorum.storages => {
                wrong(&format!("--confirm {confirm}: there are {} storages", quorum.storages))
            }
            (Some(_), _) if config.link.connect.is_empty() && config.link.zenoh_config.is_none() => {
                wrong("storages are elsewhere: --connect or --zenoh-config says in which routers")
            }
            _ => Ok(()),
        }
    }
}

fn log(verbose: u8) {
    let default = match verbose {
        0 => "warn,zenoh=error",
        1 => "warn,map_server=info,zenoh=error",
        _ => "info,map_server=debug",
    };
    // Fails only if the calling program has set up its own.
    let lines = tracing_subscriber::registry().with(logging::lines(default));
    let lines = lines.with(denials_layer()).with(door_layer());
    #[cfg(feature = "web")]
    let lines = lines.with(self::warning_layer::warning_layer());
    let _ = lines.try_init();
}

/// Runs a server on threads of its own until it is told to end (SIGTERM, Ctrl-C); `beside` as for
/// [`run_beside`].
///
/// # Errors
/// [`ServerError`].
pub fn serve_until_signal<T>(
    config: ServerConfig,
    beside: impl Fn(&zenoh::Session) -> Result<T, zenoh::Error>,
) -> Result<(), ServerError> {
    serve(config, None, beside)
}

/// The same, with a list of roles that may be read anew.
fn serve<T>(
    config: ServerConfig,
    reload: Option<RoleReload>,
    beside: impl Fn(&zenoh::Session) -> Result<T, zenoh::Error>,
) -> Result<(), ServerError> {
    let stop = Stop::on_signal_of_server("map-server").map_err(ServerError::Runtime)?;
    stop.doing("starting");
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(1)
        .max_blocking_threads(config.answers.all_threads())
        .enable_all()
        .build()
        .map_err(ServerError::Runtime)?;
    let _limit = {
        let _entered = runtime.enter();
        spare_at_file_limit().map_err(ServerError::Runtime)?
    };
    #[cfg(feature = "otel")]
    let traces = self::trace_export::TraceExport::start(runtime.handle());
    let mut order = None;
    // Waited for once it serves: until then there is nothing to put in order.
    let shutdown = async {
        order = Some(stop.in_order());
        tokio::spawn(async move {
            let followed = role_reload::follow(reload).await;
            followed.unwrap_or_else(|error| tracing::warn!("SIGHUP does not read the roles anew: {error}"));
        });
        stop.requested().await;
    };
    let outcome = runtime.block_on(run_beside(config, shutdown, beside));
    #[cfg(feature = "otel")]
    drop(traces);
    // Nobody waits for an answer that is still computed.
    runtime.shutdown_timeout(LAST_ANSWERS);
    drop(order);
    outcome
}

/// A file that may not get longer is an error like any other, and no reason to be ended: for as
/// long as this is kept.
#[cfg(target_os = "linux")]
fn spare_at_file_limit() -> std::io::Result<tokio::signal::unix::Signal> {
    /// SIGXFSZ.
    const FILE_LIMIT: i32 = 25;
    tokio::signal::unix::signal(tokio::signal::unix::SignalKind::from_raw(FILE_LIMIT))
}

/// Elsewhere the system does as it likes.
#[cfg(not(target_os = "linux"))]
fn spare_at_file_limit() -> std::io::Result<()> {
    Ok(())
}

/// How long computing answers may go on after a server was told to end.
const LAST_ANSWERS: Duration = Duration::from_millis(300);

/// Zenoh has its own threads but wants to be opened from a multi-threaded runtime.
fn operate(
    operation: Operation,
    args: &OperatorArgs,
    link: SessionConfig,
    merge: MergeConfig,
) -> Result<(), OperatorError> {
    let runtime = fht_program::runtime(1).map_err(OperatorError::Runtime)?;
    let stop = Stop::on_signal("map-server").map_err(OperatorError::Runtime)?;
    let may_be_done = if operation.changes() { "; what it was told may be done" } else { "" };
    let places = link.places();
    stop.doing(format!("waiting for a map-server at {places} to answer"));
    let once_there = || stop.doing(format!("talking to the server at {places}{may_be_done}"));
    let link = ServerEndpoints { connect: link.connect, zenoh_config: link.zenoh_config, ..ServerEndpoints::default() };
    let usual = if matches!(operation, Operation::Health) { Duration::from_secs(1) } else { Waiting::USUAL };
    let waiting = Waiting::new("map-server", args.wait(), Some(usual));
    let outcome = runtime.block_on(operation.carry_out(args, link, &waiting, merge, once_there));
    runtime.shutdown_background(); // an attempt to connect may hang
    outcome
}

/// The command line, for whoever documents it.
#[must_use]
pub fn command() -> clap::Command {
    Cli::command()
}

/// Runs the program with the given arguments, the program's name first.
pub fn main_with_args(args: Vec<OsString>) -> ExitCode {
    let cli: Cli = match parse_args(args) {
        Ok(cli) => cli,
        Err(code) => return code,
    };
    log(cli.serve.verbose);
    let file = match cli.config.settle("map-server", cli.config.over(ServerFile::default())) {
        Ok(file) => file,
        Err(code) => return code,
    };
    #[cfg(feature = "web")]
    let page = file.server.web.clone();
    let (config, reload) = match cli.server(file.server) {
        Ok(server) => server,
        Err(error) => return ProgramFailure::of_input(error).tell("map-server"),
    };
    #[cfg(feature = "web")]
    let config = match cli.with_page(config, page) {
        Ok(config) => config,
        Err(error) => return refuse(&error),
    };
    if let Err(error) = cli.check(&config) {
        return refuse(&error);
    }
    let link = ConnectArgs { connect: cli.link.connect, zenoh_config: cli.link.zenoh_config, wait: None };
    let link = link.over(&file.connect);
    let outcome = match cli.command {
        None => {
            fht_program::zenoh_threads::end_with_panics();
            serve(config, reload, |_| Ok(())).map_err(|error| {
                let is_input = error.is_input();
                ProgramFailure::of(is_input, error)
            })
        }
        Some(Command::Operate(operation)) => operate(operation, &cli.operator, link, file.merge)
            .map_err(|error| ProgramFailure::of(error.is_input(), error)),
        Some(Command::Completions(shell)) => {
            shell.print::<Cli>();
            Ok(())
        }
        Some(Command::AccessControl(access)) => {
            access.run().map(|text| print_line!("{}", text.trim_end())).map_err(ProgramFailure::of_input)
        }
        Some(Command::CheckSite(site)) => site.run().map_err(|error| ProgramFailure::of(error.is_input(), error)),
        Some(Command::Repair(repair)) => repair.run(&config.data, cli.operator.json()),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => failure.tell("map-server"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn server(file: &str, args: &[&str]) -> ServerConfig {
        let file: ServerFile = fht_program::parse(file, std::path::Path::new("robot.toml")).unwrap();
        Cli::try_parse_from(["map-server"].iter().chain(args)).unwrap().server(file.server).unwrap().0
    }

    fn link(args: &[&str]) -> ServerEndpoints {
        server("", args).link
    }

    #[test]
    fn a_server_that_was_told_where_does_not_listen_elsewhere() {
        assert_eq!(link(&[]).listen, [DEFAULT_LISTEN]);
        assert!(link(&["--connect", "tcp/router:7447"]).listen.is_empty());
        assert!(link(&["--zenoh-config", "zenoh.json5"]).listen.is_empty());
        assert_eq!(link(&["--zenoh-config", "zenoh.json5", "--listen", "tcp/[::]:1"]).listen, ["tcp/[::]:1"]);
    }

    #[test]
    fn flags_go_before_the_file_and_the_file_before_the_defaults() {
        let file = "[server]
            data = 'kept'
            listen = ['tcp/file:1']
            limits.max_map_elements = 3_000_000
            answers.threads = 2";
        let of_file = server(file, &[]);
        assert_eq!((of_file.data.to_str(), of_file.answers.threads), (Some("kept"), 2));
        assert_eq!(of_file.link.listen, ["tcp/file:1"]);
        // As many in all maps as one may have.
        assert_eq!((of_file.limits.max_map_elements, of_file.limits.max_total_elements), (3_000_000, 3_000_000));
        let of_flags = server(file, &["--data", "d", "--listen", "tcp/flag:1", "--max-map-elements", "7"]);
        assert_eq!((of_flags.data.to_str(), of_flags.limits.max_map_elements), (Some("d"), 7));
        assert_eq!(of_flags.link.listen, ["tcp/flag:1"]);
        assert!(server(file, &["--zenoh-config", "z.json5"]).link.listen.is_empty());
        let storages = "server.storages = 5";
        assert_eq!(server(storages, &[]).storages, Some(QuorumConfig { storages: 5, confirm: 3 }));
        assert_eq!(server(storages, &["--storages", "3"]).storages, Some(QuorumConfig::majority(3)));
        assert_eq!(server(storages, &["--data", "d"]).storages, None);
    }
}
