//! The robot's own disk: what it has made and the server is not known to have. Each increment is
//! there before it is put, so that an explorer that is killed and comes back under its own name
//! delivers what its last run has left and gives no number twice. What a number once stood for is
//! then what it stands for everywhere: on servers, in storages out of reach, on the wire.
//!
//! One `redb` file a map and author, `{map}.{author}.spool`:
//!
//! | table | key | value |
//! | --- | --- | --- |
//! | `increments` | number | the increment in its envelope |
//! | `acknowledged` | | number up to which the server has everything |
//! | `origin` | | whether the run began the map; the map's version vector when it began |

use crate::publish::Backlog;
use fht_proto::{AuthorId, Increment, MapName, VersionVector, decode};
use redb::{Database, DatabaseError, Durability, ReadableDatabase, TableDefinition};
use std::collections::BTreeMap;
use std::fs::{File, TryLockError};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tokio::task::JoinError;

const INCREMENTS: TableDefinition<'_, u64, &[u8]> = TableDefinition::new("increments");
const ACKNOWLEDGED: TableDefinition<'_, (), u64> = TableDefinition::new("acknowledged");
const ORIGIN: TableDefinition<'_, (), (bool, &str)> = TableDefinition::new("origin");
/// Memory for pages; the file is small.
const CACHE_BYTES: usize = 1 << 20;

/// Why the spool failed.
#[derive(Debug, thiserror::Error)]
pub enum SpoolError {
    /// Another process has it open.
    #[error("{} is in use: does another mapper run under this robot's name?", file.display())]
    InUse {
        /// The file.
        file: PathBuf,
    },
    /// It cannot be made, read or written.
    #[error("{} cannot be {action}: {reason}", file.display())]
    Disk {
        /// The file.
        file: PathBuf,
        /// `opened`, `read` or `written`.
        action: &'static str,
        /// What the system says.
        reason: String,
    },
    /// What is there is not what was written.
    #[error("{} is damaged: {reason}; remove it if what it holds is not wanted any more", file.display())]
    Damaged {
        /// The file.
        file: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// The thread that wrote has failed: a defect.
    #[error("the spool's thread failed: {0}")]
    Thread(#[from] JoinError),
}

/// How the run began that has left something.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RunOrigin {
    /// Whether it began the map, in a frame of its own.
    pub is_founder: bool,
    /// What the server had then.
    pub basis: VersionVector,
}

/// An open spool. Handles share one file.
#[derive(Clone, Debug)]
pub struct Spool {
    database: Arc<Database>,
    author: AuthorId,
    file: PathBuf,
    // Held until the last handle is gone: one run at a time.
    _lock: Arc<File>,
}

impl Spool {
    /// Opens the spool of `author` in `map`, a file in `dir`; makes both if absent.
    ///
    /// # Errors
    /// [`SpoolError::InUse`], [`SpoolError::Disk`], [`SpoolError::Damaged`].
    pub fn open(dir: &Path, map: &MapName, author: AuthorId) -> Result<Self, SpoolError> {
        let file = dir.join(format!("{map}.{author}.spool"));
        let failed = |reason: String| SpoolError::Disk { file: file.clone(), action: "opened", reason };
        let system = |error: std::io::Error| failed(error.to_string());
        std::fs::create_dir_all(dir).map_err(system)?;
        let lock = File::create(file.with_extension("spool.lock")).map_err(system)?;
        match lock.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(SpoolError::InUse { file }),
            Err(TryLockError::Error(error)) => return Err(system(error)),
        }
        let open = |path: &Path| Database::builder().set_cache_size(CACHE_BYTES).create(path);
        if !file.try_exists().map_err(system)? {
            // Made under another name: a robot that loses its power meanwhile leaves nothing that
            // is taken for a spool.
            let unfinished = file.with_extension("spool.new");
            match std::fs::remove_file(&unfinished) {
                Err(error) if error.kind() != ErrorKind::NotFound => return Err(system(error)),
                _ => {}
            }
            let database = open(&unfinished).map_err(|error| failed(error.to_string()))?;
            make_tables(&database).map_err(|error| failed(error.to_string()))?;
            drop(database);
            std::fs::rename(&unfinished, &file).map_err(system)?;
        }
        // The file's name must outlive a power failure, too.
        File::open(dir).and_then(|dir| dir.sync_all()).map_err(system)?;
        let mut database = open(&file).map_err(|error| match error {
            DatabaseError::DatabaseAlreadyOpen => SpoolError::InUse { file: file.clone() },
            other => failed(other.to_string()),
        })?;
        // It is small. Increments that are gone would be made again under the same numbers.
        let damaged = |reason: String| SpoolError::Damaged { file: file.clone(), reason };
        match database.check_integrity() {
            Ok(true) => Ok(Self { database: Arc::new(database), author, file, _lock: Arc::new(lock) }),
            Ok(false) => Err(damaged("some of it is lost".to_owned())),
            Err(error) => Err(damaged(error.to_string())),
        }
    }

