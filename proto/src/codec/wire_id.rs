//! Node ids inside an increment. One byte, as a rule: a node of the increment's own author is told
//! by how far its number is from that of the own node named before.

use crate::model::ids::{AuthorId, NodeId};
use serde::de::{Error, SeqAccess, Visitor};
use serde::ser::SerializeTuple;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;

/// A node id as an increment writes it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum WireId {
    /// Of the increment's author: the number less that of the own node before, modulo 2^32.
    Own(i32),
    /// Of another author.
    Foreign(NodeId),
}

/// What tells the two apart: the lowest bit of the first number, the rest of which is the
/// difference (positive and negative ones in turn) or the foreign number.
const FOREIGN: u64 = 1;

impl Serialize for WireId {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Own(difference) => {
                let folded = (difference << 1 ^ difference >> 31) as u32;
                let mut tuple = serializer.serialize_tuple(1)?;
                tuple.serialize_element(&(u64::from(folded) << 1))?;
                tuple.end()
            }
            Self::Foreign(id) => {
                let mut tuple = serializer.serialize_tuple(2)?;
                tuple.serialize_element(&(u64::from(id.number) << 1 | FOREIGN))?;
                tuple.serialize_element(&id.author)?;
                tuple.end()
            }
        }
    }
}

impl<'de> Deserialize<'de> for WireId {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct IdVisitor;
        impl<'de> Visitor<'de> for IdVisitor {
            type Value = WireId;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a node id")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<WireId, A::Error> {
                let missing = || A::Error::custom("a node id that is cut");
                let first: u64 = seq.next_element()?.ok_or_else(missing)?;
                let rest = u32::try_from(first >> 1).map_err(|_| A::Error::custom("a node number over 32 bits"))?;
                if first & FOREIGN == 0 {
                    return Ok(WireId::Own((rest >> 1) as i32 ^ -((rest & 1) as i32)));
                }
                let author = seq.next_element()?.ok_or_else(missing)?;
                Ok(WireId::Foreign(NodeId { author, number: rest }))
            }
        }
        deserializer.deserialize_tuple(2, IdVisitor)
    }
}

/// Ids one after another as an increment names them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Names {
    author: AuthorId,
    before: u32,
}

impl Names {
    pub(crate) fn of(author: AuthorId) -> Self {
        Self { author, before: 0 }
    }

    pub(crate) fn shorten(&mut self, id: NodeId) -> WireId {
        if id.author != self.author {
            return WireId::Foreign(id);
        }
        let difference = id.number.wrapping_sub(self.before) as i32;
        self.before = id.number;
        WireId::Own(difference)
    }

    pub(crate) fn expand(&mut self, id: WireId) -> NodeId {
        match id {
            WireId::Foreign(id) => id,
            WireId::Own(difference) => {
                self.before = self.before.wrapping_add_signed(difference);
                NodeId { author: self.author, number: self.before }
            }
        }
    }
}
