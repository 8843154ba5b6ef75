//! The sessions of robots, and the map that they work on.

use crate::site::report::SiteError;
use fht_proto::MapName;
use fht_session::SessionConfig;
use zenoh::{Session, Wait};

/// The map of the run.
pub(super) fn map() -> MapName {
    // A constant that is a valid name.
    "site".parse().unwrap_or_else(|error| panic!("{error}"))
}

/// `endpoints`, rotated to begin with the one at `first`.
pub(super) fn rotated(endpoints: &[String], first: usize) -> Vec<String> {
    let first = first % endpoints.len().max(1);
    endpoints[first..].iter().chain(&endpoints[..first]).cloned().collect()
}

/// Opens a robot's session; its first router is the one at `first`.
pub(super) async fn session(endpoints: &[String], first: usize) -> Result<Session, SiteError> {
    Ok(fht_session::open(&SessionConfig::from_options(rotated(endpoints, first), None)).await?)
}

/// Closes a session; errors do not matter any more.
pub(super) fn close(session: &Session) {
    let _ = session.close().wait();
}
