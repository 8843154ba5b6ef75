//! The map that all are on.

use fht_proto::MapName;

/// Nodes along each side of the hall that the robots are in, two metres apart.
pub(super) const SIDE: u32 = 20;
const HALL: &str = "hall";

/// Its name.
pub(super) fn map() -> MapName {
    HALL.parse().unwrap_or_else(|_| unreachable!("{HALL} is a name"))
}
