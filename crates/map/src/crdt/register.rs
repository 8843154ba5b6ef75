//! A last-writer-wins register: the smallest piece of a map that is joined.

use fht_proto::Stamp;
use serde::Serialize;
use std::io::BufWriter;

/// BLAKE3 hash of a value's `postcard` form.
pub(crate) type ContentHash = [u8; 32];

/// Hashes a value of this crate or of `fht-proto`.
pub(crate) fn content_hash<T: Serialize + ?Sized>(value: &T) -> ContentHash {
    // Neither the hasher nor the types here (structures, and sequences of known length) have a way
    // to fail. Were one to appear, the empty hash would still be the same on every machine. Through
    // a buffer: one byte at a time, as `postcard` writes them, the hash takes many times as long.
    let buffered = postcard::to_io(value, BufWriter::new(blake3::Hasher::new())).ok();
    let hasher = buffered.and_then(|buffered| buffered.into_inner().ok()).unwrap_or_default();
    *hasher.finalize().as_bytes()
}

/// A value and when it was written.
///
/// Between different values with one stamp the hash decides. An honest author never writes those,
/// but a hostile or broken one may, and the copies of a map must not come apart over it.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Register<T> {
    stamp: Stamp,
    value: T,
}

impl<T: Serialize> Register<T> {
    /// A value as written at `stamp`.
    pub(crate) fn new(stamp: Stamp, value: T) -> Self {
        Self { stamp, value }
    }

    /// When it was written.
    pub(crate) fn stamp(&self) -> Stamp {
        self.stamp
    }

    /// What was written.
    pub(crate) fn value(&self) -> &T {
        &self.value
    }

    /// Keeps the newer of this and `other`: the join of two registers.
    pub(crate) fn join(&mut self, other: Self) {
        let is_newer = match other.stamp.cmp(&self.stamp) {
            std::cmp::Ordering::Less => false,
            std::cmp::Ordering::Equal => content_hash(&other.value) > content_hash(&self.value),
            std::cmp::Ordering::Greater => true,
        };
        if is_newer {
            *self = other;
        }
    }
}

/// Joins a register into a place that may still be empty.
pub(crate) fn join_into<T: Serialize>(slot: &mut Option<Register<T>>, register: Register<T>) {
    match slot {
        Some(current) => current.join(register),
        None => *slot = Some(register),
    }
}
