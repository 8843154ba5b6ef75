//! Messages in the order of the times at which they were logged. Writers put them into a file in
//! nearly that order; who has an index reads them so, and who reads the file from its beginning
//! puts right what is out of order by a little.

use std::collections::{BTreeMap, VecDeque};

/// What lies farther apart than this is not put in order, nanoseconds: 2 s.
const WINDOW_NS: u64 = 2_000_000_000;
/// Most that waits for others, bytes.
const MAX_HELD_BYTES: usize = 64 << 20;

/// A message's time, nanoseconds, and its size, bytes.
pub(super) trait Logged {
    fn log_ns(&self) -> u64;
    fn bytes(&self) -> usize;
}

impl Logged for mcap::Message<'_> {
    fn log_ns(&self) -> u64 {
        self.log_time
    }

    fn bytes(&self) -> usize {
        self.data.len()
    }
}

/// Messages in the order of their times, as far as they lie within `WINDOW_NS`; those of one time
/// in the order in which they come. A clock that is set back begins anew: what was logged before
/// comes before. Bounded memory.
pub(super) struct LogOrder<T> {
    /// By time, and by the order of arrival.
    held: BTreeMap<(u64, u64), T>,
    held_bytes: usize,
    arrivals: u64,
    /// To be given out before any other.
    due: VecDeque<T>,
}

impl<T: Logged> LogOrder<T> {
    pub(super) fn new() -> Self {
        Self { held: BTreeMap::new(), held_bytes: 0, arrivals: 0, due: VecDeque::new() }
    }

    /// The next one of `source` and of what it has given before.
    pub(super) fn next(&mut self, mut source: impl FnMut() -> Option<T>) -> Option<T> {
        loop {
            if let Some(due) = self.due.pop_front() {
                return Some(due);
            }
            if self.is_first_due() {
                return self.take_first();
            }
            match source() {
                Some(message) => self.hold(message),
                None => return self.take_first(),
            }
        }
    }

    fn is_first_due(&self) -> bool {
        let ends = self.held.first_key_value().zip(self.held.last_key_value());
        let span_ns = ends.map_or(0, |((first, _), (last, _))| last.0 - first.0);
        span_ns > WINDOW_NS || self.held_bytes > MAX_HELD_BYTES
    }

    fn hold(&mut self, message: T) {
        let log_ns = message.log_ns();
        let newest = self.held.last_key_value().map(|((newest, _), _)| *newest);
        if newest.is_some_and(|newest| log_ns.saturating_add(WINDOW_NS) < newest) {
            self.held_bytes = 0;
            self.due.extend(std::mem::take(&mut self.held).into_values());
        }
        self.held_bytes += message.bytes();
        self.held.insert((log_ns, self.arrivals), message);
        self.arrivals += 1;
    }

    fn take_first(&mut self) -> Option<T> {
        let (_, first) = self.held.pop_first()?;
        self.held_bytes -= first.bytes();
        Some(first)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A time in milliseconds, and which message it is.
    #[derive(Clone, Copy, Debug, PartialEq)]
    struct At(u64, usize);

    impl Logged for At {
        fn log_ns(&self) -> u64 {
            self.0 * 1_000_000
        }
        fn bytes(&self) -> usize {
            self.1
        }
    }

    fn ordered(times_ms: &[u64]) -> Vec<u64> {
        let mut source = times_ms.iter().map(|&time| At(time, 100));
        let mut order = LogOrder::new();
        std::iter::from_fn(|| order.next(|| source.next())).map(|at| at.0).collect()
    }

    #[test]
    fn what_is_out_of_order_by_a_little_is_put_right() {
        let mixed = [300, 200, 100, 0, 700, 600, 500, 400, 4000, 3900, 2100];
        let mut sorted = mixed;
        sorted.sort_unstable();
        assert_eq!(ordered(&mixed), sorted);
        assert!(ordered(&[]).is_empty());
    }

    #[test]
    fn a_clock_that_is_set_back_begins_anew() {
        assert_eq!(ordered(&[9000, 9100, 0, 200, 100]), [9000, 9100, 0, 100, 200]);
    }

    #[test]
    fn messages_of_one_time_come_as_they_are_and_large_ones_do_not_pile_up() {
        let mut source = (0..8).map(|number| At(5, MAX_HELD_BYTES / 4 + number));
        let mut order = LogOrder::new();
        let mut most = 0;
        let given: Vec<At> = std::iter::from_fn(|| {
            let next = order.next(|| source.next());
            most = most.max(order.held_bytes);
            next
        })
        .collect();
        assert!(given.windows(2).all(|pair| pair[0].1 < pair[1].1) && given.len() == 8, "{given:?}");
        assert!(most < 2 * MAX_HELD_BYTES, "{most}");
    }
}
