//! When a copy of a map has to ask, and when it cannot be trusted any more: decided from the server's heads and a clock that is
//! handed in.
//!
//! Increments are applied as their writers put them, before the server has taken them. Whatever the server then refuses, or
//! never sees, shows here: the copy's digest differs at the server's vector, the copy stays ahead of it, or two increments of
//! one number meet. Only heads that were asked for count as the server's word; a published one may come from anybody and says
//! no more than that there may be something to ask for.

use fht_proto::query::Head;
use fht_proto::{Digest, VersionVector};
use std::time::{Duration, Instant};

/// How patient a copy is.
#[derive(Clone, Debug)]
pub struct FollowConfig {
    /// How long increments that a head shows may be under way before they are asked for. Default 0.3 s.
    pub behind: Duration,
    /// How long the copy may have increments that the server does not tell of. Default 10 s.
    pub ahead: Duration,
    /// Shortest and longest pause after a question whose answer brought nothing. Default 0.5 s to 5 s.
    pub ask_pause: (Duration, Duration),
    /// The same after one that nobody answered: the link may be back any moment. Default 0.25 s to 0.5 s.
    pub link_pause: (Duration, Duration),
    /// Shortest and longest pause after fetching the whole map again. Default 2 s to 60 s.
    pub refetch_pause: (Duration, Duration),
}

impl Default for FollowConfig {
    fn default() -> Self {
        let seconds = Duration::from_secs;
        Self {
            behind: Duration::from_millis(300),
            ahead: seconds(10),
            ask_pause: (Duration::from_millis(500), seconds(5)),
            link_pause: (Duration::from_millis(250), Duration::from_millis(500)),
            refetch_pause: (seconds(2), seconds(60)),
        }
    }
}

/// What to do now.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Nothing.
    Wait,
    /// Ask for what is missing.
    CatchUp,
    /// Fetch the whole map again and let go of the copy.
    Refetch,
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
pub struct Follow {
    config: FollowConfig,
    /// What there is to have, as far as was heard.
    target: VersionVector,
    /// The digest at a vector that the server told, until it is compared.
    told: Option<(VersionVector, Digest)>,
    behind_since: Option<Instant>,
    /// What the copy had when it was first seen ahead of the server.
    ahead: Option<(VersionVector, Instant)>,
    is_suspect: bool,
    /// Whether fetching the whole map again has begun.
    is_interrupted: bool,
    ask_pause: Pause,
    link_pause: Pause,
    refetch_pause: Pause,
}

