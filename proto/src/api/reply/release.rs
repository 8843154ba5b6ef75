//! The reply to `releases`.

use crate::model::ids::MapName;
use crate::model::version::{Digest, VersionVector};
use serde::{Deserialize, Serialize};

/// A release in the reply to `releases`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ReleaseView {
    /// Its name.
    pub name: String,
    /// Who made it.
    pub author: String,
    /// The version that it names.
    pub version: u64,
    /// The increments that it consists of.
    pub vector: VersionVector,
    /// Hash of the map that they add up to.
    pub digest: Digest,
    /// When it was made, microseconds since the Unix epoch by its author's clock.
    pub made_us: u64,
    /// Whether robots are to use it.
    pub enabled: bool,
    /// Whether this server has all of it.
    pub available: bool,
}

/// The reply to `releases`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ReleasesReply {
    /// The map.
    pub map: MapName,
    /// Its newest version.
    pub version: u64,
    /// Oldest first.
    pub releases: Vec<ReleaseView>,
    /// Those that were deleted, each `name@author`: their authors cannot use these names again.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub deleted: Vec<String>,
}
