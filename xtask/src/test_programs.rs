//! All tests of the workspace, several programs at a time: `cargo xtask test`.
//!
//! `cargo test` runs one test program after the other, and most of those that start processes wait
//! for something: side by side they take about half of the time. A program of many modules
//! (`tests/NAME/main.rs`) runs once for each of them. What one prints is shown in one piece when it
//! ends. One that does not end is killed.

use serde::Deserialize;
use std::collections::{BTreeMap, VecDeque};
use std::fs::File;
use std::io::{Read, Seek, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// Test programs that run at a time, for each processor.
const AT_ONCE_PER_PROCESSOR: f64 = 1.5;
/// Longest time of one program: six times what the longest takes on two cores, so that it ends on a
/// machine that is busy with other work, too.
const LIMIT: Duration = Duration::from_secs(2400);
const POLL: Duration = Duration::from_millis(50);
/// With the operators' page and traces: what is built once serves their tests, too.
const PAGE: &str = "--features=map-server/web,map-server/otel";
/// Builds all tests, and no examples, which clippy has seen.
const BUILD: [&str; 7] =
    ["test", "--release", "--workspace", "--tests", PAGE, "--no-run", "--message-format=json-render-diagnostics"];
/// Test programs that need what not everybody has installed: one program of each list.
const NEEDS: [(&str, &[&[&str]]); 2] = [
    ("ros_rclpy.rs", &[&["cmake"], &["python3.11"]]),
    ("web_browser.rs", &[&["chromium", "chromium-browser", "google-chrome"], &["npm"]]),
];
/// Those that take minutes are begun first, so that none is left alone at the end.
const LONG: [&str; 8] = [
    "explorers.rs",
    "footprints.rs",
    "handoff.rs",
    "interrupted.rs",
    "merge.rs",
    "real_slam.rs",
    "replay.rs",
    "shared_world.rs",
];
/// Zenoh's TLS may crash where two threads are at one connection (`docs/upstream.md`).
const ONE_THREAD: (&str, &str) =
    ("ZENOH_RUNTIME", "(rx: (worker_threads: 1), tx: (handover: rx), acc: (handover: rx), net: (handover: rx))");

/// Why the tests were not run, or not all of them.
#[derive(Debug, thiserror::Error)]
pub(crate) enum TestError {
    /// They do not compile, or a doctest failed; cargo has said why.
    #[error("{0} failed")]
    Cargo(&'static str),
    /// The system refuses.
    #[error("{what}: {source}")]
    System {
        /// What was tried.
        what: String,
        /// What the system says.
        source: std::io::Error,
    },
}

fn system(what: impl Into<String>) -> impl FnOnce(std::io::Error) -> TestError {
    let what = what.into();
    move |source| TestError::System { what, source }
}

/// What cargo says of each thing that it has built.
#[derive(Deserialize)]
struct Artifact {
    #[serde(default)]
    executable: Option<PathBuf>,
    #[serde(default)]
    manifest_path: PathBuf,
    #[serde(default)]
    profile: Profile,
    #[serde(default)]
    target: Target,
}

#[derive(Default, Deserialize)]
struct Profile {
    #[serde(default)]
    test: bool,
}

#[derive(Default, Deserialize)]
struct Target {
    #[serde(default)]
    src_path: PathBuf,
}

/// A test program, or one of its modules.
struct Program {
    executable: PathBuf,
    source: PathBuf,
    package: PathBuf,
    /// Only these of its tests; none: all.
    tests: Vec<String>,
}

/// How a program ended.
struct Ended {
    status: Option<ExitStatus>,
    took: Duration,
    printed: String,
}

/// Builds and runs all tests, those in documentation last. Returns the sources of the programs that
/// failed.
///
/// # Errors
/// [`TestError`].
pub(crate) fn run(root: &Path) -> Result<Vec<PathBuf>, TestError> {
    let root = &root.canonicalize().map_err(system(root.display().to_string()))?;
    let (programs, left_out): (VecDeque<_>, VecDeque<_>) =
        build(root)?.into_iter().partition(|program| program.missing().is_none());
    for program in &left_out {
        let missing = program.missing().unwrap_or_default().join(" or ");
        println!("    Left out {}: {missing} is not installed", program.source.display());
    }
    build_foreign(root, &programs)?;
    let processors = std::thread::available_parallelism().map_or(1, usize::from);
    let at_once = (processors as f64 * AT_ONCE_PER_PROCESSOR).ceil() as usize;
    let waiting = Mutex::new(programs);
    let next = || waiting.lock().unwrap_or_else(std::sync::PoisonError::into_inner).pop_front();
    let failed = Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        let work = || -> Result<(), TestError> {
            while let Some(program) = next() {
                let ended = program.run()?;
                let source = program.source.strip_prefix(root).unwrap_or(&program.source).to_owned();
                // One write, so that programs do not mix what they say.
                let text =
                    format!("     Running {} ({:.1} s)\n{}", source.display(), ended.took.as_secs_f64(), ended.printed);
                std::io::stdout().write_all(text.as_bytes()).map_err(system("standard output"))?;
                if !ended.status.is_some_and(|status| status.success()) {
                    failed.lock().unwrap_or_else(std::sync::PoisonError::into_inner).push(source);
                }
            }
            Ok(())
        };
        let workers: Vec<_> = (0..at_once).map(|_| scope.spawn(work)).collect();
        workers.into_iter().try_for_each(|worker| worker.join().unwrap_or(Err(TestError::Cargo("a test's worker"))))
    })?;
    let documented = cargo(root).args(["test", "--release", "--workspace", PAGE, "--doc"]).status();
    if !documented.map_err(system("cargo"))?.success() {
        return Err(TestError::Cargo("cargo test --doc"));
    }
    Ok(failed.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner))
}

