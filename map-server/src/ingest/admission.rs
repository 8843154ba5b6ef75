//! Who may write what, and how much of the server's room: what a sound increment is held against
//! before it finds its place. Only what writers put is judged. What is stored, what storages hold
//! and what an operator imports was let in before.

use crate::access::RoleList;
use crate::config::{Limits, Quotas, WriterQuota};
use crate::ingest::check::Refusal;
use crate::ingest::intake::{Intake, WriterUse};
use crate::ingest::room::RoomLimit;
use fht_map::WriterRole;
use fht_proto::api::quota::{QuotaChange, QuotaUse, WriterQuotaView};
use fht_proto::api::reply::known_names;
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
    /// Those that an operator has set.
    own_quotas: BTreeMap<AuthorId, WriterQuota>,
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
        Self { writers, quotas, own_quotas: BTreeMap::new(), allowances: BTreeMap::new(), taken: BTreeMap::new() }
    }

    pub(super) fn writer(&self, author: AuthorId) -> Option<Writer> {
        let writers = self.writers.now();
        let (role, name) = writers.role(author).zip(writers.name(author))?;
        let quota = self.own_quotas.get(&author).unwrap_or_else(|| self.quotas.of(role)).clone();
        Some(Writer { author, role, name: name.to_owned(), quota })
    }

    /// All who may write, by name.
    fn all_writers(&self) -> Vec<Writer> {
        let writers = self.writers.now();
        let mut names: Vec<&str> = writers.names().collect();
        names.sort_unstable();
        let all = names.into_iter().filter_map(|name| self.writer(AuthorId::of_robot(name)));
        all.filter(|writer| writer.role != WriterRole::Client).collect()
    }

    /// Sets the quota of a writer, until the server starts again.
    ///
    /// # Errors
    /// A sentence: it may write nothing.
    pub(super) fn set_quota(&mut self, change: &QuotaChange) -> Result<(), String> {
        let author = AuthorId::of_robot(&change.writer);
        let Some(writer) = self.writer(author).filter(|writer| writer.role != WriterRole::Client) else {
            let names: Vec<String> = self.all_writers().into_iter().map(|writer| writer.name).collect();
            return Err(format!("nobody called {} may write here: {}", change.writer, known_names(names.iter())));
        };
        if change.of_role {
            self.own_quotas.remove(&author);
        }
        let before = if change.of_role { self.quotas.of(writer.role).clone() } else { writer.quota };
        let after = WriterQuota {
            map_share: change.map_share.unwrap_or(before.map_share),
            total_share: change.total_share.unwrap_or(before.total_share),
            increments_per_s: change.increments_per_s.unwrap_or(before.increments_per_s),
            taken_per_hour_share: change.taken_per_hour_share.unwrap_or(before.taken_per_hour_share),
        };
        let is_of_role = *change == QuotaChange { writer: change.writer.clone(), of_role: true, ..Default::default() };
        if !is_of_role {
            self.own_quotas.insert(author, after);
        }
        // What it had left at the old pace is not left at the new one.
        self.allowances.remove(&author);
        self.taken.retain(|(_, taker), _| *taker != author);
        Ok(())
    }

    /// What everybody takes and may take of a map and of all.
    pub(super) fn quotas_in_use(&self, room: &Room<'_>) -> Vec<WriterQuotaView> {
        let view = |writer: Writer| {
            let [maps, map_bytes, map_elements, total_bytes, total_elements] =
                room.rows(&writer, 0, 0).map(|row| QuotaUse { used: row.own, most: row.most() });
            WriterQuotaView {
                is_own: self.own_quotas.contains_key(&writer.author),
                role: writer.role.to_string(),
                writer: writer.name,
                map_bytes,
                map_elements,
                total_bytes,
                total_elements,
                maps,
                increments_per_s: writer.quota.increments_per_s,
                taken_per_hour_share: writer.quota.taken_per_hour_share,
            }
        };
        self.all_writers().into_iter().map(view).collect()
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

/// One limit, and where a writer stands to it.
struct Row {
    /// Of what.
    of: RoomLimit,
    /// So much is there for the writer,
    own: u64,
    /// so much for all,
    all: u64,
    /// so much comes.
    more: u64,
    limit: u64,
    /// The writer's share of the limit.
    share: f64,
}

impl Row {
    fn part(&self, share: f64) -> u64 {
        (self.limit as f64 * share) as u64
    }

    /// What the writer may have.
    fn most(&self) -> u64 {
        self.part(self.share)
    }
}

impl Room<'_> {
    /// Whether an increment of so many bytes and at most so many elements is within its writer's
    /// quota, and outside of what is kept for operators.
    pub(super) fn check(&self, writer: &Writer, reserve: f64, bytes: u64, elements: usize) -> Result<(), Refusal> {
        // A map that is there begins for nobody.
        for row in self.rows(writer, bytes, elements as u64).into_iter().filter(|row| row.more > 0) {
            let (of, most) = (row.of, row.most());
            if row.own + row.more > most {
                return Err(Refusal::Quota { role: writer.role, name: writer.name.clone(), of, most });
            }
            if writer.role != WriterRole::Operator && row.all + row.more > row.part(1.0 - reserve) {
                return Err(Refusal::Reserved(of));
            }
        }
        Ok(())
    }

    /// Maps; bytes and elements of the map; bytes and elements of all maps.
    fn rows(&self, writer: &Writer, bytes: u64, elements: u64) -> [Row; 5] {
        let limits = self.limits;
        let uses = || self.maps.values().filter_map(|intake| intake.by_author.get(&writer.author));
        let intake = self.maps.get(self.map);
        let own = intake.and_then(|intake| intake.by_author.get(&writer.author)).copied().unwrap_or_default();
        let all = |of: fn(&Intake) -> u64| self.maps.values().map(of).sum::<u64>();
        let all_own = |of: fn(&WriterUse) -> u64| uses().map(of).sum::<u64>();
        let WriterQuota { map_share, total_share, .. } = writer.quota;
        [
            Row {
                of: RoomLimit::Maps,
                own: uses().count() as u64,
                all: self.maps.len() as u64,
                more: u64::from(intake.is_none()),
                limit: limits.max_maps as u64,
                share: total_share,
            },
            Row {
                of: RoomLimit::MapBytes,
                own: own.bytes,
                all: intake.map_or(0, |intake| intake.bytes),
                more: bytes,
                limit: limits.max_map_bytes,
                share: map_share,
            },
            Row {
                of: RoomLimit::MapElements,
                own: own.elements as u64,
                all: intake.map_or(0, |intake| intake.elements as u64),
                more: elements,
                limit: limits.max_map_elements as u64,
                share: map_share,
            },
            Row {
                of: RoomLimit::TotalBytes,
                own: all_own(|own| own.bytes),
                all: all(|intake| intake.bytes),
                more: bytes,
                limit: limits.max_total_bytes,
                share: total_share,
            },
            Row {
                of: RoomLimit::TotalElements,
                own: all_own(|own| own.elements as u64),
                all: all(|intake| intake.elements as u64),
                more: elements,
                limit: limits.max_total_elements as u64,
                share: total_share,
            },
        ]
    }
}
