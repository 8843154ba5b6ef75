//! How long a program waits for a server, and for what it asks the server for. It is one rule for
//! all programs:
//!
//! * With `--wait SECONDS`: so long, counted from the program's start, for the server, the map and
//!   the place together.
//! * Without it: for the server as long as the program usually does; what the server does not have
//!   is not waited for.
//!
//! What is waited for is said every five seconds on standard error.

use std::time::{Duration, Instant};

/// Time between two remarks.
const REMARK_EVERY: Duration = Duration::from_secs(5);

/// How long a program waits.
#[derive(Clone, Copy, Debug)]
pub struct Waiting {
    program: &'static str,
    began: Instant,
    /// What `--wait` says.
    given: Option<Duration>,
    /// For the server, without `--wait`; none: for ever.
    usual: Option<Duration>,
}

impl Waiting {
    /// How long a server is waited for by a program that asks once.
    pub const USUAL: Duration = Duration::from_secs(10);

    /// From now on, as `--wait` says, in seconds; without it `usual` for the server (none: for
    /// ever).
    #[must_use]
    pub fn new(program: &'static str, given_s: Option<f64>, usual: Option<Duration>) -> Self {
        // What is no duration is for ever.
        let given = given_s.map(|seconds| Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX));
        Self { program, began: Instant::now(), given, usual }
    }

    /// How long opening a session may take from now on; none: for ever.
    #[must_use]
    pub fn for_session(&self) -> Option<Duration> {
        let whole = self.given.or(self.usual).filter(|whole| *whole < Duration::MAX)?;
        Some(whole.saturating_sub(self.began.elapsed()))
    }

    /// For a server that can be reached to answer.
    #[must_use]
    pub fn for_answer(&self) -> Patience {
        let until = match self.given {
            Some(given) => self.began.checked_add(given),
            None => Some(Instant::now() + self.usual.map_or(Self::USUAL, |usual| usual.min(Self::USUAL))),
        };
        Patience::until(self.program, until)
    }

    /// For something that the server does not have yet: a map, a place.
    #[must_use]
    pub fn for_content(&self) -> Patience {
        let until = match self.given {
            Some(given) => self.began.checked_add(given),
            None => Some(self.began),
        };
        Patience::until(self.program, until)
    }
}

/// A wait for one thing.
#[derive(Clone, Debug)]
pub struct Patience {
    program: &'static str,
    /// None: for ever.
    until: Option<Instant>,
    remark_at: Instant,
}

impl Patience {
    fn until(program: &'static str, until: Option<Instant>) -> Self {
        Self { program, until, remark_at: Instant::now() + REMARK_EVERY }
    }

    /// How much of it is left; none: for ever.
    #[must_use]
    pub fn left(&self) -> Option<Duration> {
        self.until.map(|until| until.saturating_duration_since(Instant::now()))
    }

    /// Whether to look again, soon. Says every five seconds `what` is waited for.
    pub fn goes_on(&mut self, what: impl std::fmt::Display) -> bool {
        let now = Instant::now();
        if self.until.is_some_and(|until| now >= until) {
            return false;
        }
        if now >= self.remark_at {
            // Not counted from now: who asks now and then comes late each time.
            self.remark_at = (self.remark_at + REMARK_EVERY).max(now);
            let left = self.until.map(|until| format!(" (for {:.0} s more)", (until - now).as_secs_f64()));
            crate::tell_line!("{}: waiting for {what}{}", self.program, left.unwrap_or_default());
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_was_asked_for_is_waited_for() {
        let usual = Waiting::new("p", None, Some(Waiting::USUAL));
        assert!(usual.for_session().is_some_and(|left| left <= Waiting::USUAL && left > Duration::from_secs(8)));
        assert!(usual.for_answer().goes_on("an answer") && !usual.for_content().goes_on("a map"));
        let robot = Waiting::new("p", None, None);
        assert!(robot.for_session().is_none() && !robot.for_content().goes_on("a map"));
        let given = Waiting::new("p", Some(3.0), None);
        assert!(given.for_session().is_some_and(|left| left <= Duration::from_secs(3)));
        assert!(given.for_content().goes_on("a map"));
        let never = Waiting::new("p", Some(0.0), None);
        assert!(!never.for_answer().goes_on("an answer") && never.for_session() == Some(Duration::ZERO));
        let brief = Waiting::new("p", None, Some(Duration::from_secs(1)));
        assert!(brief.for_answer().left().is_some_and(|left| left <= Duration::from_secs(1)));
        let for_ever = Waiting::new("p", Some(f64::INFINITY), Some(Waiting::USUAL));
        assert!(for_ever.for_session().is_none() && for_ever.for_content().goes_on("a place"));
    }
}
