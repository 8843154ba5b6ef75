//! The robots of a site: writers, with the mapper's own publisher, and readers.

use crate::site::report::{SiteError, SiteReport};
use crate::site::secured::TRAITOR;
use crate::site::sessions::{close, map};
use fht_client::{AskError, ask};
use fht_map::MapState;
use fht_proto::api::keys::{Key, Topic};
use fht_proto::{AuthorId, EdgeKey, FixedPose, Increment, NodeId, NodeKind, Op, Rect};
use mapper::publish::{Progress, WindowConfig, outbox};
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use zenoh::Session;

/// Nodes along each side of the floor that the first author writes, one metre apart.
const FLOOR: u32 = 12;
/// Nodes of each writer, in a row of its own beside the floor.
const ROW: u32 = 12;
/// How long one question may take before it is repeated.
const TRY: Duration = Duration::from_millis(500);
/// Pause between two tries.
const PAUSE: Duration = Duration::from_millis(20);

/// Everything that was written, and how much of it was acknowledged.
#[derive(Debug, Default)]
pub(super) struct Written {
    authors: Mutex<BTreeMap<AuthorId, (Vec<Increment>, u64)>>,
    slowest: Mutex<Duration>,
}

impl Written {
    // Whole operations under the lock.
    fn lock(&self) -> std::sync::MutexGuard<'_, BTreeMap<AuthorId, (Vec<Increment>, u64)>> {
        self.authors.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn add(&self, increment: Increment) {
        self.lock().entry(increment.author).or_default().0.push(increment);
    }

    fn acknowledge(&self, author: AuthorId, count: u64) {
        self.lock().entry(author).or_default().1 = count;
    }

    fn took(&self, time: Duration) {
        let mut slowest = self.slowest.lock().unwrap_or_else(PoisonError::into_inner);
        *slowest = time.max(*slowest);
    }

    /// The map that it adds up to.
    pub(super) fn state(&self) -> MapState {
        let mut state = MapState::new();
        self.lock().values().flat_map(|(increments, _)| increments).for_each(|increment| state.apply(increment));
        state
    }

    pub(super) fn acknowledged(&self) -> BTreeMap<AuthorId, u64> {
        self.lock().iter().map(|(author, (_, count))| (*author, *count)).collect()
    }

    pub(super) fn report_to(&self, report: &mut SiteReport) {
        report.written = self.lock().values().map(|(increments, _)| increments.len() as u64).sum();
        report.acknowledged = self.lock().values().map(|(_, count)| count).sum();
        let slowest = *self.slowest.lock().unwrap_or_else(PoisonError::into_inner);
        report.greatest_acknowledgement_ms = slowest.as_secs_f64() * 1000.0;
    }
}

/// A node at a place in metres, with a square of free space around it.
fn node(id: NodeId, x: f64, y: f64) -> [Op; 2] {
    let pose = FixedPose::from_metres(x, y, 0.0);
    let rect = Rect::around(pose.position, (x - 0.7, y - 0.7), (x + 0.7, y + 0.7));
    [Op::PutNode { id, kind: NodeKind::Support, pose }, Op::SetFreeSpace { id, rect: Some(rect) }]
}

/// Writes the floor that paths are asked on, and waits until it is acknowledged.
pub(super) async fn write_floor(session: &Session, written: &Written, patience: Duration) -> Result<(), SiteError> {
    let author = AuthorId::of_robot("floor");
    let id = |x: u32, y: u32| NodeId { author, number: y * FLOOR + x };
    let rows = (0..FLOOR).map(|y| {
        let mut ops: Vec<Op> = (0..FLOOR).flat_map(|x| node(id(x, y), f64::from(x), f64::from(y))).collect();
        ops.extend((1..FLOOR).map(|x| Op::PutEdge { edge: EdgeKey::new(id(x - 1, y), id(x, y)) }));
        if y > 0 {
            ops.extend((0..FLOOR).map(|x| Op::PutEdge { edge: EdgeKey::new(id(x, y - 1), id(x, y)) }));
        }
        Increment { author, number: u64::from(y) + 1, hlc_us: u64::from(y) + 1, ops }
    });
    let (outbox, publisher) = outbox(session.clone(), map(), author, 0, None, WindowConfig::default());
    let increments: Vec<Increment> = rows.collect();
    for increment in &increments {
        written.add(increment.clone());
    }
    let sent = tokio::task::spawn_blocking(move || {
        for increment in increments {
            outbox.send(increment);
        }
    });
    let progress = tokio::time::timeout(patience, publisher).await;
    sent.await?;
    let progress = progress.map_err(|_| SiteError::Late("the floor is not acknowledged".to_owned()))??;
    written.acknowledge(author, progress.acknowledged);
    close(session);
    Ok(())
}

/// A robot that writes: a row of nodes, then changes of their trust.
pub(super) struct Writer {
    index: usize,
    period: Duration,
    written: Arc<Written>,
}

impl Writer {
    pub(super) fn new(index: usize, per_s: f64, written: Arc<Written>) -> Self {
        Self { index, period: Duration::from_secs_f64(1.0 / per_s), written }
    }

