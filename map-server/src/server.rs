//! Runs a server: opens the log and the session, puts the parts together, and takes them down in
//! order.
//!
//! | module | idea |
//! | --- | --- |
//! | `serving` | the parts of a running server, and their shutdown |
//! | `writer` | the thread that writes |
//! | `error` | why a server ends |

mod error;
mod serving;
mod writer;

pub use error::ServerError;

use crate::catalog::Catalog;
use crate::config::{QuorumConfig, ServerConfig};
use crate::network;
use crate::replicated::{QuorumLog, Stateless};
use crate::store::{FILE_NAME, IncrementLog, RedbLog, StoreError};
use serving::{ShutdownSignal, serve};
use std::pin::pin;
use std::sync::Arc;
use zenoh::Session;

/// Runs a server until `shutdown` completes. Everything that has arrived by then is stored, or at
/// least not acknowledged.
///
/// # Errors
/// [`ServerError`]: it could not start, or the store failed. Everything that was acknowledged is on
/// the disk, or in the storages.
pub async fn run(config: ServerConfig, shutdown: impl Future<Output = ()>) -> Result<(), ServerError> {
    run_beside(config, shutdown, |_| Ok(())).await
}

/// Like [`run`], with something else on the server's session: `beside` is called when the session
/// is open, and what it returns is kept until the server ends.
///
/// # Errors
/// As [`run`]; [`ServerError::Zenoh`] when `beside` fails.
pub async fn run_beside<T>(
    config: ServerConfig,
    shutdown: impl Future<Output = ()>,
    beside: impl FnOnce(&Session) -> Result<T, zenoh::Error>,
) -> Result<(), ServerError> {
    warn_of_strangers(&config);
    let shutdown = pin!(shutdown);
    let mut shutdown = ShutdownSignal::new(shutdown);
    let Some(quorum) = config.storages else {
        // A directory that is there comes first: that it is in use is reported before anybody can
        // connect. One that is not there is made when the server can listen.
        let early = match config.data.exists() {
            true => None,
            false => Some(network::open(&config.link).await?),
        };
        let log: Arc<dyn IncrementLog> = Arc::new(RedbLog::open(&config.data)?);
        let file = config.data.join(FILE_NAME);
        let catalog = Catalog::load(log.as_ref()).map_err(|error| error.of_file(&file))?;
        let catalog = Arc::new(catalog);
        let session = match early {
            Some(session) => session,
            None => network::open(&config.link).await?,
        };
        let beside = beside(&session)?;
        let outcome = serve(&config, &session, log, catalog, None, &mut shutdown).await;
        drop(beside);
        session.close().await?;
        return outcome;
    };
    let session = network::open(&config.link).await?;
    let beside = beside(&session)?;
    let outcome = serve_storages(&config, &session, quorum, &mut shutdown).await;
    drop(beside);
    session.close().await?;
    outcome
}

/// Says at which endpoints anybody may write, unless that is meant.
fn warn_of_strangers(config: &ServerConfig) {
    // A configuration that cannot be used is an error when the session is opened.
    let endpoints = network::open_to_strangers(&config.link).unwrap_or_default().join(", ");
    if config.open || endpoints.is_empty() {
        return;
    }
    let who = match config.writers {
        None => "every stranger who reaches it may write and delete maps and send robots",
        Some(_) => "every stranger who reaches it may write under any name in the list of roles",
    };
    tracing::warn!(
        "{endpoints}: there is no access control, and {who}. deploy/README.md says how to set it up, with --roles; \
         --open says that it is meant to be so"
    );
}

/// Serves what storages hold; starts over when another server's increment stands before one of this
/// server's.
async fn serve_storages(
    config: &ServerConfig,
    session: &Session,
    quorum: QuorumConfig,
    shutdown: &mut ShutdownSignal<'_, impl Future<Output = ()>>,
) -> Result<(), ServerError> {
    loop {
        let stateless = Stateless::new(session, quorum, config.gaps.clone());
        let log = Arc::new(QuorumLog::new(stateless.storages(), quorum));
        match serve(config, session, log, Arc::default(), Some(stateless), shutdown).await {
            Err(ServerError::Store(reason @ StoreError::Overruled { .. })) => {
                tracing::error!("{reason}: everything is read anew");
            }
            outcome => return outcome,
        }
    }
}
