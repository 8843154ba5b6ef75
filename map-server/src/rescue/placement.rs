//! A finished store under its name: in one step, and for whoever is to open it.

use crate::rescue::report::{RescueError, file_error};
use crate::store::LOCK_NAME;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// Puts `new` under the name `file`, where it is durable. It is whose `model` is, with the same
/// rights; without a model, whose the directory is: a server runs under an account of its own, and
/// whoever puts things right, as root.
pub(super) fn put(new: &Path, file: &Path, model: &Path) -> Result<(), RescueError> {
    sync(new)?;
    let dir = file.parent().unwrap_or(file);
    let is_of = if model.exists() {
        own_like(new, model).map_err(file_error(new))?;
        model
    } else {
        give(new, dir);
        dir
    };
    std::fs::rename(new, file).map_err(file_error(file))?;
    give(&dir.join(LOCK_NAME), is_of);
    sync(dir)
}

fn sync(path: &Path) -> Result<(), RescueError> {
    File::open(path).and_then(|open| open.sync_all()).map_err(file_error(path))
}

/// Makes `path` whose `model` is, with the same rights.
pub(super) fn own_like(path: &Path, model: &Path) -> std::io::Result<()> {
    std::fs::set_permissions(path, std::fs::metadata(model)?.permissions())?;
    give(path, model);
    Ok(())
}

/// Makes `path` whose `model` is, if it is somebody else's. Only root can give something away.
#[cfg(unix)]
fn give(path: &Path, model: &Path) {
    use std::os::unix::fs::{MetadataExt, chown};
    let owner = |path: &Path| std::fs::metadata(path).map(|of| (of.uid(), of.gid()));
    let (Ok(own), Ok((user, group))) = (owner(path), owner(model)) else { return };
    if own != (user, group)
        && let Err(error) = chown(path, Some(user), Some(group))
    {
        tracing::warn!(
            "{} belongs to user {} now, and not to user {user} like {}: a server that runs as {user} may not open it ({error})",
            path.display(),
            own.0,
            model.display()
        );
    }
}

#[cfg(not(unix))]
fn give(_: &Path, _: &Path) {}

/// Puts `new` in the place of `file`, and returns under which name that is kept.
pub(super) fn replace(new: &Path, file: &Path) -> Result<Option<PathBuf>, RescueError> {
    // Before anything is moved.
    sync(new)?;
    let kept = if file.try_exists().map_err(file_error(file))? {
        let kept = free_name(file);
        // A second name for the old file: the new one takes its place in one step. Where a file has
        // one name only, it is moved.
        if std::fs::hard_link(file, &kept).is_err() {
            std::fs::rename(file, &kept).map_err(file_error(&kept))?;
        }
        Some(kept)
    } else {
        None
    };
    put(new, file, kept.as_deref().unwrap_or(file))?;
    Ok(kept)
}

/// The file's name with the time, and a number if that is taken.
fn free_name(file: &Path) -> PathBuf {
    let time = humantime::format_rfc3339_seconds(SystemTime::now()).to_string().replace(':', "-");
    let name = |suffix: String| {
        let mut name = file.as_os_str().to_owned();
        name.push(format!(".replaced-{time}{suffix}"));
        PathBuf::from(name)
    };
    let others = (2_u32..).map(|number| name(format!("-{number}")));
    std::iter::once(name(String::new()))
        .chain(others)
        .find(|path| !path.exists())
        .unwrap_or_else(|| name(String::new()))
}
