//! The reply to `diff`.

use crate::model::ids::MapName;
use crate::model::version::{Digest, VersionVector};
use serde::{Deserialize, Serialize};

/// A state in a `diff`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct StateView {
    /// Sum of the vector.
    pub version: u64,
    /// The increments.
    pub vector: VersionVector,
    /// Hash of the map.
    pub digest: Digest,
}

/// A node that moved.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct MovedNode {
    /// Its id.
    pub id: String,
    /// How far, metres.
    pub by_m: f64,
}

/// The reply to `diff`: what has to be done to one state to get the other.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct DiffReply {
    /// The map.
    pub map: MapName,
    /// The state compared with.
    pub from: StateView,
    /// The state that is compared.
    pub to: StateView,
    /// Nodes that are new.
    pub added_nodes: Vec<String>,
    /// Nodes that are gone.
    pub removed_nodes: Vec<String>,
    /// Nodes that have moved.
    pub moved_nodes: Vec<MovedNode>,
    /// Nodes whose kind, rectangle, signature or trust has changed.
    pub changed_nodes: Vec<String>,
    /// Edges that are new.
    pub added_edges: Vec<[String; 2]>,
    /// Edges that are gone.
    pub removed_edges: Vec<[String; 2]>,
    /// Edges that are closed now.
    pub closed_edges: Vec<[String; 2]>,
    /// Edges that are open again.
    pub opened_edges: Vec<[String; 2]>,
    /// Named places, zones and releases that were added, removed or changed: `place dock`, `zone
    /// lab`, `release 2026-11-21.1@1a2b3c4d`.
    pub annotations: Vec<String>,
    /// The same in a sentence.
    pub words: String,
}
