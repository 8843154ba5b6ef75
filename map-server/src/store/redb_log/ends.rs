//! How many increments each author of each map has, once more, in a table of its own: what a rescue
//! of a damaged file knows of an author's last increments, and of authors of whom nothing reads. It
//! is written in the commit that stores the increments. A sum goes with each number, by which a
//! rescue knows it among what else lies in the file.

use crate::store::error::StoreError;
use crate::store::redb_log::tables::{FLOORS, LOG, reading, writing};
use fht_proto::AuthorId;
use redb::{ReadTransaction, ReadableTable, TableDefinition, TableError, WriteTransaction};
use std::collections::BTreeMap;

/// Map and author; the number of the author's last increment, and the [`end_sum`] of all three.
const ENDS: TableDefinition<'_, (&str, u32), (u64, u32)> = TableDefinition::new("ends");

/// The sum over a map's name, an author, and the number of that author's last increment.
pub(crate) fn end_sum(map: &str, author: AuthorId, last: u64) -> u32 {
    let mut sum = crc32fast::Hasher::new();
    sum.update(map.as_bytes());
    sum.update(&author.0.to_le_bytes());
    sum.update(&last.to_le_bytes());
    sum.finalize()
}

/// Notes that authors have increments up to these numbers, of those that are not known to have
/// more.
pub(super) fn note<'a>(
    write: &WriteTransaction,
    lasts: impl IntoIterator<Item = ((&'a str, AuthorId), u64)>,
) -> Result<(), StoreError> {
    let mut ends = write.open_table(ENDS).map_err(writing)?;
    for ((map, author), last) in lasts {
        let known = ends.get((map, author.0)).map_err(writing)?.map_or(0, |end| end.value().0);
        if last > known {
            ends.insert((map, author.0), (last, end_sum(map, author, last))).map_err(writing)?;
        }
    }
    Ok(())
}

/// Forgets the authors of a map that is deleted.
pub(super) fn forget(write: &WriteTransaction, map: &str) -> Result<(), StoreError> {
    let mut ends = write.open_table(ENDS).map_err(writing)?;
    ends.retain_in((map, 0)..=(map, u32::MAX), |_, _| false).map_err(writing)
}

/// The last numbers of maps' authors.
pub(super) type Lasts = BTreeMap<(String, AuthorId), u64>;

/// What the table is to hold, of a store that has none: a new one, or one of an earlier version of
/// this program.
pub(super) fn absent(read: &ReadTransaction) -> Result<Option<Lasts>, StoreError> {
    match read.open_table(ENDS) {
        Err(TableError::TableDoesNotExist(_)) => stored(read).map(Some),
        Err(other) => Err(reading(other)),
        Ok(_) => Ok(None),
    }
}

/// What the order of storing and the floors say.
fn stored(read: &ReadTransaction) -> Result<Lasts, StoreError> {
    let mut lasts = Lasts::new();
    let mut add = |map: &str, author: u32, number: u64| {
        let last = lasts.entry((map.to_owned(), AuthorId(author))).or_default();
        *last = number.max(*last);
    };
    let floors = read.open_table(FLOORS).map_err(reading)?;
    for entry in floors.iter().map_err(reading)? {
        let (key, last) = entry.map_err(reading)?;
        let (map, author) = key.value();
        add(map, author, last.value());
    }
    let log = read.open_table(LOG).map_err(reading)?;
    for entry in log.iter().map_err(reading)? {
        let (key, place) = entry.map_err(reading)?;
        let (author, number) = place.value();
        add(key.value().0, author, number);
    }
    Ok(lasts)
}
