//! Everything that servers have ever acknowledged: by author and number, the increment that a head
//! covered. It may neither vanish nor become another one.

use crate::simulation::outcome::Violation;
use fht_proto::{AuthorId, Increment, VersionVector, decode};
use std::collections::BTreeMap;

#[derive(Default)]
pub(super) struct Ledger {
    covered: BTreeMap<(AuthorId, u64), Vec<u8>>,
}

impl Ledger {
    /// A server says that it has everything up to `vector`, after it had said so `upto` another;
    /// `stored` returns what it has.
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
                if before.is_some_and(|before| before != bytes) {
                    return Err(Violation::Replaced(format!("{author}/{number}")));
                }
            }
        }
        Ok(())
    }

    /// All covered increments, decoded.
    pub(super) fn increments(&self) -> impl Iterator<Item = Result<Increment, Violation>> + '_ {
        self.covered.values().map(|bytes| decode(bytes).map_err(|error| Violation::Failed(error.to_string())))
    }
}
