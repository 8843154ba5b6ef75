//! Who may write what, and how much of the server's room: what a sound increment is held against
//! before it finds its place. Only what writers put is judged. What is stored, what storages hold
//! and what an operator imports was let in before.

use crate::catalog::AddedElements;
use crate::config::{Limits, Quotas, WriterQuota};
use crate::ingest::check::{Checked, Refusal};
use crate::ingest::pipeline::{Ingest, Intake};
use crate::store::{IncrementLog, IncrementOrigin, Piece, StoreError};
use fht_map::{WriterRole, WriterRoles, takes_from_others};
use fht_proto::{AuthorId, CompactedSeries, Increment, MapName, NodeId, decode};
use std::collections::{BTreeMap, BTreeSet};

/// For how long it counts that somebody has taken away what others made, microseconds.
const TAKEN_FOR_US: u64 = 3_600_000_000;
/// How long a burst of increments may last that comes faster than the quota, seconds.
const BURST_S: f64 = 10.0;

/// What of a map is there for one author.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct WriterUse {
    bytes: u64,
    elements: usize,
}

impl WriterUse {
    pub(super) fn add(&mut self, bytes: u64, elements: usize) {
        self.bytes += bytes;
        self.elements += elements;
    }
}

/// Increments that an author may still write at once.
#[derive(Clone, Copy, Debug)]
struct Allowance {
    left: f64,
    at_us: u64,
}

/// What an author has taken away of what others made.
#[derive(Clone, Copy, Debug)]
struct Taken {
    since_us: u64,
    allowed: usize,
    nodes: usize,
}

/// The roles and quotas of a server, and what the writers have used of them.
#[derive(Debug)]
pub(super) struct Admission {
    writers: WriterRoles,
    quotas: Quotas,
    allowances: BTreeMap<AuthorId, Allowance>,
    taken: BTreeMap<(MapName, AuthorId), Taken>,
}

/// A writer whose role is known.
#[derive(Clone, Debug)]
struct Writer {
    author: AuthorId,
    role: WriterRole,
    name: String,
    quota: WriterQuota,
}

impl Admission {
    fn writer(&self, author: AuthorId) -> Option<Writer> {
        let (role, name) = self.writers.role(author).zip(self.writers.name(author))?;
        Some(Writer { author, role, name: name.to_owned(), quota: self.quotas.of(role).clone() })
    }

    /// A token bucket.
    fn check_pace(&mut self, writer: &Writer, now_us: u64) -> Result<(), Refusal> {
        let per_s = writer.quota.increments_per_s;
        let full = per_s * BURST_S;
        let known = self.allowances.entry(writer.author).or_insert(Allowance { left: full, at_us: now_us });
        let passed_s = now_us.saturating_sub(known.at_us) as f64 / 1e6;
        *known = Allowance { left: (known.left + passed_s * per_s).min(full), at_us: now_us.max(known.at_us) };
        if known.left < 1.0 {
            return Err(Refusal::TooFast { name: writer.name.clone(), per_s });
        }
        known.left -= 1.0;
        Ok(())
    }

    /// Counts `more` nodes of others that a writer takes away; `others` counts those that there
    /// are.
    fn take_away(
        &mut self,
        map: &MapName,
        writer: &Writer,
        more: usize,
        others: impl FnOnce() -> usize,
        now_us: u64,
    ) -> Result<(), Refusal> {
        let share = writer.quota.taken_per_hour_share;
        let is_over = |taken: &Taken| now_us.saturating_sub(taken.since_us) >= TAKEN_FOR_US;
        self.taken.retain(|_, taken| !is_over(taken));
        let begin = || Taken { since_us: now_us, allowed: (others() as f64 * share).ceil() as usize, nodes: 0 };
        let taken = self.taken.entry((map.clone(), writer.author)).or_insert_with(begin);
        if taken.nodes + more > taken.allowed {
            let (name, allowed) = (writer.name.clone(), taken.allowed);
            return Err(Refusal::TakenAway { name, taken: taken.nodes, more, allowed });
        }
        taken.nodes += more;
        Ok(())
    }
}

/// Where room is needed: in a map, in all of them.
struct Room<'a> {
    maps: &'a BTreeMap<MapName, Intake>,
    map: &'a MapName,
    limits: &'a Limits,
}

