//! How a server is configured: where it keeps its maps, what writers may do, how it answers.

use crate::access::RoleList;
use fht_map::crdt::reorder_buffer::SequenceConfig;
use fht_map::plan::blocked::ReportLimits;
use fht_map::{NodeRouteConfig, WriterRole};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use std::time::Duration;

/// Where a server listens, and operators connect, unless told otherwise.
pub const DEFAULT_LISTEN: &str = "tcp/127.0.0.1:7447";

/// With less room left on its disk a server warns, unless told otherwise.
pub(crate) const MIN_FREE_BYTES: u64 = 256 << 20;

/// How a server runs.
#[derive(Clone, Debug)]
pub struct ServerConfig {
    /// Directory that keeps the maps; made if absent. Only one server may use it at a time.
    pub data: PathBuf,
    /// Replicated storages that keep the maps instead of the directory: the server is then one of
    /// several. Default none.
    pub storages: Option<QuorumConfig>,
    /// The network.
    pub link: ServerEndpoints,
    /// With less room left on the disk of `data` the server warns, bytes. Default 256 MiB.
    pub min_free_bytes: u64,
    /// What writers may do.
    pub limits: Limits,
    /// Who may write what. None: whoever reaches the server may write everything. Default none.
    pub writers: Option<RoleList>,
    /// How much room one writer may take, where `writers` says who is who.
    pub quotas: Quotas,
    /// Whether strangers are meant to write: the server does not warn of it. Default false.
    pub open: bool,
    /// How queries are answered.
    pub answers: AnswerConfig,
    /// How much robots may close by what they report blocked.
    pub reports: ReportLimits,
    /// When robots count as late.
    pub fleet: FleetConfig,
    /// How a server that stands on storages fetches what it lacks.
    pub gaps: GapFillConfig,
    /// The operators' page. None: there is none. Default none.
    #[cfg(feature = "web")]
    pub web: Option<fht_web::WebConfig>,
}

impl ServerConfig {
    /// A server that keeps its maps in `data` and is reached over `link`, with defaults for
    /// everything else.
    #[must_use]
    pub fn new(data: PathBuf, link: ServerEndpoints) -> Self {
        Self {
            data,
            storages: None,
            link,
            min_free_bytes: MIN_FREE_BYTES,
            limits: Limits::default(),
            writers: None,
            quotas: Quotas::default(),
            open: false,
            answers: AnswerConfig::default(),
            reports: ReportLimits::default(),
            fleet: FleetConfig::default(),
            gaps: GapFillConfig::default(),
            #[cfg(feature = "web")]
            web: None,
        }
    }
}

/// How the server is reached. With `listen` it is a Zenoh router that robots and tools connect to;
/// with `connect` alone it is a client of another router.
#[derive(Clone, Debug, Default)]
pub struct ServerEndpoints {
    /// Endpoints to listen on, such as `tcp/0.0.0.0:7447`.
    pub listen: Vec<String>,
    /// Endpoints of other routers.
    pub connect: Vec<String>,
    /// A Zenoh configuration file (JSON5) to start from: endpoints, TLS, access control. The
    /// endpoints above override it; whatever it leaves open is set as without a file.
    pub zenoh_config: Option<PathBuf>,
    /// How long a client tries to connect; none: for ever. Default none.
    pub patience: Option<Duration>,
}

/// How many storages there are, and how many of them must hold what is acknowledged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct QuorumConfig {
    /// Storages of the site, each in a router of its own.
    pub storages: usize,
    /// How many must hold an increment before a head covers it. More than half, so that any two
    /// such sets share one.
    pub confirm: usize,
}

impl QuorumConfig {
    /// More than half of `storages` confirm.
    #[must_use]
    pub fn majority(storages: usize) -> Self {
        Self { storages, confirm: storages / 2 + 1 }
    }

    /// How many must answer before a server knows everything that was acknowledged.
    #[must_use]
    pub fn to_read(self) -> usize {
        (self.storages + 1).saturating_sub(self.confirm)
    }
}

