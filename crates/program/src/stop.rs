//! Ending a program when it is asked to: soon, and with its files in order.
//!
//! A program installs [`Stop::on_signal`] first of all. Until it holds an [`Order`], the first
//! signal ends it at once: it has nothing that must be put in order. While it holds one, the signal
//! sets the flag, and the program ends itself; it is ended when that takes too long, or when it is
//! asked again.

mod parent;

pub use parent::{PARENT_VARIABLE, end_with_parent};

use std::io::{IsTerminal, Write};
use std::process::ExitCode;
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::Duration;
use tokio::sync::watch;

/// How long a program may take to put its files in order after it was asked to end.
const GRACE: Duration = Duration::from_secs(5);
/// Signals as soon after each other are one request.
const SAME_REQUEST: Duration = Duration::from_millis(200);

/// What asks a program to end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StopSignal {
    /// Ctrl-C (SIGINT).
    Interrupt,
    /// A polite `kill` (SIGTERM), or the end of the program that has started this one.
    Terminate,
    /// The terminal is gone (SIGHUP).
    HangUp,
}

impl StopSignal {
    /// What an interrupted program ends with: 128 and the signal's number, as shells have it.
    #[must_use]
    pub fn exit_code(self) -> u8 {
        match self {
            Self::Interrupt => 130,
            Self::Terminate => 143,
            Self::HangUp => 129,
        }
    }
}

type LastAct = Box<dyn FnOnce() + Send>;

#[derive(Default)]
struct Work {
    /// What the program is doing, to be said when it is interrupted.
    doing: String,
    orders: usize,
    last_acts: Vec<LastAct>,
}

/// Whether the program was asked to end. Copies are one flag.
#[derive(Clone)]
pub struct Stop {
    asked: Arc<watch::Sender<Option<StopSignal>>>,
    work: Arc<Mutex<Work>>,
}

impl Default for Stop {
    fn default() -> Self {
        Self { asked: Arc::new(watch::Sender::new(None)), work: Arc::default() }
    }
}

impl std::fmt::Debug for Stop {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Stop").field(&self.asked()).finish()
    }
}

/// Says something on standard error, if anybody still reads that.
fn say(text: &str) {
    let _ = writeln!(std::io::stderr(), "{text}");
}

/// Held while a program has something to put in order before it ends.
#[must_use]
#[derive(Debug)]
pub struct Order(Stop);

impl Drop for Order {
    fn drop(&mut self) {
        self.0.work().orders -= 1;
    }
}

impl Stop {
    /// The flag of this process, which Ctrl-C (and a polite `kill`) sets. It is made once; later
    /// calls return the same one. `program` says its name when it is interrupted.
    ///
    /// # Errors
    /// When the system gives no thread or no signal handler.
    pub fn on_signal(program: &str) -> std::io::Result<Self> {
        Self::on_signals(program, true)
    }

    /// The same for a server, to which SIGHUP says something else than to end.
    ///
    /// # Errors
    /// As [`on_signal`](Self::on_signal).
    pub fn on_signal_of_server(program: &str) -> std::io::Result<Self> {
        Self::on_signals(program, false)
    }

    fn on_signals(program: &str, ends_at_hang_up: bool) -> std::io::Result<Self> {
        static MADE: OnceLock<Stop> = OnceLock::new();
        if let Some(made) = MADE.get() {
            return Ok(made.clone());
        }
        let (stop, program) = (Self::default(), program.to_owned());
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
        let mut signals = runtime.block_on(async { Signals::new(ends_at_hang_up) })?;
        let watched = stop.clone();
        std::thread::Builder::new()
            .name("signals".to_owned())
            .spawn(move || runtime.block_on(watched.obey(&program, &mut signals)))?;
        Ok(MADE.get_or_init(|| stop).clone())
    }

    /// Waits for the first request, and sees to it that the program ends.
    async fn obey(&self, program: &str, signals: &mut Signals) {
        let by_others = self.requested();
        tokio::select! {
            signal = signals.next() => self.request(signal),
            () = by_others => {}
        }
        if self.work().orders == 0 {
            self.say_interrupted(program);
        } else {
            // Some send a signal to the program and to its group: that is asked once.
            let asked_again = async {
                tokio::time::sleep(SAME_REQUEST).await;
                signals.forget().await;
                signals.next().await
            };
            tokio::select! {
                _ = asked_again => say(&format!("{program}: asked twice: it ends at once")),
                () = tokio::time::sleep(GRACE) => {
                    say(&format!("{program}: its files are not in order after {} s: it ends", GRACE.as_secs()));
                }
            }
        }
        self.leave();
    }

    fn say_interrupted(&self, program: &str) {
        // There may be a progress bar.
        let break_line = if std::io::stderr().is_terminal() { "\n" } else { "" };
        let doing = self.work().doing.clone();
        let during = if doing.is_empty() { String::new() } else { format!(" while {doing}") };
        say(&format!("{break_line}{program}: interrupted{during}"));
    }

    fn work(&self) -> MutexGuard<'_, Work> {
        self.work.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Says what the program is doing, such as `waiting for a server`: what it was interrupted
    /// while it did.
    pub fn doing(&self, what: impl Into<String>) {
        self.work().doing = what.into();
    }

    /// From here on, until what is returned is dropped, the program ends itself when the flag is
    /// set.
    pub fn in_order(&self) -> Order {
        self.work().orders += 1;
        Order(self.clone())
    }

