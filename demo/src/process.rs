//! The programs as child processes. All of them are in one executable
//! (`handoff role NAME -- ARGS`), so that one build makes everything that a scenario starts.

mod children;

pub(crate) use children::is_over;
pub use children::leave_nothing_behind;

use children::lock;
use fht_program::stop::PARENT_VARIABLE;
use rustix::process::{Pid, Signal, kill_process};
use std::ffi::OsStr;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, ExitStatus, Stdio};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// One of the programs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Role {
    /// The map server.
    MapServer,
    /// The explorer.
    Mapper,
    /// The robot that uses the map.
    ClientRobot,
    /// A simulated robot that speaks ROS 2, or the router of its graph.
    Sim,
}

impl Role {
    /// What people call it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::MapServer => "map-server",
            Self::Mapper => "mapper",
            Self::ClientRobot => "client-robot",
            Self::Sim => "sim",
        }
    }
}

impl From<Role> for &'static str {
    fn from(role: Role) -> Self {
        role.name()
    }
}

/// Why a program could not be used.
#[derive(Debug, thiserror::Error)]
pub enum ProcessError {
    /// It cannot be started.
    #[error("{role} cannot be started: {source}")]
    Start {
        /// The program.
        role: &'static str,
        /// The system's error.
        source: std::io::Error,
    },
    /// It ended too early, or with a failure.
    #[error("{role} failed ({status}){}", tail(stderr))]
    Failed {
        /// The program.
        role: &'static str,
        /// Its exit status.
        status: ExitStatus,
        /// The last lines of its output.
        stderr: String,
    },
    /// It does not listen.
    #[error("{role} does not listen on {endpoint} after {seconds} s")]
    Silent {
        /// The program.
        role: &'static str,
        /// Where it should listen.
        endpoint: String,
        /// How long we waited.
        seconds: u64,
    },
    /// It has not ended.
    #[error("{role} has not ended after {seconds} s{}", tail(stderr))]
    Late {
        /// The program.
        role: &'static str,
        /// How long we waited.
        seconds: u64,
        /// The last lines of its output.
        stderr: String,
    },
    /// Waiting failed.
    #[error("{role}: {source}")]
    Wait {
        /// The program.
        role: &'static str,
        /// The system's error.
        source: std::io::Error,
    },
}

fn tail(stderr: &str) -> String {
    let text = stderr.trim();
    if text.is_empty() { String::new() } else { format!(": {text}") }
}

/// A running program. It is killed when this is dropped; one of the roles ends with its parent,
/// too, however that ends.
pub struct Process {
    role: &'static str,
    child: Arc<Mutex<Child>>,
    id: u32,
    stdout: Option<ChildStdout>,
    stderr: Option<std::thread::JoinHandle<String>>,
}

impl Process {
    /// Starts a program of `executable` (the handoff binary) with `args`.
    ///
    /// # Errors
    /// [`ProcessError::Start`].
    pub fn start<A: AsRef<OsStr>>(
        executable: &Path,
        role: impl Into<&'static str>,
        args: impl IntoIterator<Item = A>,
    ) -> Result<Self, ProcessError> {
        let role = role.into();
        let mut command = Command::new(executable);
        command.args(["role", role, "--"]).args(args);
        Self::run(role, command)
    }

    /// Starts a map-server that keeps its maps in `data`, and waits until it listens on
    /// `endpoint`.
    ///
    /// # Errors
    /// [`ProcessError`].
    pub fn map_server(
        executable: &Path,
        data: &Path,
        endpoint: &str,
        patience: Duration,
    ) -> Result<Self, ProcessError> {
        let args = ["--data".as_ref(), data.as_os_str(), "--listen".as_ref(), endpoint.as_ref()];
        let mut server = Self::start(executable, Role::MapServer, args)?;
        server.wait_until_listening(endpoint, patience)?;
        Ok(server)
    }