/// The most that the server takes in. Writers are not trusted.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct Limits {
    /// Longest increment, bytes. Default 1 MiB; a typical one has one or two kilobytes.
    pub max_increment_bytes: usize,
    /// Bytes of increments in one map. Default 1 GiB.
    pub max_map_bytes: u64,
    /// Bytes of increments in all maps together. Default 4 GiB.
    pub max_total_bytes: u64,
    /// Nodes, edges and descriptor models in one map, removed ones included: each takes some
    /// hundred bytes of memory, however short its increment was. Default 500 000.
    pub max_map_elements: usize,
    /// The same in all maps together. Default 2 000 000.
    pub max_total_elements: usize,
    /// Maps. Default 256.
    pub max_maps: usize,
    /// How far stamps may be ahead of the server's clock, seconds. Default 3600. Honest writers
    /// could not overwrite a stamp far in the future.
    pub max_clock_ahead_s: u64,
    /// Increments that wait to be taken in, bytes. Default 64 MiB. What arrives when the queue is
    /// full is dropped; its writer sends it again.
    pub max_queue_bytes: usize,
    /// Bytes in one commit, as they travelled; in memory they may be ten times that. Default 2 MiB.
    pub max_batch_bytes: usize,
    /// Increments that wait for a gap to close, per map: 4096 numbers ahead and 4 MiB of memory.
    pub early: SequenceConfig,
    /// Memory for the increments of all maps whose first increment has not arrived yet, bytes.
    /// Default 4 MiB.
    pub max_pending_bytes: usize,
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
            max_pending_bytes: 4 << 20,
        }
    }
}

/// How much of the room that [`Limits`] give one writer may take, by its role. They hold where the
/// roles are known.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct Quotas {
    /// What one explorer may take.
    pub explorers: WriterQuota,
    /// What one operator may take. Default: everything.
    pub operators: WriterQuota,
    /// Share of every limit (maps, and bytes and elements of a map and of all) that is kept for
    /// operators, so that they can still write when explorers have filled the rest. Default 0.1.
    #[cfg_attr(feature = "schema", schemars(range(min = 0, max = 1)))]
    pub operators_reserve_share: f64,
}

impl Quotas {
    /// The quota of one writer.
    #[must_use]
    pub fn of(&self, role: WriterRole) -> &WriterQuota {
        if role == WriterRole::Operator { &self.operators } else { &self.explorers }
    }
}

/// How much one writer may take.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct WriterQuota {
    /// Share of one map's bytes and elements (`limits.max_map_bytes`, `limits.max_map_elements`).
    /// Default 0.5; of an operator 1.
    #[cfg_attr(feature = "schema", schemars(range(min = 0, max = 1)))]
    pub map_share: f64,
    /// Share of the bytes and elements of all maps together (`limits.max_total_bytes`,
    /// `limits.max_total_elements`), and of the maps themselves (`limits.max_maps`): who writes in
    /// so many maps begins no other. Default 0.25; of an operator 1.
    #[cfg_attr(feature = "schema", schemars(range(min = 0, max = 1)))]
    pub total_share: f64,
    /// Increments a second, ten times as many in a burst. What comes faster is dropped, and its
    /// writer sends it again. Default 1000.
    #[cfg_attr(feature = "schema", schemars(range(min = 1, max = 1000000)))]
    pub increments_per_s: f64,
    /// Share of the nodes of others in a map that a writer may take away within an hour, rounded up
    /// to whole nodes. Default 0.25; of an operator 1.
    #[cfg_attr(feature = "schema", schemars(range(min = 0, max = 1)))]
    pub taken_per_hour_share: f64,
}

impl WriterQuota {
    /// All that there is.
    const EVERYTHING: Self =
        Self { map_share: 1.0, total_share: 1.0, increments_per_s: 1000.0, taken_per_hour_share: 1.0 };
}

