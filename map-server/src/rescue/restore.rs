//! A backup in the place of a store: a copy of a data directory, or exported maps.
//!
//! Everything is made and checked beside the store; what takes the store's place is one file under
//! one name, so that a restore which is cut off has either happened or not.

use crate::catalog::Catalog;
use crate::config::Limits;
use crate::ingest::Ingest;
use crate::rescue::placement::replace;
use crate::rescue::report::{RescueError, RescuedAuthor, file_error};
use crate::rescue::{ForAWhile, Scratch, examine, file_of, rebuild};
use crate::store::{DirectoryLock, FILE_NAME, IncrementLog, MemoryLog, RedbLog, StoreError};
use fht_proto::api::reply::ErrorReply;
use fht_proto::codec::archive::{Archive, ArchiveError};
use fht_proto::{AuthorId, Digest, MapName};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// How the names of exported maps end.
const ARCHIVE: &str = "fht";
/// What the names of stores contain, also of those that were replaced.
const STORE: &str = ".redb";
/// How the files of stores begin: with redb's magic number.
const STORE_BEGINS: &[u8] = b"redb\x1A\x0A\xA9\x0D\x0A";

/// What a restore has done.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Restored {
    /// The store's file.
    pub file: PathBuf,
    /// Where the file is that was replaced; none if there was none.
    pub replaced: Option<PathBuf>,
    /// What the store has, by map and author.
    pub authors: Vec<RescuedAuthor>,
}

/// Why nothing was restored. The store is as it was.
#[derive(Debug, thiserror::Error)]
pub enum RestoreError {
    /// There is nothing to restore from.
    #[error(
        "{}: this is no backup: neither a data directory ({FILE_NAME}), nor an exported map (*.{ARCHIVE}), nor a folder \
         of exported maps", .0.display()
    )]
    NoBackup(PathBuf),
    /// The backup is the store.
    #[error("{} is the store itself: give the backup", .0.display())]
    Itself(PathBuf),
    /// The backup is damaged.
    #[error("the backup {} is damaged: {reason}. Nothing was changed; `map-server rescue` copies what still reads", file.display())]
    Damaged {
        /// The backup.
        file: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// An exported map is damaged.
    #[error("{}: {source}", file.display())]
    Archive {
        /// The file.
        file: PathBuf,
        /// What is wrong.
        source: ArchiveError,
    },
    /// Two exported maps of one name.
    #[error("{} and {}: both are of map {map}: take one of them away", first.display(), file.display())]
    Twice {
        /// The first file.
        first: PathBuf,
        /// The second file.
        file: PathBuf,
        /// The map.
        map: MapName,
    },
    /// What an exported map holds is not taken in.
    #[error("{}: {reply}", file.display())]
    Refused {
        /// The file.
        file: PathBuf,
        /// Why.
        reply: ErrorReply,
    },
    /// An exported map does not add up.
    #[error("{}: the map is not what the file says it is: digest {found} instead of {expected}", file.display())]
    Digest {
        /// The file.
        file: PathBuf,
        /// Of what is in it.
        found: Digest,
        /// Of what should be.
        expected: Digest,
    },
    /// An exported map does not consist of what its first line says.
    #[error(
        "{}: the map is not what the vector in its first line says: {found} increments of author {author} instead of \
         {expected}", file.display()
    )]
    Vector {
        /// The file.
        file: PathBuf,
        /// The first author of whom there is another number.
        author: AuthorId,
        /// So many are in the file.
        found: u64,
        /// So many should be.
        expected: u64,
    },
    /// The system refuses, or a file is none.
    #[error(transparent)]
    Rescue(#[from] RescueError),
    /// A server runs on the backup, and may change it meanwhile.
    #[error(
        "a map-server runs on {}: end it first, or restore what `map-server export` writes of its maps", .0.display()
    )]
    BackupInUse(PathBuf),
    /// A server runs on the store.
    #[error("a map-server runs on {}: end it first, and start it again after the restore", .0.display())]
    InUse(PathBuf),
    /// The store cannot be written.
    #[error(transparent)]
    Store(StoreError),
}

impl RestoreError {
    /// Whether what was given is wrong, and would fail again.
    #[must_use]
    pub fn is_input(&self) -> bool {
        match self {
            Self::Rescue(error) => error.is_input(),
            Self::BackupInUse(_) | Self::InUse(_) | Self::Store(_) => false,
            _ => true,
        }
    }
}

