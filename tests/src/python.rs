//! Python packages from PyPI, for tests with other people's programs.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Runs a command that has to succeed.
///
/// # Panics
/// When it cannot be run or fails, with what it said.
pub fn run(command: &mut Command) -> Output {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    assert!(output.status.success(), "{command:?}: {}", String::from_utf8_lossy(&output.stderr));
    output
}

/// The folder of the commands of a virtual environment with `packages`, made once in `folder`.
///
/// # Panics
/// When it cannot be made.
#[must_use]
pub fn environment(folder: &Path, packages: &[&str]) -> PathBuf {
    let commands = folder.join("bin");
    // Written last: an environment whose making was interrupted is made again.
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
