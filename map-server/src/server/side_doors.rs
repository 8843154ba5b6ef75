//! What else than Zenoh a server is reached over: the operators' page, if it was built with it.

use crate::config::ServerConfig;
use crate::network::QueryService;
use crate::server::error::ServerError;
#[cfg(feature = "web")]
use crate::web::WebSide;
#[cfg(feature = "web")]
use fht_web::{WebConfig, WebListener};
#[cfg(feature = "web")]
use std::io::Write;
#[cfg(feature = "web")]
use std::sync::Arc;
use zenoh::Session;

/// Sockets that are bound. Clones are the same ones.
#[derive(Clone, Debug, Default)]
pub(super) struct SideDoors {
    #[cfg(feature = "web")]
    web: Option<Arc<WebListener>>,
}

/// What is served at them. It ends when dropped.
#[derive(Default)]
pub(super) struct OpenSideDoors {
    #[cfg(feature = "web")]
    _web: Option<WebSide>,
}

#[cfg(feature = "web")]
impl SideDoors {
    /// Binds what the configuration asks for.
    ///
    /// # Errors
    /// [`ServerError::Web`].
    pub(super) fn open(config: &ServerConfig) -> Result<Self, ServerError> {
        let with_zenoh = |web: &WebConfig| WebConfig { zenoh: config.link.listen.first().cloned(), ..web.clone() };
        let web = config.web.as_ref().map(with_zenoh);
        let web = web.as_ref().map(WebListener::bind).transpose()?;
        Ok(Self { web: web.map(Arc::new) })
    }

    /// Serves what `service` answers.
    ///
    /// # Errors
    /// When Zenoh refuses the subscriptions.
    pub(super) async fn serve(&self, service: &QueryService, session: &Session) -> Result<OpenSideDoors, ServerError> {
        let web = match &self.web {
            Some(listener) => Some(WebSide::start(Arc::clone(listener), service.clone(), session).await?),
            None => None,
        };
        Ok(OpenSideDoors { _web: web })
    }

    /// Says where the page is.
    pub(super) fn print_where(&self) {
        if let Some(listener) = &self.web {
            let _ = writeln!(std::io::stderr(), "map-server: the page is at {}", listener.url());
        }
    }
}

/// Without the page there is nothing to open.
#[cfg(not(feature = "web"))]
impl SideDoors {
    pub(super) fn open(_: &ServerConfig) -> Result<Self, ServerError> {
        Ok(Self::default())
    }

    pub(super) async fn serve(&self, _: &QueryService, _: &Session) -> Result<OpenSideDoors, ServerError> {
        Ok(OpenSideDoors::default())
    }

    pub(super) fn print_where(&self) {}
}