    /// Runs a command; errors call it `role`.
    ///
    /// # Errors
    /// [`ProcessError::Start`].
    pub fn run(role: &'static str, command: Command) -> Result<Self, ProcessError> {
        Ok(Self::spawn(role, command, Stdio::null())?.0)
    }

    /// The same, with a pipe to its standard input.
    ///
    /// # Errors
    /// [`ProcessError::Start`].
    pub fn run_with_input(role: &'static str, command: Command) -> Result<(Self, ChildStdin), ProcessError> {
        let (process, input) = Self::spawn(role, command, Stdio::piped())?;
        let source = || std::io::Error::other("it has no standard input");
        Ok((process, input.ok_or_else(|| ProcessError::Start { role, source: source() })?))
    }

    fn spawn(
        role: &'static str,
        mut command: Command,
        stdin: Stdio,
    ) -> Result<(Self, Option<ChildStdin>), ProcessError> {
        let start_error = |source| ProcessError::Start { role, source };
        command.stdin(stdin).stdout(Stdio::piped()).stderr(Stdio::piped());
        command.env(PARENT_VARIABLE, std::process::id().to_string());
        let (child, id) = children::spawn(&mut command).map_err(start_error)?;
        let mut running = lock(&child);
        let (stdin, stdout) = (running.stdin.take(), running.stdout.take());
        // Read continuously, or a talkative child would block; keep the last lines.
        let stderr = running.stderr.take().map(|mut pipe| {
            std::thread::spawn(move || {
                let mut kept = Vec::new();
                let mut buffer = [0; 4096];
                while let Ok(count @ 1..) = pipe.read(&mut buffer) {
                    kept.extend_from_slice(&buffer[..count]);
                    let excess = kept.len().saturating_sub(4096);
                    kept.drain(..excess);
                }
                String::from_utf8_lossy(&kept).into_owned()
            })
        });
        drop(running);
        Ok((Self { role, child, id, stdout, stderr }, stdin))
    }

    /// Asks it to end, as a polite `kill` would (SIGTERM).
    pub fn ask_to_end(&self) {
        if let Some(id) = i32::try_from(self.id).ok().and_then(Pid::from_raw) {
            // It may have ended already.
            let _ = kill_process(id, Signal::TERM);
        }
    }

    /// Processor time that it has used so far, seconds; 0 where the system does not tell.
    #[must_use]
    pub fn cpu_s(&self) -> f64 {
        /// Of user and system, counted from the state, which comes after the name.
        const TIMES: std::ops::Range<usize> = 11..13;
        /// The kernel's clock for these.
        const TICKS_PER_S: f64 = 100.0;
        let stat = std::fs::read_to_string(format!("/proc/{}/stat", self.id)).unwrap_or_default();
        let fields: Vec<&str> = stat.rsplit_once(')').map_or("", |(_, rest)| rest).split_whitespace().collect();
        let ticks = fields.get(TIMES).unwrap_or_default().iter().filter_map(|field| field.parse::<f64>().ok());
        ticks.sum::<f64>() / TICKS_PER_S
    }

    /// The process id.
    #[must_use]
    pub fn id(&self) -> u32 {
        self.id
    }

    /// Kills it, as a power cut would (SIGKILL).
    ///
    /// # Errors
    /// [`ProcessError::Wait`].
    pub fn kill(&mut self) -> Result<(), ProcessError> {
        let wait_error = |source| ProcessError::Wait { role: self.role, source };
        let mut child = lock(&self.child);
        child.kill().map_err(wait_error)?;
        child.wait().map_err(wait_error)?;
        Ok(())
    }

    /// Waits until it listens on `endpoint` (`tcp/host:port`).
    ///
    /// # Errors
    /// [`ProcessError::Failed`] if it ends instead, [`ProcessError::Silent`] if it does not within
    /// `patience`.
    pub fn wait_until_listening(&mut self, endpoint: &str, patience: Duration) -> Result<(), ProcessError> {
        let address = endpoint.strip_prefix("tcp/").unwrap_or(endpoint);
        let deadline = Instant::now() + patience;
        while std::net::TcpStream::connect(address).is_err() {
            if let Some(status) = self.ended()? {
                return Err(self.failure(status));
            }
            if Instant::now() > deadline {
                let endpoint = endpoint.to_owned();
                return Err(ProcessError::Silent { role: self.role, endpoint, seconds: patience.as_secs() });
            }
            std::thread::sleep(Duration::from_millis(50));
        }
        Ok(())
    }

