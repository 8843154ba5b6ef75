//! The files of a shared world, and their locks.

use fht_proto::SharedWorldName;
use fht_sim::CommonsState;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Seek, Write};
use std::path::{Path, PathBuf};

/// What the world's file begins with.
const MAGIC: &[u8; 8] = b"FHTWORL1";
/// Bytes before the state: magic, length, checksum.
const HEADER: usize = 16;
/// No state is longer, bytes: that of 65,535 people has some 12 MB.
const MOST_BYTES: u64 = 16 << 20;

/// Why the files of a shared world cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum WorldFileError {
    /// The system refuses.
    #[error("{path}: {source}", path = path.display())]
    System {
        /// Which file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The state is none.
    #[error("{path} is damaged; end all robots of this world, and it begins anew", path = path.display())]
    Damaged {
        /// Which file.
        path: PathBuf,
    },
}

/// The folder of a world, in the system's folder for temporary files.
#[must_use]
pub fn folder_of(name: &SharedWorldName) -> PathBuf {
    std::env::temp_dir().join(format!("fht-world-{name}"))
}

/// What a world's file has.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Stored {
    /// No robot was there yet.
    Nothing,
    /// The world as it is.
    State(Box<CommonsState>),
    /// Its last robot has gone, and the folder goes: look for another.
    Closed,
}

/// The folder of one world, open.
pub(crate) struct WorldFolder {
    path: PathBuf,
    world: File,
}

/// The world's file, locked: nobody else reads or writes it.
pub(crate) struct Locked<'a> {
    folder: &'a WorldFolder,
}

/// A file that is locked while its owner lives.
pub(crate) struct Alive {
    path: PathBuf,
    _file: File,
}

fn system(path: &Path) -> impl FnOnce(std::io::Error) -> WorldFileError {
    let path = path.to_owned();
    |source| WorldFileError::System { path, source }
}

impl WorldFolder {
    /// Opens the folder of a world, and makes it if it is not there.
    pub(crate) fn open(name: &SharedWorldName) -> Result<Self, WorldFileError> {
        let path = folder_of(name);
        let mut builder = std::fs::DirBuilder::new();
        builder.recursive(true);
        #[cfg(unix)]
        std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
        builder.create(&path).map_err(system(&path))?;
        let file = path.join("world");
        let open = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(&file);
        Ok(Self { world: open.map_err(system(&file))?, path })
    }

    /// The world's file, locked; none while somebody else has it.
    pub(crate) fn lock(&self) -> Result<Option<Locked<'_>>, WorldFileError> {
        match self.world.try_lock() {
            Ok(()) => Ok(Some(Locked { folder: self })),
            Err(TryLockError::WouldBlock) => Ok(None),
            Err(TryLockError::Error(error)) => Err(system(&self.file())(error)),
        }
    }

    fn file(&self) -> PathBuf {
        self.path.join("world")
    }
}

impl Locked<'_> {
    /// What the file has.
    pub(crate) fn read(&self) -> Result<Stored, WorldFileError> {
        let (mut file, path) = (&self.folder.world, self.folder.file());
        let mut bytes = Vec::new();
        file.rewind().map_err(system(&path))?;
        file.take(MOST_BYTES).read_to_end(&mut bytes).map_err(system(&path))?;
        if bytes.is_empty() {
            return Ok(Stored::Nothing);
        }
        decode(&bytes).ok_or(WorldFileError::Damaged { path })
    }

    /// Stores a state.
    pub(crate) fn write(&self, state: &CommonsState) -> Result<(), WorldFileError> {
        let payload = postcard::to_stdvec(state).map_err(|error| WorldFileError::System {
            path: self.folder.file(),
            source: std::io::Error::other(error),
        })?;
        self.put(&payload)
    }

    fn put(&self, payload: &[u8]) -> Result<(), WorldFileError> {
        let (mut file, path) = (&self.folder.world, self.folder.file());
        let length = u32::try_from(payload.len()).unwrap_or(u32::MAX).to_le_bytes();
        let checksum = crc32fast::hash(payload).to_le_bytes();
        let bytes = [&MAGIC[..], &length, &checksum, payload].concat();
        file.rewind().map_err(system(&path))?;
        // One call, so that whoever is killed leaves the old state or the new one. What is behind
        // the new one does not count.
        file.write_all(&bytes).map_err(system(&path))?;
        file.set_len(bytes.len() as u64).map_err(system(&path))
    }

    /// Takes a seat: a file of this name, locked. None if somebody who lives has it.
    pub(crate) fn take_seat(&self, seat: &str) -> Result<Option<Alive>, WorldFileError> {
        let path = self.folder.path.join(seat);
        let open = OpenOptions::new().write(true).create(true).truncate(false).open(&path);
        let file = open.map_err(system(&path))?;
        match file.try_lock() {
            Ok(()) => Ok(Some(Alive { path, _file: file })),
            Err(TryLockError::WouldBlock) => Ok(None),
            Err(TryLockError::Error(error)) => Err(system(&path)(error)),
        }
    }

    /// Whether the owner of a seat lives. The file of one that has died is removed.
    pub(crate) fn is_alive(&self, seat: &str) -> bool {
        let path = self.folder.path.join(seat);
        let Ok(file) = OpenOptions::new().write(true).open(&path) else { return false };
        match file.try_lock() {
            Ok(()) => {
                // It does no harm if it stays.
                let _ = std::fs::remove_file(&path);
                false
            }
            Err(_) => true,
        }
    }

    /// Whether anybody who lives has a seat.
    pub(crate) fn has_anybody(&self) -> bool {
        let Ok(entries) = std::fs::read_dir(&self.folder.path) else { return false };
        let names = entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
        // Of each, so that the files of all who are dead go.
        names.filter(|name| name != "world").filter(|seat| self.is_alive(seat)).count() > 0
    }

    /// Gives a seat back. After the last one the folder goes.
    pub(crate) fn give_back(&self, seat: Alive) {
        // Whoever cannot remove it leaves it to the next who looks.
        let _ = std::fs::remove_file(&seat.path);
        drop(seat);
        if !self.has_anybody() && self.put(&[]).is_ok() {
            let _ = std::fs::remove_file(self.folder.file());
            let _ = std::fs::remove_dir(&self.folder.path);
        }
    }
}

impl Drop for Locked<'_> {
    fn drop(&mut self) {
        // The system takes it back at the latest with the file.
        let _ = self.folder.world.unlock();
    }
}

fn decode(bytes: &[u8]) -> Option<Stored> {
    let (header, rest) = bytes.split_at_checked(HEADER)?;
    let number = |at: usize| Some(u32::from_le_bytes(header.get(at..at + 4)?.try_into().ok()?));
    let payload = rest.get(..usize::try_from(number(8)?).ok()?)?;
    if header.get(..8)? != MAGIC || crc32fast::hash(payload) != number(12)? {
        return None;
    }
    if payload.is_empty() {
        return Some(Stored::Closed);
    }
    postcard::from_bytes(payload).ok().map(|state| Stored::State(Box::new(state)))
}