    /// Where it is.
    #[must_use]
    pub fn file(&self) -> &Path {
        &self.file
    }

    /// What is there.
    ///
    /// # Errors
    /// [`SpoolError::Disk`], [`SpoolError::Damaged`].
    pub fn backlog(&self) -> Result<Backlog, SpoolError> {
        let backlog = self.read_backlog().map_err(|error| self.failed("read", &error))?;
        for ((number, bytes), expected) in backlog.encoded.iter().zip(backlog.acknowledged.saturating_add(1)..) {
            let is_sound = *number == expected
                && decode::<Increment>(bytes)
                    .is_ok_and(|found| (found.author, found.number) == (self.author, expected));
            if !is_sound {
                return Err(self.damaged(format!("increment {expected} is missing or broken")));
            }
        }
        Ok(backlog)
    }

    fn read_backlog(&self) -> Result<Backlog, redb::Error> {
        let read = self.database.begin_read()?;
        let acknowledged = read.open_table(ACKNOWLEDGED)?.get(())?.map_or(0, |number| number.value());
        let mut encoded = BTreeMap::new();
        for entry in read.open_table(INCREMENTS)?.range(acknowledged.saturating_add(1)..)? {
            let (number, bytes) = entry?;
            encoded.insert(number.value(), bytes.value().to_vec());
        }
        Ok(Backlog { acknowledged, encoded })
    }

    /// How the run began that has left it; none: there was no run.
    ///
    /// # Errors
    /// [`SpoolError::Disk`], [`SpoolError::Damaged`].
    pub fn origin(&self) -> Result<Option<RunOrigin>, SpoolError> {
        let Some((is_founder, basis)) = self.read_origin().map_err(|error| self.failed("read", &error))? else {
            return Ok(None);
        };
        let basis = basis.parse().map_err(|error| self.damaged(format!("the map's version: {error}")))?;
        Ok(Some(RunOrigin { is_founder, basis }))
    }

    fn read_origin(&self) -> Result<Option<(bool, String)>, redb::Error> {
        let read = self.database.begin_read()?;
        let origin = read.open_table(ORIGIN)?.get(())?;
        Ok(origin.map(|origin| (origin.value().0, origin.value().1.to_owned())))
    }

    /// A run begins; the server has all of this author that its `basis` says, and nothing waits any
    /// more.
    ///
    /// # Errors
    /// [`SpoolError::Disk`], [`SpoolError::Thread`].
    pub async fn begin(&self, origin: RunOrigin) -> Result<(), SpoolError> {
        let author = self.author;
        self.write(move |write| {
            // A newest commit that does not verify is then an error, and not passed over.
            write.set_two_phase_commit(true);
            acknowledge(write, origin.basis.get(author))?;
            write.open_table(ORIGIN)?.insert((), (origin.is_founder, origin.basis.to_string().as_str()))?;
            Ok(())
        })
        .await
    }

    /// Adds increments in their envelopes, by number; they are durable when this returns.
    ///
    /// # Errors
    /// [`SpoolError::Disk`], [`SpoolError::Thread`].
    pub async fn add(&self, increments: Vec<(u64, Vec<u8>)>) -> Result<(), SpoolError> {
        self.write(move |write| {
            write.set_two_phase_commit(true);
            let mut table = write.open_table(INCREMENTS)?;
            for (number, bytes) in &increments {
                table.insert(number, bytes.as_slice())?;
            }
            Ok(())
        })
        .await
    }

    /// The server has everything up to `number`: that need not be kept. It is written with what
    /// comes next; if that is lost, it is only delivered once more.
    ///
    /// # Errors
    /// [`SpoolError::Disk`], [`SpoolError::Thread`].
    pub async fn acknowledge(&self, number: u64) -> Result<(), SpoolError> {
        self.write(move |write| {
            write.set_durability(Durability::None)?;
            acknowledge(write, number)
        })
        .await
    }

    async fn write(
        &self,
        what: impl FnOnce(&mut redb::WriteTransaction) -> Result<(), redb::Error> + Send + 'static,
    ) -> Result<(), SpoolError> {
        let spool = self.clone();
        let commit = move || {
            let mut write = spool.database.begin_write()?;
            what(&mut write)?;
            Ok::<_, redb::Error>(write.commit()?)
        };
        tokio::task::spawn_blocking(commit).await?.map_err(|error| self.failed("written", &error))
    }

