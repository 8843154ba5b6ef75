//! The fleet's server: a map-server, and on the same session a bare queryable that answers at once with as many bytes as it is
//! asked for.

use map_server::config::LinkConfig;
use map_server::{ServerConfig, ServerError};
use std::path::PathBuf;
use zenoh::Wait;
use zenoh::bytes::Encoding;
use zenoh::query::Query;

/// Where the bare queryable answers.
pub const BARE_KEY: &str = "fleet/bare";
/// Longest bare answer, bytes.
const MAX_BARE_BYTES: usize = 1 << 20;

/// What a client asks for a bare answer of so many bytes.
#[must_use]
pub fn bare_selector(bytes: usize) -> String {
    format!("{BARE_KEY}?bytes={bytes}")
}

fn answer(query: &Query) {
    let bytes = query.parameters().get("bytes").and_then(|bytes| bytes.parse::<usize>().ok()).unwrap_or(0);
    let payload = vec![b'.'; bytes.min(MAX_BARE_BYTES)];
    // Who asked may be gone.
    let _ = query.reply(BARE_KEY, payload).encoding(Encoding::APPLICATION_JSON).wait();
}

/// Runs until it is told to end.
///
/// # Errors
/// [`ServerError`].
pub fn serve(data: PathBuf, endpoint: String) -> Result<(), ServerError> {
    let link = LinkConfig { listen: vec![endpoint], ..LinkConfig::default() };
    map_server::cli::serve(ServerConfig::new(data, link), |session| {
        session.declare_queryable(BARE_KEY).callback(|query| answer(&query)).wait()
    })
}
