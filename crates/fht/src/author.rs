//! Writing to a map: places, zones, closed edges.

use crate::map::Map;
use fht_client::ask_json_async;
use fht_client::author::{Authorship, NotWritten, write};
use fht_map::{DoubtfulWords, check_place, check_zone};
use fht_perception::pose::{Pose2, to_fixed};
use fht_proto::api::keys::{Key, Topic};
use fht_proto::api::reply::{Head, RulesReply, known_names};
use fht_proto::{EdgeKey, FixedPoint, Invalid, Label, NodeId, Op, Zone, ZoneRule};

impl Map {
    /// Somebody who writes to this map under `name`: an operator, or a program. Give every author a
    /// name of its own.
    #[must_use]
    pub fn author(&self, name: &str) -> Author {
        Author { map: self.clone(), name: name.to_owned(), is_sure: false }
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
    #[error("zone {name}: {reason}")]
    Border {
        /// The zone's name.
        name: String,
        /// What is wrong with it.
        reason: Invalid,
    },
    /// The place or zone makes no sense on the own copy of the map: [`Author::anyway`] writes it
    /// all the same.
    #[error("{0}")]
    Doubtful(#[from] DoubtfulWords),
    /// There is no place or zone of this name.
    #[error("there is no {what} {name} on the map ({})", known_names(known))]
    NoSuch {
        /// `place` or `zone`.
        what: &'static str,
        /// The name.
        name: String,
        /// Those that there are.
        known: Vec<String>,
    },
    /// There is no such node, as far as the own copy knows.
    #[error("there is no node {0} on the map")]
    NoNode(NodeId),
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
    is_sure: bool,
}

fn is_there(what: &'static str, name: &Label, known: Vec<String>) -> Result<(), AuthorError> {
    let is_known = known.iter().any(|known| known == name.as_str());
    if is_known { Ok(()) } else { Err(AuthorError::NoSuch { what, name: name.to_string(), known }) }
}

fn label(name: &str) -> Result<Label, AuthorError> {
    name.parse().map_err(|error| AuthorError::Name(format!("{error}")))
}

impl Author {
    /// Writes places and zones also where they make no sense on the own copy of the map: on ground
    /// that nobody saw, behind walls, beyond the map.
    #[must_use]
    pub fn anyway(mut self) -> Self {
        self.is_sure = true;
        self
    }

    /// What the server has: the own copy may not have yet what was written a moment ago.
    async fn rules(&self) -> Result<RulesReply, NotWritten> {
        let inner = &self.map.inner;
        let selector = Key::topic(&inner.name, Topic::Rules).to_string();
        Ok(ask_json_async(&inner.session, &selector, inner.timeout).await?)
    }

    /// Names a place, or moves the one that has the name, so that queries and robots can go there
    /// by name.
    ///
    /// # Errors
    /// [`AuthorError`].
    pub async fn set_place(&self, name: &str, map_from_place: Pose2) -> Result<Head, AuthorError> {
        let (name, pose) = (label(name)?, to_fixed(&map_from_place));
        if !self.is_sure {
            let map = self.map.newest();
            // It blocks for as long as it takes to find the free space of the whole map.
            let checked = tokio::task::spawn_blocking(move || check_place(&map, pose.position)).await;
            checked.unwrap_or(Ok(()))?;
        }
        self.write(vec![Op::SetPlace { name, pose: Some(pose) }]).await
    }

    /// Takes a place's name away.
    ///
    /// # Errors
    /// [`AuthorError`].
    pub async fn remove_place(&self, name: &str) -> Result<Head, AuthorError> {
        let name = label(name)?;
        let known = self.rules().await?.places.into_iter().map(|place| place.name.to_string());
        is_there("place", &name, known.collect())?;
        self.write(vec![Op::SetPlace { name, pose: None }]).await
    }

    /// Draws a zone with a rule, or redraws the one that has the name. `corners`: its border in
    /// order, map frame, metres.
    ///
    /// # Errors
    /// [`AuthorError`].
    pub async fn set_zone(&self, name: &str, rule: ZoneRule, corners: &[(f64, f64)]) -> Result<Head, AuthorError> {
        let corners = corners.iter().map(|&(x, y)| FixedPoint::from_metres(x, y)).collect();
        let zone = Zone { rule, corners };
        zone.check_border().map_err(|reason| AuthorError::Border { name: name.to_owned(), reason })?;
        if !self.is_sure {
            check_zone(&self.map.newest(), &zone)?;
        }
        self.write(vec![Op::SetZone { name: label(name)?, zone: Some(zone) }]).await
    }

    /// Takes a zone away.
    ///
    /// # Errors
    /// [`AuthorError`].
    pub async fn remove_zone(&self, name: &str) -> Result<Head, AuthorError> {
        let name = label(name)?;
        let known = self.rules().await?.zones.into_iter().map(|zone| zone.name.to_string());
        is_there("zone", &name, known.collect())?;
        self.write(vec![Op::SetZone { name, zone: None }]).await
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
        let map = self.map.newest();
        if let Some(missing) = [a, b].into_iter().find(|id| map.node(*id).is_none()) {
            return Err(AuthorError::NoNode(missing));
        }
        if a == b || !map.has_edge(EdgeKey::new(a, b)) {
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