    fn failed(&self, action: &'static str, error: &redb::Error) -> SpoolError {
        SpoolError::Disk { file: self.file.clone(), action, reason: error.to_string() }
    }

    fn damaged(&self, reason: String) -> SpoolError {
        SpoolError::Damaged { file: self.file.clone(), reason }
    }
}

fn make_tables(database: &Database) -> Result<(), redb::Error> {
    let write = database.begin_write()?;
    write.open_table(INCREMENTS)?;
    write.open_table(ACKNOWLEDGED)?;
    write.open_table(ORIGIN)?;
    Ok(write.commit()?)
}

fn acknowledge(write: &redb::WriteTransaction, number: u64) -> Result<(), redb::Error> {
    write.open_table(INCREMENTS)?.retain_in(..=number, |_, _| false)?;
    write.open_table(ACKNOWLEDGED)?.insert((), number)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_proto::{NodeId, Op, encode};
    use std::ops::RangeInclusive;

    const AUTHOR: AuthorId = AuthorId(7);

    fn open(dir: &Path) -> Result<Spool, SpoolError> {
        Spool::open(dir, &"museum".parse().unwrap(), AUTHOR)
    }

    fn some(numbers: RangeInclusive<u64>) -> Vec<(u64, Vec<u8>)> {
        let ops = || vec![Op::RemoveNode { id: NodeId { author: AUTHOR, number: 1 } }];
        let increment = |number| Increment { author: AUTHOR, number, hlc_us: number, ops: ops() };
        numbers.map(|number| (number, encode(&increment(number)).unwrap())).collect()
    }

    fn left(acknowledged: u64, numbers: RangeInclusive<u64>) -> Backlog {
        Backlog { acknowledged, encoded: some(numbers).into_iter().collect() }
    }

    #[tokio::test]
    async fn what_is_not_acknowledged_is_there_when_it_is_opened_again() {
        let folder = tempfile::tempdir().unwrap();
        let dir = folder.path().join("made/on/the/way");
        let spool = open(&dir).unwrap();
        assert_eq!((spool.backlog().unwrap(), spool.origin().unwrap()), (Backlog::default(), None));
        assert!(matches!(open(&dir), Err(SpoolError::InUse { .. })));
        spool.add(some(1..=5)).await.unwrap();
        spool.acknowledge(3).await.unwrap();
        spool.add(some(6..=6)).await.unwrap();
        assert_eq!(spool.backlog().unwrap(), left(3, 4..=6));
        drop(spool);
        let spool = open(&dir).unwrap();
        assert_eq!(spool.backlog().unwrap(), left(3, 4..=6));
        assert_eq!(left(3, 4..=6).written(), 6);
        // A run without a spool has written the next two.
        let origin = RunOrigin { is_founder: false, basis: "00000001:3,00000007:8".parse().unwrap() };
        spool.begin(origin.clone()).await.unwrap();
        spool.add(some(9..=9)).await.unwrap();
        drop(spool);
        let spool = open(&dir).unwrap();
        assert_eq!((spool.backlog().unwrap(), spool.origin().unwrap()), (left(8, 9..=9), Some(origin)));
    }

    #[tokio::test]
    async fn a_kill_while_it_is_made_leaves_nothing_in_the_way() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("museum.00000007.spool.new"), [0; 5000]).unwrap();
        assert_eq!(open(folder.path()).unwrap().backlog().unwrap(), Backlog::default());
    }

    #[tokio::test]
    async fn what_is_no_spool_is_refused_with_its_name() {
        let folder = tempfile::tempdir().unwrap();
        let spool = open(folder.path()).unwrap();
        spool.add(some(2..=3)).await.unwrap();
        let gap = spool.backlog().unwrap_err();
        assert!(matches!(gap, SpoolError::Damaged { .. }) && gap.to_string().contains("increment 1"), "{gap}");
        spool.add(vec![(1, b"broken".to_vec())]).await.unwrap();
        assert!(matches!(spool.backlog(), Err(SpoolError::Damaged { .. })));
        let file = spool.file().to_owned();
        drop(spool);
        let sound = std::fs::read(&file).unwrap();
        for content in [b"no spool".to_vec(), vec![0; 100_000], sound[..sound.len() / 2].to_vec()] {
            std::fs::write(&file, content).unwrap();
            let refused = open(folder.path()).unwrap_err();
            assert!(refused.to_string().contains("museum.00000007.spool"), "{refused}");
        }
        let taken = folder.path().join("a file");
        std::fs::write(&taken, "").unwrap();
        assert!(matches!(open(&taken), Err(SpoolError::Disk { action: "opened", .. })));
    }
}
