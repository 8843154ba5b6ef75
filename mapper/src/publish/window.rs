//! What the server does not have yet: which increment goes out next, and when it is sent again. No
//! network and no clock of its own.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// How much may be under way, and how long.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct WindowConfig {
    /// Increments that may be under way without an acknowledgement. Default 256.
    #[cfg_attr(feature = "schema", schemars(range(min = 1, max = 1000000)))]
    pub max_count: u64,
    /// Bytes that may be under way; one increment always may. Default 1 MiB.
    #[cfg_attr(feature = "schema", schemars(range(min = 1024, max = 4294967296_u64)))]
    pub max_bytes: usize,
    /// How long to wait for news before the server is asked, at first, seconds. Default 1. Doubles
    /// with every repetition that brings none.
    #[cfg_attr(feature = "schema", schemars(range(min = 0.01, max = 3600.0)))]
    pub patience_s: f64,
    /// The longest wait, seconds. Default 30.
    #[cfg_attr(feature = "schema", schemars(range(min = 0.01, max = 3600.0)))]
    pub max_patience_s: f64,
}

impl Default for WindowConfig {
    fn default() -> Self {
        Self { max_count: 256, max_bytes: 1 << 20, patience_s: 1.0, max_patience_s: 30.0 }
    }
}

/// The server has increments that were never made here.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "another robot of the same name writes this map: the server has {stored} increments under this name, and this run has \
     made {written}"
)]
pub struct ForeignWriter {
    /// Number up to which the server has increments of this author.
    pub stored: u64,
    /// Number of the newest increment made here.
    pub written: u64,
}

/// What a run that has ended had made and the server was not known to have.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Backlog {
    /// Number up to which the server had everything.
    pub acknowledged: u64,
    /// The increments after that, in their envelopes, by number, without gaps.
    pub encoded: BTreeMap<u64, Vec<u8>>,
}

impl Backlog {
    /// Nothing: the server has all `stored` increments of earlier runs.
    #[must_use]
    pub fn after(stored: u64) -> Self {
        Self { acknowledged: stored, encoded: BTreeMap::new() }
    }

    /// Number of the newest increment that was ever made.
    #[must_use]
    pub fn written(&self) -> u64 {
        self.encoded.last_key_value().map_or(self.acknowledged, |(number, _)| *number)
    }
}

/// The increments of one run that are not acknowledged, numbered without gaps.
#[derive(Clone, Debug)]
pub struct Window {
    config: WindowConfig,
    encoded: BTreeMap<u64, Vec<u8>>,
    written: u64,
    /// Number of the last one put since the last loss.
    sent: u64,
    acknowledged: u64,
    bytes_under_way: usize,
    /// Since when there is no news of the oldest one under way.
    quiet_since: Option<Instant>,
    patience: Duration,
    next_patience: Duration,
}

impl Window {
    /// Before the first increment.
    #[must_use]
    pub fn new(config: WindowConfig) -> Self {
        Self::after(config, 0)
    }

    /// Before the first increment of a run that goes on where earlier ones ended, of which the
    /// server has `stored` increments.
    #[must_use]
    pub fn after(config: WindowConfig, stored: u64) -> Self {
        Self::of_backlog(config, Backlog::after(stored))
    }

    /// What earlier runs have left is put first.
    #[must_use]
    pub fn of_backlog(config: WindowConfig, backlog: Backlog) -> Self {
        let patience = seconds(config.patience_s);
        Self {
            config,
            written: backlog.written(),
            sent: backlog.acknowledged,
            acknowledged: backlog.acknowledged,
            encoded: backlog.encoded,
            bytes_under_way: 0,
            quiet_since: None,
            patience,
            next_patience: patience,
        }
    }

    /// What this run would leave if it ended now.
    #[must_use]
    pub fn backlog(&self) -> Backlog {
        Backlog { acknowledged: self.acknowledged, encoded: self.encoded.clone() }
    }

