//! What a server has counted.

use fht_proto::MapName;

/// What is counted of one map.
#[derive(Clone, Debug, PartialEq)]
pub struct MapGauges {
    /// The map.
    pub map: MapName,
    /// Increments.
    pub version: u64,
    /// Main nodes that are shown.
    pub main_nodes: usize,
    /// Support nodes that are shown.
    pub support_nodes: usize,
    /// Edges that are shown.
    pub edges: usize,
    /// Bytes of all increments as they travelled.
    pub bytes: u64,
    /// Increments refused since the server started.
    pub refused: u64,
    /// Robots whose tokens are there.
    pub robots: usize,
    /// Those of them that have lacked something for too long.
    pub late_robots: usize,
}

/// What is counted of the questions of one kind.
#[derive(Clone, Debug, PartialEq)]
pub struct QueryFigures {
    /// What is asked, such as `path`.
    pub topic: &'static str,
    /// How many were answered.
    pub answered: u64,
    /// How many were refused with a reason.
    pub refused: u64,
    /// How many were told that the server is busy.
    pub busy: u64,
    /// What all of them took together, seconds.
    pub seconds: f64,
    /// How many took at most so many seconds, and longer than those before; infinity last.
    pub buckets: Vec<(f64, u64)>,
}

/// What a server has counted.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ServerFigures {
    /// Its maps.
    pub maps: Vec<MapGauges>,
    /// What it was asked.
    pub queries: Vec<QueryFigures>,
    /// Zenoh sessions that are connected to it, by what they are: `router`, `peer`, `client`.
    pub sessions: Vec<(&'static str, usize)>,
    /// Whether it takes nothing in at present.
    pub is_read_only: bool,
    /// Room left on its disk; none: that is not known.
    pub disk_free_bytes: Option<u64>,
    /// Warnings in its log since it started.
    pub warnings: u64,
    /// Errors in its log since it started.
    pub errors: u64,
}
