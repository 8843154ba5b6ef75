//! Starts the page, and ends it with the server.

use crate::network::{ConnectedSessions, QueryService};
use crate::web::feed::Feed;
use crate::web::port::ServerPort;
use fht_web::{EventHub, WebListener};
use std::sync::Arc;
use tokio::task::AbortHandle;
use zenoh::Session;

/// The page of a running server. It ends when dropped: the connections are closed, and browsers
/// come again.
pub(crate) struct WebSide {
    _feed: Feed,
    serving: AbortHandle,
}

impl WebSide {
    /// Serves at `listener` what `service` answers; changes are put over `session`.
    ///
    /// # Errors
    /// When Zenoh refuses the subscriptions.
    pub(crate) async fn start(
        listener: Arc<WebListener>,
        service: QueryService,
        session: &Session,
    ) -> Result<Self, zenoh::Error> {
        let hub = EventHub::default();
        let feed = Feed::start(session, service.sources(), hub.clone()).await?;
        let connected = ConnectedSessions::follow(session).await?;
        let port = Arc::new(ServerPort::new(service, session.clone(), connected));
        let serving = tokio::spawn(async move {
            if let Err(error) = listener.serve(port, hub).await {
                tracing::error!("the page is not served: {error}");
            }
        });
        Ok(Self { _feed: feed, serving: serving.abort_handle() })
    }
}

impl Drop for WebSide {
    fn drop(&mut self) {
        self.serving.abort();
    }
}
