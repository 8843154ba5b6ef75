//! Python packages from PyPI, for tests with other people's programs.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// The command line client of Zenoh that people have.
pub const ZENOH_CLI: &str = "zenoh-cli==0.7.0";

/// Runs a command that must succeed.
///
/// # Panics
/// When it cannot be run or fails; the message has its output.
pub fn run(command: &mut Command) -> Output {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    assert!(output.status.success(), "{command:?}: {}", String::from_utf8_lossy(&output.stderr));
    output
}

/// The `bin` folder of a virtual environment with `packages`, made once in `folder`.
///
/// # Panics
/// When it cannot be made.
#[must_use]
pub fn environment(folder: &Path, packages: &[&str]) -> PathBuf {
    let commands = folder.join("bin");
    // Written last: an environment that was interrupted while being made is made again.
    let done = folder.join("packages.txt");
    if std::fs::read_to_string(&done).is_ok_and(|made| made == packages.join("\n")) {
        return commands;
    }
    run(Command::new("python3").args(["-m", "venv", "--clear"]).arg(folder));
    let pip = commands.join("pip");
    run(Command::new(pip).args(["install", "--quiet", "--disable-pip-version-check"]).args(packages));
    if let Err(error) = std::fs::write(&done, packages.join("\n")) {
        panic!("{}: {error}", done.display());
    }
    commands
}
