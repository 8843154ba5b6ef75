//! Fetching the library: the PyPI wheel `onnxruntime`, by the system's pip.
//!
//! What runs is the system's Python, isolated (`-I`) from the current folder, the user's packages
//! and `PYTHON*` variables, in a folder of its own. What it brings is taken only with the known
//! hash, the wheel's by pip and the library's when it is loaded.

use std::path::{Path, PathBuf};
use std::process::Command;

/// The version in the cache: the last one without telemetry. With a library from 1.29 on, set
/// `ORT_DISABLE_TELEMETRY=1`.
pub(super) const VERSION: &str = "1.28.0";
/// The library inside the wheel.
pub(super) const LIBRARY: &str = "libonnxruntime.so.1.28.0";

/// The wheel for one kind of machine.
#[derive(Clone, Copy)]
pub(super) struct Wheel {
    platform: &'static str,
    /// SHA-256 of the wheel, as PyPI states it.
    sha256: &'static str,
    /// BLAKE3 of the library inside.
    pub(super) library_blake3: &'static str,
}

/// The wheel for this machine; other machines use a system library.
pub(super) const WHEEL: Option<Wheel> = if cfg!(all(target_os = "linux", target_env = "gnu", target_arch = "x86_64")) {
    Some(Wheel {
        platform: "manylinux_2_28_x86_64",
        sha256: "a166b78ee04f3a37fa1ef82034b6a3ce96d9684e582d4d30b296de83e9998bb5",
        library_blake3: "a787c8f69bd3bbf075aef0ab6ee3ed2a0e7ded3ad2f0bd54baa190f55dbffc30",
    })
} else if cfg!(all(target_os = "linux", target_env = "gnu", target_arch = "aarch64")) {
    Some(Wheel {
        platform: "manylinux_2_28_aarch64",
        sha256: "8d66f9ceb29909c70839e4e4fb3435c7b490050d8f162bd5f3aba4ca01ee517f",
        library_blake3: "4a868db23848a007962802f2e252bb124d13763522739e6fa686d182ae39a840",
    })
} else {
    None
};

/// Fetches the wheel into the folder `work`, which is new and this process's own, and unpacks it.
/// Returns the library's path.
pub(super) fn fetch(work: &Path) -> Result<PathBuf, String> {
    let wheel = WHEEL.ok_or("no wheel is known for this kind of machine")?;
    let python = python()?;
    let requirements = work.join("requirements.txt");
    let wanted = format!("onnxruntime=={VERSION} --hash=sha256:{}\n", wheel.sha256);
    std::fs::write(&requirements, wanted).map_err(|error| format!("{}: {error}", requirements.display()))?;
    let mut pip = isolated(&python, work);
    pip.args(["-m", "pip", "download", "--quiet", "--disable-pip-version-check", "--no-deps", "--require-hashes"])
        .args(["--only-binary=:all:", "--platform", wheel.platform, "--python-version", "3.11", "--dest"])
        .arg(work)
        .arg("--requirement")
        .arg(&requirements);
    run(pip, "python3 -I -m pip download")?;
    let mut entries = std::fs::read_dir(work).map_err(|error| error.to_string())?.filter_map(Result::ok);
    let archive = entries
        .find(|entry| entry.path().extension().is_some_and(|ending| ending == "whl"))
        .ok_or("pip downloaded no wheel")?;
    let mut unzip = isolated(&python, work);
    unzip.args(["-m", "zipfile", "-e"]).arg(archive.path()).arg(work);
    run(unzip, "python3 -I -m zipfile")?;
    let library = work.join("onnxruntime").join("capi").join(LIBRARY);
    if library.is_file() { Ok(library) } else { Err(format!("the wheel has no {LIBRARY}")) }
}

/// The first `python3` of `PATH`, of its absolute folders only.
fn python() -> Result<PathBuf, String> {
    let path = std::env::var_os("PATH").unwrap_or_default();
    std::env::split_paths(&path)
        .filter(|folder| folder.is_absolute())
        .map(|folder| folder.join("python3"))
        .find(|python| python.is_file())
        .ok_or_else(|| "python3, which fetches it, is in no folder of PATH".to_owned())
}

fn isolated(python: &Path, work: &Path) -> Command {
    let mut command = Command::new(python);
    command.arg("-I").current_dir(work);
    command
}

fn run(mut command: Command, what: &str) -> Result<(), String> {
    let output = command.output().map_err(|error| format!("{what} cannot be run: {error}"))?;
    if output.status.success() {
        return Ok(());
    }
    let stderr = String::from_utf8_lossy(&output.stderr);
    let last = stderr.lines().last().unwrap_or_default();
    Err(format!("{what} failed: {last}"))
}
