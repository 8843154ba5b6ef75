//! The writer with its guard: roles and quotas before an increment finds its place.

use crate::access::RoleList;
use crate::config::Quotas;
use crate::ingest::admission::{Admission, Room};
use crate::ingest::check::{Checked, Refusal};
use crate::ingest::pipeline::Ingest;
use crate::store::{IncrementOrigin, Piece, StoreError};
use fht_map::{WriterRole, WriterRoles, takes_from_others};
use fht_proto::api::quota::{QuotaChange, QuotaReply};
use fht_proto::{AuthorId, CompactedSeries, Increment, MapName, NodeId, decode};
use std::collections::{BTreeMap, BTreeSet};

/// Counts the increments in a piece of a log that its author may not write.
fn against_roles(writers: &WriterRoles, piece: Piece<'_>) -> usize {
    match piece {
        Piece::Increment(bytes) => {
            decode::<Increment>(bytes).is_ok_and(|increment| writers.check(&increment).is_err()).into()
        }
        Piece::Compacted(bytes) => decode::<CompactedSeries>(bytes).map_or(0, |series| {
            let is_against = |op| writers.check_op(series.author, op).is_err();
            series.rests.iter().filter(|rest| rest.ops.iter().any(|(_, op)| is_against(op))).count()
        }),
    }
}

impl Ingest {
    /// The same, where only those may write who have a role, and what it allows, within the quotas.
    /// What the log holds against the roles stays, and is named in the program's log.
    ///
    /// # Errors
    /// [`StoreError`] when the log cannot be read.
    pub fn guarded_by(mut self, list: impl Into<RoleList>, quotas: Quotas) -> Result<Self, StoreError> {
        let list = list.into();
        let writers = list.now();
        self.count_elements();
        let mut against: BTreeMap<(String, AuthorId), usize> = BTreeMap::new();
        let maps = &mut self.maps;
        self.log.reader().for_each(None, &mut |name, author, _, piece| {
            if let Some(intake) = name.parse::<MapName>().ok().and_then(|map| maps.get_mut(&map)) {
                intake.by_author.entry(author).or_default().bytes += piece.bytes().len() as u64;
            }
            // Who has left the fleet has no role, and may have had any.
            if writers.role(author).is_some() {
                *against.entry((name.to_owned(), author)).or_default() += against_roles(&writers, piece);
            }
            Ok(())
        })?;
        for ((map, author), count) in against.iter().filter(|(_, count)| **count > 0) {
            let name = writers.name(*author).unwrap_or_default();
            tracing::warn!(
                "map {map} has {count} increments of {name} that its role does not allow, from before the roles: \
                 map-server undo {map} --author {name} --against-roles FILE takes back those that are not folded"
            );
        }
        self.admission = Some(Admission::new(list, quotas));
        Ok(self)
    }

    /// Counts which elements of all maps are whose.
    fn count_elements(&mut self) {
        for view in self.catalog.views() {
            let Some(intake) = self.maps.get_mut(&view.head.map) else { continue };
            for (author, elements) in view.state.elements_by_writer() {
                intake.by_author.entry(author).or_default().elements = elements;
            }
        }
    }

    /// Counts again what is there for whom in all maps.
    pub(super) fn count_all(&mut self) -> Result<(), StoreError> {
        if self.admission.is_some() {
            self.maps.values_mut().for_each(|intake| intake.by_author.clear());
            self.count_elements();
        }
        let maps: Vec<MapName> = self.maps.keys().cloned().collect();
        maps.iter().try_for_each(|map| self.recount(map))
    }

    /// Counts again what is there for whom in a map that was compacted.
    pub(super) fn recount(&mut self, map: &MapName) -> Result<(), StoreError> {
        match self.maps.get_mut(map).filter(|_| self.admission.is_some()) {
            Some(intake) => intake.recount_bytes(map, self.log.as_ref()),
            None => Ok(()),
        }
    }

    /// What writers take and may take of a map and of all, after the change, if there is one.
    ///
    /// # Errors
    /// A sentence: there are no roles, or the writer has none.
    pub fn quotas(&mut self, map: &MapName, change: Option<&QuotaChange>) -> Result<QuotaReply, String> {
        let none = || "quotas hold where the server knows roles: map-server --roles roles.json5".to_owned();
        let admission = self.admission.as_mut().ok_or_else(none)?;
        if let Some(change) = change {
            admission.set_quota(change)?;
            tracing::warn!("an operator has set a quota, until the server starts again: {change}");
        }
        let room = Room { maps: &self.maps, map, limits: &self.limits };
        Ok(QuotaReply { map: map.clone(), writers: admission.quotas_in_use(&room) })
    }

    /// Holds an increment against its author's role and quota. `None`: it comes too early to be
    /// judged, and its writer sends it again.
    pub(super) fn admit(&mut self, checked: Checked, now_us: u64) -> Result<Option<Checked>, Refusal> {
        // A clock that is set back must not stop a writer for as long.
        let passed_us = self.passed.at(now_us);
        let (coming_bytes, coming_elements) = self.coming(&checked);
        let Some(admission) = self.admission.as_mut().filter(|_| checked.origin == IncrementOrigin::Writer) else {
            return Ok(Some(checked));
        };
        let Checked { map, increment, .. } = &checked;
        let Increment { author, number, ops, .. } = increment;
        admission.writers.now().check(increment)?;
        // Increments have at least one operation, and so their author has a role.
        let Some(writer) = admission.writer(*author) else { return Ok(None) };
        admission.check_pace(&writer, passed_us)?;
        let written = self.maps.get(map).map_or(0, |intake| intake.sequence.vector().get(*author));
        if *number <= written {
            return Ok(Some(checked)); // it is there, or is another one of its number
        }
        let reserve = admission.quotas.operators_reserve_share;
        let room = Room { maps: &self.maps, map, limits: &self.limits };
        if let Err(refusal) = room.check(&writer, reserve, coming_bytes, coming_elements) {
            let may_exceed = writer.role == WriterRole::Operator && self.may_exceed(&checked);
            return if may_exceed { Ok(Some(checked)) } else { Err(refusal) };
        }
        let taken: BTreeSet<NodeId> = ops.iter().filter_map(|op| takes_from_others(*author, op)).collect();
        if taken.is_empty() || writer.role == WriterRole::Operator {
            return Ok(Some(checked));
        }
        // In order, so that each is counted once and none that waits goes uncounted.
        if *number != written + 1 {
            return Ok(None);
        }
        let state = self.catalog.view(map).map(|view| view.state);
        let others = || {
            let nodes = state.iter().flat_map(|state| state.nodes());
            nodes.filter(|node| node.id.author != *author).count()
        };
        admission.take_away(map, &writer, taken.len(), others, passed_us)?;
        Ok(Some(checked))
    }
}
