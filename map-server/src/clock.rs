//! The server's clocks: the time of day, which people may set back and forth, and the time that has
//! passed, which runs evenly. What lasts for a while is measured by the latter.

use std::sync::OnceLock;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Microseconds since the Unix epoch.
pub(crate) fn now_us() -> u64 {
    let since_epoch = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    u64::try_from(since_epoch.as_micros()).unwrap_or(u64::MAX)
}

/// A time of day in UTC, to the second (RFC 3339), of microseconds since the Unix epoch. What is
/// beyond all calendars is the last second of the year 9999.
pub(crate) fn utc_text(us: u64) -> String {
    const LAST: Duration = Duration::from_secs(253_402_300_799);
    humantime::format_rfc3339_seconds(UNIX_EPOCH + Duration::from_micros(us).min(LAST)).to_string()
}

/// Microseconds since somebody first asked.
pub(crate) fn passed_us() -> u64 {
    static BEGAN: OnceLock<Instant> = OnceLock::new();
    u64::try_from(BEGAN.get_or_init(Instant::now).elapsed().as_micros()).unwrap_or(u64::MAX)
}

/// The time that has passed, as it follows from times of day: a clock that is set back stops it for
/// a moment, and no longer.
#[derive(Debug, Default)]
pub(crate) struct PassedTime {
    last_us: Option<u64>,
    passed_us: u64,
}

impl PassedTime {
    /// What has passed when it is `now_us` by the time of day, microseconds.
    pub(crate) fn at(&mut self, now_us: u64) -> u64 {
        let before_us = self.last_us.replace(now_us).unwrap_or(now_us);
        self.passed_us = self.passed_us.saturating_add(now_us.saturating_sub(before_us));
        self.passed_us
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clock_set_back_goes_on_from_there() {
        let mut passed = PassedTime::default();
        let day = 86_400_000_000;
        assert_eq!([day, day + 5, 7, 9].map(|now_us| passed.at(now_us)), [0, 5, 5, 7]);
        assert!(passed_us() <= passed_us());
    }
}
