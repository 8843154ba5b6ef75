//! The page behind a door that is open already: an address that is taken is told at once, and the
//! door outlives whoever answers.

use crate::config::{WebConfig, WebError};
use crate::connections::Connections;
use crate::counts::WebCounts;
use crate::events::EventHub;
use crate::port::MapPort;
use crate::routes::router;
use crate::site::{Site, SiteParts};
use fht_door::{Door, DoorCounts};
use std::net::SocketAddr;
use std::sync::Arc;

/// Where the page is served.
#[derive(Debug)]
pub struct WebListener {
    door: Door,
    config: WebConfig,
    counts: Arc<WebCounts>,
}

impl WebListener {
    /// Listens. Who connects waits until it is served.
    ///
    /// # Errors
    /// [`WebError`]: the configuration would let strangers in, a file is of no use, or the address
    /// is taken.
    pub fn bind(config: &WebConfig) -> Result<Self, WebError> {
        config.check()?;
        let door = Door::bind(config.address, config.tls.as_ref(), &config.names, config.limits.of_door())?;
        Ok(Self { door, config: config.clone(), counts: Arc::default() })
    }

    /// Where it listens.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.door.address()
    }

    /// What to open in a browser.
    #[must_use]
    pub fn url(&self) -> String {
        format!("{}://{}/", self.door.hosts().scheme(), self.address())
    }

    /// Serves what `port` answers, and the events of `hub`, until it is dropped: then all
    /// connections end. Within a Tokio runtime.
    ///
    /// # Errors
    /// [`WebError::Listen`] when the system gives no more sockets to begin with.
    pub async fn serve(&self, port: Arc<dyn MapPort>, hub: EventHub) -> Result<(), WebError> {
        let (limits, zenoh) = (self.config.limits.clone(), self.config.zenoh.clone());
        let (hosts, counts) = (Arc::clone(self.door.hosts()), Arc::clone(&self.counts));
        let parts = SiteParts { port, hub, hosts, limits: limits.clone(), zenoh, counts };
        let router = router(Arc::new(Site::new(parts)));
        let connections = Connections { operator: self.config.operator.clone(), limits, router };
        let counts: Arc<dyn DoorCounts> = Arc::clone(&self.counts) as _;
        self.door.take_all(counts, move |stream, caller| connections.clone().answer(stream, caller)).await?;
        Ok(())
    }
}
