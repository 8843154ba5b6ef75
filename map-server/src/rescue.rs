//! What still reads of a store whose file is damaged, and backups in the place of stores.
//!
//! | module | idea |
//! | --- | --- |
//! | `leaf_scan` | increments out of the bytes of the file |
//! | `placement` | a finished store under its name, and whose it is |
//! | `rebuild` | a whole store of what was found |
//! | `report` | what was rescued, or why nothing was |
//! | `restore` | a backup in the place of a store |
//!
//! The file itself is never changed: it is looked at as a copy.

mod leaf_scan;
mod placement;
mod rebuild;
mod report;
mod restore;

pub use report::{RescueError, Rescued, RescuedAuthor};
pub use restore::{RestoreError, Restored, check_archive, check_archives, restore};

use crate::catalog::Catalog;
use crate::store::{DirectoryLock, FILE_NAME, RedbLog, StoreError};
use report::file_error;
use std::fs::File;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::mpsc;
use std::time::Duration;

/// Where the copy is looked at, in the target directory; with a number, where that is taken.
const COPY: &str = "examined";
/// Longest time that the copy's own order is followed, at least; and for each MiB. A damaged file
/// may lead in circles.
const PATIENCE: (Duration, Duration) = (Duration::from_secs(20), Duration::from_millis(200));

/// Is told of a directory that is made for a while, before anything is in it: who ends the program
/// meanwhile removes it.
pub type ForAWhile<'a> = &'a dyn Fn(&Path);

/// A directory of this program's own for a copy, which goes with it.
struct Scratch(PathBuf);

impl Scratch {
    /// A new one in `dir`, which is made if absent. What somebody else has there stays.
    fn new(dir: &Path, made: ForAWhile<'_>) -> Result<Self, RescueError> {
        std::fs::create_dir_all(dir).map_err(file_error(dir))?;
        let others = (2_u32..).map(|number| format!("{COPY}-{number}"));
        for name in std::iter::once(COPY.to_owned()).chain(others) {
            let path = dir.join(name);
            match std::fs::create_dir(&path) {
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
                outcome => {
                    outcome.map_err(file_error(&path))?;
                    made(&path);
                    return Ok(Self(path));
                }
            }
        }
        Err(RescueError::Occupied(dir.to_owned()))
    }

    fn path(&self) -> &Path {
        &self.0
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0); // it is of no more use
    }
}

/// The file of a store: in a directory, or itself. No server may have it open.
fn file_of(source: &Path) -> Result<PathBuf, RescueError> {
    let file = if source.is_dir() { source.join(FILE_NAME) } else { source.to_owned() };
    if !file.is_file() {
        return Err(RescueError::NoStore(source.to_owned()));
    }
    let dir = file.parent().unwrap_or(&file);
    if DirectoryLock::is_taken(dir) { Err(StoreError::InUse { dir: dir.to_owned() }.into()) } else { Ok(file) }
}

/// Copies everything that still reads of the store in `source`, a data directory or its file, into
/// a new one in the directory `target`. An undamaged store is copied as it is. Of a damaged one
/// each author's increments up to the last one that is lost become compacted ones without loss, in
/// which those that are lost have left nothing; so all others go on as they were. If nothing can be
/// read, no store is made.
///
/// # Errors
/// [`RescueError`].
pub fn rescue(source: &Path, target: &Path, made: ForAWhile<'_>) -> Result<Rescued, RescueError> {
    let file = file_of(source)?;
    if target.join(FILE_NAME).exists() {
        return Err(RescueError::Occupied(target.to_owned()));
    }
    let is_new = !target.exists();
    let copy = Scratch::new(target, made)?;
    let rescued = rescue_by(&file, copy.path(), target);
    drop(copy);
    if is_new && !target.join(FILE_NAME).exists() {
        let _ = std::fs::remove_dir(target); // nothing has come into it
    } else if is_new {
        placement::own_like(target, file.parent().unwrap_or(&file)).map_err(file_error(target))?;
    }
    rescued
}

