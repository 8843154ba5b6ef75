//! The last warnings of this program's log, for operators who do not see it.

use serde::Serialize;
use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};
#[cfg(feature = "program")]
use std::time::{SystemTime, UNIX_EPOCH};

/// So many lines are kept.
const MAX_LINES: usize = 50;
/// So much of a line, characters.
const MAX_CHARS: usize = 300;

/// A line of the log.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct WarningLine {
    /// Microseconds since 1970.
    at_us: u64,
    is_error: bool,
    text: String,
}

/// What was logged: how many warnings, how many errors, and the last ones of both.
#[derive(Clone, Debug, Default, Serialize)]
pub(crate) struct LastWarnings {
    pub(crate) warnings: u64,
    pub(crate) errors: u64,
    /// The newest first.
    lines: VecDeque<WarningLine>,
}

/// A process has one log.
static LAST: Mutex<LastWarnings> = Mutex::new(LastWarnings { warnings: 0, errors: 0, lines: VecDeque::new() });

fn last() -> MutexGuard<'static, LastWarnings> {
    LAST.lock().unwrap_or_else(PoisonError::into_inner)
}

impl LastWarnings {
    /// What was logged so far.
    pub(super) fn now() -> Self {
        last().clone()
    }

    fn add(&mut self, is_error: bool, text: &str, at_us: u64) {
        *(if is_error { &mut self.errors } else { &mut self.warnings }) += 1;
        // Names and keys come from outside.
        let text = text.chars().filter(|c| !c.is_control()).take(MAX_CHARS).collect();
        self.lines.push_front(WarningLine { at_us, is_error, text });
        self.lines.truncate(MAX_LINES);
    }
}

/// Notes a line of the log.
#[cfg(feature = "program")]
pub(crate) fn note_warning(is_error: bool, text: &str) {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    last().add(is_error, text, u64::try_from(since.as_micros()).unwrap_or(u64::MAX));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_lines_are_kept_and_all_are_counted() {
        let mut kept = LastWarnings::default();
        for number in 0..2 * MAX_LINES {
            kept.add(number % 2 == 0, &format!("line\u{1b}[31m {number} {}", "x".repeat(2 * MAX_CHARS)), 7);
        }
        assert_eq!((kept.warnings, kept.errors, kept.lines.len()), (50, 50, MAX_LINES));
        let newest = &kept.lines[0].text;
        assert!(newest.starts_with("line[31m 99") && newest.chars().count() == MAX_CHARS, "{newest}");
    }
}
