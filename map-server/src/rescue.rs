//! What still reads of a store whose file is damaged, and backups in the place of stores.
//!
//! | module | idea |
//! | --- | --- |
//! | `leaf_scan` | increments out of the bytes of the file |
//! | `rebuild` | a whole store of what was found |
//! | `report` | what was rescued, or why nothing was |
//! | `restore` | a backup in the place of a store |
//!
//! The file itself is never changed: it is looked at as a copy.

mod leaf_scan;
mod rebuild;
mod report;
mod restore;

pub use report::{RescueError, Rescued, RescuedAuthor};
pub use restore::{RestoreError, Restored, check_archive, check_archives, restore};

use crate::catalog::Catalog;
use crate::store::{FILE_NAME, LOCK_NAME, RedbLog, StoreError};
use report::file_error;
use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};
use std::sync::mpsc;
use std::time::Duration;

/// Where the copy is looked at, in the target directory.
const COPY: &str = "examined";
/// Longest time that the copy's own order is followed, at least; and for each MiB. A damaged file
/// may lead in circles.
const PATIENCE: (Duration, Duration) = (Duration::from_secs(20), Duration::from_millis(200));

/// The file of a store: in a directory, or itself. No server may have it open.
fn file_of(source: &Path) -> Result<PathBuf, RescueError> {
    let file = if source.is_dir() { source.join(FILE_NAME) } else { source.to_owned() };
    if !file.is_file() {
        return Err(RescueError::NoStore(source.to_owned()));
    }
    // Nothing is written: the disk may be full, or mounted for reading.
    let dir = file.parent().unwrap_or(&file);
    let is_used = File::open(dir.join(LOCK_NAME))
        .is_ok_and(|lock| matches!(lock.try_lock_shared(), Err(TryLockError::WouldBlock)));
    if is_used { Err(StoreError::InUse { dir: dir.to_owned() }.into()) } else { Ok(file) }
}

/// Copies everything that still reads of the store in `source`, a data directory or its file, into
/// a new one in the directory `target`. An undamaged store is copied as it is. Of a damaged one
/// each author's increments up to the last one that is lost become compacted ones without loss, in
/// which those that are lost have left nothing; so all others go on as they were.
///
/// # Errors
/// [`RescueError`].
pub fn rescue(source: &Path, target: &Path) -> Result<Rescued, RescueError> {
    let file = file_of(source)?;
    std::fs::create_dir_all(target).map_err(file_error(target))?;
    if target.join(FILE_NAME).exists() {
        return Err(RescueError::Occupied(target.to_owned()));
    }
    let copy = target.join(COPY);
    let outcome = rescue_by(&file, &copy, target);
    let _ = std::fs::remove_dir_all(&copy); // it is of no more use
    outcome
}

fn rescue_by(file: &Path, copy: &Path, target: &Path) -> Result<Rescued, RescueError> {
    let damage = match examine(file, copy)? {
        Ok(heads) => {
            let (from, to) = (copy.join(FILE_NAME), target.join(FILE_NAME));
            std::fs::rename(&from, &to).map_err(file_error(&to))?;
            return Ok(Rescued { damage: None, authors: heads });
        }
        Err(damage) => damage,
    };
    let bytes = std::fs::read(file).map_err(file_error(file))?;
    let found = leaf_scan::scan(&bytes);
    drop(bytes);
    let authors = rebuild::counted(&found);
    rebuild::write(found, target)?;
    Ok(Rescued { damage: Some(damage), authors })
}

/// Looks at a store and says what a rescue would bring; nothing is written but a copy in the
/// directory `scratch`, which is removed.
///
/// # Errors
/// [`RescueError`].
pub fn check(source: &Path, scratch: &Path) -> Result<Rescued, RescueError> {
    let file = file_of(source)?;
    let copy = scratch.join(COPY);
    let examined = examine(&file, &copy);
    let _ = std::fs::remove_dir_all(&copy); // it is of no more use
    match examined? {
        Ok(authors) => Ok(Rescued { damage: None, authors }),
        Err(damage) => {
            let bytes = std::fs::read(&file).map_err(file_error(&file))?;
            Ok(Rescued { damage: Some(damage), authors: rebuild::counted(&leaf_scan::scan(&bytes)) })
        }
    }
}

/// What a copy of the file holds, or what is wrong with it.
fn examine(file: &Path, copy: &Path) -> Result<Result<Vec<RescuedAuthor>, String>, RescueError> {
    std::fs::create_dir_all(copy).map_err(file_error(copy))?;
    let to = copy.join(FILE_NAME);
    let length = std::fs::copy(file, &to).map_err(file_error(&to))?;
    let (report, answer) = mpsc::channel();
    let dir = copy.to_owned();
    let look = move || {
        let outcome = RedbLog::open_checked(&dir).and_then(|log| Catalog::load(&log));
        let _ = report.send(outcome); // nobody waits any more
    };
    let thread = std::thread::Builder::new().name("examine".to_owned()).spawn(look);
    thread.map_err(file_error(copy))?;
    let patience = PATIENCE.0 + PATIENCE.1 * u32::try_from(length >> 20).unwrap_or(u32::MAX);
    Ok(match answer.recv_timeout(patience) {
        Ok(Ok(catalog)) => Ok(rebuild::of_catalog(&catalog)),
        Ok(Err(StoreError::Broken { reason, .. })) => Err(reason),
        // What is said of the copy is said of the store.
        Ok(Err(error)) => Err(error.to_string().replace(&to.display().to_string(), &file.display().to_string())),
        Err(_) => Err(format!("it was not read within {} s", patience.as_secs())),
    })
}
