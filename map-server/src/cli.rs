//! The command line.

use crate::access::command::AccessArgs;
use crate::config::{AnswerConfig, Limits, LinkConfig, ServerConfig};
use crate::{ServerError, denials, run};
use clap::{Parser, Subcommand};
use std::ffi::OsString;
use std::path::PathBuf;
use std::process::ExitCode;
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;
use tracing_subscriber::{EnvFilter, Layer};

/// Where a server listens that was told nothing.
const DEFAULT_LISTEN: &str = "tcp/127.0.0.1:7447";

/// Keeps the maps of explorer robots and answers questions about them over Zenoh.
///
/// Explorers put increments; each is acknowledged once it is on the disk. Robots and people ask for maps, paths and nodes.
#[derive(Debug, Parser)]
#[command(name = "map-server", version, after_long_help = EXAMPLES, args_conflicts_with_subcommands = true)]
struct Args {
    #[command(subcommand)]
    command: Option<Command>,
    /// Directory that keeps the maps; made if absent. One server at a time.
    #[arg(long, value_name = "DIR", default_value = "fht-data")]
    data: PathBuf,
    /// Listen here for robots and tools (repeatable) [default: tcp/127.0.0.1:7447, unless --connect or --zenoh-config
    /// is given].
    ///
    /// The server then is a Zenoh router: whoever connects sees everyone else. Use tcp/0.0.0.0:7447 to be reached from
    /// other machines.
    #[arg(long, value_name = "ENDPOINT")]
    listen: Vec<String>,
    /// Connect to a Zenoh router, such as zenohd (repeatable). Without --listen the server is its client.
    #[arg(long, value_name = "ENDPOINT")]
    connect: Vec<String>,
    /// A Zenoh configuration file (JSON5): endpoints, TLS, access control. --listen and --connect go before what it says.
    #[arg(long, value_name = "FILE")]
    zenoh_config: Option<PathBuf>,
    /// Say more: once for what is stored, twice for everything. RUST_LOG is obeyed, too.
    #[arg(short, long, action = clap::ArgAction::Count)]
    verbose: u8,
}

#[derive(Debug, Subcommand)]
enum Command {
    AccessControl(AccessArgs),
}

const EXAMPLES: &str = "\
Examples:
  map-server --data maps
      keeps maps in ./maps and listens on this machine only

  pip install zenoh-cli
  zenoh --connect tcp/127.0.0.1:7447 get -s 'fht/maps' --decoder json
  zenoh --connect tcp/127.0.0.1:7447 get -s 'fht/museum/path?from=0,0;to=5,3' --decoder json
  zenoh --connect tcp/127.0.0.1:7447 get -s 'fht/museum/nodes?near=0,0;radius=3' --decoder json
      ask a running server

Topics of a map: head, path?from=X,Y;to=X,Y, nodes?near=X,Y;radius=R, since?vector=V, snapshot?version=N, match";

impl Args {
    fn config(&self) -> ServerConfig {
        let mut listen = self.listen.clone();
        if listen.is_empty() && self.connect.is_empty() && self.zenoh_config.is_none() {
            listen.push(DEFAULT_LISTEN.to_owned());
        }
        let link = LinkConfig { listen, connect: self.connect.clone(), zenoh_config: self.zenoh_config.clone() };
        ServerConfig { data: self.data.clone(), link, limits: Limits::default(), answers: AnswerConfig::default() }
    }
}

fn log(verbose: u8) {
    let default = match verbose {
        0 => "warn,zenoh=error",
        1 => "warn,map_server=info,zenoh=error",
        _ => "info,map_server=debug",
    };
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(default));
    // Fails only if the program that calls this has set up its own.
    let lines = tracing_subscriber::fmt::layer().with_writer(std::io::stderr).with_filter(filter);
    let _ = tracing_subscriber::registry().with(lines).with(denials::layer()).try_init();
}

async fn until_told() {
    #[cfg(unix)]
    {
        use tokio::signal::unix::{SignalKind, signal};
        if let Ok(mut terminate) = signal(SignalKind::terminate()) {
            tokio::select! {
                _ = terminate.recv() => {}
                _ = tokio::signal::ctrl_c() => {}
            }
            return;
        }
    }
    let _ = tokio::signal::ctrl_c().await;
}

fn serve(args: &Args) -> Result<(), ServerError> {
    let config = args.config();
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(1)
        .max_blocking_threads(config.answers.threads.max(1))
        .enable_all()
        .build()
        .map_err(ServerError::Runtime)?;
    runtime.block_on(run(config, until_told()))
}

/// Runs the program with the given arguments, the program's name first.
pub fn main_with_args<I, T>(args: I) -> ExitCode
where
    I: IntoIterator<Item = T>,
    T: Into<OsString> + Clone,
{
    let args = match Args::try_parse_from(args) {
        Ok(args) => args,
        Err(error) => {
            let code = if error.use_stderr() { ExitCode::from(2) } else { ExitCode::SUCCESS };
            let _ = error.print();
            return code;
        }
    };
    log(args.verbose);
    let outcome = match &args.command {
        Some(Command::AccessControl(access)) => {
            access.run().map(|text| print!("{text}")).map_err(|error| error.to_string())
        }
        None => serve(&args).map_err(|error| error.to_string()),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("map-server: {error}");
            ExitCode::FAILURE
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn link(args: &[&str]) -> LinkConfig {
        Args::try_parse_from(["map-server"].iter().chain(args)).unwrap().config().link
    }

    #[test]
    fn a_server_that_was_told_where_does_not_listen_elsewhere() {
        assert_eq!(link(&[]).listen, [DEFAULT_LISTEN]);
        assert!(link(&["--connect", "tcp/router:7447"]).listen.is_empty());
        assert!(link(&["--zenoh-config", "zenoh.json5"]).listen.is_empty());
        assert_eq!(link(&["--zenoh-config", "zenoh.json5", "--listen", "tcp/[::]:1"]).listen, ["tcp/[::]:1"]);
    }
}
