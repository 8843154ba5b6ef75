//! Messages that have not come, by the numbers that their publishers give them.

use crate::attachment::Gid;
use std::collections::VecDeque;

/// Publishers whose numbers are remembered; what was missed of those before stays counted.
const PUBLISHERS: usize = 64;

/// What came of one publisher's messages.
struct Course {
    gid: Gid,
    first: i64,
    newest: i64,
    came: u64,
}

impl Course {
    fn missed(&self) -> u64 {
        self.newest.abs_diff(self.first).saturating_add(1).saturating_sub(self.came)
    }
}

/// Counts what is missing between the first and the newest message of each publisher. What was
/// published before the first that came is none of it.
#[derive(Default)]
pub(crate) struct Missed {
    /// Of publishers that are not remembered any more.
    before: u64,
    /// The newest publisher last.
    courses: VecDeque<Course>,
}

impl Missed {
    /// A message has come; each is told once.
    pub(crate) fn take(&mut self, gid: Gid, sequence: i64) {
        match self.courses.iter_mut().find(|course| course.gid == gid) {
            Some(course) if sequence >= course.first => {
                course.newest = course.newest.max(sequence);
                course.came += 1;
            }
            Some(_) => {}
            None => {
                if self.courses.len() >= PUBLISHERS
                    && let Some(oldest) = self.courses.pop_front()
                {
                    self.before = self.before.saturating_add(oldest.missed());
                }
                self.courses.push_back(Course { gid, first: sequence, newest: sequence, came: 1 });
            }
        }
    }

    pub(crate) fn count(&self) -> u64 {
        self.courses.iter().fold(self.before, |sum, course| sum.saturating_add(course.missed()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_are_missed_and_what_comes_late_is_not() {
        let (mut missed, [a, b]) = (Missed::default(), [Gid([1; 16]), Gid([2; 16])]);
        for sequence in [40, 41, 42] {
            missed.take(a, sequence);
        }
        assert_eq!(missed.count(), 0, "what was before the first is nobody's");
        missed.take(a, 47);
        assert_eq!(missed.count(), 4);
        missed.take(a, 45);
        assert_eq!(missed.count(), 3);
        // Started anew it is another publisher, that begins anew.
        missed.take(b, 1);
        missed.take(b, 3);
        assert_eq!(missed.count(), 4);
        missed.take(b, 0);
        assert_eq!(missed.count(), 4);
    }

    #[test]
    fn wild_numbers_and_many_publishers_do_no_harm() {
        let mut missed = Missed::default();
        for sequence in [i64::MIN, i64::MAX, -1, 0] {
            missed.take(Gid([0; 16]), sequence);
        }
        assert_eq!(missed.count(), u64::MAX - 4);
        for number in 1..=255 {
            missed.take(Gid([number; 16]), 0);
            missed.take(Gid([number; 16]), 2);
        }
        assert!(missed.courses.len() <= PUBLISHERS);
        assert_eq!(missed.count(), u64::MAX);
    }
}
