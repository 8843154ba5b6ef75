//! Work beside the robot's loop: a thread takes one job at a time, and its result is taken at a frame that was fixed when the
//! job was given, so that the same frames give the same map however fast the threads are.

use std::sync::mpsc::{Receiver, SyncSender, TryRecvError, sync_channel};

/// What happens when a result is due and the thread is not ready.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Pace {
    /// The loop waits: a run repeats exactly. For simulations and replays, which run faster than the robot did.
    #[default]
    Repeatable,
    /// The loop goes on and looks again at the next frame: nothing ever blocks a robot that drives.
    RealTime,
}

/// A thread that works on one job at a time.
pub struct Beside<J, R> {
    jobs: SyncSender<J>,
    results: Receiver<R>,
    pace: Pace,
    /// The frame at which the result of the job under way is taken.
    due: Option<u64>,
    has_ended: bool,
}

impl<J: Send + 'static, R: Send + 'static> Beside<J, R> {
    /// Starts the thread; `work` is what it does with a job.
    ///
    /// # Errors
    /// When the system gives no thread.
    pub fn start(name: &str, pace: Pace, mut work: impl FnMut(J) -> R + Send + 'static) -> std::io::Result<Self> {
        let (jobs, incoming) = sync_channel::<J>(1);
        let (outgoing, results) = sync_channel(1);
        std::thread::Builder::new().name(name.to_owned()).spawn(move || {
            for job in incoming {
                if outgoing.send(work(job)).is_err() {
                    return;
                }
            }
        })?;
        Ok(Self { jobs, results, pace, due: None, has_ended: false })
    }

    /// Whether a job would be taken now.
    #[must_use]
    pub fn is_idle(&self) -> bool {
        self.due.is_none() && !self.has_ended
    }

    /// Whether the thread has ended, which is a defect of its work.
    #[must_use]
    pub fn has_ended(&self) -> bool {
        self.has_ended
    }

    /// Hands over a job whose result is to be taken at frame `due`. Only for an idle thread: another's job is dropped.
    pub fn submit(&mut self, job: J, due: u64) {
        if self.is_idle() {
            match self.jobs.try_send(job) {
                Ok(()) => self.due = Some(due),
                Err(_) => self.has_ended = true,
            }
        }
    }

    /// The result that is due at `frame`, if there is one and it is ready; at a repeatable pace it is waited for.
    pub fn take_due(&mut self, frame: u64) -> Option<R> {
        self.due.filter(|due| frame >= *due)?;
        match self.pace {
            Pace::Repeatable => self.finish(),
            Pace::RealTime => match self.results.try_recv() {
                Ok(result) => {
                    self.due = None;
                    Some(result)
                }
                Err(TryRecvError::Empty) => None,
                Err(TryRecvError::Disconnected) => self.end(),
            },
        }
    }

    /// The result of the job under way, waiting for it.
    pub fn finish(&mut self) -> Option<R> {
        self.due.take()?;
        match self.results.recv() {
            Ok(result) => Some(result),
            Err(_) => self.end(),
        }
    }

    fn end(&mut self) -> Option<R> {
        self.due = None;
        self.has_ended = true;
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc::channel;

    #[test]
    fn a_result_is_taken_at_its_frame_and_not_before() {
        let mut twice = Beside::start("test", Pace::Repeatable, |x: i32| 2 * x).expect("a thread");
        twice.submit(21, 10);
        assert!(!twice.is_idle());
        twice.submit(1, 11);
        assert_eq!(twice.take_due(9), None);
        assert_eq!(twice.take_due(10), Some(42));
        assert_eq!(twice.take_due(11), None);
        assert!(twice.is_idle());
    }

    #[test]
    fn in_real_time_nothing_is_waited_for() {
        let (go, gate) = channel::<()>();
        let work = move |x: i32| gate.recv().map_or(0, |()| x);
        let mut slow = Beside::start("test", Pace::RealTime, work).expect("a thread");
        slow.submit(7, 0);
        for frame in 0..100 {
            assert_eq!(slow.take_due(frame), None);
        }
        go.send(()).expect("the thread waits");
        assert_eq!(slow.finish(), Some(7));
    }

    #[test]
    fn a_thread_that_fails_is_noticed() {
        let mut broken = Beside::start("test", Pace::Repeatable, |x: i32| 10 / x).expect("a thread");
        broken.submit(0, 0);
        assert_eq!(broken.take_due(0), None);
        assert!(broken.has_ended() && !broken.is_idle());
    }
}
