//! How a run goes.

use std::path::PathBuf;
use std::time::Duration;

/// How a run goes.
#[derive(Clone, Debug)]
pub struct SiteConfig {
    /// An executable with the roles `map-server` and `router`.
    pub executable: PathBuf,
    /// The folder for configurations.
    pub folder: PathBuf,
    /// Routers, each with a storage. Default 3.
    pub routers: usize,
    /// Stateless servers. Default 3.
    pub servers: usize,
    /// Robots that write. Default 3.
    pub writers: usize,
    /// Increments of each writer, per second. Default 10.
    pub increments_per_s: f64,
    /// Robots that ask. Default 4.
    pub readers: usize,
    /// Questions of each reader, per second. Default 10.
    pub questions_per_s: f64,
    /// How long the load lasts. Default 5 minutes.
    pub duration: Duration,
    /// Time between kills of one router and one server. Default 20 s.
    pub kill_every: Duration,
    /// How long they stay down. Default 5 s.
    pub back_after: Duration,
    /// Numbers of the attacks by two strangers and a client, against which it has mutual TLS and
    /// access control. Default none.
    pub attacks: Vec<u32>,
    /// Decides who is killed.
    pub seed: u64,
    /// How long an answer may take, seen from the client. Default 2 s.
    pub limit: Duration,
    /// How long the last acknowledgement, and agreement, may take in the end. Default 60 s.
    pub patience: Duration,
}

impl SiteConfig {
    /// Defaults, for programs of `executable` with what they need in `folder`.
    #[must_use]
    pub fn new(executable: PathBuf, folder: PathBuf) -> Self {
        Self {
            executable,
            folder,
            routers: 3,
            servers: 3,
            writers: 3,
            increments_per_s: 10.0,
            readers: 4,
            questions_per_s: 10.0,
            duration: Duration::from_secs(300),
            kill_every: Duration::from_secs(20),
            back_after: Duration::from_secs(5),
            attacks: Vec::new(),
            seed: 1,
            limit: Duration::from_secs(2),
            patience: Duration::from_secs(60),
        }
    }
}
