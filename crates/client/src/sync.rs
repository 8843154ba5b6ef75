//! How a copy of a map keeps up, without a network and a clock of its own: what came in, what to
//! ask for next.
//!
//! Increments are applied as their writers put them. Whenever the server's head shows more than has
//! come, the rest is asked for, in parts of limited size and one question at a time, so that live
//! increments get through on a thin link. Each part comes in pieces, and each piece counts at once:
//! a question that breaks off is put again with what is lacking then. When the copy turns out not
//! to be what the server has ([`crate::staleness`]), the map is fetched anew and takes the copy's
//! place in one step.
//!
//! What the robot runs is the release that is enabled, or else the copy as it grows. A release that
//! the copy is not just at is fetched like the rest, beside it, and is run once it is whole and its
//! digest is right; until then the robot goes on with what it ran.

use crate::staleness::{Staleness, StalenessConfig, StalenessStep, seconds};
use fht_map::{Accepted, MapState, Replica, WriterRoles};
use fht_proto::api::reply::{Head, Series};
use fht_proto::{Increment, Release, ReleaseId, VersionVector};
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use std::time::Instant;

/// How a copy keeps up.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct SyncConfig {
    /// When it asks and when it does not trust itself any more.
    pub follow: StalenessConfig,
    /// The head is asked for this often, in case its publication was lost, seconds. Default 2.
    pub head_every_s: f64,
    /// A release that could not be fetched is asked for again after this, seconds. Default 10.
    pub release_pause_s: f64,
}

impl Default for SyncConfig {
    fn default() -> Self {
        Self { follow: StalenessConfig::default(), head_every_s: 2.0, release_pause_s: 10.0 }
    }
}

/// What to ask the server for. Every question ends with one call that says so, whether it was
/// answered or not.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SyncQuestion {
    /// The head; ends with [`Sync::head_answered`].
    Head,
    /// A part of what a copy with these increments lacks; ends with [`Sync::part_ended`].
    Since(VersionVector),
    /// A part of what a copy with the increments `have` lacks of the state at `vector`; ends with
    /// [`Sync::part_ended`].
    At {
        /// The state.
        vector: VersionVector,
        /// What is there of it.
        have: VersionVector,
    },
}

/// The release that a robot runs.
#[derive(Clone, Debug)]
pub struct Running {
    /// Which.
    pub id: ReleaseId,
    /// Its state.
    pub state: Arc<MapState>,
}

/// What is being fetched.
#[derive(Debug)]
enum Fetch {
    /// What the copy lacks; so many increments came.
    Rest { brought: usize },
    /// The whole map again.
    Whole { fresh: Box<Replica> },
    /// A release.
    Release { id: ReleaseId, release: Release, fresh: Box<Replica> },
}

/// A part under way.
#[derive(Debug)]
struct Part {
    fetch: Fetch,
    /// Whether the question was put and has not ended.
    is_asked: bool,
    /// Whether the part has brought anything so far.
    has_news: bool,
    /// Whether the server has said that nothing is lacking.
    is_complete: bool,
}

impl Part {
    fn of(fetch: Fetch) -> Self {
        Self { fetch, is_asked: false, has_news: false, is_complete: false }
    }
}

/// The state of keeping up.
#[derive(Debug)]
pub struct Sync {
    config: SyncConfig,
    roles: Option<WriterRoles>,
    follow: Staleness,
    part: Option<Part>,
    /// A map that was being fetched again when the server fell silent: the next attempt goes on
    /// there.
    begun: Option<Box<Replica>>,
    running: Option<Running>,
    /// A release that could not be fetched is not asked for again before this.
    release_after: Option<Instant>,
    head_asked_at: Option<Instant>,
    is_head_under_way: bool,
    /// Whether the server has ever had the map.
    is_known: bool,
    /// Whether the server had the map no more when it was asked last.
    is_gone: bool,
    /// Whether the map was gone, and it is not known yet that the copy is what is there now. Then
    /// what comes is not taken into it: it may be of another map.
    is_in_doubt: bool,
    /// The copy when it was last seen to be the server's. What writers have put into it since may
    /// be of another map.
    agreed: Option<MapState>,
    generation: u64,
}

/// Whether anything was applied.
fn count(outcomes: &[Accepted]) -> usize {
    outcomes.iter().map(|outcome| if let Accepted::Applied(count) = outcome { *count } else { 0 }).sum()
}