    fn increment(&self, author: AuthorId, number: u64) -> Increment {
        let position = (number - 1) % u64::from(ROW);
        let id = NodeId { author, number: u32::try_from(position).unwrap_or(0) };
        let ops = if number <= u64::from(ROW) {
            node(id, position as f64, f64::from(FLOOR) + self.index as f64).to_vec()
        } else {
            let percent = u8::try_from(number % 101).unwrap_or(100);
            vec![Op::SetTrust { id, percent }]
        };
        Increment { author, number, hlc_us: 1000 + number, ops }
    }

    /// Writes until it is over, and waits until everything is acknowledged.
    pub(super) async fn run(
        self,
        session: Session,
        is_over: Arc<AtomicBool>,
        patience: Duration,
    ) -> Result<Progress, SiteError> {
        let author = AuthorId::of_robot(&format!("writer-{}", self.index));
        let (outbox, publisher) = outbox(session.clone(), map(), author, 0, None, WindowConfig::default());
        let mut publisher = tokio::spawn(publisher);
        let written = Arc::clone(&self.written);
        let write = move || {
            let mut times = BTreeMap::new();
            let mut number = 0;
            let note = |outbox: &mapper::publish::Outbox, times: &mut BTreeMap<u64, Instant>| {
                let acknowledged = outbox.progress().acknowledged;
                let open = times.split_off(&(acknowledged + 1));
                std::mem::replace(times, open).into_values().for_each(|at: Instant| self.written.took(at.elapsed()));
                self.written.acknowledge(author, acknowledged);
            };
            while !is_over.load(Ordering::Relaxed) && !outbox.has_ended() {
                number += 1;
                let increment = self.increment(author, number);
                self.written.add(increment.clone());
                times.insert(number, Instant::now());
                outbox.send(increment);
                std::thread::sleep(self.period);
                note(&outbox, &mut times);
            }
            outbox.close()
        };
        let closed = tokio::task::spawn_blocking(write).await?;
        let progress = match tokio::time::timeout(patience, &mut publisher).await {
            Ok(published) => published??,
            Err(_) => {
                publisher.abort();
                closed.progress()
            }
        };
        written.acknowledge(author, progress.acknowledged);
        close(&session);
        Ok(progress)
    }
}

/// What a reader has measured.
#[derive(Debug, Default)]
pub(super) struct Asked {
    times: Vec<Duration>,
    late: u64,
    repeated: u64,
    closed: u64,
}

impl Asked {
    pub(super) fn add(&mut self, other: Self) {
        self.times.extend(other.times);
        self.late += other.late;
        self.repeated += other.repeated;
        self.closed += other.closed;
    }

    pub(super) fn report_to(mut self, report: &mut SiteReport) {
        self.times.sort_unstable();
        let ms = |time: Option<&Duration>| time.map_or(0.0, |time| time.as_secs_f64() * 1000.0);
        let count = self.times.len();
        report.questions = count as u64;
        report.late = self.late;
        report.repeated = self.repeated;
        report.closed = self.closed;
        report.median_ms = ms(self.times.get(count / 2));
        report.p99_ms = ms(self.times.get(count * 99 / 100));
        report.greatest_ms = ms(self.times.last());
    }
}

/// A robot that asks for heads and paths, one after the other.
pub(super) struct Reader {
    index: usize,
    period: Duration,
    limit: Duration,
}

impl Reader {
    pub(super) fn new(index: usize, per_s: f64, limit: Duration) -> Self {
        Self { index, period: Duration::from_secs_f64(1.0 / per_s), limit }
    }

    pub(super) fn run(self, session: &Session, is_over: &AtomicBool) -> Asked {
        let mut asked = Asked::default();
        let mut number = self.index;
        while !is_over.load(Ordering::Relaxed) {
            let begin = Instant::now();
            number += 1;
            let selector = if number.is_multiple_of(2) {
                Key::topic(&map(), Topic::Head).to_string()
            } else {
                let (from, to) = (number % FLOOR as usize, (number / 7) % FLOOR as usize);
                format!("{}?from={from},0;to={to},{}", Key::topic(&map(), Topic::Path), FLOOR - 1)
            };
            // Asked until it is answered.
            let repeated = asked.repeated;
            let mut answer = answer(session, &selector);
            while answer.is_none() && begin.elapsed() < 30 * self.limit {
                asked.repeated += 1;
                std::thread::sleep(PAUSE);
                answer = self::answer(session, &selector);
            }
            asked.closed += u64::from(answer == Some(Answer::Closed));
            let time = begin.elapsed();
            if time > self.limit {
                asked.late += 1;
                tracing::info!(reader = self.index, selector, ?time, tries = asked.repeated - repeated, "late");
            }
            asked.times.push(time);
            std::thread::sleep(self.period.saturating_sub(time));
        }
        close(session);
        asked
    }
}

/// How a question was answered.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Answer {
    /// As it should be.
    Given,
    /// There is no path, since the traitor reports that the way is blocked: the answer says so.
    Closed,
}

/// The answer to a question, if there is one. A server that has not read the map yet, and says so,
/// gives none.
fn answer(session: &Session, selector: &str) -> Option<Answer> {
    match ask(session, selector, TRY) {
        Ok(answers) => (!answers.is_empty()).then_some(Answer::Given),
        Err(AskError::Refused(reply)) if reply.message.contains(TRAITOR) => Some(Answer::Closed),
        Err(AskError::Refused(reply)) if !reply.code.is_trouble_of_the_server() => {
            tracing::warn!("{selector}: {reply}");
            None
        }
        Err(error) => {
            tracing::debug!("{selector}: {error}");
            None
        }
    }
}