impl From<StoreError> for RestoreError {
    fn from(error: StoreError) -> Self {
        match error {
            StoreError::InUse { dir } => Self::InUse(dir),
            other => Self::Store(other),
        }
    }
}

/// What a backup is.
enum Backup {
    /// The file of a store.
    Store(PathBuf),
    /// Exported maps.
    Archives(Vec<PathBuf>),
}

impl Backup {
    fn find(backup: &Path) -> Result<Self, RestoreError> {
        let is_archive = |path: &Path| path.is_file() && path.extension().is_some_and(|ending| ending == ARCHIVE);
        if is_archive(backup) {
            return Ok(Self::Archives(vec![backup.to_owned()]));
        }
        let mut archives = Vec::new();
        if backup.is_dir() {
            let entries = std::fs::read_dir(backup).map_err(file_error(backup))?;
            let paths = entries.map(|entry| entry.map(|entry| entry.path())).collect::<Result<Vec<_>, _>>();
            archives = paths.map_err(file_error(backup))?;
            archives.retain(|path| is_archive(path));
            archives.sort();
        }
        match file_of(backup) {
            Ok(file) if may_be_store(&file)? => {
                if !archives.is_empty() {
                    // As a server that is started on this folder does.
                    tracing::warn!(
                        "{}: there is both a store and {} exported maps (*.{ARCHIVE}): {} is taken, and those are not; \
                         to take those, give one of them, or put them into a folder of their own",
                        backup.display(),
                        archives.len(),
                        file.display()
                    );
                }
                return Ok(Self::Store(file));
            }
            Ok(_) => return Err(RestoreError::NoBackup(backup.to_owned())),
            Err(RescueError::Store(StoreError::InUse { dir })) => return Err(RestoreError::BackupInUse(dir)),
            // Not a store, but maybe a folder of exported maps.
            Err(_) => {}
        }
        if archives.is_empty() { Err(RestoreError::NoBackup(backup.to_owned())) } else { Ok(Self::Archives(archives)) }
    }
}

/// Whether a file may be a store: by its name, since its beginning may be damaged, or by that.
fn may_be_store(file: &Path) -> Result<bool, RestoreError> {
    if file.file_name().is_some_and(|name| name.to_string_lossy().contains(STORE)) {
        return Ok(true);
    }
    let mut begin = Vec::new();
    let open = File::open(file).map_err(file_error(file))?;
    open.take(STORE_BEGINS.len() as u64).read_to_end(&mut begin).map_err(file_error(file))?;
    Ok(begin == STORE_BEGINS)
}

/// Puts what `backup` holds in the place of the store in `dir`, which is made if absent. The file
/// that was there stays beside it under another name.
///
/// # Errors
/// [`RestoreError`]: the store is as it was.
pub fn restore(backup: &Path, dir: &Path, made: ForAWhile<'_>) -> Result<Restored, RestoreError> {
    let backup = Backup::find(backup)?;
    let file = dir.join(FILE_NAME);
    let is_itself = |from: &Path| from.canonicalize().is_ok_and(|from| file.canonicalize().is_ok_and(|to| from == to));
    if let Backup::Store(from) = &backup
        && is_itself(from)
    {
        return Err(RestoreError::Itself(file));
    }
    let is_new = !dir.exists();
    // Held to the end: no server begins meanwhile.
    let lock = DirectoryLock::take(dir)?;
    let outcome = Scratch::new(dir, made).map_err(RestoreError::from).and_then(|scratch| {
        let authors = make(&backup, scratch.path())?;
        let replaced = replace(&scratch.path().join(FILE_NAME), &file)?;
        Ok(Restored { file: file.clone(), replaced, authors })
    });
    drop(lock);
    if outcome.is_err() && is_new {
        RedbLog::unmake(dir);
    }
    outcome
}

/// Makes a store of the backup in the directory `scratch`, which is empty, and checks it.
fn make(backup: &Backup, scratch: &Path) -> Result<Vec<RescuedAuthor>, RestoreError> {
    match backup {
        Backup::Store(file) => {
            let damaged = |reason| RestoreError::Damaged { file: file.clone(), reason };
            examine(file, scratch)?.map_err(damaged)
        }
        Backup::Archives(files) => {
            import(files, scratch)?;
            let log = RedbLog::open(scratch)?;
            Ok(rebuild::of_catalog(&Catalog::load(&log)?, &log)?)
        }
    }
}

