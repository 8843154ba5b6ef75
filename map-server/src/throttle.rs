//! Lets at most one message a period through and counts the others.

use std::time::{Duration, Instant};

/// A throttle for one kind of message.
#[derive(Debug)]
pub struct Throttle {
    period: Duration,
    passed: Option<Instant>,
    suppressed: u64,
}

impl Throttle {
    /// A throttle that lets one message through per `period`.
    #[must_use]
    pub fn new(period: Duration) -> Self {
        Self { period, passed: None, suppressed: 0 }
    }

    /// Whether a message may pass at `now`; if so, how many were held back since the last one that
    /// did.
    pub fn pass(&mut self, now: Instant) -> Option<u64> {
        if self.passed.is_some_and(|passed| now.duration_since(passed) < self.period) {
            self.suppressed += 1;
            return None;
        }
        self.passed = Some(now);
        Some(std::mem::take(&mut self.suppressed))
    }
}