    /// Whether the server has everything.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.encoded.is_empty()
    }

    /// Number up to which the server has everything.
    #[must_use]
    pub fn acknowledged(&self) -> u64 {
        self.acknowledged
    }

    /// Adds the increment that was made next.
    pub fn push(&mut self, number: u64, bytes: Vec<u8>) {
        self.written = self.written.max(number);
        self.encoded.insert(number, bytes);
    }

    /// An increment that is not acknowledged, in its envelope.
    #[must_use]
    pub fn get(&self, number: u64) -> Option<&[u8]> {
        self.encoded.get(&number).map(Vec::as_slice)
    }

    /// Whether the server may have everything up to `stored`.
    ///
    /// # Errors
    /// [`ForeignWriter`] when that is more than was made.
    pub fn check(&self, stored: u64) -> Result<(), ForeignWriter> {
        if stored > self.written { Err(ForeignWriter { stored, written: self.written }) } else { Ok(()) }
    }

    /// The next to be put, if there is room for it under way.
    #[must_use]
    pub fn next(&self) -> Option<(u64, &[u8])> {
        let next = self.sent.checked_add(1)?;
        let bytes = self.encoded.get(&next)?;
        let is_first = self.sent == self.acknowledged;
        let has_room = self.sent - self.acknowledged < self.config.max_count
            && self.bytes_under_way + bytes.len() <= self.config.max_bytes;
        (is_first || has_room).then_some((next, bytes.as_slice()))
    }

    /// The one that [`Window::next`] named was put at `now`.
    pub fn put(&mut self, now: Instant) {
        let Some((number, bytes)) = self.next() else { return };
        let length = bytes.len();
        self.bytes_under_way += length;
        self.sent = number;
        if self.quiet_since.is_none() {
            self.quiet_since = Some(now);
            self.patience = self.next_patience;
        }
    }

    /// The server has everything up to `stored`, as was heard at `now`. Returns whether that is
    /// news.
    ///
    /// # Errors
    /// [`ForeignWriter`] when that is more than was made; nothing is discarded then.
    pub fn acknowledge(&mut self, stored: u64, now: Instant) -> Result<bool, ForeignWriter> {
        self.check(stored)?;
        if stored <= self.acknowledged {
            return Ok(false);
        }
        while let Some(entry) = self.encoded.first_entry().filter(|entry| *entry.key() <= stored) {
            let (number, bytes) = entry.remove_entry();
            if number <= self.sent {
                self.bytes_under_way -= bytes.len();
            }
        }
        self.acknowledged = stored;
        self.sent = self.sent.max(stored);
        self.patience = seconds(self.config.patience_s);
        self.next_patience = seconds(self.config.patience_s);
        self.quiet_since = (self.sent > self.acknowledged).then_some(now);
        Ok(true)
    }

    /// When to ask the server what it has, unless there is news before; `None` while nothing is
    /// under way.
    #[must_use]
    pub fn ask_at(&self) -> Option<Instant> {
        self.quiet_since.map(|since| since + self.patience)
    }

    /// The server was asked and has nothing new: what was under way is lost and goes out again; the
    /// next wait is longer.
    pub fn lost(&mut self) {
        self.sent = self.acknowledged;
        self.bytes_under_way = 0;
        self.quiet_since = None;
        self.next_patience = (self.next_patience * 2).min(seconds(self.config.max_patience_s));
    }

    /// The server was asked and did not answer: it is asked again soon, but there is nobody to send
    /// to.
    pub fn unanswered(&mut self, now: Instant) {
        self.quiet_since = Some(now);
        self.patience = seconds(self.config.patience_s);
    }
}

/// What is no time (negative, not a number) is none.
fn seconds(seconds: f64) -> Duration {
    Duration::try_from_secs_f64(seconds).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn window(max_count: u64, max_bytes: usize, written: u64) -> Window {
        let mut window = Window::new(WindowConfig { max_count, max_bytes, ..WindowConfig::default() });
        (1..=written).for_each(|number| window.push(number, vec![0; 100]));
        window
    }

    /// Puts all that there is room for and returns the numbers.
    fn put_all(window: &mut Window, now: Instant) -> Vec<u64> {
        let mut numbers = Vec::new();
        while let Some((number, _)) = window.next() {
            numbers.push(number);
            window.put(now);
        }
        numbers
    }

    #[test]
    fn each_is_put_once_within_the_window() {
        let now = Instant::now();
        let mut window = window(3, usize::MAX, 5);
        assert_eq!(put_all(&mut window, now), [1, 2, 3]);
        assert_eq!(window.acknowledge(2, now), Ok(true));
        assert_eq!(put_all(&mut window, now), [4, 5]);
        assert_eq!(window.acknowledge(5, now), Ok(true));
        assert!(window.is_empty() && window.ask_at().is_none());
    }

    #[test]
    fn the_window_is_bounded_in_bytes_but_never_shut() {
        let now = Instant::now();
        let mut window = window(256, 250, 4);
        assert_eq!(put_all(&mut window, now), [1, 2]);
        window.acknowledge(1, now).unwrap();
        assert_eq!(put_all(&mut window, now), [3]);
        window.lost();
        assert_eq!(put_all(&mut window, now), [2, 3]);
        let mut narrow = self::window(256, 10, 2);
        assert_eq!(put_all(&mut narrow, now), [1]);
    }

    #[test]
    fn what_no_run_has_made_is_not_acknowledged() {
        let now = Instant::now();
        let mut window = window(256, usize::MAX, 3);
        put_all(&mut window, now);
        for stored in [4, 300, u64::MAX] {
            assert_eq!(window.acknowledge(stored, now), Err(ForeignWriter { stored, written: 3 }));
        }
        assert_eq!(window.acknowledged(), 0);
        assert!(!window.is_empty());
    }

    #[test]
    fn an_idle_time_is_no_silence() {
        let start = Instant::now();
        let at = |ms| start + Duration::from_millis(ms);
        let mut window = window(256, usize::MAX, 1);
        put_all(&mut window, at(0));
        window.acknowledge(1, at(10)).unwrap();
        window.push(2, vec![0]);
        put_all(&mut window, at(5000));
        assert_eq!(window.ask_at(), Some(at(6000)), "counted from the put, not from the last news");
        window.push(3, vec![0]);
        put_all(&mut window, at(5500));
        assert_eq!(window.ask_at(), Some(at(6000)), "the oldest counts");
        window.acknowledge(2, at(5900)).unwrap();
        assert_eq!(window.ask_at(), Some(at(6900)), "news starts the wait anew");
    }

    #[test]
    fn waits_double_until_there_is_news() {
        let now = Instant::now();
        let mut window = window(256, usize::MAX, 1);
        let mut waits = Vec::new();
        for _ in 0..7 {
            assert_eq!(put_all(&mut window, now), [1]);
            waits.push(window.ask_at().unwrap().duration_since(now).as_secs());
            window.lost();
        }
        assert_eq!(waits, [1, 2, 4, 8, 16, 30, 30]);
        put_all(&mut window, now);
        window.unanswered(now);
        assert_eq!(window.ask_at(), Some(now + Duration::from_secs(1)), "a server that comes back is found soon");
        assert!(window.next().is_none(), "and nothing is sent to nobody");
        window.acknowledge(1, now).unwrap();
        window.push(2, vec![0]);
        put_all(&mut window, now);
        assert_eq!(window.ask_at(), Some(now + Duration::from_secs(1)));
    }
}
