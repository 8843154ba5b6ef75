//! How a robot's parts are, as `/diagnostics` has it.

use super::HeaderMsg;
use serde::{Deserialize, Serialize};

/// `diagnostic_msgs/KeyValue`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct KeyValue {
    pub key: String,
    pub value: String,
}

/// `diagnostic_msgs/DiagnosticStatus`: how one part is.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct DiagnosticStatus {
    /// [`Self::OK`] to [`Self::STALE`].
    pub level: u8,
    pub name: String,
    pub message: String,
    pub hardware_id: String,
    pub values: Vec<KeyValue>,
}

impl DiagnosticStatus {
    /// All is well.
    pub const OK: u8 = 0;
    /// Something is to be looked at.
    pub const WARN: u8 = 1;
    /// The part does not work.
    pub const ERROR: u8 = 2;
    /// Nothing has been heard of it for a while.
    pub const STALE: u8 = 3;
}

/// `diagnostic_msgs/DiagnosticArray`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct DiagnosticArray {
    pub header: HeaderMsg,
    pub status: Vec<DiagnosticStatus>,
}
