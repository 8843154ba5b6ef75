//! One thread, one type: jobs in, results out, taken by the loop frame by frame.

use crate::config::{Pace, Taking};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, TryRecvError, channel};
use std::time::Duration;

/// How long the loop waits for a result that is due.
#[derive(Clone, Copy, Debug)]
enum Patience {
    /// Not at all: it looks again at the next frame.
    None,
    /// So long, then it goes on without the result.
    AtMost(Duration),
    /// Until it is there.
    Endless,
}

/// A thread that works beside the robot's loop, of whose jobs one counts at a time.
///
/// The result is taken at a frame that is fixed when the job is given, so that the same frames lead
/// to the same results however fast the thread is. It ends after the worker is dropped.
pub struct BackgroundWorker<J, R> {
    jobs: Sender<(u64, J)>,
    results: Receiver<(u64, R)>,
    patience: Patience,
    /// Frames from a job to its result, for jobs that replace each other.
    delay: u64,
    /// Frames that [`take`](Self::take) has counted.
    frame: u64,
    /// Number of the newest job.
    number: u64,
    /// The frame at which its result is taken; none if nobody waits for one.
    due: Option<u64>,
    has_ended: bool,
}

impl<J: Send + 'static, R: Send + 'static> BackgroundWorker<J, R> {
    /// A worker that finishes each job before it takes the next: [`submit`](Self::submit) and
    /// [`take_due`](Self::take_due).
    ///
    /// # Errors
    /// When the system gives no thread.
    pub fn one_by_one(name: &str, pace: Pace, work: impl FnMut(J) -> R + Send + 'static) -> std::io::Result<Self> {
        let patience = match pace {
            Pace::Repeatable => Patience::Endless,
            Pace::RealTime => Patience::None,
        };
        Self::start(name, patience, 0, work)
    }

    /// A worker of whose jobs the newest replaces those before it: [`replace`](Self::replace) and
    /// [`take`](Self::take). In simulated time the loop waits `at_most` so long for a late result,
    /// and goes on without it then.
    ///
    /// # Errors
    /// When the system gives no thread.
    pub fn newest_first(
        name: &str,
        taking: Taking,
        at_most: Duration,
        work: impl FnMut(J) -> R + Send + 'static,
    ) -> std::io::Result<Self> {
        match taking {
            Taking::WhenThere => Self::start(name, Patience::None, 0, work),
            Taking::AfterFrames(frames) => Self::start(name, Patience::AtMost(at_most), frames.into(), work),
        }
    }

    fn start(
        name: &str,
        patience: Patience,
        delay: u64,
        mut work: impl FnMut(J) -> R + Send + 'static,
    ) -> std::io::Result<Self> {
        let (jobs, incoming) = channel::<(u64, J)>();
        let (outgoing, results) = channel();
        std::thread::Builder::new().name(name.to_owned()).spawn(move || {
            while let Ok(job) = incoming.recv() {
                // Nobody waits for the results of older jobs.
                let (number, job) = incoming.try_iter().last().unwrap_or(job);
                if outgoing.send((number, work(job))).is_err() {
                    return;
                }
            }
        })?;
        Ok(Self { jobs, results, patience, delay, frame: 0, number: 0, due: None, has_ended: false })
    }

    /// Whether [`submit`](Self::submit) would take a job now.
    #[must_use]
    pub fn is_idle(&self) -> bool {
        self.due.is_none() && !self.has_ended
    }

    /// Whether a result is awaited.
    #[must_use]
    pub fn is_pending(&self) -> bool {
        self.due.is_some()
    }

    /// Whether the thread has ended, which is a defect of its work.
    #[must_use]
    pub fn has_ended(&self) -> bool {
        self.has_ended
    }

    /// Hands over a job whose result is to be taken at frame `due`. A worker that is not idle drops
    /// the job.
    pub fn submit(&mut self, job: J, due: u64) {
        if self.is_idle() {
            self.send(job, due);
        }
    }

    /// Hands over a job in place of any before it.
    pub fn replace(&mut self, job: J) {
        self.send(job, self.frame.saturating_add(self.delay));
    }

    fn send(&mut self, job: J, due: u64) {
        self.number += 1;
        self.has_ended = self.jobs.send((self.number, job)).is_err();
        self.due = (!self.has_ended).then_some(due);
    }

    /// Wants no result any more.
    pub fn cancel(&mut self) {
        self.due = None;
    }

    /// Once per frame: the result of the newest job when it is due and ready, once.
    pub fn take(&mut self) -> Option<R> {
        self.frame += 1;
        self.take_due(self.frame)
    }

    /// The result that is due at `frame`, if there is one and it is ready. In simulated time the
    /// loop waits for it.
    pub fn take_due(&mut self, frame: u64) -> Option<R> {
        self.due.filter(|due| frame >= *due)?;
        self.receive(self.patience)
    }

    /// The result of the job under way, waiting for it.
    pub fn finish(&mut self) -> Option<R> {
        self.due?;
        self.receive(Patience::Endless)
    }

    fn receive(&mut self, patience: Patience) -> Option<R> {
        loop {
            let received = match patience {
                Patience::None => self.results.try_recv(),
                Patience::AtMost(time) => self.results.recv_timeout(time).map_err(|error| match error {
                    RecvTimeoutError::Timeout => TryRecvError::Empty,
                    RecvTimeoutError::Disconnected => TryRecvError::Disconnected,
                }),
                Patience::Endless => self.results.recv().map_err(TryRecvError::from),
            };
            match received {
                Ok((number, result)) if number == self.number => {
                    self.due = None;
                    return Some(result);
                }
                // A job that was replaced or cancelled.
                Ok(_) => {}
                Err(TryRecvError::Empty) => {
                    if !matches!(patience, Patience::None) {
                        self.due = None;
                    }
                    return None;
                }
                Err(TryRecvError::Disconnected) => {
                    self.due = None;
                    self.has_ended = true;
                    return None;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests;
