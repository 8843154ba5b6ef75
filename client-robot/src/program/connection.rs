//! The way to the server.

use super::error::CliError;
use fht_client::{AskError, ask_head};
use fht_proto::MapName;
use fht_session::{SessionConfig, open};
use std::time::{Duration, Instant};
use tokio::runtime::Runtime;
use zenoh::Session;

/// How long questions to the server may take.
pub(super) const TIMEOUT: Duration = Duration::from_secs(5);

/// Zenoh brings its own threads but wants to be opened, and waited for, from a multi-threaded
/// runtime.
pub(super) fn runtime() -> Result<Runtime, CliError> {
    fht_program::runtime(1).map_err(CliError::Runtime)
}

/// Opens a session.
pub(super) fn connect(config: &SessionConfig) -> Result<Session, CliError> {
    Ok(runtime()?.block_on(open(config))?)
}

/// A client session connects in the background: asks until the server answers, for as long as a
/// question may take.
pub(super) fn wait_for_server(session: &Session, map: &MapName) -> Result<fht_proto::api::reply::Head, AskError> {
    let deadline = Instant::now() + TIMEOUT;
    loop {
        match ask_head(session, map, Duration::from_secs(1)) {
            Err(AskError::Silent) if Instant::now() < deadline => std::thread::sleep(Duration::from_millis(100)),
            outcome => return outcome,
        }
    }
}