impl Room<'_> {
    /// Whether an increment of so many bytes and at most so many elements is within its writer's
    /// quota, and outside of what is kept for operators.
    fn check(&self, writer: &Writer, reserve: f64, bytes: u64, elements: usize) -> Result<(), Refusal> {
        let limits = self.limits;
        let uses = || self.maps.values().filter_map(|intake| intake.by_author.get(&writer.author));
        let (known, own) = match self.maps.get(self.map) {
            None => ((0, 0), WriterUse::default()),
            Some(intake) => {
                let own = intake.by_author.get(&writer.author).copied().unwrap_or_default();
                ((intake.bytes, intake.elements as u64), own)
            }
        };
        let is_new = u64::from(!self.maps.contains_key(self.map));
        let all = |of: fn(&Intake) -> u64| self.maps.values().map(of).sum::<u64>();
        let all_own = |of: fn(&WriterUse) -> u64| uses().map(of).sum::<u64>();
        let more = elements as u64;
        let WriterQuota { map_share, total_share, .. } = writer.quota;
        let (map_elements, total_elements) = (limits.max_map_elements as u64, limits.max_total_elements as u64);
        // What, how much of it is there for the writer and for all, how much comes, the limit, the
        // writer's share.
        let rows = [
            ("maps", uses().count() as u64, self.maps.len() as u64, is_new, limits.max_maps as u64, total_share),
            ("bytes in this map", own.bytes, known.0, bytes, limits.max_map_bytes, map_share),
            ("nodes and edges in this map", own.elements as u64, known.1, more, map_elements, map_share),
            (
                "bytes in all maps",
                all_own(|own| own.bytes),
                all(|intake| intake.bytes),
                bytes,
                limits.max_total_bytes,
                total_share,
            ),
            (
                "nodes and edges in all maps",
                all_own(|own| own.elements as u64),
                all(|intake| intake.elements as u64),
                more,
                total_elements,
                total_share,
            ),
        ];
        let part = |limit: u64, share: f64| (limit as f64 * share) as u64;
        for (of, own, all, more, limit, share) in rows {
            // A map that is there begins for nobody.
            if more == 0 {
                continue;
            }
            let most = part(limit, share);
            if own + more > most {
                return Err(Refusal::Quota { role: writer.role, name: writer.name.clone(), of, most });
            }
            if writer.role != WriterRole::Operator && all + more > part(limit, 1.0 - reserve) {
                return Err(Refusal::Reserved(of));
            }
        }
        Ok(())
    }
}

impl Intake {
    /// What was added is durable, and counted.
    pub(super) fn added(&mut self, added: &AddedElements, increments: &[Increment]) {
        self.elements = added.total;
        for ((author, elements), increment) in added.by_author.iter().zip(increments) {
            let own = self.by_author.entry(*author).or_default();
            // It was counted by its operations.
            own.elements = (own.elements + elements).saturating_sub(increment.ops.len());
        }
    }

    /// Counts again how many bytes are there for whom.
    fn recount_bytes(&mut self, map: &MapName, log: &dyn IncrementLog) -> Result<(), StoreError> {
        self.by_author.values_mut().for_each(|own| own.bytes = 0);
        log.reader().for_each(Some(map), &mut |_, author, _, piece| {
            self.by_author.entry(author).or_default().bytes += piece.bytes().len() as u64;
            Ok(())
        })
    }
}

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
    pub fn guarded_by(mut self, writers: WriterRoles, quotas: Quotas) -> Result<Self, StoreError> {
        for view in self.catalog.views() {
            let Some(intake) = self.maps.get_mut(&view.head.map) else { continue };
            for (author, elements) in view.state.elements_by_writer() {
                intake.by_author.entry(author).or_default().elements = elements;
            }
        }
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
                 map-server undo {map} --author {name} --against-roles FILE takes them back"
            );
        }
        let (allowances, taken) = (BTreeMap::new(), BTreeMap::new());
        self.admission = Some(Admission { writers, quotas, allowances, taken });
        Ok(self)
    }

    /// Counts again what is there for whom in a map that was compacted.
    pub(super) fn recount(&mut self, map: &MapName) -> Result<(), StoreError> {
        match self.maps.get_mut(map).filter(|_| self.admission.is_some()) {
            Some(intake) => intake.recount_bytes(map, self.log.as_ref()),
            None => Ok(()),
        }
    }

    /// Holds an increment against its author's role and quota. `None`: it comes too early to be
    /// judged, and its writer sends it again.
    pub(super) fn admit(&mut self, checked: Checked, now_us: u64) -> Result<Option<Checked>, Refusal> {
        let Some(admission) = self.admission.as_mut().filter(|_| checked.origin == IncrementOrigin::Writer) else {
            return Ok(Some(checked));
        };
        let Checked { map, increment, bytes, .. } = &checked;
        let Increment { author, number, ops, .. } = increment;
        admission.writers.check(increment)?;
        // Increments have at least one operation, and so their author has a role.
        let Some(writer) = admission.writer(*author) else { return Ok(None) };
        admission.check_pace(&writer, now_us)?;
        let written = self.maps.get(map).map_or(0, |intake| intake.sequence.vector().get(*author));
        if *number <= written {
            return Ok(Some(checked)); // it is there, or is another one of its number
        }
        let reserve = admission.quotas.operators_reserve_share;
        let room = Room { maps: &self.maps, map, limits: &self.limits };
        room.check(&writer, reserve, bytes.len() as u64, ops.len())?;
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
        admission.take_away(map, &writer, taken.len(), others, now_us)?;
        Ok(Some(checked))
    }
}