/// Whether one of these programs is installed.
fn is_installed(names: &[&str]) -> bool {
    let folders = std::env::var_os("PATH").unwrap_or_default();
    std::env::split_paths(&folders).any(|folder| names.iter().any(|name| folder.join(name).is_file()))
}

/// Cargo, without what the Cargo that runs this program tells it of itself: the build script of
/// `ring` looks at that, and it and all of Zenoh's TLS would be built again, now and at the next
/// direct call.
fn cargo(root: &Path) -> Command {
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.current_dir(root);
    for (name, _) in std::env::vars_os() {
        let is_of_this_package =
            name.to_str().is_some_and(|name| name.starts_with("CARGO_PKG_") || name.starts_with("CARGO_MANIFEST_"));
        if is_of_this_package {
            command.env_remove(name);
        }
    }
    command
}

fn build(root: &Path) -> Result<VecDeque<Program>, TestError> {
    let mut building = cargo(root).args(BUILD).stdout(Stdio::piped()).spawn().map_err(system("cargo"))?;
    let mut said = String::new();
    if let Some(mut stdout) = building.stdout.take() {
        stdout.read_to_string(&mut said).map_err(system("what cargo says"))?;
    }
    if !building.wait().map_err(system("cargo"))?.success() {
        return Err(TestError::Cargo("cargo test --no-run"));
    }
    let artifacts = said.lines().filter_map(|line| serde_json::from_str::<Artifact>(line).ok());
    let programs = artifacts.filter(|artifact| artifact.profile.test).filter_map(|artifact| {
        let Artifact { executable, manifest_path, target, .. } = artifact;
        let package = manifest_path.parent()?.to_owned();
        Some(Program { executable: executable?, source: target.src_path, package, tests: Vec::new() })
    });
    let mut all = Vec::new();
    for program in programs {
        if program.source.ends_with("main.rs") { all.extend(program.modules()?) } else { all.push(program) }
    }
    all.sort_by_key(|program| !program.source.file_name().is_some_and(|name| LONG.iter().any(|long| name == *long)));
    Ok(all.into())
}

