//! Identity: authors (robots that write), nodes and maps.

use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;
use std::str::FromStr;

/// A robot that writes increments. Shown as eight hexadecimal digits, in JSON too.
///
/// Derived from the robot's name, so that the same robot has the same id after a restart.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct AuthorId(pub u32);

impl Serialize for AuthorId {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if serializer.is_human_readable() { serializer.collect_str(self) } else { self.0.serialize(serializer) }
    }
}

impl<'de> Deserialize<'de> for AuthorId {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        if deserializer.is_human_readable() {
            String::deserialize(deserializer)?.parse().map_err(D::Error::custom)
        } else {
            u32::deserialize(deserializer).map(Self)
        }
    }
}

impl AuthorId {
    /// The id of the robot called `name`: the first four bytes of the name's BLAKE3 hash.
    #[must_use]
    pub fn of_robot(name: &str) -> Self {
        let hash = blake3::hash(name.as_bytes());
        let bytes = hash.as_bytes();
        Self(u32::from_be_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]))
    }
}

impl fmt::Display for AuthorId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:08x}", self.0)
    }
}

/// A text that is not an id of the expected form.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("'{text}' is not {expected}")]
pub struct ParseIdError {
    text: String,
    expected: &'static str,
}

impl ParseIdError {
    pub(crate) fn new(text: &str, expected: &'static str) -> Self {
        Self { text: text.chars().take(80).collect(), expected }
    }
}

impl FromStr for AuthorId {
    type Err = ParseIdError;
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let well_formed = text.len() == 8 && text.bytes().all(|b| b.is_ascii_digit() || (b'a'..=b'f').contains(&b));
        let error = || ParseIdError::new(text, "an author id (eight lower-case hexadecimal digits)");
        if !well_formed {
            return Err(error());
        }
        u32::from_str_radix(text, 16).map(Self).map_err(|_| error())
    }
}

/// A node of the map, named by its author and that author's running number. Shown as `1a2b3c4d.17`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct NodeId {
    /// The robot that made the node.
    pub author: AuthorId,
    /// That robot's running number, from 0.
    pub number: u32,
}

impl fmt::Display for NodeId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}", self.author, self.number)
    }
}

impl FromStr for NodeId {
    type Err = ParseIdError;
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let error = || ParseIdError::new(text, "a node id such as 1a2b3c4d.17");
        let (author, number) = text.split_once('.').ok_or_else(error)?;
        if number.is_empty() || !number.bytes().all(|b| b.is_ascii_digit()) {
            return Err(error());
        }
        Ok(Self { author: author.parse()?, number: number.parse().map_err(|_| error())? })
    }
}

/// A name: a text of a certain form, checked when it is made.
macro_rules! name_of {
    ($name:ident, $is_valid:expr, $expected:expr) => {
        name_of!($name, $is_valid, $expected, str::to_owned);
    };
    ($name:ident, $is_valid:expr, $expected:expr, $normal_form:expr) => {
        impl $name {
            /// The name as text.
            #[must_use]
            pub fn as_str(&self) -> &str {
                &self.0
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(&self.0)
            }
        }

        impl FromStr for $name {
            type Err = ParseIdError;
            fn from_str(text: &str) -> Result<Self, Self::Err> {
                let text: String = $normal_form(text);
                if $is_valid(&text) { Ok(Self(text)) } else { Err(ParseIdError::new(&text, $expected)) }
            }
        }

        impl TryFrom<String> for $name {
            type Error = ParseIdError;
            fn try_from(text: String) -> Result<Self, Self::Error> {
                text.parse()
            }
        }

        impl From<$name> for String {
            fn from(name: $name) -> Self {
                name.0
            }
        }
    };
}

pub(crate) use name_of;

/// The name of a map: 1 to 64 of `a-z A-Z 0-9 _ -`, so that it is one chunk of a key expression.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct MapName(String);

/// The name of a robot, or of an operator: 1 to 64 of `a-z A-Z 0-9 _ -`, so that it is one chunk of
/// a key expression.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct RobotName(String);

/// The name of a simulated world that several robots share: 1 to 64 of `a-z A-Z 0-9 _ -`.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct SharedWorldName(String);

name_of!(MapName, is_name, "a map name (1 to 64 of the letters a to z and A to Z, digits, _ or -)");
name_of!(
    RobotName,
    is_name,
    "a name of a robot or operator (1 to 64 of the letters a to z and A to Z, digits, _ or -)"
);
name_of!(
    SharedWorldName,
    is_name,
    "a name of a shared world (1 to 64 of the letters a to z and A to Z, digits, _ or -)"
);

/// Whether `text` can be one chunk of a key: 1 to 64 of `a-z A-Z 0-9 _ -`.
pub(crate) fn is_name(text: &str) -> bool {
    (1..=64).contains(&text.len()) && text.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_' || b == b'-')
}
