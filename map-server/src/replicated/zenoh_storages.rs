//! The storages of Zenoh routers. Every question goes to all of them (`QueryTarget::All`), and each
//! answers for itself: nothing is consolidated, so the answers to one key are the storages that
//! hold it.

use crate::replicated::storages::{Held, IncrementKey, Storages};
use fht_proto::api::keys::{ALL_FIRST_KEPT, Key, STORAGE_PRESENCE, kept_of};
use fht_proto::{AuthorId, MapName};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Condvar, Mutex, PoisonError};
use std::time::{Duration, Instant};
use zenoh::bytes::Encoding;
use zenoh::qos::CongestionControl;
use zenoh::query::{ConsolidationMode, QueryTarget, Reply};
use zenoh::{Session, Wait};

/// How long an answer about one place may take. A router that has silently gone delays its part of
/// an answer for so long.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(1);
/// How long everything of an author may take, and the list of authors. A router that is lost
/// meanwhile may take the end of an answer with it, which then never comes.
const FIRST_PATIENCE: Duration = Duration::from_secs(4);
/// … at most, if answers do not come to their end: for a wildcard a storage goes through all of
/// its keys.
const LONGEST_PATIENCE: Duration = Duration::from_secs(60);
/// Questions under way at one time.
const AT_A_TIME: usize = 64;
/// The first wait before a question is repeated, and the longest.
const FIRST_PAUSE: Duration = Duration::from_millis(2);
const LONGEST_PAUSE: Duration = Duration::from_millis(200);

/// The storages that a session reaches.
#[derive(Debug)]
pub struct ZenohStorages {
    session: Session,
    closed: Mutex<bool>,
    closing: Condvar,
    /// How long the next answer for a wildcard may take.
    patience: Mutex<Duration>,
}

/// One answer: the number of the question, key and payload; or that some answers are missing.
type StorageAnswer = Result<(usize, String, Vec<u8>), Incomplete>;

/// A storage did not answer completely.
struct Incomplete;

impl ZenohStorages {
    /// The storages that `session` reaches.
    #[must_use]
    pub fn new(session: Session) -> Self {
        Self { session, closed: Mutex::new(false), closing: Condvar::new(), patience: Mutex::new(FIRST_PATIENCE) }
    }

    /// Ends all waiting.
    pub fn close(&self) {
        *self.closed.lock().unwrap_or_else(PoisonError::into_inner) = true;
        self.closing.notify_all();
    }

    /// Waits for `time`; false when closed.
    pub fn wait(&self, time: Duration) -> bool {
        let closed = self.closed.lock().unwrap_or_else(PoisonError::into_inner);
        let waited = self.closing.wait_timeout_while(closed, time, |closed| !*closed);
        !*waited.unwrap_or_else(PoisonError::into_inner).0
    }

    /// Asks all storages; the answers arrive on `answers` until the last one, or until `timeout` is
    /// over.
    fn ask(&self, number: usize, key: &str, timeout: Duration, answers: Sender<StorageAnswer>) {
        let answered = move |reply: Reply| {
            let answer = reply.result().map_err(|_| Incomplete).map(|sample| {
                let key = sample.key_expr().as_str().to_owned();
                (number, key, sample.payload().to_bytes().into_owned())
            });
            // Nobody is waiting any more: enough others have answered.
            let _ = answers.send(answer);
        };
        let asked = self
            .session
            .get(key)
            .target(QueryTarget::All)
            .consolidation(ConsolidationMode::None)
            .timeout(timeout)
            .callback(answered)
            .wait();
        if let Err(error) = asked {
            tracing::debug!(%key, "storages cannot be asked: {error}");
        }
    }

    fn ask_one(&self, key: &str, timeout: Duration) -> StorageAnswers {
        let (sender, answers) = channel();
        self.ask(0, key, timeout, sender);
        StorageAnswers::within(timeout, answers)
    }

    /// Passes all answers to `each`, key and payload. Returns whether they are everything that the
    /// storages hold. If not, the next answer may take longer.
    fn ask_all(&self, key: &str, mut each: impl FnMut(String, Vec<u8>)) -> bool {
        let patience = *self.patience.lock().unwrap_or_else(PoisonError::into_inner);
        let mut answers = self.ask_one(key, patience);
        answers.by_ref().for_each(|(_, key, bytes)| each(key, bytes));
        let next = if answers.are_all { FIRST_PATIENCE } else { (2 * patience).min(LONGEST_PATIENCE) };
        *self.patience.lock().unwrap_or_else(PoisonError::into_inner) = next;
        answers.are_all
    }

