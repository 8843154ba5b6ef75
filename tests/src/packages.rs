//! Packages from PyPI and npm, for tests with other people's programs.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// The command line client of Zenoh that people have.
const ZENOH_CLI: &str = "zenoh-cli==0.7.0";

/// Runs a command that must succeed.
///
/// # Panics
/// When it cannot be run or fails; the message has its output.
pub fn run(command: &mut Command) -> Output {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    assert!(output.status.success(), "{command:?}: {}", String::from_utf8_lossy(&output.stderr));
    output
}

/// Holds `of`, a file or a folder, against whoever else prepares it: tests run beside each other.
fn lock(of: &Path) -> File {
    let locked = File::open(of).and_then(|file| file.lock().map(|()| file));
    locked.unwrap_or_else(|error| panic!("{}: {error}", of.display()))
}

/// The `bin` folder of a virtual environment with `packages`, made once in `folder`.
///
/// # Panics
/// When it cannot be made.
#[must_use]
pub fn environment(folder: &Path, packages: &[&str]) -> PathBuf {
    if let Err(error) = std::fs::create_dir_all(folder) {
        panic!("{}: {error}", folder.display());
    }
    let _alone = lock(folder);
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

/// The program `zenoh` of PyPI's zenoh-cli, installed once for all tests; `temporary` is their
/// folder (`CARGO_TARGET_TMPDIR`).
///
/// # Panics
/// When it cannot be installed.
#[must_use]
pub fn zenoh_cli(temporary: &str) -> PathBuf {
    environment(&Path::new(temporary).join("zenoh-cli"), &[ZENOH_CLI]).join("zenoh")
}

/// Installs what `package-lock.json` of `folder` names, once.
///
/// # Panics
/// When it cannot be installed, for instance without npm (`apt-get install -y nodejs npm`).
pub fn node_packages(folder: &Path) {
    let _alone = lock(&folder.join("package.json"));
    // npm writes it last.
    if !folder.join("node_modules/.package-lock.json").exists() {
        run(Command::new("npm").arg("ci").current_dir(folder));
    }
}