impl Follow {
    /// Before any head.
    #[must_use]
    pub fn new(config: FollowConfig) -> Self {
        Self {
            target: VersionVector::default(),
            told: None,
            behind_since: None,
            ahead: None,
            is_suspect: false,
            is_interrupted: false,
            ask_pause: Pause::new(config.ask_pause),
            link_pause: Pause::new(config.link_pause),
            refetch_pause: Pause::new(config.refetch_pause),
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
            // Still without something that the copy had so long ago: the server refused it, or lost it.
            Some((then, since)) if !head.vector.covers(&then) => {
                self.is_suspect |= now.duration_since(since) >= self.config.ahead;
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

    /// The whole map was asked for again, and the server fell silent before it had all come. The next attempt goes on there, and soon.
    pub fn interrupted(&mut self, now: Instant) {
        self.is_interrupted = true;
        self.link_pause.begin(now);
    }

    /// What to do at `now` with a copy that has `mine`; its digest is asked for where it matters.
    pub fn step(&mut self, mine: &VersionVector, digest: impl FnOnce() -> Digest, now: Instant) -> Step {
        if let Some((vector, told)) = self.told.take()
            && vector == *mine
        {
            self.is_suspect = digest() != told;
            if !self.is_suspect {
                self.refetch_pause.end();
            }
        }
        let pause = if self.is_interrupted { &self.link_pause } else { &self.refetch_pause };
        if self.is_suspect && pause.is_over(now) {
            return Step::Refetch;
        }
        if mine.covers(&self.target) {
            self.behind_since = None;
            self.ask_pause.end();
            self.link_pause.end();
            return Step::Wait;
        }
        let since = *self.behind_since.get_or_insert(now);
        let is_paused = !self.ask_pause.is_over(now) || !self.link_pause.is_over(now);
        let is_due = now.duration_since(since) >= self.config.behind && !is_paused;
        if is_due { Step::CatchUp } else { Step::Wait }
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
        Head {
            map: "m".parse().unwrap(),
            version: count,
            vector: vector(count),
            clock_us: 0,
            enabled: None,
            digest: digest(byte),
            main_nodes: 0,
            support_nodes: 0,
            edges: 0,
            bytes: 0,
            refused: 0,
        }
    }

    fn clock() -> impl Fn(u64) -> Instant {
        let start = Instant::now();
        move |ms| start + Duration::from_millis(ms)
    }

    #[test]
    fn what_is_missing_is_asked_for_after_a_moment() {
        let (mut follow, at) = (Follow::new(FollowConfig::default()), clock());
        follow.published(&head(5, 0));
        assert_eq!(follow.step(&vector(4), || digest(0), at(0)), Step::Wait);
        assert_eq!(follow.step(&vector(4), || digest(0), at(300)), Step::CatchUp);
        follow.caught_up(1, at(310));
        assert_eq!(follow.step(&vector(5), || digest(0), at(310)), Step::Wait);
    }

    #[test]
    fn a_head_that_nobody_can_reach_costs_few_questions() {
        let (mut follow, at) = (Follow::new(FollowConfig::default()), clock());
        follow.published(&head(u64::MAX, 0));
        let mut questions = 0;
        for ms in (0..20_000).step_by(50) {
            if follow.step(&vector(4), || digest(0), at(ms)) == Step::CatchUp {
                questions += 1;
                follow.caught_up(0, at(ms));
            }
        }
        assert!((4..9).contains(&questions), "{questions}");
        // The server's own word ends it.
        follow.answered(head(4, 0), &vector(4), at(20_000));
        assert_eq!(follow.step(&vector(4), || digest(0), at(60_000)), Step::Wait);
    }

    #[test]
    fn another_digest_at_the_same_vector_is_found() {
        let (mut follow, at) = (Follow::new(FollowConfig::default()), clock());
        follow.answered(head(4, 1), &vector(4), at(0));
        assert_eq!(follow.step(&vector(4), || digest(2), at(0)), Step::Refetch);
        follow.refetched(at(0));
        assert_eq!(follow.step(&vector(4), || digest(1), at(0)), Step::Wait);
        // At another vector nothing can be compared.
        follow.answered(head(5, 1), &vector(4), at(10));
        assert_eq!(follow.step(&vector(4), || digest(2), at(10)), Step::Wait);
    }

    #[test]
    fn a_conflict_is_settled_by_the_servers_word() {
        let (mut follow, at) = (Follow::new(FollowConfig::default()), clock());
        follow.conflict();
        assert_eq!(follow.step(&vector(4), || digest(0), at(0)), Step::Refetch);
        follow.refetched(at(0));
        // Again at once: whoever sends rubbish does not make the robot fetch all the time.
        follow.conflict();
        assert_eq!(follow.step(&vector(4), || digest(0), at(100)), Step::Wait);
        follow.answered(head(4, 7), &vector(4), at(200));
        assert_eq!(follow.step(&vector(4), || digest(7), at(200)), Step::Wait);
        assert_eq!(follow.step(&vector(4), || digest(7), at(9000)), Step::Wait, "the copy was right");
    }

    #[test]
    fn staying_ahead_of_the_server_is_suspect_and_running_ahead_is_not() {
        let (mut follow, at) = (Follow::new(FollowConfig::default()), clock());
        // The server follows, a little behind.
        for second in 0..60 {
            follow.answered(head(10 + second, 0), &vector(13 + second), at(second * 1000));
            assert_eq!(follow.step(&vector(13 + second), || digest(0), at(second * 1000)), Step::Wait);
        }
        // It stops short of what the copy has.
        let mut steps = Vec::new();
        for second in 60..73 {
            follow.answered(head(69, 0), &vector(72), at(second * 1000));
            steps.push(follow.step(&vector(72), || digest(0), at(second * 1000)));
        }
        assert_eq!(steps.first(), Some(&Step::Wait));
        assert_eq!(steps.last(), Some(&Step::Refetch));
    }
}
