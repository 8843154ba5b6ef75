//! What can be configured, and how a configuration is refused.

use schemars::JsonSchema;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::fmt;
use std::path::{Path, PathBuf};

/// Sections of the file that some program reads. Each program takes its own and leaves the others
/// to theirs.
pub const SECTIONS: [&str; 9] = ["connect", "robot", "sim", "ros", "bag", "mapper", "client", "server", "merge"];

/// What a configuration file can be read into and printed from. Every such structure has this
/// trait.
pub trait Configuration: Serialize + DeserializeOwned + JsonSchema + Default {}

impl<T: Serialize + DeserializeOwned + JsonSchema + Default> Configuration for T {}

/// Why a configuration file is refused.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("{}: the configuration cannot be read: {source}", file.display())]
    Read {
        /// Which.
        file: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The file is no TOML.
    #[error("{}:{line}: {reason}", file.display())]
    Syntax {
        /// Which.
        file: PathBuf,
        /// Where, counted from 1.
        line: usize,
        /// What the parser says.
        reason: String,
    },
    /// Keys or values are refused. All of them are named, one a line.
    #[error("{}", in_lines(file, problems))]
    Refused {
        /// Which.
        file: PathBuf,
        /// At least one.
        problems: Vec<Problem>,
    },
}

/// One key of the file that is refused.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// Where, counted from 1.
    pub line: usize,
    /// The key from the top of the file, as in `client.localize.observe_every_m`.
    pub key: String,
    /// What is wrong with it, as the rest of a sentence that begins with the key.
    pub reason: String,
}

impl fmt::Display for Problem {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{}: {} {}", self.line, self.key, self.reason)
    }
}

fn in_lines(file: &Path, problems: &[Problem]) -> String {
    let lines: Vec<_> = problems.iter().map(|problem| format!("{}:{problem}", file.display())).collect();
    lines.join("\n")
}

/// Why a configuration cannot be written.
#[derive(Debug, thiserror::Error)]
#[error("the configuration cannot be written as TOML: {0}")]
pub struct PrintError(pub(super) String);
