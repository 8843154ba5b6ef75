//! Version vectors and digests: the names of a map's states.

use crate::model::ids::{AuthorId, ParseIdError};
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::collections::BTreeMap;
use std::fmt;
use std::str::FromStr;

/// How many increments of each author a state contains. Authors with none are absent.
///
/// As text (in queries): `1a2b3c4d:17,99ff00aa:3`; the empty vector is the empty text.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct VersionVector(BTreeMap<AuthorId, u64>);

impl VersionVector {
    /// Most authors that a vector from outside may name.
    pub const MAX_AUTHORS: usize = 4096;

    /// How many increments of `author` are contained.
    #[must_use]
    pub fn get(&self, author: AuthorId) -> u64 {
        self.0.get(&author).copied().unwrap_or(0)
    }

    /// Sets the count of one author.
    pub fn set(&mut self, author: AuthorId, count: u64) {
        if count == 0 {
            self.0.remove(&author);
        } else {
            self.0.insert(author, count);
        }
    }

    /// Authors and counts, in the order of the authors.
    pub fn iter(&self) -> impl Iterator<Item = (AuthorId, u64)> + '_ {
        self.0.iter().map(|(&author, &count)| (author, count))
    }

    /// The scalar version shown to people: the sum of the counts.
    #[must_use]
    pub fn version(&self) -> u64 {
        self.0.values().fold(0, |sum, &count| sum.saturating_add(count))
    }

    /// Whether everything in `other` is also in `self`.
    #[must_use]
    pub fn covers(&self, other: &Self) -> bool {
        other.iter().all(|(author, count)| self.get(author) >= count)
    }

    /// The least vector that covers both.
    #[must_use]
    pub fn join(&self, other: &Self) -> Self {
        let mut joined = self.clone();
        for (author, count) in other.iter() {
            joined.set(author, joined.get(author).max(count));
        }
        joined
    }

    /// The greatest vector that both cover.
    #[must_use]
    pub fn meet(&self, other: &Self) -> Self {
        let mut met = Self::default();
        for (author, count) in self.iter() {
            met.set(author, count.min(other.get(author)));
        }
        met
    }
}

impl fmt::Display for VersionVector {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, (author, count)) in self.iter().enumerate() {
            let comma = if index == 0 { "" } else { "," };
            write!(f, "{comma}{author}:{count}")?;
        }
        Ok(())
    }
}

/// A text that is not a version vector.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ParseVectorError {
    /// One entry is not `author:count`.
    #[error("{0} is not of the form author:count")]
    Entry(String),
    /// The author part is not an id.
    #[error(transparent)]
    Author(#[from] ParseIdError),
    /// An author is named twice.
    #[error("author {0} is named twice")]
    Twice(AuthorId),
    /// More authors than any map has.
    #[error("more than {} authors", VersionVector::MAX_AUTHORS)]
    TooMany,
}

impl FromStr for VersionVector {
    type Err = ParseVectorError;
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let mut vector = Self::default();
        for entry in text.split(',').filter(|entry| !entry.is_empty()) {
            let bad = || ParseVectorError::Entry(entry.chars().take(80).collect());
            let (author, count) = entry.split_once(':').ok_or_else(bad)?;
            let author: AuthorId = author.parse()?;
            if vector.get(author) != 0 {
                return Err(ParseVectorError::Twice(author));
            }
            vector.set(author, count.parse().map_err(|_| bad())?);
            if vector.0.len() > Self::MAX_AUTHORS {
                return Err(ParseVectorError::TooMany);
            }
        }
        Ok(vector)
    }
}

/// A BLAKE3 hash of the canonical form of a map's state. Equal digests mean equal maps. Shown as 64
/// hexadecimal digits, in JSON too.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct Digest(pub [u8; 32]);

impl Serialize for Digest {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if serializer.is_human_readable() { serializer.collect_str(self) } else { self.0.serialize(serializer) }
    }
}

impl<'de> Deserialize<'de> for Digest {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        if deserializer.is_human_readable() {
            String::deserialize(deserializer)?.parse().map_err(D::Error::custom)
        } else {
            <[u8; 32]>::deserialize(deserializer).map(Self)
        }
    }
}

impl fmt::Display for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

impl fmt::Debug for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Digest({self})")
    }
}

impl FromStr for Digest {
    type Err = blake3::HexError;
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        blake3::Hash::from_hex(text).map(|hash| Self(*hash.as_bytes()))
    }
}
