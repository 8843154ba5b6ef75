//! Finding the ONNX Runtime library without the user's help: `ORT_DYLIB_PATH`, then the system,
//! then a cache that is filled once from the PyPI wheel `onnxruntime`.

use ort::environment::Environment;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Mutex, OnceLock, PoisonError};

/// The version in the cache: the last one without telemetry. With a library from 1.29 on, set
/// `ORT_DISABLE_TELEMETRY=1`.
const VERSION: &str = "1.28.0";
/// The library inside the wheel.
const LIBRARY: &str = "libonnxruntime.so.1.28.0";

/// The wheel for one kind of machine, and the BLAKE3 hash of the library inside.
struct Wheel {
    platform: &'static str,
    library_blake3: &'static str,
}

/// The wheel for this machine; other machines use a system library.
const WHEEL: Option<Wheel> = if cfg!(all(target_os = "linux", target_env = "gnu", target_arch = "x86_64")) {
    Some(Wheel {
        platform: "manylinux_2_28_x86_64",
        library_blake3: "a787c8f69bd3bbf075aef0ab6ee3ed2a0e7ded3ad2f0bd54baa190f55dbffc30",
    })
} else if cfg!(all(target_os = "linux", target_env = "gnu", target_arch = "aarch64")) {
    Some(Wheel {
        platform: "manylinux_2_28_aarch64",
        library_blake3: "4a868db23848a007962802f2e252bb124d13763522739e6fa686d182ae39a840",
    })
} else {
    None
};

/// Why there is no ONNX Runtime.
#[derive(Clone, Debug, thiserror::Error)]
#[error(
    "the ONNX Runtime library was not found ({reason}); install it (pip download onnxruntime=={VERSION} and unpack \
     {LIBRARY}, or a system package) and set ORT_DYLIB_PATH to its path"
)]
pub struct RuntimeError {
    reason: String,
}

/// The process's ONNX Runtime. The first call loads it.
///
/// # Errors
/// [`RuntimeError`] says what was tried and what to do.
pub(crate) fn environment() -> Result<&'static Environment, RuntimeError> {
    static ENVIRONMENT: OnceLock<Environment> = OnceLock::new();
    static LOADING: Mutex<()> = Mutex::new(());
    // A process may have only one environment, so two threads must not try at once.
    let _guard = LOADING.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(environment) = ENVIRONMENT.get() {
        return Ok(environment);
    }
    let loaded = load()?;
    Ok(ENVIRONMENT.get_or_init(|| loaded))
}

fn load() -> Result<Environment, RuntimeError> {
    let mut reasons = Vec::new();
    let mut attempt = |path: &Path| match try_load(path) {
        Ok(environment) => Some(environment),
        Err(reason) => {
            reasons.push(format!("{}: {reason}", path.display()));
            None
        }
    };
    if let Some(path) = std::env::var_os("ORT_DYLIB_PATH").filter(|path| !path.is_empty()) {
        // The library that the user asks for is used or rejected, never silently replaced.
        let path = PathBuf::from(path);
        return attempt(&path).ok_or_else(|| RuntimeError { reason: reasons.join("; ") });
    }
    for path in system_libraries() {
        if let Some(environment) = attempt(&path) {
            return Ok(environment);
        }
    }
    match cached_library() {
        Ok(path) => attempt(&path).ok_or_else(|| RuntimeError { reason: reasons.join("; ") }),
        Err(reason) => {
            reasons.push(reason);
            Err(RuntimeError { reason: reasons.join("; ") })
        }
    }
}

fn try_load(path: &Path) -> Result<Environment, String> {
    if !path.is_file() {
        return Err("no such file".to_owned());
    }
    let builder = ort::init_from(path).map_err(|error| error.to_string())?;
    // Libraries from 1.29 on have telemetry; this disables what the interface can disable.
    builder.with_name("fht").with_telemetry(false).build().map_err(|error| error.to_string())
}

