//! What the programs share, so that each of it is written once.
//!
//! | module | feature | idea |
//! | --- | --- | --- |
//! | `config` | `config` | one documented file: read over the defaults, checked, printed |
//! | `sections` | `cli` | sections of that file that several programs read |
//! | `flags` | `cli` | flags that several programs have, and what a wrong one ends in |
//! | `logging` | `cli` | logs on standard error |
//! | [`print_line!`] | – | lines for readers that may stop reading |
//! | [`tell_line!`] | – | lines for people, where standard error may be full |
//! | [`write_output`] | – | files that are whole or not there |
//! | [`exit_code`] | – | a program whose output is lost has failed |
//! | [`ProgramFailure`] | – | how a program ends that does not what it was told |
//! | [`Waiting`] | – | how long a server, a map or a place is waited for |
//! | [`Stop`] | – | ending soon when asked to, with files in order |
//! | [`zenoh_threads`] | – | one thread for Zenoh's links in a program that speaks TLS; what a panic there ends |
//!
//! A configuration is an ordinary structure:
//!
//! ```
//! # #[cfg(feature = "config")] {
//! use schemars::JsonSchema;
//! use serde::{Deserialize, Serialize};
//!
//! /// How the lamp shines.
//! #[derive(Serialize, Deserialize, JsonSchema)]
//! #[serde(default, deny_unknown_fields)]
//! struct LampConfig {
//!     /// How far it reaches, metres. Default 3.
//!     reach_m: f64,
//! }
//!
//! impl Default for LampConfig {
//!     fn default() -> Self {
//!         Self { reach_m: 3.0 }
//!     }
//! }
//!
//! let file = std::path::Path::new("lamp.toml");
//! let lamp: LampConfig = fht_program::parse("reach_m = 4.5", file)?;
//! assert_eq!(lamp.reach_m, 4.5);
//! let printed = "# How far it reaches, metres. Default 3.\nreach_m = 4.5\n";
//! assert!(fht_program::print(&lamp)?.contains(printed));
//!
//! let error = fht_program::parse::<LampConfig>("reach = 4.5", file).err();
//! let error = error.map(|error| error.to_string());
//! assert_eq!(error.as_deref(), Some("lamp.toml:1: reach is not known; did you mean reach_m?"));
//! # }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#[cfg(feature = "config")]
mod config;
mod failure;
#[cfg(feature = "cli")]
pub mod flags;
#[cfg(feature = "cli")]
pub mod logging;
mod output;
#[cfg(feature = "cli")]
mod sections;
pub mod stop;
mod waiting;
pub mod zenoh_threads;

#[cfg(feature = "config")]
pub use config::{
    ConfigError, Configuration, PrintError, Problem, SECTIONS, load, load_over, parse, parse_over, print,
};
pub use failure::ProgramFailure;
pub use output::{exit_code, write_error_line, write_line, write_output};
#[cfg(feature = "cli")]
pub use sections::RobotConfig;
pub use stop::{Order, Stop, StopSignal};
pub use waiting::{Patience, Waiting};

/// A runtime for a program, of `threads` threads. Zenoh brings its own threads but wants to be
/// opened from a multi-threaded runtime.
///
/// # Errors
/// When the system gives no thread.
pub fn runtime(threads: usize) -> std::io::Result<tokio::runtime::Runtime> {
    tokio::runtime::Builder::new_multi_thread().worker_threads(threads).enable_all().build()
}
