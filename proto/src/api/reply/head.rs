//! The state of a map in a few numbers: `head` and `maps`.

use crate::api::deletion::MapDeletion;
use crate::model::ids::MapName;
use crate::model::validate::{Invalid, Validate, check};
use crate::model::version::{Digest, VersionVector};
use serde::{Deserialize, Serialize};

/// The state of a map: reply and publication under `head`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Head {
    /// The map.
    pub map: MapName,
    /// Sum of the vector.
    pub version: u64,
    /// Increments contained, all durable: the acknowledgement of the writers.
    pub vector: VersionVector,
    /// Hash of the canonical map.
    pub digest: Digest,
    /// The newest clock in it, microseconds. Writers use a greater one.
    #[serde(default)]
    pub clock_us: u64,
    /// The release that robots are to use, as `name@author`; none: this state.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub enabled: Option<String>,
    /// Whether that release is not used, since not all of it is here, or its digest is wrong:
    /// robots go on with what they ran.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub enabled_unused: bool,
    /// That the map will be deleted; none: it will not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub deletion: Option<MapDeletion>,
    /// Main nodes shown.
    pub main_nodes: usize,
    /// Support nodes shown.
    pub support_nodes: usize,
    /// Edges shown.
    pub edges: usize,
    /// Bytes of all increments as they travelled.
    pub bytes: u64,
    /// Increments refused since the server started.
    pub refused: u64,
    /// How often operators have cleared what robots reported blocked since the server started: when
    /// it changes, `rules` says what is still blocked.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub reports_cleared: u32,
    /// Whether the server takes nothing in at present, for its disk cannot be written. It goes on
    /// answering.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub read_only: bool,
    /// Whether an increment of it in the server's store cannot be read: nothing of the map can be
    /// had, and it counts as empty. Only in the list of maps.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub damaged: bool,
}

// Serde's attribute asks for a reference.
#[allow(clippy::trivially_copy_pass_by_ref)]
fn is_zero(count: &u32) -> bool {
    *count == 0
}

impl Head {
    /// Of a map that has nothing yet. Its digest is no map's.
    #[must_use]
    pub fn of_nothing(map: MapName) -> Self {
        Self {
            map,
            version: 0,
            vector: VersionVector::default(),
            digest: Digest([0; 32]),
            clock_us: 0,
            enabled: None,
            enabled_unused: false,
            deletion: None,
            main_nodes: 0,
            support_nodes: 0,
            edges: 0,
            bytes: 0,
            refused: 0,
            reports_cleared: 0,
            read_only: false,
            damaged: false,
        }
    }

    /// The head, if it makes sense and is one of `map`: what everybody asks of a head that came
    /// from outside. The numbers in its vector may still be anything.
    ///
    /// # Errors
    /// The first thing that is wrong.
    pub fn checked(self, map: &MapName) -> Result<Self, Invalid> {
        check(self.map == *map, || format!("a head of map {} where one of {map} was expected", self.map))?;
        self.validate()?;
        Ok(self)
    }
}

/// The reply to `maps`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct MapsReply {
    /// Heads of all maps, by name.
    pub maps: Vec<Head>,
    /// Why the server takes nothing in at present; none: it does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub read_only: Option<String>,
    /// What will keep it from taking anything in, if nobody sees to it: little room on its disk.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub warning: Option<String>,
}

impl Validate for Head {
    fn validate(&self) -> Result<(), Invalid> {
        self.vector.validate()?;
        self.deletion.as_ref().map_or(Ok(()), Validate::validate)?;
        check(self.version == self.vector.version(), || {
            format!("a head of version {} with vector {}", self.version, self.vector)
        })
    }
}
