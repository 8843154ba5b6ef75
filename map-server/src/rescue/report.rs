//! What was rescued, or why nothing was.

use crate::store::{FILE_NAME, StoreError};
use fht_proto::{AuthorId, MapName};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// What was rescued of one author's increments of a map.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RescuedAuthor {
    /// The map.
    pub map: MapName,
    /// The author.
    pub author: AuthorId,
    /// The newest number that there was, as far as it can be told.
    pub last: u64,
    /// How many increments do not read.
    pub lost: u64,
    /// The first numbers of those, at most ten.
    pub first_lost: Vec<u64>,
    /// Up to this number they are folded: which of these there were cannot be told any more. None
    /// are: 0.
    #[serde(default)]
    pub folded: u64,
    /// How many increments of the map, of whichever authors, a rescue did not find before.
    #[serde(default)]
    pub lost_before: u64,
    /// Whether the store says that there were no more than `last`. If not, those after it may be
    /// lost, too.
    pub is_end_known: bool,
}

/// What was rescued.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Rescued {
    /// What is wrong with the file; none if nothing is.
    pub damage: Option<String>,
    /// By map and author.
    pub authors: Vec<RescuedAuthor>,
}

impl Rescued {
    /// How many increments do not read, of all that are known to have been there.
    #[must_use]
    pub fn lost(&self) -> u64 {
        self.authors.iter().fold(0, |sum, author| sum.saturating_add(author.lost))
    }

    /// The authors after whose last increment others may be lost: nothing that reads of a damaged
    /// store says how many there were.
    pub fn unknown_ends(&self) -> impl Iterator<Item = &RescuedAuthor> {
        self.authors.iter().filter(|author| self.damage.is_some() && !author.is_end_known)
    }
}

/// Why nothing was rescued.
#[derive(Debug, thiserror::Error)]
pub enum RescueError {
    /// There is no store.
    #[error("{}: there is no store of a map-server ({FILE_NAME})", .0.display())]
    NoStore(PathBuf),
    /// The target has one already.
    #[error("{} has a store already: give a new directory", .0.display())]
    Occupied(PathBuf),
    /// The system refuses.
    #[error("{}: {source}", path.display())]
    File {
        /// The file or directory.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// A server uses the source, or the new store cannot be written.
    #[error(transparent)]
    Store(#[from] StoreError),
}

impl RescueError {
    /// Whether what was given is wrong, and would fail again.
    #[must_use]
    pub fn is_input(&self) -> bool {
        matches!(self, Self::NoStore(_) | Self::Occupied(_))
    }
}

pub(super) fn file_error(path: &Path) -> impl FnOnce(std::io::Error) -> RescueError + use<'_> {
    move |source| RescueError::File { path: path.to_owned(), source }
}
