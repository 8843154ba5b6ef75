//! What servers have ever said that they have: by author and number, the increment that a head covered. It may neither go nor become
//! another one. Of an explorer that came back, becoming another one is counted unless runs are strict.

use super::Violation;
use fht_proto::{AuthorId, Increment, VersionVector, decode};
use std::collections::{BTreeMap, BTreeSet};

#[derive(Default)]
pub(super) struct Ledger {
    covered: BTreeMap<(AuthorId, u64), Vec<u8>>,
    /// Whose numbers may have been given twice.
    lenient: BTreeSet<AuthorId>,
    replaced: BTreeSet<(AuthorId, u64)>,
}

impl Ledger {
    /// From now on this author's replaced increments are counted.
    pub(super) fn be_lenient(&mut self, author: AuthorId) {
        self.lenient.insert(author);
    }

    /// How many have become others.
    pub(super) fn replaced(&self) -> u64 {
        self.replaced.len() as u64
    }

    /// A server says that it has everything up to `vector`, after it had said so `upto` another; `stored` is what it has.
    pub(super) fn cover(
        &mut self,
        upto: &VersionVector,
        vector: &VersionVector,
        stored: impl Fn(AuthorId, u64) -> Option<Vec<u8>>,
    ) -> Result<(), Violation> {
        for (author, last) in vector.iter() {
            for number in upto.get(author) + 1..=last {
                let bytes = stored(author, number).ok_or_else(|| Violation::Lost(format!("{author}/{number}")))?;
                let before = self.covered.insert((author, number), bytes.clone());
                if before.is_none_or(|before| before == bytes) {
                    continue;
                }
                if !self.lenient.contains(&author) {
                    return Err(Violation::Replaced(format!("{author}/{number}")));
                }
                self.replaced.insert((author, number));
            }
        }
        Ok(())
    }

    /// All of them as they are now, decoded.
    pub(super) fn increments(&self) -> impl Iterator<Item = Result<Increment, Violation>> + '_ {
        self.covered.values().map(|bytes| decode(bytes).map_err(|error| Violation::Failed(error.to_string())))
    }
}
