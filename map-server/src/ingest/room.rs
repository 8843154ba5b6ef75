//! The limits of a server's room, and what can be done when one is reached.

use std::fmt::{self, Display, Formatter};

/// What there is a limit of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RoomLimit {
    /// Maps.
    Maps,
    /// Authors of one map.
    Authors,
    /// Bytes of one map's increments.
    MapBytes,
    /// Nodes and edges of one map.
    MapElements,
    /// Bytes of all maps' increments.
    TotalBytes,
    /// Nodes and edges of all maps.
    TotalElements,
}

impl RoomLimit {
    /// What an operator can do when it is reached.
    #[must_use]
    pub fn remedy(self) -> &'static str {
        match self {
            Self::Maps => "map-server delete frees one, server.limits.max_maps raises it",
            Self::Authors => "write under a name that has written this map, or begin another map",
            Self::MapBytes => "map-server retain frees some, --max-map-mib raises it",
            Self::MapElements => "--max-map-elements raises it; or begin another map",
            Self::TotalBytes => "map-server retain and delete free some, --max-total-mib raises it",
            Self::TotalElements => "map-server delete frees some, --max-total-elements raises it",
        }
    }
}

impl Display for RoomLimit {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Maps => "maps",
            Self::Authors => "authors of this map",
            Self::MapBytes => "bytes in this map",
            Self::MapElements => "nodes and edges in this map",
            Self::TotalBytes => "bytes in all maps",
            Self::TotalElements => "nodes and edges in all maps",
        })
    }
}
