//! Who may write what, and how much of the server's room: what a sound increment is held against
//! before it finds its place. Only what writers put is judged. What is stored, what storages hold
//! and what an operator imports was let in before.

use crate::access::RoleList;
use crate::config::{Limits, Quotas, WriterQuota};
use crate::ingest::check::Refusal;
use crate::ingest::intake::{Intake, WriterUse};
use fht_map::WriterRole;
use fht_proto::{AuthorId, MapName};
use std::collections::BTreeMap;

/// For how long it counts that somebody has taken away what others made, microseconds.
const TAKEN_FOR_US: u64 = 3_600_000_000;
/// How long a burst of increments may last that comes faster than the quota, seconds.
const BURST_S: f64 = 10.0;

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
    pub(super) writers: RoleList,
    pub(super) quotas: Quotas,
    allowances: BTreeMap<AuthorId, Allowance>,
    taken: BTreeMap<(MapName, AuthorId), Taken>,
}

/// A writer whose role is known.
#[derive(Clone, Debug)]
pub(super) struct Writer {
    pub(super) author: AuthorId,
    pub(super) role: WriterRole,
    pub(super) name: String,
    quota: WriterQuota,
}

impl Admission {
    /// Nobody has written yet.
    pub(super) fn new(writers: RoleList, quotas: Quotas) -> Self {
        Self { writers, quotas, allowances: BTreeMap::new(), taken: BTreeMap::new() }
    }

    pub(super) fn writer(&self, author: AuthorId) -> Option<Writer> {
        let writers = self.writers.now();
        let (role, name) = writers.role(author).zip(writers.name(author))?;
        Some(Writer { author, role, name: name.to_owned(), quota: self.quotas.of(role).clone() })
    }

    /// A token bucket.
    pub(super) fn check_pace(&mut self, writer: &Writer, passed_us: u64) -> Result<(), Refusal> {
        let per_s = writer.quota.increments_per_s;
        let full = per_s * BURST_S;
        let known = self.allowances.entry(writer.author).or_insert(Allowance { left: full, at_us: passed_us });
        let passed_s = passed_us.saturating_sub(known.at_us) as f64 / 1e6;
        *known = Allowance { left: (known.left + passed_s * per_s).min(full), at_us: passed_us.max(known.at_us) };
        if known.left < 1.0 {
            return Err(Refusal::TooFast { name: writer.name.clone(), per_s });
        }
        known.left -= 1.0;
        Ok(())
    }

    /// Counts `more` nodes of others that a writer takes away; `others` counts those that there
    /// are.
    pub(super) fn take_away(
        &mut self,
        map: &MapName,
        writer: &Writer,
        more: usize,
        others: impl FnOnce() -> usize,
        passed_us: u64,
    ) -> Result<(), Refusal> {
        let share = writer.quota.taken_per_hour_share;
        let is_over = |taken: &Taken| passed_us.saturating_sub(taken.since_us) >= TAKEN_FOR_US;
        self.taken.retain(|_, taken| !is_over(taken));
        let begin = || Taken { since_us: passed_us, allowed: (others() as f64 * share).ceil() as usize, nodes: 0 };
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
pub(super) struct Room<'a> {
    pub(super) maps: &'a BTreeMap<MapName, Intake>,
    pub(super) map: &'a MapName,
    pub(super) limits: &'a Limits,
}

impl Room<'_> {
    /// Whether an increment of so many bytes and at most so many elements is within its writer's
    /// quota, and outside of what is kept for operators.
    pub(super) fn check(&self, writer: &Writer, reserve: f64, bytes: u64, elements: usize) -> Result<(), Refusal> {
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