/// Feeds a replica; says what became of each piece.
fn feed(replica: &mut Replica, series: Series) -> Vec<Accepted> {
    let mut outcomes: Vec<Accepted> = series.folds.iter().map(|fold| replica.accept_fold(fold)).collect();
    outcomes.extend(series.increments.into_iter().map(|increment| replica.accept(increment)));
    outcomes
}

impl Sync {
    /// Before anything is known: the first thing is to ask.
    #[must_use]
    pub fn new(config: SyncConfig) -> Self {
        Self {
            follow: Staleness::new(config.follow.clone()),
            config,
            roles: None,
            part: Some(Part::of(Fetch::Rest { brought: 0 })),
            begun: None,
            running: None,
            release_after: None,
            head_asked_at: None,
            is_head_under_way: false,
            is_known: false,
            is_gone: false,
            is_in_doubt: false,
            agreed: None,
            generation: 0,
        }
    }

    /// The same for a copy that knows who may write what: of what writers put it takes only what
    /// their roles allow, as the server does. What the server has stored it takes in any case.
    #[must_use]
    pub fn with_roles(self, roles: Option<WriterRoles>) -> Self {
        Self { roles, ..self }
    }

    /// What to ask for at `now`, if anything. Call it until it has no more.
    pub fn poll(&mut self, copy: &Replica, now: Instant) -> Option<SyncQuestion> {
        let is_due = self.head_asked_at.is_none_or(|at| now.duration_since(at) >= seconds(self.config.head_every_s));
        if is_due && !self.is_head_under_way {
            self.head_asked_at = Some(now);
            self.is_head_under_way = true;
            return Some(SyncQuestion::Head);
        }
        if self.part.is_none() {
            let step = self.follow.step(copy.vector(), || copy.state().digest(), now);
            if self.follow.take_agreement() {
                // It shares everything with the copy.
                self.agreed = Some(copy.state().clone());
                self.is_in_doubt = self.is_gone;
            }
            let fetch = match step {
                StalenessStep::Wait => self.release_to_fetch(copy, now)?,
                StalenessStep::CatchUp if self.is_in_doubt => return None,
                StalenessStep::CatchUp => Fetch::Rest { brought: 0 },
                StalenessStep::Refetch => Fetch::Whole { fresh: self.begun.take().unwrap_or_default() },
            };
            self.part = Some(Part::of(fetch));
        }
        let part = self.part.as_mut().filter(|part| !part.is_asked)?;
        (part.is_asked, part.has_news, part.is_complete) = (true, false, false);
        Some(match &part.fetch {
            Fetch::Rest { .. } => SyncQuestion::Since(copy.vector().clone()),
            Fetch::Whole { fresh } => SyncQuestion::Since(fresh.vector().clone()),
            Fetch::Release { release, fresh, .. } => {
                SyncQuestion::At { vector: release.vector.clone(), have: fresh.vector().clone() }
            }
        })
    }

    /// The release that the robot runs; none: the copy as it is.
    #[must_use]
    pub fn running(&self) -> Option<&Running> {
        self.running.as_ref()
    }

    /// Takes what is enabled into use, if it is at hand; returns what must be fetched for it, if it
    /// may be asked for now.
    fn release_to_fetch(&mut self, copy: &Replica, now: Instant) -> Option<Fetch> {
        let Some(enabled) = copy.state().annotations().enabled() else {
            self.running = None;
            return None;
        };
        if self.running.as_ref().is_some_and(|running| running.id == *enabled.id) {
            return None;
        }
        let (id, release) = (enabled.id.clone(), enabled.release.clone());
        if *copy.vector() == release.vector && copy.state().digest() == release.digest {
            self.running = Some(Running { id, state: Arc::new(copy.state().clone()) });
            return None;
        }
        let is_due = self.release_after.is_none_or(|after| now >= after);
        is_due.then(|| Fetch::Release { id, release, fresh: Box::default() })
    }

    /// A number that changes when the copy is that of another map, which has come to the name: what
    /// was known by the old one, such as the robot's place, is void.
    #[must_use]
    pub fn generation(&self) -> u64 {
        self.generation
    }

    /// The server has no such map. If it has had it, what writers put from here on is not of the
    /// map that the copy is of.
    pub fn map_gone(&mut self) {
        self.is_gone = self.is_known;
        self.is_in_doubt |= self.is_gone;
    }