    /// Has `act` carried out when the program is interrupted: a temporary folder is removed, a
    /// child is ended. A program that ends otherwise sees to that itself.
    pub fn finally(&self, act: impl FnOnce() + Send + 'static) {
        self.work().last_acts.push(Box::new(act));
    }

    /// Carries out the last acts and ends the process, with the signal's code. Whoever comes second
    /// waits for the first.
    pub fn leave(&self) -> ! {
        let mut work = self.work();
        let acts = std::mem::take(&mut work.last_acts);
        acts.into_iter().rev().for_each(|act| act());
        std::process::exit(self.asked().unwrap_or(StopSignal::Interrupt).exit_code().into());
    }

    /// Asks the program to end, as `signal` would. The first request counts.
    pub fn request(&self, signal: StopSignal) {
        self.asked.send_if_modified(|asked| {
            let is_first = asked.is_none();
            asked.get_or_insert(signal);
            is_first
        });
    }

    /// Asks the program to end, as Ctrl-C would.
    pub fn set(&self) {
        self.request(StopSignal::Interrupt);
    }

    /// What has asked the program to end.
    #[must_use]
    pub fn asked(&self) -> Option<StopSignal> {
        *self.asked.borrow()
    }

    /// Whether the program was asked to end.
    #[must_use]
    pub fn is_set(&self) -> bool {
        self.asked().is_some()
    }

    /// Waits until the program is asked to end.
    pub async fn requested(&self) {
        // The sender is alive as long as this is.
        let _ = self.asked.subscribe().wait_for(Option::is_some).await;
    }

    /// What the program ends with if it was asked to end.
    #[must_use]
    pub fn exit_code(&self) -> Option<ExitCode> {
        self.asked().map(|signal| ExitCode::from(signal.exit_code()))
    }
}

/// The signals that ask a program to end.
struct Signals {
    #[cfg(unix)]
    interrupt: tokio::signal::unix::Signal,
    #[cfg(unix)]
    terminate: tokio::signal::unix::Signal,
    /// None: nobody cares for the terminal.
    #[cfg(unix)]
    hang_up: Option<tokio::signal::unix::Signal>,
}

#[cfg(unix)]
impl Signals {
    fn new(ends_at_hang_up: bool) -> std::io::Result<Self> {
        use tokio::signal::unix::{SignalKind, signal};
        let hang_up = (ends_at_hang_up && !is_hang_up_ignored()).then(|| signal(SignalKind::hangup())).transpose()?;
        let (interrupt, terminate) = (signal(SignalKind::interrupt())?, signal(SignalKind::terminate())?);
        Ok(Self { interrupt, terminate, hang_up })
    }

    async fn next(&mut self) -> StopSignal {
        let hung_up = async {
            match &mut self.hang_up {
                Some(signal) => _ = signal.recv().await,
                None => std::future::pending().await,
            }
        };
        tokio::select! {
            _ = self.interrupt.recv() => StopSignal::Interrupt,
            _ = self.terminate.recv() => StopSignal::Terminate,
            () = hung_up => StopSignal::HangUp,
        }
    }
}

/// Whether whoever has started this program wants it to outlive the terminal, as `nohup` does.
#[cfg(unix)]
fn is_hang_up_ignored() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    ignores_hang_up(&status)
}

/// The same, given a process's status as Linux has it.
#[cfg(unix)]
fn ignores_hang_up(status: &str) -> bool {
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    // SIGHUP is the first of the signals.
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).is_some_and(|mask| mask & 1 == 1)
}

impl Signals {
    /// Forgets the signals that have come.
    async fn forget(&mut self) {
        loop {
            tokio::select! {
                biased;
                _ = self.next() => {}
                () = std::future::ready(()) => return,
            }
        }
    }
}

#[cfg(not(unix))]
impl Signals {
    fn new(_: bool) -> std::io::Result<Self> {
        Ok(Self {})
    }

    async fn next(&mut self) -> StopSignal {
        let _ = tokio::signal::ctrl_c().await;
        StopSignal::Interrupt
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicUsize, Ordering};

    #[test]
    fn the_first_request_counts() {
        let stop = Stop::default();
        assert_eq!((stop.is_set(), stop.asked()), (false, None));
        stop.clone().request(StopSignal::Terminate);
        stop.set();
        assert_eq!((stop.is_set(), stop.asked()), (true, Some(StopSignal::Terminate)));
        let runtime = tokio::runtime::Builder::new_current_thread().build();
        runtime.unwrap_or_else(|error| panic!("{error}")).block_on(stop.requested());
    }

    #[cfg(unix)]
    #[test]
    fn who_is_to_outlive_the_terminal_does() {
        let status = |mask: &str| format!("Name:\tmapper\nSigIgn:\t{mask}\nSigCgt:\t0000000000000001\n");
        assert!(ignores_hang_up(&status("0000000000001001")));
        assert!(!ignores_hang_up(&status("0000000000001000")) && !ignores_hang_up(""));
    }

    #[test]
    fn what_must_be_put_in_order_is_counted() {
        static ACTS: AtomicUsize = AtomicUsize::new(0);
        let stop = Stop::default();
        stop.finally(|| _ = ACTS.fetch_add(1, Ordering::Relaxed));
        let (one, two) = (stop.in_order(), stop.in_order());
        assert_eq!(stop.work().orders, 2);
        drop(one);
        drop(two);
        assert_eq!((stop.work().orders, ACTS.load(Ordering::Relaxed)), (0, 0), "a last act is for interrupts");
    }
}
