//! When a copy of a map has to ask, and when it cannot be trusted any more: decided from the
//! server's heads and a clock that is handed in.
//!
//! Increments are applied as their writers put them, before the server has taken them. Whatever the
//! server then refuses, or never sees, shows here: the copy's digest differs at the server's
//! vector, the copy stays ahead of it, or two increments of one number meet. Only heads that were
//! asked for count as the server's word; a published one may come from anybody and says no more
//! than that there may be something to ask for.

use fht_proto::api::reply::Head;
use fht_proto::{Digest, VersionVector};
use serde::{Deserialize, Serialize};
use std::time::{Duration, Instant};

/// How patient a copy is.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct StalenessConfig {
    /// How long increments that a head shows may be under way before they are asked for, seconds.
    /// Default 0.3.
    pub behind_s: f64,
    /// How long the copy may have increments that the server does not tell of, seconds. Default 10.
    pub ahead_s: f64,
    /// Shortest and longest pause after a question whose answer brought nothing, seconds. Default
    /// 0.5 to 5.
    pub ask_pause_s: [f64; 2],
    /// The same after one that nobody answered: the link may be back any moment, seconds. Default
    /// 0.25 to 0.5.
    pub link_pause_s: [f64; 2],
    /// Shortest and longest pause after fetching the whole map again, seconds. Default 2 to 60.
    pub refetch_pause_s: [f64; 2],
}

impl Default for StalenessConfig {
    fn default() -> Self {
        Self {
            behind_s: 0.3,
            ahead_s: 10.0,
            ask_pause_s: [0.5, 5.0],
            link_pause_s: [0.25, 0.5],
            refetch_pause_s: [2.0, 60.0],
        }
    }
}

/// What to do now.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StalenessStep {
    /// Nothing.
    Wait,
    /// Ask for what is missing.
    CatchUp,
    /// Fetch the whole map again and let go of the copy.
    Refetch,
}

/// A time that a configuration says. What is no time (negative, not a number) is none.
pub(crate) fn seconds(seconds: f64) -> Duration {
    Duration::try_from_secs_f64(seconds).unwrap_or_default()
}

/// Pauses that double.
#[derive(Clone, Debug)]
struct Pause {
    range: (Duration, Duration),
    current: Duration,
    until: Option<Instant>,
}

impl Pause {
    fn new(range: (Duration, Duration)) -> Self {
        Self { range, current: range.0, until: None }
    }

    fn is_over(&self, now: Instant) -> bool {
        self.until.is_none_or(|until| now >= until)
    }

    fn begin(&mut self, now: Instant) {
        self.until = Some(now + self.current);
        self.current = (self.current * 2).min(self.range.1);
    }

    fn end(&mut self) {
        *self = Self::new(self.range);
    }
}

/// What is known of the server, against the copy.
#[derive(Clone, Debug)]
pub struct Staleness {
    config: StalenessConfig,
    /// What there is to have, as far as was heard.
    target: VersionVector,
    /// The digest at a vector that the server told, until it is compared.
    told: Option<(VersionVector, Digest)>,
    behind_since: Option<Instant>,
    /// What the copy had when it was first seen ahead of the server.
    ahead: Option<(VersionVector, Instant)>,
    is_suspect: bool,
    /// Whether the copy was just seen to be what the server has.
    agrees: bool,
    /// Whether fetching the whole map again has begun.
    is_interrupted: bool,
    ask_pause: Pause,
    link_pause: Pause,
    refetch_pause: Pause,
}

impl Staleness {
    /// Before any head.
    #[must_use]
    pub fn new(config: StalenessConfig) -> Self {
        Self {
            target: VersionVector::default(),
            told: None,
            behind_since: None,
            ahead: None,
            is_suspect: false,
            agrees: false,
            is_interrupted: false,
            ask_pause: Pause::new(config.ask_pause_s.map(seconds).into()),
            link_pause: Pause::new(config.link_pause_s.map(seconds).into()),
            refetch_pause: Pause::new(config.refetch_pause_s.map(seconds).into()),
            config,
        }
    }

