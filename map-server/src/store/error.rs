//! Why a log fails.

use fht_proto::codec::envelope::FORMAT_VERSION;
use fht_proto::{AuthorId, MapName};
use std::path::{Path, PathBuf};

/// Why the log failed.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// Another process has it open.
    #[error("the data directory {} is in use by another map-server", dir.display())]
    InUse {
        /// The data directory.
        dir: PathBuf,
    },
    /// The directory cannot be made or the file cannot be opened.
    #[error("the data directory {} cannot be used: {reason}", dir.display())]
    Open {
        /// The data directory.
        dir: PathBuf,
        /// What the system says.
        reason: String,
    },
    /// Written by another version of this program.
    #[error("the data directory {} has format {found}; this program reads formats up to {known}", dir.display())]
    Format {
        /// The data directory.
        dir: PathBuf,
        /// The format found.
        found: u64,
        /// The newest format known.
        known: u64,
    },
    /// Reading or writing failed.
    #[error("the store cannot be {action}: {reason}")]
    Disk {
        /// `read` or `written`.
        action: &'static str,
        /// What the system says.
        reason: String,
    },
    /// The disk did not take something, and nothing more is given to it for the moment.
    #[error("the store cannot be written at present: {reason}")]
    ReadOnly {
        /// What the system says.
        reason: String,
    },
    /// The file has no byte.
    #[error(
        "the store {} is empty: somebody has cut it off, and no map is in it any more. Put a backup of this directory in its \
         place (`map-server restore`); or, to begin with no maps, move the file away",
        file.display()
    )]
    Empty {
        /// The file.
        file: PathBuf,
    },
    /// A later version of this program has stored increments.
    #[error(
        "the store has increments of format {found} in map {map}; this program reads formats up to {FORMAT_VERSION}: use the \
         map-server that wrote them"
    )]
    IncrementFormat {
        /// The map.
        map: String,
        /// The format found.
        found: u8,
    },
    /// The server was told to end while it waited for storages.
    #[error("too few of the storages have confirmed what should be kept")]
    Unconfirmed,
    /// Two servers have accepted two increments of one author and number, and this server has the
    /// one that gives way.
    #[error("map {map}: the storages keep another increment {author}/{number} than this server has")]
    Overruled {
        /// The map.
        map: MapName,
        /// Who wrote it.
        author: AuthorId,
        /// Its place in the author's sequence.
        number: u64,
    },
    /// The file cannot be read as what it should be.
    #[error(
        "the store {} cannot be used, for it is damaged: {reason}. If there is a backup of this directory, or of its \
         maps (`map-server export`), put it in its place with `map-server restore BACKUP --store {dir}`; `map-server \
         check {dir}` says what is lost, and `map-server rescue {dir} TARGET` copies what still reads into a new \
         directory",
        file.display(), dir = file.parent().unwrap_or(file).display()
    )]
    Broken {
        /// The file.
        file: PathBuf,
        /// What is wrong, as far as it can be said.
        reason: String,
    },
    /// What was read is not what was written.
    #[error("the store is damaged: map {map}: {reason}")]
    Damaged {
        /// The map.
        map: String,
        /// What is wrong.
        reason: String,
    },
}

impl StoreError {
    /// The same, if it says that a store is damaged, with the file and with what can be done.
    #[must_use]
    pub fn of_file(self, file: &Path) -> Self {
        match self {
            Self::Damaged { .. } | Self::Disk { action: "read", .. } => {
                Self::Broken { file: file.to_owned(), reason: self.to_string() }
            }
            other => other,
        }
    }
}