    fn send(&self, key: &str, bytes: &[u8]) {
        let sent = self
            .session
            .put(key, bytes)
            .encoding(Encoding::APPLICATION_OCTET_STREAM)
            .congestion_control(CongestionControl::Block)
            .wait();
        if let Err(error) = sent {
            tracing::debug!(%key, "nothing can be put: {error}");
        }
    }

    /// At most [`AT_A_TIME`] places.
    fn held_at(&self, places: &[IncrementKey], enough: usize) -> Vec<Held> {
        let mut held = vec![Held::default(); places.len()];
        let (sender, answers) = channel();
        for (index, place) in places.iter().enumerate() {
            self.ask(index, &key_of(place), ANSWER_TIMEOUT, sender.clone());
        }
        drop(sender);
        let mut wanting = places.len();
        for (index, _, bytes) in StorageAnswers::within(ANSWER_TIMEOUT, answers) {
            let Some(held) = held.get_mut(index) else { continue };
            held.add(bytes);
            wanting -= usize::from(held.answers() == enough);
            if wanting == 0 {
                break;
            }
        }
        held
    }
}

fn key_of(place: &IncrementKey) -> String {
    Key::kept(&place.map, place.author, place.number).to_string()
}

/// The place of an increment that storages keep.
fn place_of(key: &str) -> Option<IncrementKey> {
    match key.parse() {
        Ok(Key::Kept { map, author, number }) => Some(IncrementKey { map, author, number }),
        _ => None,
    }
}

/// Answers until all have arrived, or their time is over.
struct StorageAnswers {
    answers: Receiver<StorageAnswer>,
    deadline: Instant,
    /// Whether none is known to be missing.
    are_all: bool,
}

impl StorageAnswers {
    fn within(timeout: Duration, answers: Receiver<StorageAnswer>) -> Self {
        Self { answers, deadline: Instant::now() + timeout, are_all: true }
    }
}

impl Iterator for StorageAnswers {
    type Item = (usize, String, Vec<u8>);

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            let left = self.deadline.saturating_duration_since(Instant::now());
            match self.answers.recv_timeout(left) {
                Ok(Ok(answer)) => return Some(answer),
                Ok(Err(Incomplete)) => self.are_all = false,
                Err(RecvTimeoutError::Disconnected) => return None,
                Err(RecvTimeoutError::Timeout) => {
                    self.are_all = false;
                    return None;
                }
            }
        }
    }
}

impl Storages for ZenohStorages {
    fn put(&self, place: &IncrementKey, bytes: &[u8]) {
        self.send(&key_of(place), bytes);
    }

    fn held(&self, places: &[IncrementKey], enough: usize) -> Vec<Held> {
        places.chunks(AT_A_TIME).flat_map(|places| self.held_at(places, enough)).collect()
    }

    fn present(&self) -> usize {
        self.send(STORAGE_PRESENCE, &[]);
        // Routers may forward a question ahead of what was put before it.
        self.wait(FIRST_PAUSE);
        self.ask_one(STORAGE_PRESENCE, ANSWER_TIMEOUT).count()
    }

    fn authors(&self) -> Option<BTreeSet<(MapName, AuthorId)>> {
        let mut authors = BTreeSet::new();
        let are_all = self.ask_all(ALL_FIRST_KEPT, |key, _| {
            authors.extend(place_of(&key).map(|place| (place.map, place.author)));
        });
        are_all.then_some(authors)
    }

    fn all_of(&self, map: &MapName, author: AuthorId) -> Option<BTreeMap<u64, Held>> {
        let mut all: BTreeMap<u64, Held> = BTreeMap::new();
        let are_all = self.ask_all(&kept_of(map, author), |key, bytes| {
            if let Some(place) = place_of(&key) {
                all.entry(place.number).or_default().add(bytes);
            }
        });
        are_all.then_some(all)
    }

    fn pause(&self, attempts: u32) -> bool {
        let factor = 1 << attempts.min(16);
        self.wait((FIRST_PAUSE * factor).min(LONGEST_PAUSE))
    }
}