    /// A head was published.
    pub fn published(&mut self, head: &Head) {
        self.target = self.target.join(&head.vector);
    }

    /// The server was asked at `now` and told its head; the copy has `mine`.
    pub fn answered(&mut self, head: Head, mine: &VersionVector, now: Instant) {
        self.ahead = match self.ahead.take() {
            // Still without something that the copy had so long ago: the server refused it, or lost
            // it.
            Some((then, since)) if !head.vector.covers(&then) => {
                self.is_suspect |= now.duration_since(since) >= seconds(self.config.ahead_s);
                Some((then, since))
            }
            _ if head.vector.covers(mine) => None,
            _ => Some((mine.clone(), now)),
        };
        self.target.clone_from(&head.vector);
        self.told = Some((head.vector, head.digest));
    }

    /// Two different increments of one author and number have met.
    pub fn conflict(&mut self) {
        self.is_suspect = true;
    }

    /// What was missing was asked for and brought so many increments.
    pub fn caught_up(&mut self, brought: usize, now: Instant) {
        self.behind_since = None;
        if brought == 0 {
            self.ask_pause.begin(now);
        } else {
            self.ask_pause.end();
        }
        self.link_pause.end();
    }

    /// What was missing was asked for, and nobody answered.
    pub fn unanswered(&mut self, now: Instant) {
        self.behind_since = None;
        self.link_pause.begin(now);
    }

    /// The whole map was asked for again, and has come.
    pub fn refetched(&mut self, now: Instant) {
        self.refetch_pause.begin(now);
        self.ask_pause.end();
        self.is_interrupted = false;
        self.is_suspect = false;
        self.ahead = None;
        self.told = None;
    }

    /// The whole map was asked for again, and the server fell silent before it had all come. The
    /// next attempt goes on there, and soon.
    pub fn interrupted(&mut self, now: Instant) {
        self.is_interrupted = true;
        self.link_pause.begin(now);
    }

    /// Whether the copy was the server's, to the digest, when it was looked last; told once.
    pub fn take_agreement(&mut self) -> bool {
        std::mem::take(&mut self.agrees)
    }

