//! What all evaluations print, show and write.

use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Where figures go.
#[derive(Debug, Default, Args)]
pub struct OutputArgs {
    /// Write the figures to this file.
    #[arg(long, value_name = "FILE", value_parser = fht_program::flags::output_file)]
    json: Option<PathBuf>,
    /// No progress bar.
    #[arg(long, short)]
    quiet: bool,
}

impl OutputArgs {
    /// The file that was asked for, if one was.
    pub fn file(&self) -> Option<&PathBuf> {
        self.json.as_ref()
    }

    /// Writes the figures to the file, if one was asked for.
    pub fn write<T: Serialize + ?Sized>(&self, figures: &T) -> Result<(), String> {
        let Some(path) = &self.json else { return Ok(()) };
        let json = serde_json::to_string_pretty(figures).map_err(|error| error.to_string())?;
        write_file(path, &json)
    }

    /// A progress bar over `count` steps, drawn as `template` says.
    pub fn progress_bar(&self, count: u64, template: &str) -> ProgressBar {
        if self.quiet {
            return ProgressBar::hidden();
        }
        let style = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
        ProgressBar::new(count).with_style(style)
    }
}

/// Writes a file.
pub fn write_file(path: &Path, text: &str) -> Result<(), String> {
    std::fs::write(path, text).map_err(|error| format!("{} cannot be written: {error}", path.display()))
}

/// Prints a line.
pub fn say(line: &str) -> Result<(), String> {
    writeln!(io::stdout(), "{line}").map_err(|error| format!("the figures cannot be printed: {error}"))
}

/// An empty cell of a table.
pub fn none() -> String {
    "–".to_owned()
}

/// A finite number with its decimals, or an empty cell.
pub fn number(value: f64, decimals: usize) -> String {
    if value.is_finite() { format!("{value:.decimals$}") } else { none() }
}
