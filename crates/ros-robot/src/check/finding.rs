//! What is found about a topic.

use serde::{Deserialize, Serialize};

/// How bad a finding is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Readiness {
    /// All is well.
    Good,
    /// It works, but not as it should.
    Doubtful,
    /// It cannot work.
    Missing,
}

/// What was found about one topic.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Finding {
    /// The topic's full name.
    pub topic: String,
    /// How bad it is.
    pub readiness: Readiness,
    /// What it is, and what to do.
    pub sentence: String,
}

/// At most four of them, each once.
pub(super) fn listed(names: &[&str]) -> String {
    let mut names = names.to_vec();
    names.dedup();
    let more = if names.len() > 4 { " …" } else { "" };
    names.truncate(4);
    format!("{}{more}", names.join(", "))
}
