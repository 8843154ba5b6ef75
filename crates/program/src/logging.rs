//! Logs on standard error. They are quiet unless `RUST_LOG` says otherwise.

use tracing_subscriber::EnvFilter;

/// What a robot logs: errors, and why it waits for a server.
pub const ROBOT: &str = "error,fht_session=warn";

/// What `RUST_LOG` says, else `default`.
#[must_use]
pub fn filter(default: &str) -> EnvFilter {
    EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(default))
}

/// Sets up logs, as `RUST_LOG` says, else as `default`. A process that has a subscriber already
/// keeps it.
pub fn init(default: &str) {
    let _ = tracing_subscriber::fmt().with_env_filter(filter(default)).with_writer(std::io::stderr).try_init();
}
