//! Writing to a map: places, zones, closed edges.

use crate::map::Map;
use fht_client::author::{Authorship, NotWritten, write};
use fht_perception::pose::{Pose2, to_fixed};
use fht_proto::api::reply::Head;
use fht_proto::{EdgeKey, FixedPoint, Label, NodeId, Op, Zone, ZoneRule};

impl Map {
    /// Somebody who writes to this map under `name`: an operator, or a program. Give every author a
    /// name of its own.
    #[must_use]
    pub fn author(&self, name: &str) -> Author {
        Author { map: self.clone(), name: name.to_owned() }
    }
}

/// Why nothing was written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AuthorError {
    /// The text is not the name of a place or zone.
    #[error("{0}")]
    Name(String),
    /// The zone's border is none.
    #[error("the border of zone {0} has fewer than three corners or crosses itself: give its corners in order")]
    Border(String),
    /// No edge joins these nodes, as far as the own copy knows.
    #[error("no edge joins {0} and {1}")]
    NoEdge(NodeId, NodeId),
    /// The server did not take it.
    #[error(transparent)]
    NotWritten(#[from] NotWritten),
}

/// Somebody who writes to a map; made by [`Map::author`].
///
/// Each call writes one increment and returns when the server has it durably: the [`Head`] that
/// comes back contains it. All copies of the map have it soon after. What two authors write of the
/// same thing at once, the later stamp decides, everywhere alike.
#[derive(Clone, Debug)]
pub struct Author {
    map: Map,
    name: String,
}

fn label(name: &str) -> Result<Label, AuthorError> {
    name.parse().map_err(|error| AuthorError::Name(format!("{error}")))
}

impl Author {
    /// Names a place, or moves the one that has the name, so that queries and robots can go there
    /// by name.
    ///
    /// # Errors
    /// [`AuthorError`].
    pub async fn set_place(&self, name: &str, map_from_place: Pose2) -> Result<Head, AuthorError> {
        self.write(vec![Op::SetPlace { name: label(name)?, pose: Some(to_fixed(&map_from_place)) }]).await
    }

    /// Takes a place's name away.
    ///
    /// # Errors
    /// [`AuthorError`].
    pub async fn remove_place(&self, name: &str) -> Result<Head, AuthorError> {
        self.write(vec![Op::SetPlace { name: label(name)?, pose: None }]).await
    }

    /// Draws a zone with a rule, or redraws the one that has the name. `corners`: its border in
    /// order, map frame, metres.
    ///
    /// # Errors
    /// [`AuthorError`].
    pub async fn set_zone(&self, name: &str, rule: ZoneRule, corners: &[(f64, f64)]) -> Result<Head, AuthorError> {
        let corners = corners.iter().map(|&(x, y)| FixedPoint::from_metres(x, y)).collect();
        let zone = Zone { rule, corners };
        if zone.corners.len() < 3 || zone.crosses_itself() {
            return Err(AuthorError::Border(name.to_owned()));
        }
        self.write(vec![Op::SetZone { name: label(name)?, zone: Some(zone) }]).await
    }

    /// Takes a zone away.
    ///
    /// # Errors
    /// [`AuthorError`].
    pub async fn remove_zone(&self, name: &str) -> Result<Head, AuthorError> {
        self.write(vec![Op::SetZone { name: label(name)?, zone: None }]).await
    }

    /// Closes the edge between two nodes: no path uses it until it is opened. For what is blocked
    /// for a while only, a robot says [`Map::report_blocked`].
    ///
    /// # Errors
    /// [`AuthorError`].
    pub async fn close_edge(&self, a: NodeId, b: NodeId) -> Result<Head, AuthorError> {
        self.set_closed(a, b, true).await
    }

    /// Opens an edge that was closed.
    ///
    /// # Errors
    /// [`AuthorError`].
    pub async fn open_edge(&self, a: NodeId, b: NodeId) -> Result<Head, AuthorError> {
        self.set_closed(a, b, false).await
    }

    async fn set_closed(&self, a: NodeId, b: NodeId, closed: bool) -> Result<Head, AuthorError> {
        if a == b || !self.map.has_edge(EdgeKey::new(a, b)) {
            return Err(AuthorError::NoEdge(a, b));
        }
        self.write(vec![Op::SetClosed { edge: EdgeKey::new(a, b), closed }]).await
    }

    /// Writes any operations as one increment: they hold together or not at all.
    ///
    /// # Errors
    /// [`AuthorError::NotWritten`].
    pub async fn write(&self, ops: Vec<Op>) -> Result<Head, AuthorError> {
        let inner = &self.map.inner;
        let by = Authorship { name: &self.name, may_begin: inner.may_begin, timeout: inner.timeout };
        Ok(write(&inner.session, &inner.name, by, ops).await?)
    }
}
