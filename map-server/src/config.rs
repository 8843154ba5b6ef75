//! What a server is told at its start.

use crate::fleet::FleetConfig;
use crate::storages::QuorumConfig;
use fht_map::RouteConfig;
use fht_map::sequence::SequenceConfig;
use std::path::PathBuf;
use std::time::Duration;

/// How a server runs.
#[derive(Clone, Debug)]
pub struct ServerConfig {
    /// Directory that keeps the maps; made if absent. One server at a time.
    pub data: PathBuf,
    /// Storages that keep the maps, in the place of the directory: the server is one of several then. Default none.
    pub storages: Option<QuorumConfig>,
    /// The network.
    pub link: LinkConfig,
    /// What writers may do.
    pub limits: Limits,
    /// How queries are answered.
    pub answers: AnswerConfig,
    /// When robots count as late.
    pub fleet: FleetConfig,
}

impl ServerConfig {
    /// A server with its maps in `data`, reached over `link`, in all else by default.
    #[must_use]
    pub fn new(data: PathBuf, link: LinkConfig) -> Self {
        let (limits, answers, fleet) = (Limits::default(), AnswerConfig::default(), FleetConfig::default());
        Self { data, storages: None, link, limits, answers, fleet }
    }
}

/// How the server is reached. With `listen` it is a Zenoh router that robots and tools connect to; with `connect` alone it
/// is a client of another router.
#[derive(Clone, Debug, Default)]
pub struct LinkConfig {
    /// Endpoints to listen on, such as `tcp/0.0.0.0:7447`.
    pub listen: Vec<String>,
    /// Endpoints of other routers.
    pub connect: Vec<String>,
    /// A Zenoh configuration file (JSON5) to start from: endpoints, TLS, access control. What is given above goes before what
    /// it says; whatever it leaves open is set as without a file.
    pub zenoh_config: Option<PathBuf>,
    /// How long a client tries to connect; none: without end. Default none.
    pub patience: Option<Duration>,
}

/// What the server takes in at most. Writers are not trusted.
#[derive(Clone, Debug)]
pub struct Limits {
    /// Longest increment, bytes. Default 1 MiB; a usual one has one or two kilobytes.
    pub max_increment_bytes: usize,
    /// Bytes of increments in one map. Default 1 GiB.
    pub max_map_bytes: u64,
    /// Bytes of increments in all maps together. Default 4 GiB.
    pub max_total_bytes: u64,
    /// Nodes, edges and descriptor models in one map, removed ones included: each takes up some hundred bytes of memory,
    /// however short its increment was. Default 500 000.
    pub max_map_elements: usize,
    /// The same in all maps together. Default 2 000 000.
    pub max_total_elements: usize,
    /// Maps. Default 256.
    pub max_maps: usize,
    /// Stamps may be ahead of the server's clock by so much, seconds. Default 3600. A stamp far in the future could not be
    /// overwritten by honest ones.
    pub max_clock_ahead_s: u64,
    /// Increments that wait to be taken in, bytes. Default 64 MiB. What comes when the queue is full is dropped; its writer
    /// sends again.
    pub max_queue_bytes: usize,
    /// Bytes in one commit, as they travelled; in memory they may be ten times that. Default 2 MiB.
    pub max_batch_bytes: usize,
    /// Increments that wait for a gap to close, per map: 4096 numbers ahead and 4 MiB of memory.
    pub early: SequenceConfig,
    /// Memory for increments of all maps that have not begun, bytes. Default 4 MiB.
    pub max_nursery_bytes: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            max_increment_bytes: 1 << 20,
            max_map_bytes: 1 << 30,
            max_total_bytes: 4 << 30,
            max_map_elements: 500_000,
            max_total_elements: 2_000_000,
            max_maps: 256,
            max_clock_ahead_s: 3600,
            max_queue_bytes: 64 << 20,
            max_batch_bytes: 2 << 20,
            early: SequenceConfig { max_ahead: 4096, max_waiting_bytes: 4 << 20 },
            max_nursery_bytes: 4 << 20,
        }
    }
}

/// How queries are answered.
#[derive(Clone, Debug)]
pub struct AnswerConfig {
    /// How paths are planned.
    pub route: RouteConfig,
    /// Queries under way at one time, one with a payload for several; more are told that the server is busy. Default 2048: what a
    /// large fleet asks in some tenths of a second.
    pub max_queries: usize,
    /// Paths on meshes of at most so many triangles are planned on the thread that brings the query, if nothing has to be made or waited for
    /// first: to hand such a query to another thread would take as long as to answer it. Default 4000.
    pub at_once_triangles: usize,
    /// Threads that answer. Default 4.
    pub threads: usize,
}

impl Default for AnswerConfig {
    fn default() -> Self {
        Self { route: RouteConfig::default(), max_queries: 2048, at_once_triangles: 4000, threads: 4 }
    }
}
