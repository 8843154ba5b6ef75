//! How bad a simulated run is.

use crate::simulation::network::NetworkConfig;

/// How bad things are.
#[derive(Clone, Debug)]
pub struct SimulationConfig {
    /// The network during the time of trouble.
    pub network: NetworkConfig,
    /// Servers that stand on storages; 0: one with a disk. Default 0.
    pub servers: usize,
    /// Explorers, at most. Default 3.
    pub explorers: usize,
    /// Clients, at most. Default 3.
    pub clients: usize,
    /// Increments that an explorer writes, at most. Default 60.
    pub increments: u64,
    /// How long the trouble lasts, seconds. Default 60.
    pub trouble_s: u64,
    /// How long everything may take after that, seconds. Default 300.
    pub calm_s: u64,
    /// Share of durable writes at which the machine fails. Default 0.05.
    pub crash_share: f64,
    /// Share of killed explorers that come back within seconds. Default 0.8.
    pub returning: f64,
    /// Share of explorers that keep nothing on a disk, and so may use a number again that they had
    /// put in vain. Default 0.5 with one server. Where several servers stand on storages, once in
    /// some thousand fleets a server may accept what an earlier run had put just when another
    /// accepts the new one: plain storages cannot decide between the two, and what a head covered
    /// is replaced. The default there is 0.
    pub forgetful: Option<f64>,
}

impl Default for SimulationConfig {
    fn default() -> Self {
        Self {
            network: NetworkConfig::default(),
            servers: 0,
            explorers: 3,
            clients: 3,
            increments: 60,
            trouble_s: 60,
            calm_s: 300,
            crash_share: 0.05,
            returning: 0.8,
            forgetful: None,
        }
    }
}
