//! The sessions of robots, and the map that they work on.

use crate::site::report::SiteError;
use crate::site::secured::Secured;
use fht_proto::MapName;
use fht_session::SessionConfig;
use std::sync::Arc;
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

/// How robots come to the site.
#[derive(Clone)]
pub(super) struct Way {
    pub(super) endpoints: Vec<String>,
    /// Where certificates are asked for.
    pub(super) secured: Option<Arc<Secured>>,
}

impl Way {
    /// Opens the session of a robot or operator; its first router is the one at `first`.
    pub(super) async fn session(&self, role: &str, name: &str, first: usize) -> Result<Session, SiteError> {
        let endpoints = rotated(&self.endpoints, first);
        let link = match &self.secured {
            None => SessionConfig::from_options(endpoints, None),
            Some(site) => {
                SessionConfig::from_options(Vec::new(), Some(site.credentials.session(role, name, &endpoints)?))
            }
        };
        Ok(fht_session::open(&link).await?)
    }
}

/// Closes a session; errors do not matter any more.
pub(super) fn close(session: &Session) {
    let _ = session.close().wait();
}