/// Takes exported maps into a new store.
fn import(files: &[PathBuf], dir: &Path) -> Result<(), RestoreError> {
    take_all(files, Arc::new(RedbLog::open(dir)?)).map(|_| ())
}

/// What exported maps hold, if `source` is one or a folder of them, and each is whole; none:
/// `source` is something else.
///
/// # Errors
/// What is wrong with the first that is not whole.
pub fn check_archives(source: &Path) -> Result<Option<Vec<RescuedAuthor>>, RestoreError> {
    match Backup::find(source) {
        Ok(Backup::Archives(files)) => {
            let log: Arc<dyn IncrementLog> = Arc::new(MemoryLog::new());
            let catalog = take_all(&files, Arc::clone(&log))?;
            Ok(Some(rebuild::of_catalog(&catalog, log.as_ref())?))
        }
        _ => Ok(None),
    }
}

/// Takes exported maps into a log.
fn take_all(files: &[PathBuf], log: Arc<dyn IncrementLog>) -> Result<Arc<Catalog>, RestoreError> {
    let mut intake = ArchiveIntake::into(log)?;
    let mut known = BTreeMap::new();
    for file in files {
        let bytes = std::fs::read(file).map_err(file_error(file))?;
        let damaged = |source| RestoreError::Archive { file: file.clone(), source };
        let archive = Archive::open(&bytes).map_err(damaged)?;
        let map = archive.header.map.clone();
        if let Some(first) = known.insert(map.clone(), file.clone()) {
            return Err(RestoreError::Twice { first, file: file.clone(), map });
        }
        intake.take(file, archive)?;
    }
    Ok(intake.catalog)
}

/// Takes a map from `file` in to see whether it is what the file says it is, and keeps nothing.
///
/// # Errors
/// What is wrong with it.
pub fn check_archive(file: &Path, archive: Archive<'_>) -> Result<(), RestoreError> {
    ArchiveIntake::into(Arc::new(MemoryLog::new()))?.take(file, archive)
}

/// Takes exported maps in, as a server does.
struct ArchiveIntake {
    catalog: Arc<Catalog>,
    ingest: Ingest,
}

impl ArchiveIntake {
    fn into(log: Arc<dyn IncrementLog>) -> Result<Self, RestoreError> {
        let catalog = Arc::new(Catalog::load(log.as_ref())?);
        // A server has taken all of it before.
        let limits = Limits {
            max_map_bytes: u64::MAX,
            max_total_bytes: u64::MAX,
            max_map_elements: usize::MAX,
            max_total_elements: usize::MAX,
            max_maps: usize::MAX,
            max_clock_ahead_s: u64::MAX,
            ..Limits::default()
        };
        let ingest = Ingest::new(log, Arc::clone(&catalog), limits);
        Ok(Self { catalog, ingest })
    }

    fn take(&mut self, file: &Path, archive: Archive<'_>) -> Result<(), RestoreError> {
        let header = archive.header.clone();
        for series in archive {
            let series = series.map_err(|source| RestoreError::Archive { file: file.to_owned(), source })?;
            if let Err(refusal) = self.ingest.import(&header.map, series, 0)? {
                return Err(RestoreError::Refused { file: file.to_owned(), reply: refusal.reply() });
            }
        }
        let head = self.catalog.view(&header.map).map(|view| view.head);
        let found = head.as_ref().map_or(Digest([0; 32]), |head| head.digest);
        let vector = head.map(|head| head.vector.clone()).unwrap_or_default();
        let either = vector.join(&header.vector);
        let mut counts = either.iter().map(|(author, _)| (author, vector.get(author), header.vector.get(author)));
        if let Some((author, found, expected)) = counts.find(|(_, found, expected)| found != expected) {
            return Err(RestoreError::Vector { file: file.to_owned(), author, found, expected });
        }
        if found != header.digest {
            return Err(RestoreError::Digest { file: file.to_owned(), found, expected: header.digest });
        }
        Ok(())
    }
}
