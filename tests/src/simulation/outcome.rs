//! What happened in a simulated run, or what must not happen in one.

use std::ops::AddAssign;

/// What happened in a successful run.
#[derive(Clone, Debug, Default)]
pub struct SimulationOutcome {
    /// Increments in the end.
    pub increments: u64,
    /// Failures of machines that write, and servers killed.
    pub crashes: u64,
    /// How often the network fell into two groups.
    pub partitions: u64,
    /// How often explorers came back.
    pub returns: u64,
    /// Runs that ended because they learned that their numbers were another run's.
    pub told: u64,
    /// Messages lost.
    pub lost: u64,
    /// Messages in all.
    pub sent: u64,
    /// Releases made.
    pub releases: usize,
    /// Compactions of the log.
    pub compactions: u64,
    /// When everything had settled, seconds.
    pub seconds: u64,
}

impl AddAssign for SimulationOutcome {
    fn add_assign(&mut self, other: Self) {
        self.increments += other.increments;
        self.crashes += other.crashes;
        self.partitions += other.partitions;
        self.returns += other.returns;
        self.told += other.told;
        self.lost += other.lost;
        self.sent += other.sent;
        self.releases += other.releases;
        self.compactions += other.compactions;
        self.seconds += other.seconds;
    }
}

/// A rule that a run broke.
#[derive(Debug, thiserror::Error)]
pub enum Violation {
    /// Some copies are still not the server's.
    #[error("after {seconds} s {who} has {has}, and the server {server}")]
    Apart {
        /// How long it took.
        seconds: u64,
        /// Whose copy.
        who: String,
        /// What it has.
        has: String,
        /// What the server has.
        server: String,
    },
    /// An acknowledged increment is not there, or another one is.
    #[error("increment {0} was acknowledged and is not there")]
    Lost(String),
    /// An increment that a head covered has become another one.
    #[error("increment {0}, which a head covered, has become another one")]
    Replaced(String),
    /// A run took an increment of another run for its own acknowledged one.
    #[error("increment {0} of one run was taken for acknowledged, and the server has another run's")]
    Mistaken(String),
    /// A release has changed.
    #[error("release {0} has changed")]
    Release(String),
    /// The map is not what its increments add up to.
    #[error("the map is not what its increments add up to")]
    Sum,
    /// A part failed that must not.
    #[error("{0}")]
    Failed(String),
}
