//! How a replica keeps up with the server.

use fht_map::WriterRoles;
use serde::{Deserialize, Serialize};

/// How a replica keeps up.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct ReplicaConfig {
    /// Samples that may wait to be taken in; what comes when the queue is full is dropped, and
    /// asked for later. Default 1024.
    #[cfg_attr(feature = "schema", schemars(range(min = 1, max = 1000000)))]
    pub queue: usize,
    /// How long to wait for an answer, seconds. Default 5.
    pub timeout_s: f64,
    /// How long increments that the head shows may be under way before they are asked for, seconds.
    /// Default 0.15.
    pub grace_s: f64,
    /// How long the copy may have increments that the server does not tell of before it is fetched
    /// anew, seconds. Default 10.
    pub ahead_s: f64,
    /// The head is asked for this often, in case its publication was lost, seconds. Default 2.
    pub head_every_s: f64,
    /// About how much is asked for at one time, bytes: what may be under way on the link. Default
    /// 64 KiB.
    #[cfg_attr(feature = "schema", schemars(range(min = 1024, max = 1073741824)))]
    pub part_bytes: usize,
    /// In pieces of about so many bytes: what is lost when the link breaks. Default 4 KiB.
    #[cfg_attr(feature = "schema", schemars(range(min = 256, max = 1073741824)))]
    pub piece_bytes: usize,
    /// Who may write what: what writers put against it is taken only if the server takes it. Not in
    /// files. Default none: everybody may write everything.
    #[serde(skip)]
    pub roles: Option<WriterRoles>,
}

impl Default for ReplicaConfig {
    fn default() -> Self {
        Self {
            queue: 1024,
            timeout_s: 5.0,
            grace_s: 0.15,
            ahead_s: 10.0,
            head_every_s: 2.0,
            part_bytes: 64 << 10,
            piece_bytes: 4 << 10,
            roles: None,
        }
    }
}
