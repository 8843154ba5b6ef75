//! Logs on standard error. They are quiet unless `RUST_LOG` says otherwise, have colours only on a
//! terminal (and not with `NO_COLOR`), and name no place in the source of libraries.

use fht_session::without_source_paths;
use std::io::{IsTerminal, Write};
use tracing::Subscriber;
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::registry::LookupSpan;
use tracing_subscriber::util::SubscriberInitExt;
use tracing_subscriber::{EnvFilter, Layer};

/// What a robot logs: errors, why it waits for a server, that its map ends, what is wrong with its
/// sensors, and what a simulated world lacks.
pub const ROBOT: &str =
    "error,fht_session=warn,fht_client::notice=warn,mapper::notice=warn,fht_sim=warn,fht_ros_robot=warn";

/// What `RUST_LOG` says, else `default`.
fn filter(default: &str) -> EnvFilter {
    EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(default))
}

/// Whether standard error takes colours.
fn has_colours() -> bool {
    std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty())
}

/// Logs as `RUST_LOG` says, else as `default`: for a program that watches its own logs, too.
pub fn lines<S>(default: &str) -> impl Layer<S> + Send + Sync + 'static
where
    S: Subscriber + for<'a> LookupSpan<'a>,
{
    let lines = tracing_subscriber::fmt::layer().with_ansi(has_colours()).with_writer(|| Plain);
    // What the layer has to say of a line that is lost could not be written either.
    lines.log_internal_errors(false).with_filter(filter(default))
}

/// Sets up logs, as `RUST_LOG` says, else as `default`. A process that has a subscriber already
/// keeps it.
pub fn init(default: &str) {
    let _ = tracing_subscriber::registry().with(lines(default)).try_init();
}

/// Standard error, without places in the source.
struct Plain;

impl Write for Plain {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        // Each line comes whole.
        let text = String::from_utf8_lossy(bytes);
        std::io::stderr().lock().write_all(without_source_paths(&text).as_bytes())?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        std::io::stderr().flush()
    }
}
