//! The fleet's server: a map-server, with a bare queryable on the same session that answers at once
//! with as many bytes as it is asked for.

use map_server::{ServerConfig, ServerEndpoints, ServerError};
use std::path::PathBuf;
use zenoh::Wait;
use zenoh::bytes::Encoding;
use zenoh::query::Query;

/// The key of the bare queryable.
pub const BARE_KEY: &str = "fleet/bare";
/// Longest bare answer, bytes.
const MAX_BARE_BYTES: usize = 1 << 20;

/// The question for a bare answer of `bytes`.
#[must_use]
pub fn bare_selector(bytes: usize) -> String {
    format!("{BARE_KEY}?bytes={bytes}")
}

fn answer(query: &Query) {
    let bytes = query.parameters().get("bytes").and_then(|bytes| bytes.parse::<usize>().ok()).unwrap_or(0);
    let payload = vec![b'.'; bytes.min(MAX_BARE_BYTES)];
    // The client may be gone.
    let _ = query.reply(BARE_KEY, payload).encoding(Encoding::APPLICATION_JSON).wait();
}

/// Runs until SIGTERM or Ctrl-C.
///
/// # Errors
/// [`ServerError`].
pub fn serve(data: PathBuf, endpoint: String, zenoh_config: PathBuf) -> Result<(), ServerError> {
    let zenoh_config = Some(zenoh_config);
    let link = ServerEndpoints { listen: vec![endpoint], zenoh_config, ..ServerEndpoints::default() };
    map_server::serve_until_signal(ServerConfig::new(data, link), |session| {
        session.declare_queryable(BARE_KEY).callback(|query| answer(&query)).wait()
    })
}
