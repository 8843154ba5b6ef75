//! The last-writer-wins register that every element of the map is kept in.

use fht_proto::Stamp;
use serde::Serialize;

/// A value and the stamp of its last change. Joining is commutative, associative and idempotent.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Register<T> {
    stamp: Stamp,
    value: T,
}

impl<T: Serialize> Register<T> {
    pub fn stamp(&self) -> Stamp {
        self.stamp
    }

    pub fn value(&self) -> &T {
        &self.value
    }

    /// Keeps the newer of what `slot` holds and `(stamp, value)`. Stamps are unique among honest writers; should two
    /// writes carry one stamp, the one whose bytes sort last wins, so that all replicas still agree.
    pub fn join(slot: &mut Option<Self>, stamp: Stamp, value: T) {
        let wins = match slot {
            None => true,
            Some(held) if stamp != held.stamp => stamp > held.stamp,
            Some(held) => bytes(&value) > bytes(&held.value),
        };
        if wins {
            *slot = Some(Self { stamp, value });
        }
    }
}

fn bytes<T: Serialize>(value: &T) -> Vec<u8> {
    // Plain data always serialises; if it ever did not, equal bytes keep what is held.
    postcard::to_stdvec(value).unwrap_or_default()
}
