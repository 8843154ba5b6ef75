//! What the map of a run came to: the figures that explorations and replays have in common.

use crate::explore::Ending;
use crate::mapping::Mapper;
use crate::publish::{EarlierDelivery, ServerLoss};
use crate::run::MappingSummary;
use fht_program::print_line;
use fht_proto::{Digest, VersionVector};
use serde::{Deserialize, Serialize};

/// The map that a run made, and how much of it the server has.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct MapFigures {
    /// Why the run ended.
    pub ending: Ending,
    /// Main nodes of the map.
    pub main_nodes: usize,
    /// Support nodes of the map.
    pub support_nodes: usize,
    /// Edges of the map.
    pub edges: usize,
    /// The map's version: increments of all authors that are in it, as this robot knew it at the
    /// end.
    pub version: u64,
    /// The same increments, author by author; none without a server.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub vector: Option<VersionVector>,
    /// Increments that this robot has written, those of its earlier runs included.
    #[serde(default)]
    pub written: u64,
    /// Of these, what the server has acknowledged.
    #[serde(default)]
    pub acknowledged: u64,
    /// Whether the server has acknowledged everything.
    pub delivered: bool,
    /// Why the server has not taken what it was sent last, if it says so.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub refusal: Option<String>,
    /// Whether nobody answered when the server was asked last.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub is_unanswered: bool,
    /// What the server has lost of what it had acknowledged.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub loss: Option<ServerLoss>,
    /// What an earlier run of this robot had left in its spool, and was delivered first. It is
    /// not among the bytes below.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub earlier: Option<EarlierDelivery>,
    /// Digest of this robot's own map.
    pub digest: Digest,
    /// Bytes of all increments, each counted once.
    pub map_bytes: u64,
    /// Bytes put on the wire, repetitions included.
    pub wire_bytes: u64,
    /// Loop closures: close at hand, and after a long way.
    pub closures: [usize; 2],
    /// Longest time that a frame took, sensing excluded, milliseconds.
    pub frame_max_ms: f64,
}

impl MapFigures {
    pub(super) fn of(summary: &MappingSummary, mapper: &Mapper) -> Self {
        let counts = mapper.map().counts();
        let published = summary.published.as_ref();
        Self {
            ending: summary.ending,
            main_nodes: counts.main_nodes,
            support_nodes: counts.support_nodes,
            edges: counts.edges,
            version: summary.version,
            vector: summary.vector.clone(),
            written: summary.written,
            acknowledged: summary.acknowledged(),
            delivered: summary.is_delivered(),
            refusal: summary.refusal(),
            is_unanswered: published.is_some_and(|published| published.is_unanswered),
            loss: published.and_then(|published| published.loss),
            earlier: published.and_then(|published| published.earlier),
            digest: mapper.map().digest(),
            map_bytes: published.map_or(0, |published| published.map_bytes),
            wire_bytes: published.map_or(0, |published| published.wire_bytes),
            closures: [mapper.closures().near, mapper.closures().far],
            frame_max_ms: summary.frame_max.as_secs_f64() * 1e3,
        }
    }

    /// Prints how large the map is. `more` goes on with the first line.
    pub(super) fn print_size(&self, more: &str) {
        print_line!(
            "map         {} main nodes, {} support nodes, {} edges, version {}{more}",
            self.main_nodes,
            self.support_nodes,
            self.edges,
            self.version
        );
        print_line!("bytes       {} of increments, {} on the wire", self.map_bytes, self.wire_bytes);
        if let Some(EarlierDelivery { increments, bytes }) = self.earlier {
            print_line!("earlier     {increments} increments of an earlier run delivered, {bytes} bytes");
        }
    }
}
