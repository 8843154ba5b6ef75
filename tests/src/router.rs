//! A Zenoh router with the storage manager linked in: what zenohd with its plugin is to a site, as
//! a process that tests can kill.

use clap::Parser;
use fht_program::stop::end_with_parent;
use std::ffi::OsString;
use std::path::PathBuf;
use std::process::ExitCode;
use zenoh::config::Config;
use zenoh::internal::plugins::PluginsManager;
use zenoh::internal::runtime::RuntimeBuilder;
use zenoh_plugin_storage_manager::StoragesPlugin;

/// The router's name among the programs.
pub const NAME: &str = "router";
/// zenohd's name for the plugin.
const PLUGIN: &str = "storage_manager";

/// A Zenoh router with storages. The options are those of zenohd.
#[derive(Debug, Parser)]
struct Cli {
    /// The configuration (JSON5).
    #[arg(short, long, value_name = "FILE")]
    config: PathBuf,
    /// Listen here instead of where the configuration says (repeatable).
    #[arg(short, long, value_name = "ENDPOINT")]
    listen: Vec<String>,
    /// Connect to these routers as well (repeatable).
    #[arg(short = 'e', long, value_name = "ENDPOINT")]
    connect: Vec<String>,
}

fn config(cli: &Cli) -> Result<Config, zenoh::Error> {
    let mut config = Config::from_file(&cli.config)?;
    for (key, endpoints) in [("listen/endpoints", &cli.listen), ("connect/endpoints", &cli.connect)] {
        if !endpoints.is_empty() {
            config.insert_json5(key, &serde_json::to_string(endpoints)?)?;
        }
    }
    Ok(config)
}

/// Runs until it is killed.
async fn run(config: Config) -> Result<(), zenoh::Error> {
    let mut plugins = PluginsManager::static_plugins_only();
    if config.get_json("plugins")?.contains(PLUGIN) {
        plugins.declare_static_plugin::<StoragesPlugin, &str>(PLUGIN, true);
    }
    let mut runtime = RuntimeBuilder::new(config).plugins_manager(plugins).build().await?;
    let _session = zenoh::session::init(runtime.clone().into()).await?;
    runtime.start().await?;
    std::future::pending().await
}

/// Runs the program with the given arguments, the program's name first.
pub fn main_with_args(args: Vec<OsString>) -> ExitCode {
    let cli = Cli::parse_from(args);
    if let Err(error) = end_with_parent(NAME) {
        eprintln!("router: {error}");
        return ExitCode::FAILURE;
    }
    fht_program::logging::init("error");
    // As zenohd, which is built to.
    fht_program::zenoh_threads::end_with_panics();
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build();
    let outcome = config(&cli).and_then(|config| runtime?.block_on(run(config)));
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("router: {}", fht_session::in_words(&error));
            ExitCode::FAILURE
        }
    }
}
