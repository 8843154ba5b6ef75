//! The programs' arguments, progress bars and reports.

use super::config::{HandoffConfig, HandoffError};
use fht_proto::{MapName, SharedWorldName};
use fht_session::SessionConfig;
use indicatif::{MultiProgress, ProgressBar, ProgressStyle};
use serde::Deserialize;
use std::path::Path;
use std::time::Duration;
use tokio::runtime::Runtime;
use zenoh::Session;

/// A line for each program that shows what it is doing.
pub(super) struct Bars {
    /// Programs that run at once have lines of their own.
    lines: MultiProgress,
    are_shown: bool,
}

impl Bars {
    pub(super) fn new(config: &HandoffConfig) -> Self {
        Self { lines: MultiProgress::new(), are_shown: config.progress }
    }

    /// Tells something above the lines, or where these are not shown.
    pub(super) fn say(&self, text: &str) {
        self.lines.suspend(|| fht_program::tell_line!("handoff: {text}"));
    }

    /// A spinner for one program.
    pub(super) fn add(&self, program: String) -> ProgressBar {
        if !self.are_shown {
            return ProgressBar::hidden();
        }
        let bar = self.lines.add(ProgressBar::new_spinner().with_prefix(program));
        bar.enable_steady_tick(Duration::from_millis(120));
        match ProgressStyle::with_template("{spinner} {prefix:<10} {elapsed:>4}  {msg}") {
            Ok(style) => bar.with_style(style),
            Err(_) => bar,
        }
    }
}

/// A session with the demo's server, which lives no longer than the runtime.
pub(super) fn session(config: &HandoffConfig) -> Result<(Runtime, Session), HandoffError> {
    let runtime = fht_program::runtime(1)?;
    let link = SessionConfig::from_options(vec![config.endpoint.clone()], None);
    let session = runtime.block_on(fht_session::open(&link))?;
    Ok((runtime, session))
}

/// Reads the figures that a program wrote.
pub(super) fn read_report<T: for<'de> Deserialize<'de>>(path: &Path) -> Result<T, HandoffError> {
    let report_error = |reason: String| HandoffError::Report { path: path.to_owned(), reason };
    let text = std::fs::read_to_string(path).map_err(|error| report_error(error.to_string()))?;
    serde_json::from_str(&text).map_err(|error| report_error(error.to_string()))
}

/// The arguments that explorer and client share.
pub(super) fn world_args(
    config: &HandoffConfig,
    map: &MapName,
    report: &Path,
    shared: Option<&SharedWorldName>,
) -> Vec<std::ffi::OsString> {
    let mut args: Vec<std::ffi::OsString> = Vec::new();
    let mut add = |name: &str, value: &std::ffi::OsStr| args.extend([name.into(), value.to_owned()]);
    add("--world", config.world.as_ref());
    add("--map", map.as_str().as_ref());
    add("--connect", config.endpoint.as_ref());
    add("--world-seed", config.seed.to_string().as_ref());
    add("--report", report.as_os_str());
    add("--people", config.people.to_string().as_ref());
    if let Some(name) = shared {
        add("--shared-world", name.as_str().as_ref());
    }
    if let Some(textures) = &config.textures {
        add("--textures", textures.as_os_str());
    }
    if !config.fetch {
        args.push("--no-fetch".into());
    }
    args
}