    /// What to do at `now` with a copy that has `mine`; its digest is asked for where it matters.
    pub fn step(&mut self, mine: &VersionVector, digest: impl FnOnce() -> Digest, now: Instant) -> StalenessStep {
        if let Some((vector, told)) = self.told.take()
            && vector == *mine
        {
            self.is_suspect = digest() != told;
            if !self.is_suspect {
                self.agrees = true;
                self.refetch_pause.end();
            }
        }
        let pause = if self.is_interrupted { &self.link_pause } else { &self.refetch_pause };
        if self.is_suspect && pause.is_over(now) {
            return StalenessStep::Refetch;
        }
        if mine.covers(&self.target) {
            self.behind_since = None;
            self.ask_pause.end();
            self.link_pause.end();
            return StalenessStep::Wait;
        }
        let since = *self.behind_since.get_or_insert(now);
        let is_paused = !self.ask_pause.is_over(now) || !self.link_pause.is_over(now);
        let is_due = now.duration_since(since) >= seconds(self.config.behind_s) && !is_paused;
        if is_due { StalenessStep::CatchUp } else { StalenessStep::Wait }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_proto::AuthorId;

    fn vector(count: u64) -> VersionVector {
        let mut vector = VersionVector::default();
        vector.set(AuthorId(1), count);
        vector
    }

    fn digest(byte: u8) -> Digest {
        Digest([byte; 32])
    }

    fn head(count: u64, byte: u8) -> Head {
        Head { version: count, vector: vector(count), digest: digest(byte), ..Head::of_nothing("m".parse().unwrap()) }
    }

    fn clock() -> impl Fn(u64) -> Instant {
        let start = Instant::now();
        move |ms| start + Duration::from_millis(ms)
    }

    #[test]
    fn what_is_missing_is_asked_for_after_a_moment() {
        let (mut follow, at) = (Staleness::new(StalenessConfig::default()), clock());
        follow.published(&head(5, 0));
        assert_eq!(follow.step(&vector(4), || digest(0), at(0)), StalenessStep::Wait);
        assert_eq!(follow.step(&vector(4), || digest(0), at(300)), StalenessStep::CatchUp);
        follow.caught_up(1, at(310));
        assert_eq!(follow.step(&vector(5), || digest(0), at(310)), StalenessStep::Wait);
    }

    #[test]
    fn a_head_that_nobody_can_reach_costs_few_questions() {
        let (mut follow, at) = (Staleness::new(StalenessConfig::default()), clock());
        follow.published(&head(u64::MAX, 0));
        let mut questions = 0;
        for ms in (0..20_000).step_by(50) {
            if follow.step(&vector(4), || digest(0), at(ms)) == StalenessStep::CatchUp {
                questions += 1;
                follow.caught_up(0, at(ms));
            }
        }
        assert!((4..9).contains(&questions), "{questions}");
        // The server's own word ends it.
        follow.answered(head(4, 0), &vector(4), at(20_000));
        assert_eq!(follow.step(&vector(4), || digest(0), at(60_000)), StalenessStep::Wait);
    }

    #[test]
    fn another_digest_at_the_same_vector_is_found() {
        let (mut follow, at) = (Staleness::new(StalenessConfig::default()), clock());
        follow.answered(head(4, 1), &vector(4), at(0));
        assert_eq!(follow.step(&vector(4), || digest(2), at(0)), StalenessStep::Refetch);
        follow.refetched(at(0));
        assert_eq!(follow.step(&vector(4), || digest(1), at(0)), StalenessStep::Wait);
        // At another vector nothing can be compared.
        follow.answered(head(5, 1), &vector(4), at(10));
        assert_eq!(follow.step(&vector(4), || digest(2), at(10)), StalenessStep::Wait);
    }

    #[test]
    fn a_conflict_is_settled_by_the_servers_word() {
        let (mut follow, at) = (Staleness::new(StalenessConfig::default()), clock());
        follow.conflict();
        assert_eq!(follow.step(&vector(4), || digest(0), at(0)), StalenessStep::Refetch);
        follow.refetched(at(0));
        // Again at once: whoever sends rubbish does not make the robot fetch all the time.
        follow.conflict();
        assert_eq!(follow.step(&vector(4), || digest(0), at(100)), StalenessStep::Wait);
        follow.answered(head(4, 7), &vector(4), at(200));
        assert_eq!(follow.step(&vector(4), || digest(7), at(200)), StalenessStep::Wait);
        assert_eq!(follow.step(&vector(4), || digest(7), at(9000)), StalenessStep::Wait, "the copy was right");
    }

    #[test]
    fn staying_ahead_of_the_server_is_suspect_and_running_ahead_is_not() {
        let (mut follow, at) = (Staleness::new(StalenessConfig::default()), clock());
        // The server follows, a little behind.
        for second in 0..60 {
            follow.answered(head(10 + second, 0), &vector(13 + second), at(second * 1000));
            assert_eq!(follow.step(&vector(13 + second), || digest(0), at(second * 1000)), StalenessStep::Wait);
        }
        // It stops short of what the copy has.
        let mut steps = Vec::new();
        for second in 60..73 {
            follow.answered(head(69, 0), &vector(72), at(second * 1000));
            steps.push(follow.step(&vector(72), || digest(0), at(second * 1000)));
        }
        assert_eq!(steps.first(), Some(&StalenessStep::Wait));
        assert_eq!(steps.last(), Some(&StalenessStep::Refetch));
    }
}