/// ONNX Runtime libraries in the places where the system's linker looks, newest name first.
fn system_libraries() -> Vec<PathBuf> {
    let listed = std::env::var_os("LD_LIBRARY_PATH").unwrap_or_default();
    let arch = std::env::consts::ARCH;
    let fixed = ["/usr/local/lib", "/usr/lib", "/usr/lib64", "/opt/homebrew/lib"].map(PathBuf::from);
    let multiarch = PathBuf::from(format!("/usr/lib/{arch}-linux-gnu"));
    let mut found = Vec::new();
    for folder in std::env::split_paths(&listed).chain(fixed).chain([multiarch]) {
        let Ok(entries) = std::fs::read_dir(&folder) else { continue };
        let is_library = |name: &OsString| {
            let name = name.to_string_lossy();
            name.starts_with("libonnxruntime.so") || name == "libonnxruntime.dylib"
        };
        let mut names: Vec<OsString> =
            entries.filter_map(|entry| Some(entry.ok()?.file_name())).filter(is_library).collect();
        names.sort_by(|a, b| b.cmp(a));
        found.extend(names.into_iter().map(|name| folder.join(name)));
    }
    found
}

/// The library in the user's cache; it is fetched if it is not there yet.
fn cached_library() -> Result<PathBuf, String> {
    let wheel = WHEEL.ok_or("no wheel is known for this kind of machine")?;
    let base = std::env::var_os("XDG_CACHE_HOME")
        .map(PathBuf::from)
        .or_else(|| std::env::var_os("HOME").map(|home| PathBuf::from(home).join(".cache")))
        .ok_or("there is neither XDG_CACHE_HOME nor HOME")?;
    let folder = base.join("fht-map").join(format!("onnxruntime-{VERSION}"));
    let library = folder.join(LIBRARY);
    if library.is_file() {
        return Ok(library);
    }
    tracing::info!("fetching onnxruntime {VERSION} from PyPI into {}", folder.display());
    let io_error = |error: std::io::Error| format!("{}: {error}", folder.display());
    std::fs::create_dir_all(&folder).map_err(io_error)?;
    // Several processes may fetch at once: each uses its own folder, and the rename is atomic.
    let work = folder.join(format!("fetch-{}", std::process::id()));
    std::fs::create_dir_all(&work).map_err(io_error)?;
    let fetched = fetch(&wheel, &work).and_then(|path| std::fs::rename(path, &library).map_err(io_error));
    // Leftovers only cost space.
    let _ = std::fs::remove_dir_all(&work);
    fetched.map(|()| library)
}

fn fetch(wheel: &Wheel, work: &Path) -> Result<PathBuf, String> {
    let mut pip = Command::new("python3");
    pip.args(["-m", "pip", "download", "--quiet", "--disable-pip-version-check", "--no-deps"])
        .args(["--only-binary=:all:", "--platform", wheel.platform, "--python-version", "3.11", "--dest"])
        .arg(work)
        .arg(format!("onnxruntime=={VERSION}"));
    run(pip, "python3 -m pip download")?;
    let mut entries = std::fs::read_dir(work).map_err(|error| error.to_string())?.filter_map(Result::ok);
    let archive = entries
        .find(|entry| entry.path().extension().is_some_and(|ending| ending == "whl"))
        .ok_or("pip downloaded no wheel")?;
    let mut unzip = Command::new("python3");
    unzip.args(["-m", "zipfile", "-e"]).arg(archive.path()).arg(work);
    run(unzip, "python3 -m zipfile")?;
    let library = work.join("onnxruntime").join("capi").join(LIBRARY);
    let bytes = std::fs::read(&library).map_err(|error| format!("the wheel has no {LIBRARY}: {error}"))?;
    let hash = blake3::hash(&bytes).to_hex();
    if hash.as_str() != wheel.library_blake3 {
        return Err(format!("{LIBRARY} from the wheel has the hash {hash}, expected {}", wheel.library_blake3));
    }
    Ok(library)
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