    /// Reads its standard output line by line until it ends or `goes_on` says no.
    pub fn listen(&mut self, mut goes_on: impl FnMut(&str) -> bool) {
        if let Some(stdout) = self.stdout.take() {
            let lines = BufReader::new(stdout).lines().map_while(Result::ok);
            let _ = lines.take_while(|line| goes_on(line)).last();
        }
    }

    /// Reads its standard output line by line until it ends; fails unless it ends well.
    ///
    /// # Errors
    /// [`ProcessError::Failed`].
    pub fn follow(mut self, mut each_line: impl FnMut(&str)) -> Result<(), ProcessError> {
        if let Some(stdout) = self.stdout.take() {
            BufReader::new(stdout).lines().map_while(Result::ok).for_each(|line| each_line(&line));
        }
        let status = loop {
            match self.ended()? {
                Some(status) => break status,
                None => std::thread::sleep(Duration::from_millis(10)),
            }
        };
        if status.success() { Ok(()) } else { Err(self.failure(status)) }
    }

    /// Waits until it ends, and returns what it printed; fails unless it ends well.
    ///
    /// # Errors
    /// [`ProcessError::Failed`], [`ProcessError::Late`] if it takes longer than `patience`.
    pub fn finish(mut self, patience: Duration) -> Result<String, ProcessError> {
        // Read continuously, or a talkative child would block.
        let printed = self.stdout.take().map(|mut pipe| {
            std::thread::spawn(move || {
                let mut bytes = Vec::new();
                // What was printed before the failure is worth reading, too.
                let _ = pipe.read_to_end(&mut bytes);
                String::from_utf8_lossy(&bytes).into_owned()
            })
        });
        let deadline = Instant::now() + patience;
        let status = loop {
            if let Some(status) = self.ended()? {
                break status;
            }
            if Instant::now() > deadline {
                self.kill()?;
                return Err(ProcessError::Late { role: self.role, seconds: patience.as_secs(), stderr: self.said() });
            }
            std::thread::sleep(Duration::from_millis(10));
        };
        if !status.success() {
            return Err(self.failure(status));
        }
        Ok(printed.and_then(|thread| thread.join().ok()).unwrap_or_default())
    }

    /// Whether it still runs.
    ///
    /// # Errors
    /// [`ProcessError::Wait`].
    pub fn is_running(&mut self) -> Result<bool, ProcessError> {
        Ok(self.ended()?.is_none())
    }

    /// Its exit status, if it has ended.
    fn ended(&mut self) -> Result<Option<ExitStatus>, ProcessError> {
        lock(&self.child).try_wait().map_err(|source| ProcessError::Wait { role: self.role, source })
    }

    /// The last lines of its output; it must have ended.
    fn said(&mut self) -> String {
        self.stderr.take().and_then(|thread| thread.join().ok()).unwrap_or_default()
    }

    fn failure(&mut self, status: ExitStatus) -> ProcessError {
        ProcessError::Failed { role: self.role, status, stderr: self.said() }
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // It may have ended already; there is nobody to report to.
        let mut child = lock(&self.child);
        let _ = child.kill();
        let _ = child.wait();
    }
}

/// The executable that is running: for a binary that starts its own roles.
///
/// # Errors
/// When the system does not know.
pub fn this_executable() -> std::io::Result<PathBuf> {
    std::env::current_exe()
}

/// A loopback endpoint whose port the system gives to nobody else while this process runs.
///
/// # Errors
/// When no port is free.
pub fn free_endpoint() -> std::io::Result<String> {
    Ok(format!("tcp/{}", fht_reserved_port::reserve()?))
}
