//! A bag written by a thread of its own.

use super::writer::{BagWriter, WriteError, WriteReport};
use std::path::Path;
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread::JoinHandle;

/// Most jobs that may wait. A job holds a frame, so this bounds memory to some 20 MB. If the disk
/// is slower, the robot waits.
const QUEUE: usize = 64;

type Job = Box<dyn FnOnce(&mut BagWriter) -> Result<(), WriteError> + Send>;

/// A bag written by a thread of its own. Nothing is dropped: a caller that is faster than the disk
/// waits.
pub struct Recorder {
    jobs: SyncSender<Job>,
    thread: JoinHandle<Result<WriteReport, WriteError>>,
}

impl Recorder {
    /// Starts a bag at `path`, see [`BagWriter`].
    ///
    /// # Errors
    /// [`WriteError`] when the bag cannot be made.
    pub fn start(path: &Path) -> Result<Self, WriteError> {
        let mut bag = BagWriter::create(path)?;
        let (jobs, incoming) = sync_channel::<Job>(QUEUE);
        let thread = std::thread::Builder::new()
            .name("recorder".to_owned())
            .spawn(move || {
                let mut outcome = Ok(());
                for job in incoming {
                    // After an error, jobs are still received, so that nobody waits for a thread
                    // that has ended.
                    if outcome.is_ok() {
                        outcome = job(&mut bag);
                    }
                }
                let report = bag.finish();
                outcome.and(report)
            })
            .map_err(|source| WriteError::Create { path: path.to_owned(), source })?;
        Ok(Self { jobs, thread })
    }

    /// Hands a job to the thread: encoding and writing.
    pub fn submit(&self, job: impl FnOnce(&mut BagWriter) -> Result<(), WriteError> + Send + 'static) {
        // The thread lives until the sender is dropped.
        let _ = self.jobs.send(Box::new(job));
    }

    /// Writes what is waiting and finishes the bag.
    ///
    /// # Errors
    /// The first [`WriteError`]; what was written before it can still be read.
    pub fn finish(self) -> Result<WriteReport, WriteError> {
        drop(self.jobs);
        match self.thread.join() {
            Ok(outcome) => outcome,
            Err(panic) => std::panic::resume_unwind(panic),
        }
    }
}
