//! The library in the user's cache, fetched if it is not there yet.

use super::checked::CheckedLibrary;
use super::wheel::{self, LIBRARY, VERSION, WHEEL};
use std::path::{Path, PathBuf};

/// Forbids fetching, whatever a program's flags say, if it is set to anything but `0`.
const NO_FETCH: &str = "FHT_NO_FETCH";

/// What may be done about a library that is not there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Fetching {
    /// It is fetched from PyPI, by `python3 -m pip` (default). Only the library whose hash this
    /// crate knows is taken. The environment variable `FHT_NO_FETCH=1` forbids it all the same.
    #[default]
    Allowed,
    /// No process is started and nothing is fetched.
    Never,
}

impl Fetching {
    pub(super) fn in_this_environment(self) -> Self {
        match std::env::var_os(NO_FETCH) {
            Some(value) if !value.is_empty() && value != "0" => Self::Never,
            _ => self,
        }
    }
}

/// The library in the cache, checked.
pub(super) fn library(fetching: Fetching) -> Result<CheckedLibrary, String> {
    let wheel = WHEEL.ok_or("no wheel is known for this kind of machine")?;
    let folder = folder()?;
    let library = folder.join(LIBRARY);
    if !library.is_file() {
        if fetching == Fetching::Never {
            return Err(format!("{} is not there, and --no-fetch forbids fetching it", library.display()));
        }
        fill(&folder, &library)?;
    }
    CheckedLibrary::open(library, wheel.library_blake3)
}

/// The folder of the cache. Paths that are not absolute do not count, as the XDG specification has
/// it: they would be wherever the program is started.
fn folder() -> Result<PathBuf, String> {
    let named = |name: &str| std::env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
    let base = named("XDG_CACHE_HOME")
        .or_else(|| named("HOME").map(|home| home.join(".cache")))
        .ok_or("neither XDG_CACHE_HOME nor HOME names a folder for the cache")?;
    Ok(base.join("fht-map").join(format!("onnxruntime-{VERSION}")))
}

fn fill(folder: &Path, library: &Path) -> Result<(), String> {
    tracing::info!("fetching onnxruntime {VERSION} from PyPI into {}; --no-fetch forbids it", folder.display());
    let io_error = |error: std::io::Error| format!("{}: {error}", folder.display());
    std::fs::create_dir_all(folder).map_err(io_error)?;
    // Several processes may fetch at once: each uses a folder of its own, and the rename is atomic.
    let work = tempfile::Builder::new().prefix("fetch-").tempdir_in(folder).map_err(io_error)?;
    let fetched = wheel::fetch(work.path())?;
    std::fs::rename(fetched, library).map_err(io_error)
}