/// Builds the foreign ROS 2 programs of the tests, which are no part of the workspace. The tests
/// that need them would do so themselves, for minutes, with other tests beside them.
fn build_foreign(root: &Path, programs: &VecDeque<Program>) -> Result<(), TestError> {
    // Programs lie in release/deps of the target folder.
    let target = programs.iter().find_map(|program| program.executable.ancestors().nth(3));
    let mut command = cargo(&root.join("tests/tests/foreign_ros"));
    command.args(["build", "--locked", "--quiet"]);
    if is_installed(&["cmake"]) {
        command.args(["--features", "dds"]);
    }
    if let Some(target) = target {
        command.env("CARGO_TARGET_DIR", target.join("tmp/foreign-ros"));
    }
    let status = command.status().map_err(system("cargo"))?;
    if status.success() { Ok(()) } else { Err(TestError::Cargo("cargo build of tests/tests/foreign_ros")) }
}

impl Program {
    /// A program for each of its modules that has tests.
    fn modules(self) -> Result<Vec<Self>, TestError> {
        let failed = || system(self.executable.display().to_string());
        let listed = Command::new(&self.executable).args(["--list", "--format", "terse"]).output().map_err(failed())?;
        if !listed.status.success() {
            return Err(failed()(std::io::Error::other(format!("--list: {}", listed.status))));
        }
        let listed = String::from_utf8_lossy(&listed.stdout);
        let mut modules: BTreeMap<&str, Vec<String>> = BTreeMap::new();
        for name in listed.lines().filter_map(|line| line.strip_suffix(": test")) {
            let (module, _) = name.split_once("::").unwrap_or(("main", name));
            modules.entry(module).or_default().push(name.to_owned());
        }
        let of_module = |(module, tests)| Self {
            executable: self.executable.clone(),
            source: self.source.with_file_name(format!("{module}.rs")),
            package: self.package.clone(),
            tests,
        };
        Ok(modules.into_iter().map(of_module).collect())
    }

    /// What it needs and is not installed: one of these.
    fn missing(&self) -> Option<&'static [&'static str]> {
        let name = self.source.file_name()?;
        let (_, needs) = NEEDS.iter().find(|(file, _)| name == *file)?;
        needs.iter().find(|programs| !is_installed(programs)).copied()
    }

    /// Whether it opens sessions with TLS itself.
    fn is_of_a_secured_site(&self) -> bool {
        std::fs::read_to_string(&self.source).is_ok_and(|text| text.contains("crate::site"))
    }

    fn run(&self) -> Result<Ended, TestError> {
        let of = || self.executable.display().to_string();
        let mut output = tempfile::tempfile().map_err(system("a temporary file"))?;
        let both = |file: &File| file.try_clone().map_err(system("a temporary file"));
        let begin = Instant::now();
        let tls = self.is_of_a_secured_site().then_some(ONE_THREAD);
        let mut child = Command::new(&self.executable)
            .args(self.tests.first().map(|_| "--exact"))
            .args(&self.tests)
            .envs(tls)
            .current_dir(&self.package)
            .env("CARGO_MANIFEST_DIR", &self.package)
            .stdin(Stdio::null())
            .stdout(both(&output)?)
            .stderr(both(&output)?)
            .spawn()
            .map_err(system(of()))?;
        let status = wait(&mut child, begin).map_err(system(of()))?;
        let mut printed = Vec::new();
        output.rewind().and_then(|()| output.read_to_end(&mut printed)).map_err(system("a temporary file"))?;
        let mut printed = String::from_utf8_lossy(&printed).into_owned();
        match status {
            Some(status) if !status.success() => printed += &format!("FAILED: {}: {status}\n", of()),
            None => printed += &format!("FAILED: {} did not end within {} s\n", of(), LIMIT.as_secs()),
            Some(_) => {}
        }
        Ok(Ended { status, took: begin.elapsed(), printed })
    }
}

/// Waits until a program ends; `None` if it had to be killed.
fn wait(child: &mut Child, begin: Instant) -> std::io::Result<Option<ExitStatus>> {
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(Some(status));
        }
        if begin.elapsed() > LIMIT {
            child.kill()?;
            child.wait()?;
            return Ok(None);
        }
        std::thread::sleep(POLL);
    }
}
