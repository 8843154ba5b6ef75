//! Finding the ONNX Runtime library without the user's help: `ORT_DYLIB_PATH`, then the system,
//! then a cache that is filled once from the PyPI wheel `onnxruntime`.
//!
//! A library that the user or the system provides is theirs to vouch for. The one in the cache is
//! checked against its hash each time, and exactly the bytes that were checked are loaded.
//!
//! | module | idea |
//! | --- | --- |
//! | `cache` | the library in the user's cache |
//! | `wheel` | fetching it from PyPI |
//! | `checked` | a library whose hash is known, as a file that nobody can change |

mod cache;
mod checked;
mod wheel;

pub use cache::Fetching;

use ort::environment::Environment;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, OnceLock, PoisonError};
use wheel::{LIBRARY, VERSION};

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
pub(crate) fn environment(fetching: Fetching) -> Result<&'static Environment, RuntimeError> {
    static ENVIRONMENT: OnceLock<Environment> = OnceLock::new();
    static LOADING: Mutex<()> = Mutex::new(());
    // A process may have only one environment, so two threads must not try at once.
    let _guard = LOADING.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(environment) = ENVIRONMENT.get() {
        return Ok(environment);
    }
    let loaded = load(fetching.in_this_environment())?;
    Ok(ENVIRONMENT.get_or_init(|| loaded))
}

fn load(fetching: Fetching) -> Result<Environment, RuntimeError> {
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
    load_cached(fetching).map_err(|reason| {
        reasons.push(reason);
        RuntimeError { reason: reasons.join("; ") }
    })
}

fn load_cached(fetching: Fetching) -> Result<Environment, String> {
    let library = cache::library(fetching)?;
    let path = library.loadable();
    build(&path).map_err(|reason| format!("{}: {reason}", library.path().display()))
}

fn try_load(path: &Path) -> Result<Environment, String> {
    if !path.is_file() {
        return Err("no such file".to_owned());
    }
    build(path)
}

fn build(library: &Path) -> Result<Environment, String> {
    let builder = ort::init_from(library).map_err(|error| error.to_string())?;
    // Libraries from 1.29 on have telemetry; this disables what the interface can disable.
    builder.with_name("fht").with_telemetry(false).build().map_err(|error| error.to_string())
}

/// ONNX Runtime libraries in the places where the system's linker looks, newest name first. A
/// place that is not absolute is wherever the program happens to be started, and is left out.
fn system_libraries() -> Vec<PathBuf> {
    let listed = std::env::var_os("LD_LIBRARY_PATH").unwrap_or_default();
    let arch = std::env::consts::ARCH;
    let fixed = ["/usr/local/lib", "/usr/lib", "/usr/lib64", "/opt/homebrew/lib"].map(PathBuf::from);
    let multiarch = PathBuf::from(format!("/usr/lib/{arch}-linux-gnu"));
    let mut found = Vec::new();
    for folder in std::env::split_paths(&listed).chain(fixed).chain([multiarch]).filter(|folder| folder.is_absolute()) {
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