impl Default for WriterQuota {
    fn default() -> Self {
        Self { map_share: 0.5, total_share: 0.25, taken_per_hour_share: 0.25, ..Self::EVERYTHING }
    }
}

impl Default for Quotas {
    fn default() -> Self {
        Self { explorers: WriterQuota::default(), operators: WriterQuota::EVERYTHING, operators_reserve_share: 0.1 }
    }
}

/// How queries are answered.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct AnswerConfig {
    /// How paths are planned.
    pub route: NodeRouteConfig,
    /// Queries under way at one time; one with a payload counts as several. Further ones are told
    /// that the server is busy. Default 2048: what a large fleet asks in some tenths of a second.
    #[cfg_attr(feature = "schema", schemars(range(min = 1, max = 1000000)))]
    pub max_queries: usize,
    /// The same for long questions: `diff`, and paths on releases that are not enabled. Default 8.
    #[cfg_attr(feature = "schema", schemars(range(min = 1, max = 1000000)))]
    pub max_long: usize,
    /// Long questions, and snapshots, that are answered at a time; further ones wait. They have
    /// threads of their own, so no other question waits for them. Default 1.
    #[cfg_attr(feature = "schema", schemars(range(min = 1, max = 1024)))]
    pub long_at_once: usize,
    /// How long they wait for their turn before they are told that the server is busy, seconds.
    /// Default 8: whoever asks gives up after 10, unless told otherwise.
    #[cfg_attr(feature = "schema", schemars(range(min = 0, max = 3600)))]
    pub max_wait_s: f64,
    /// Paths on meshes of at most this many triangles are planned on the thread that brings the
    /// query, if nothing has to be built or waited for first: handing such a query to another
    /// thread would take as long as answering it. Default 4000.
    pub at_once_triangles: usize,
    /// Threads that answer short questions. Default 4.
    #[cfg_attr(feature = "schema", schemars(range(min = 1, max = 1024)))]
    pub threads: usize,
}

impl AnswerConfig {
    /// Threads that answer questions of all kinds.
    #[must_use]
    pub fn all_threads(&self) -> usize {
        self.threads.max(1) + 2 * self.long_at_once.max(1)
    }
}

impl Default for AnswerConfig {
    fn default() -> Self {
        Self {
            route: NodeRouteConfig::default(),
            max_queries: 2048,
            max_long: 8,
            long_at_once: 1,
            max_wait_s: 8.0,
            at_once_triangles: 4000,
            threads: 4,
        }
    }
}

/// When a robot counts as late.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct FleetConfig {
    /// How long it may lack increments, or run another release than the one enabled, seconds.
    /// Default 10.
    pub late_after_s: f64,
    /// How many robots are remembered; anybody can invent names. Default 4096.
    pub max_robots: usize,
    /// How many of one map. Default 1000.
    pub max_robots_of_map: usize,
    /// How much memory what they told may take, bytes: who was not heard for the longest time is
    /// forgotten first. Default 16 MiB.
    pub max_bytes: usize,
}

impl Default for FleetConfig {
    fn default() -> Self {
        Self { late_after_s: 10.0, max_robots: 4096, max_robots_of_map: 1000, max_bytes: 16 << 20 }
    }
}

/// How a server that stands on storages fetches what it lacks: how much is asked at a time.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct GapFillConfig {
    /// Authors that are asked about per round. Default 64; more authors take several rounds.
    pub authors: usize,
    /// Increments of one author that are fetched at a time, once one was found. Default 64.
    pub part: u64,
    /// Increments of one author that are fetched per round. Default 1024.
    pub max_increments: u64,
    /// Unknown authors are looked for every so many rounds. Default 15: storages go through all of
    /// their keys for it.
    pub list_every: u64,
}

impl Default for GapFillConfig {
    fn default() -> Self {
        Self { authors: 64, part: 64, max_increments: 1024, list_every: 15 }
    }
}
