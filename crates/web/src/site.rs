//! What all requests share.

use crate::config::WebLimits;
use crate::counts::WebCounts;
use crate::events::EventHub;
use crate::port::{Answering, MapPort, WebAnswer};
use crate::rights::Rights;
use crate::visitor::Visitor;
use fht_door::Hosts;
use fht_proto::api::reply::ErrorReply;
use std::sync::Arc;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::timeout;

/// Whom requests are answered by.
pub(crate) struct SiteParts {
    pub(crate) port: Arc<dyn MapPort>,
    pub(crate) hub: EventHub,
    pub(crate) hosts: Arc<Hosts>,
    pub(crate) limits: WebLimits,
    pub(crate) zenoh: Option<String>,
    pub(crate) counts: Arc<WebCounts>,
}

/// What all requests share.
pub(crate) struct Site {
    parts: SiteParts,
    streams: Arc<Semaphore>,
}

impl Site {
    pub(crate) fn new(parts: SiteParts) -> Self {
        let streams = Arc::new(Semaphore::new(parts.limits.streams));
        Self { parts, streams }
    }

    pub(crate) fn port(&self) -> &Arc<dyn MapPort> {
        &self.parts.port
    }

    pub(crate) fn hub(&self) -> &EventHub {
        &self.parts.hub
    }

    pub(crate) fn hosts(&self) -> &Hosts {
        &self.parts.hosts
    }

    pub(crate) fn limits(&self) -> &WebLimits {
        &self.parts.limits
    }

    pub(crate) fn zenoh(&self) -> Option<&str> {
        self.parts.zenoh.as_deref()
    }

    pub(crate) fn counts(&self) -> &Arc<WebCounts> {
        &self.parts.counts
    }

    pub(crate) fn rights(&self, visitor: &Visitor) -> Rights {
        visitor.rights(self.parts.port.as_ref())
    }

    /// Room for a stream of events.
    pub(crate) fn stream(&self) -> Result<OwnedSemaphorePermit, ErrorReply> {
        Arc::clone(&self.streams)
            .try_acquire_owned()
            .map_err(|_| ErrorReply::busy("too many watch already; ask again after 10 s", 10))
    }

    /// An answer, if it comes in time.
    pub(crate) async fn in_time(&self, answering: Answering) -> Result<WebAnswer, ErrorReply> {
        let late = |_| ErrorReply::busy("the answer takes too long; ask again after 5 s", 5);
        timeout(self.parts.limits.answering, answering).await.map_err(late)?
    }
}