fn rescue_by(file: &Path, copy: &Path, target: &Path) -> Result<Rescued, RescueError> {
    let damage = match examine(file, copy)? {
        Ok(heads) => {
            placement::put(&copy.join(FILE_NAME), &target.join(FILE_NAME), file)?;
            return Ok(Rescued { damage: None, authors: heads });
        }
        Err(damage) => damage,
    };
    let bytes = std::fs::read(file).map_err(file_error(file))?;
    let found = leaf_scan::scan(&bytes);
    drop(bytes);
    let authors = rebuild::counted(&found);
    if !authors.is_empty() {
        // Made beside, so that it is there as a whole or not at all.
        let rebuilt = copy.join("rebuilt");
        std::fs::create_dir(&rebuilt).map_err(file_error(&rebuilt))?;
        rebuild::write(found, &rebuilt)?;
        placement::put(&rebuilt.join(FILE_NAME), &target.join(FILE_NAME), file)?;
    }
    Ok(Rescued { damage: Some(damage), authors })
}

/// Looks at a store and says what a rescue would bring; nothing is written but a copy in a new
/// directory in `scratch`, which is removed.
///
/// # Errors
/// [`RescueError`].
pub fn check(source: &Path, scratch: &Path, made: ForAWhile<'_>) -> Result<Rescued, RescueError> {
    let file = file_of(source)?;
    let copy = Scratch::new(scratch, made)?;
    match examine(&file, copy.path())? {
        Ok(authors) => Ok(Rescued { damage: None, authors }),
        Err(damage) => {
            let bytes = std::fs::read(&file).map_err(file_error(&file))?;
            Ok(Rescued { damage: Some(damage), authors: rebuild::counted(&leaf_scan::scan(&bytes)) })
        }
    }
}

/// Whose increments the copy of the file `from` in `dir` holds. A file of which the storage library
/// mends only its own notes is whole: a server reads of it what it reads of the mended one.
fn look_at(from: &Path, dir: &Path) -> Result<Vec<RescuedAuthor>, StoreError> {
    let (log, is_clean) = RedbLog::open_checked(dir)?;
    let catalog = Catalog::load(&log)?;
    let authors = rebuild::of_catalog(&catalog, &log)?;
    if is_clean {
        return Ok(authors);
    }
    let served = dir.join("served");
    let failed = |error: std::io::Error| StoreError::Open { dir: served.clone(), reason: error.to_string() };
    std::fs::create_dir(&served).map_err(failed)?;
    std::fs::copy(from, served.join(FILE_NAME)).map_err(failed)?;
    let as_served = Catalog::load(&RedbLog::open(&served)?)?;
    let state = |catalog: &Catalog| -> Vec<_> {
        catalog.heads().iter().map(|head| (head.map.clone(), head.vector.clone(), head.digest)).collect()
    };
    if state(&as_served) == state(&catalog) {
        return Ok(authors);
    }
    Err(StoreError::Broken { file: from.to_owned(), reason: "its sums do not hold".to_owned() })
}

/// What a copy of the file in the directory `copy` holds, or what is wrong with it.
fn examine(file: &Path, copy: &Path) -> Result<Result<Vec<RescuedAuthor>, String>, RescueError> {
    let to = copy.join(FILE_NAME);
    // What cannot be read is the store, and not its copy.
    File::open(file).map_err(file_error(file))?;
    let length = std::fs::copy(file, &to).map_err(file_error(&to))?;
    let (report, answer) = mpsc::channel();
    let (from, dir) = (file.to_owned(), copy.to_owned());
    let look = move || {
        let _ = report.send(look_at(&from, &dir)); // nobody waits any more
    };
    let thread = std::thread::Builder::new().name("examine".to_owned()).spawn(look);
    thread.map_err(file_error(copy))?;
    let patience = PATIENCE.0 + PATIENCE.1 * u32::try_from(length >> 20).unwrap_or(u32::MAX);
    Ok(match answer.recv_timeout(patience) {
        Ok(Ok(authors)) => Ok(authors),
        Ok(Err(StoreError::Broken { reason, .. } | StoreError::Open { reason, .. })) => Err(reason),
        // What is said of the copy is said of the store.
        Ok(Err(error)) => Err(error.to_string().replace(&to.display().to_string(), &file.display().to_string())),
        Err(_) => Err(format!("it was not read within {} s", patience.as_secs())),
    })
}