    /// Whether the map is being fetched anew, because the copy cannot be trusted.
    #[must_use]
    pub fn is_refetching(&self) -> bool {
        self.part.as_ref().is_some_and(|part| matches!(part.fetch, Fetch::Whole { .. }))
    }

    /// A writer has put an increment. Returns how many were applied.
    pub fn live(&mut self, copy: &mut Replica, increment: Increment) -> usize {
        if let Some(violation) = self.roles.as_ref().and_then(|roles| roles.check(&increment).err()) {
            tracing::debug!("an increment is left out unless the server takes it: {violation}");
            return 0;
        }
        if self.is_in_doubt {
            return 0;
        }
        let outcome = copy.accept(increment);
        self.note(std::slice::from_ref(&outcome));
        count(&[outcome])
    }

    /// A head was published; it may come from anybody.
    pub fn head_published(&mut self, head: &Head) {
        self.follow.published(head);
    }

    /// The question for the head has ended.
    pub fn head_answered(&mut self, copy: &Replica, head: Option<Head>, now: Instant) {
        self.is_head_under_way = false;
        if let Some(head) = head {
            let is_gone = head.deletion.as_ref().is_some_and(|deletion| deletion.done);
            self.is_known = true;
            self.is_in_doubt |= is_gone;
            if std::mem::replace(&mut self.is_gone, is_gone) && !is_gone {
                // One of its name is there: the same again, or another one.
                self.follow.conflict();
            }
            self.follow.answered(head, copy.vector(), now);
        }
    }

    /// A piece of the part asked for. Returns how many increments were applied to the copy.
    pub fn piece(&mut self, copy: &mut Replica, series: Series) -> usize {
        let Some(part) = self.part.as_mut().filter(|part| part.is_asked) else { return 0 };
        part.is_complete |= series == Series::default();
        match &mut part.fetch {
            Fetch::Whole { fresh } | Fetch::Release { fresh, .. } => {
                part.has_news |= count(&feed(fresh, series)) > 0;
                0
            }
            Fetch::Rest { .. } if self.is_in_doubt => 0,
            Fetch::Rest { brought } => {
                let outcomes = feed(copy, series);
                let applied = count(&outcomes);
                part.has_news |= applied > 0;
                *brought += applied;
                self.note(&outcomes);
                applied
            }
        }
    }

    /// The question for a part has ended at `now`, answered or not. Returns whether the copy was
    /// replaced, or what is run.
    pub fn part_ended(&mut self, copy: &mut Replica, now: Instant) -> bool {
        let Some(mut part) = self.part.take() else { return false };
        part.is_asked = false;
        if part.has_news {
            // Perhaps there is more.
            self.part = Some(part);
            return false;
        }
        match part.fetch {
            Fetch::Release { id, release, fresh } => {
                let state = fresh.state();
                let is_whole = *fresh.vector() == release.vector && state.digest() == release.digest;
                if is_whole {
                    self.running = Some(Running { id, state: Arc::new(state.clone()) });
                } else {
                    tracing::warn!(%id, "the release that is enabled cannot be had whole; the robot goes on with what it runs");
                    self.release_after = Some(now + seconds(self.config.release_pause_s));
                }
                is_whole
            }
            Fetch::Rest { brought } => {
                // Whoever has nothing to say says so.
                if brought == 0 && !part.is_complete {
                    self.follow.unanswered(now);
                } else {
                    self.follow.caught_up(brought, now);
                }
                false
            }
            Fetch::Whole { fresh } => {
                if part.is_complete {
                    self.follow.refetched(now);
                    let agreed = self.agreed.as_ref().filter(|agreed| agreed.nodes().next().is_some());
                    let before = agreed.unwrap_or_else(|| copy.state());
                    if !before.shares_history(fresh.state()) {
                        self.generation += 1;
                        // Its releases are others, whatever they are called.
                        self.running = None;
                    }
                    *copy = *fresh;
                    self.agreed = Some(copy.state().clone());
                    self.is_in_doubt = self.is_gone;
                } else {
                    self.follow.interrupted(now);
                    self.begun = Some(fresh);
                }
                part.is_complete
            }
        }
    }

    fn note(&mut self, outcomes: &[Accepted]) {
        if outcomes.contains(&Accepted::Conflict) {
            self.follow.conflict();
        }
    }
}

#[cfg(test)]
mod tests;
