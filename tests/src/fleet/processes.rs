//! The clients' processes. Each has a part of the clients, and all of them take each step together:
//! a process says that it is ready for a step, and takes it when it is told to.

use crate::fleet::clients::{Event, Report, Step};
use crate::trial::TrialError;
use fht_demo::{Process, ProcessError};
use std::io::Write;
use std::process::{ChildStdin, Command};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;

/// Sessions in one process: with more of them its own threads are the narrowest place.
const IN_ONE_PROCESS: usize = 250;

/// The first number and the count of each process's part of `count` clients or robots.
pub fn parts(count: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..count).step_by(IN_ONE_PROCESS).map(move |first| (first, IN_ONE_PROCESS.min(count - first)))
}

/// What a process has said; none when it has ended.
type Said = (usize, Option<Event>);

struct ClientProcess {
    id: u32,
    input: ChildStdin,
    reading: Option<JoinHandle<Result<(), ProcessError>>>,
}

/// The processes that have been started.
pub(super) struct ClientProcesses {
    processes: Vec<ClientProcess>,
    said: Receiver<Said>,
    saying: Sender<Said>,
}

impl ClientProcesses {
    /// None yet.
    pub(super) fn new() -> Self {
        let (saying, said) = channel();
        Self { processes: Vec::new(), said, saying }
    }

    /// Starts a process, waits until its clients have the map, and returns what they do next.
    pub(super) fn add(&mut self, command: Command) -> Result<Step, TrialError> {
        let (process, input) = Process::run_with_input("the clients", command)?;
        let (id, number, saying) = (process.id(), self.processes.len(), self.saying.clone());
        let reading = std::thread::spawn(move || {
            let ended = process.follow(|line| match serde_json::from_str(line) {
                // Nobody listens any more when the trial has failed.
                Ok(event) => drop(saying.send((number, Some(event)))),
                Err(error) => tracing::warn!("not understood: {error}"),
            });
            drop(saying.send((number, None)));
            ended
        });
        self.processes.push(ClientProcess { id, input, reading: Some(reading) });
        self.next_step(1)
    }

    /// The process ids.
    pub(super) fn ids(&self) -> impl Iterator<Item = u32> {
        self.processes.iter().map(|process| process.id)
    }

    /// Has all of them take the step that they are ready for, and returns the next one when all are
    /// ready for it.
    pub(super) fn step(&mut self) -> Result<Step, TrialError> {
        self.tell()?;
        self.next_step(self.processes.len())
    }

    /// Has all of them take the last step, and returns what they report together.
    pub(super) fn finish(mut self) -> Result<Report, TrialError> {
        self.tell()?;
        let mut whole = Report::default();
        for _ in 0..self.processes.len() {
            match self.listen()? {
                Event::Report(part) => whole.add(&part),
                Event::Ready(_) => return Err(TrialError::NoReport),
            }
        }
        for process in &mut self.processes {
            process.ended()?;
        }
        Ok(whole)
    }

    fn tell(&mut self) -> Result<(), TrialError> {
        for process in &mut self.processes {
            // One that has ended tells more by how it did.
            if writeln!(process.input).is_err() {
                process.ended()?;
            }
        }
        Ok(())
    }

    fn next_step(&mut self, count: usize) -> Result<Step, TrialError> {
        let mut next = Step::End;
        for _ in 0..count {
            match self.listen()? {
                Event::Ready(step) => next = step,
                Event::Report(_) => return Err(TrialError::NoReport),
            }
        }
        Ok(next)
    }

    fn listen(&mut self) -> Result<Event, TrialError> {
        match self.said.recv() {
            Ok((_, Some(event))) => Ok(event),
            Ok((number, None)) => {
                self.processes[number].ended()?;
                Err(TrialError::NoReport)
            }
            Err(_) => Err(TrialError::NoReport),
        }
    }
}

impl ClientProcess {
    /// Waits for its end, and says how that was.
    fn ended(&mut self) -> Result<(), TrialError> {
        let Some(reading) = self.reading.take() else { return Ok(()) };
        Ok(reading.join().map_err(|_| TrialError::NoReport)??)
    }
}

#[cfg(test)]
mod tests {
    use super::parts;

    #[test]
    fn everybody_is_in_one_part() {
        assert_eq!(parts(20).collect::<Vec<_>>(), [(0, 20)]);
        assert_eq!(parts(600).collect::<Vec<_>>(), [(0, 250), (250, 250), (500, 100)]);
        assert_eq!(parts(0).count(), 0);
    }
}
