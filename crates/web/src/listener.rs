//! A socket that is bound, and serving on it. It is bound before anything else is done, so that an
//! address that is taken is told at once, and outlives whoever answers.

use crate::config::{WebConfig, WebError};
use crate::connections::Connections;
use crate::counts::WebCounts;
use crate::events::EventHub;
use crate::hosts::Hosts;
use crate::port::MapPort;
use crate::routes::router;
use crate::site::{Site, SiteParts};
use crate::tls::secure;
use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use tokio_rustls::TlsAcceptor;

/// Where the page is served.
pub struct WebListener {
    listener: TcpListener,
    address: SocketAddr,
    acceptor: Option<TlsAcceptor>,
    hosts: Arc<Hosts>,
    config: WebConfig,
    counts: Arc<WebCounts>,
}

impl std::fmt::Debug for WebListener {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("WebListener").field("address", &self.address).finish_non_exhaustive()
    }
}

impl WebListener {
    /// Listens. Who connects waits until it is served.
    ///
    /// # Errors
    /// [`WebError`]: the configuration would let strangers in, a file is of no use, or the address
    /// is taken.
    pub fn bind(config: &WebConfig) -> Result<Self, WebError> {
        config.check()?;
        let (acceptor, names) = match config.tls.as_ref().map(secure).transpose()? {
            Some(side) => (Some(side.acceptor), side.names),
            None => (None, Vec::new()),
        };
        let failed = |source| WebError::Listen { address: config.address, source };
        let listener = TcpListener::bind(config.address).map_err(failed)?;
        listener.set_nonblocking(true).map_err(failed)?;
        let address = listener.local_addr().map_err(failed)?;
        let hosts = Hosts::new(address.ip(), names.into_iter().chain(config.names.iter().cloned()), acceptor.is_some());
        let counts = Arc::default();
        Ok(Self { listener, address, acceptor, hosts: Arc::new(hosts), config: config.clone(), counts })
    }

    /// Where it listens.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// What to open in a browser.
    #[must_use]
    pub fn url(&self) -> String {
        let scheme = if self.acceptor.is_some() { "https" } else { "http" };
        format!("{scheme}://{}/", self.address)
    }

    /// Serves what `port` answers, and the events of `hub`, until it is dropped: then all
    /// connections end. Within a Tokio runtime.
    ///
    /// # Errors
    /// [`WebError::Listen`] when the system gives no more sockets to begin with.
    pub async fn serve(&self, port: Arc<dyn MapPort>, hub: EventHub) -> Result<(), WebError> {
        let failed = |source| WebError::Listen { address: self.address, source };
        let listener = self.listener.try_clone().map_err(failed)?;
        let listener = tokio::net::TcpListener::from_std(listener).map_err(failed)?;
        let limits = self.config.limits.clone();
        let counts = Arc::clone(&self.counts);
        let zenoh = self.config.zenoh.clone();
        let parts = SiteParts { port, hub, hosts: Arc::clone(&self.hosts), limits: limits.clone(), zenoh, counts };
        let router = router(Arc::new(Site::new(parts)));
        let connections = Connections {
            acceptor: self.acceptor.clone(),
            operator: self.config.operator.clone(),
            limits,
            counts: Arc::clone(&self.counts),
            router,
        };
        connections.take_all(listener).await;
        Ok(())
    }
}
