//! Whether what the server has under a robot's name is what this run has made. A head counts
//! increments and does not say which: a run before this one may have put others under the same
//! numbers, which reach the log late (they waited for one that was lost, or in a storage that was
//! out of reach). So what a head covers counts as acknowledged when it was read back and is the
//! same, byte by byte; a map is some ten kilobytes.

use crate::publish::Window;
use fht_proto::api::reply::Series;
use fht_proto::codec::envelope::is_canonical;
use fht_proto::{AuthorId, VersionVector};

/// The server has another increment under a number of this run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("increment {number} of this name on the server was made by another run, or by another robot of the same name")]
pub struct NumberTaken {
    /// Its number.
    pub number: u64,
}

/// How far the server's series of an author is known to be this run's.
#[derive(Clone, Debug)]
pub struct Verified {
    author: AuthorId,
    upto: u64,
    /// What heads cover. An answer may be ahead of the head that it was asked after: that is for
    /// the next head to say.
    covered: u64,
}

impl Verified {
    /// Of a run that begins after the `stored` increments of earlier ones.
    #[must_use]
    pub fn after(author: AuthorId, stored: u64) -> Self {
        Self { author, upto: stored, covered: stored }
    }

    /// Number up to which it is.
    #[must_use]
    pub fn upto(&self) -> u64 {
        self.upto
    }

    /// What to ask the server `since`, when its head is at `vector`: all that it has but what is to
    /// be read back. `None` when there is nothing.
    #[must_use]
    pub fn lacking(&mut self, vector: &VersionVector) -> Option<VersionVector> {
        self.covered = self.covered.max(vector.get(self.author));
        (vector.get(self.author) > self.upto).then(|| {
            let mut have = vector.clone();
            have.set(self.author, self.upto);
            have
        })
    }

    /// Compares a piece of the answer with what is in `window`.
    ///
    /// # Errors
    /// [`NumberTaken`]: the first that is another.
    pub fn compare(&mut self, piece: &Series, window: &Window) -> Result<(), NumberTaken> {
        for fold in &piece.folds {
            if fold.author == self.author && fold.first <= self.upto + 1 {
                // Nobody can tell any more.
                self.upto = self.upto.max(fold.last.min(self.covered));
            }
        }
        for increment in &piece.increments {
            if increment.author != self.author || increment.number != self.upto + 1 || self.upto == self.covered {
                continue;
            }
            // What an earlier run has left may be of the format of an earlier program.
            let is_ours = |bytes| is_canonical(increment, bytes).unwrap_or(false);
            if !window.get(increment.number).is_some_and(is_ours) {
                return Err(NumberTaken { number: increment.number });
            }
            self.upto += 1;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::publish::WindowConfig;
    use fht_proto::codec::envelope::{Message, OLDEST_FORMAT_VERSION, seal};
    use fht_proto::{CompactedSeries, Increment, NodeId, Op, encode};

    const OWN: AuthorId = AuthorId(7);

    fn increment(author: AuthorId, number: u64, node: u32) -> Increment {
        let ops = vec![Op::RemoveNode { id: NodeId { author, number: node } }];
        Increment { author, number, hlc_us: number, ops }
    }

    fn piece(increments: Vec<Increment>) -> Series {
        Series { folds: Vec::new(), increments }
    }

    #[test]
    fn what_an_earlier_program_has_left_is_the_same_increment() {
        let made = increment(OWN, 1, 1);
        let bytes = encode(&made).unwrap();
        // A short body, between the header and the checksum.
        let old = seal(OLDEST_FORMAT_VERSION, Increment::KIND, &bytes[6..bytes.len() - 4]).unwrap();
        assert_ne!(old, bytes);
        let mut window = Window::after(WindowConfig::default(), 0);
        window.push(1, old);
        let mut verified = Verified::after(OWN, 0);
        let mut vector = VersionVector::default();
        vector.set(OWN, 1);
        verified.lacking(&vector).unwrap();
        assert_eq!(verified.compare(&piece(vec![made]), &window), Ok(()));
        assert_eq!(verified.upto(), 1);
    }

    #[test]
    fn what_is_read_back_must_be_what_was_put() {
        let mut window = Window::after(WindowConfig::default(), 4);
        (5..=8).for_each(|number| window.push(number, encode(&increment(OWN, number, 1)).unwrap()));
        let mut verified = Verified::after(OWN, 4);
        let mut vector = VersionVector::default();
        vector.set(AuthorId(1), 9);
        vector.set(OWN, 4);
        assert_eq!(verified.lacking(&vector), None);
        vector.set(OWN, 7);
        assert_eq!(verified.clone().compare(&piece(vec![increment(OWN, 5, 1)]), &window), Ok(()));
        assert_eq!(verified.upto(), 4, "no head covers it yet");
        let asked = verified.lacking(&vector).unwrap();
        assert_eq!((asked.get(OWN), asked.get(AuthorId(1))), (4, 9));
        let others = vec![increment(AuthorId(1), 10, 3), increment(OWN, 5, 1), increment(OWN, 7, 1)];
        assert_eq!(verified.compare(&piece(others), &window), Ok(()));
        assert_eq!(verified.upto(), 5, "nothing is passed over");
        let fold = CompactedSeries { author: OWN, first: 6, last: 6, rests: Vec::new() };
        verified.compare(&Series { folds: vec![fold], increments: Vec::new() }, &window).unwrap();
        assert_eq!(verified.upto(), 6);
        let other = piece(vec![increment(OWN, 7, 2)]);
        assert_eq!(verified.compare(&other, &window), Err(NumberTaken { number: 7 }));
        assert_eq!(verified.upto(), 6);
        vector.set(OWN, 9);
        verified.lacking(&vector).unwrap();
        let never_made = piece((7..=9).map(|number| increment(OWN, number, 1)).collect());
        assert_eq!(verified.compare(&never_made, &window), Err(NumberTaken { number: 9 }));
    }
}
