//! A question put beside the robot's loop: a thread waits for the answer, the loop looks once per frame whether it is there.

use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, TryRecvError, channel};
use std::time::Duration;

/// When an answer is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Taking {
    /// As soon as it is there: the loop never waits. For robots in real time.
    WhenThere,
    /// This many frames after the question, whatever the thread's speed, so that a simulated run repeats exactly. Frames
    /// stand still while the loop waits for a late answer.
    AfterFrames(u32),
}

/// Questions of which the newest matters.
pub struct Inquiry<Q, A> {
    questions: Sender<(u64, Q)>,
    answers: Receiver<(u64, A)>,
    taking: Taking,
    /// Number of the newest question.
    number: u64,
    /// Frames since it was put; none when nothing is awaited.
    waited: Option<u32>,
    /// Longest that the loop waits for a late answer.
    patience: Duration,
}

impl<Q: Send + 'static, A: Send + 'static> Inquiry<Q, A> {
    /// Starts the thread, which answers by `ask`. It ends after the inquiry is dropped.
    ///
    /// # Errors
    /// When the system gives no thread.
    pub fn start(
        taking: Taking,
        patience: Duration,
        mut ask: impl FnMut(Q) -> A + Send + 'static,
    ) -> std::io::Result<Self> {
        let (questions, incoming) = channel::<(u64, Q)>();
        let (outgoing, answers) = channel();
        std::thread::Builder::new().name("inquiry".to_owned()).spawn(move || {
            while let Ok(question) = incoming.recv() {
                // Older questions are of no use any more.
                let (number, question) = incoming.try_iter().last().unwrap_or(question);
                if outgoing.send((number, ask(question))).is_err() {
                    return;
                }
            }
        })?;
        Ok(Self { questions, answers, taking, number: 0, waited: None, patience })
    }

    /// Puts a question; the answer to any before it is not wanted any more.
    pub fn put(&mut self, question: Q) {
        self.number += 1;
        self.waited = self.questions.send((self.number, question)).is_ok().then_some(0);
    }

    /// Wants no answer any more.
    pub fn cancel(&mut self) {
        self.waited = None;
    }

    /// Whether an answer is awaited.
    #[must_use]
    pub fn is_pending(&self) -> bool {
        self.waited.is_some()
    }

    /// Once per frame: the answer to the newest question, once.
    pub fn take(&mut self) -> Option<A> {
        let waited = self.waited?.saturating_add(1);
        self.waited = Some(waited);
        match self.taking {
            Taking::AfterFrames(frames) if waited < frames => None,
            Taking::AfterFrames(_) => {
                self.waited = None;
                loop {
                    match self.answers.recv_timeout(self.patience) {
                        Ok((number, answer)) if number == self.number => return Some(answer),
                        Ok(_) => {}
                        Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => return None,
                    }
                }
            }
            Taking::WhenThere => loop {
                match self.answers.try_recv() {
                    Ok((number, answer)) if number == self.number => {
                        self.waited = None;
                        return Some(answer);
                    }
                    Ok(_) => {}
                    Err(TryRecvError::Empty) => return None,
                    Err(TryRecvError::Disconnected) => {
                        self.waited = None;
                        return None;
                    }
                }
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Instant;

    const PATIENCE: Duration = Duration::from_secs(20);

    #[test]
    fn a_late_answer_does_not_hold_up_the_loop() {
        let (go, gate) = channel::<()>();
        let ask = move |question: u32| {
            let _ = gate.recv();
            question
        };
        let mut inquiry = Inquiry::start(Taking::WhenThere, PATIENCE, ask).expect("a thread");
        assert_eq!(inquiry.take(), None);
        inquiry.put(1);
        let began = Instant::now();
        assert!((0..100).all(|_| inquiry.take().is_none()) && inquiry.is_pending());
        assert!(began.elapsed() < PATIENCE / 4);
        inquiry.put(2);
        for _ in 0..2 {
            go.send(()).expect("the thread lives");
        }
        let answer = loop {
            if let Some(answer) = inquiry.take() {
                break answer;
            }
            assert!(began.elapsed() < PATIENCE);
            std::thread::sleep(Duration::from_millis(1));
        };
        assert_eq!(answer, 2, "only the newest question counts");
        assert!(!inquiry.is_pending() && inquiry.take().is_none());
    }

    #[test]
    fn in_simulated_time_the_answer_comes_at_its_frame_however_slow_the_thread() {
        for delay_ms in [0, 30] {
            let ask = move |question: u32| {
                std::thread::sleep(Duration::from_millis(delay_ms));
                question
            };
            let mut inquiry = Inquiry::start(Taking::AfterFrames(3), PATIENCE, ask).expect("a thread");
            inquiry.put(1);
            assert_eq!(inquiry.take(), None);
            inquiry.put(2);
            assert_eq!([inquiry.take(), inquiry.take(), inquiry.take(), inquiry.take()], [None, None, Some(2), None]);
            inquiry.put(3);
            inquiry.cancel();
            assert!((0..5).all(|_| inquiry.take().is_none()));
        }
    }
}
