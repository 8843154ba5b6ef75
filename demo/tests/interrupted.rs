//! Every program ends soon after the first SIGINT or SIGTERM, whatever it is doing, with the code
//! of the signal, and leaves no process and no folder behind.
#![cfg(unix)]
#![allow(clippy::unwrap_used)] // tests may panic

use fht_demo::free_endpoint;
use std::ffi::OsStr;
use std::io::Read;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// How long a program may take to end, on a machine that is busy with all other tests. On one with
/// nothing else to do a program that waits is gone after some 20 ms, an explorer on the way after
/// 0.3 s, and one whose server has gone after 0.8 s.
const SOON: Duration = Duration::from_secs(15);
/// How long anything else may take.
const PATIENCE: Duration = Duration::from_secs(60);
/// The signals, with the codes that programs end with.
const SIGNALS: [(&str, i32); 2] = [("INT", 130), ("TERM", 143)];

/// A program of its own, with its own folder for temporary files.
struct Running {
    child: Child,
    folder: TempDir,
}

impl Running {
    fn start<A: AsRef<OsStr>>(args: &[A]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let mut command = Command::new(env!("CARGO_BIN_EXE_handoff"));
        command.args(args).current_dir(folder.path()).env("TMPDIR", folder.path());
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        Self { child: command.spawn().unwrap(), folder }
    }

    fn program(name: &str, args: &[&str]) -> Self {
        Self::start(&[&["role", name, "--"], args].concat())
    }

    fn signal(&self, signal: &str) {
        signal_to(signal, self.child.id());
    }

    /// Waits until it has printed a line with this text on standard output.
    fn until_printed(&mut self, text: &str) {
        let mut seen = String::new();
        let pipe = self.child.stdout.as_mut().unwrap();
        let mut byte = [0];
        while !seen.contains(text) {
            if pipe.read(&mut byte).unwrap() == 0 {
                let mut said = String::new();
                let _ = self.child.stderr.as_mut().unwrap().read_to_string(&mut said); // whatever it is
                panic!("it ended after: {seen}; it said: {said}");
            }
            seen.push(byte[0].into());
        }
    }

    /// Waits for its end after a signal; its code, and what it said on standard error.
    fn ends(mut self) -> (i32, String, TempDir) {
        let asked = Instant::now();
        let status = loop {
            if let Some(status) = self.child.try_wait().unwrap() {
                break status;
            }
            assert!(asked.elapsed() < SOON, "it is still there after {SOON:?}");
            std::thread::sleep(Duration::from_millis(5));
        };
        println!("ended after {:.0} ms", asked.elapsed().as_secs_f64() * 1e3);
        // A talkative program would block on the pipe that nobody reads.
        let stdout = self.child.stdout.take();
        std::thread::spawn(move || stdout.map(|mut pipe| pipe.read_to_end(&mut Vec::new())));
        let mut said = String::new();
        self.child.stderr.take().unwrap().read_to_string(&mut said).unwrap();
        (status.code().unwrap_or_else(|| panic!("{status}: {said}")), said, self.folder)
    }
}

fn signal_to(signal: &str, process: u32) {
    assert!(Command::new("kill").args([&format!("-{signal}"), &process.to_string()]).status().unwrap().success());
}

/// Processes with this text in their command line or environment.
fn processes_with(text: &str) -> Vec<String> {
    let found = std::fs::read_dir("/proc").unwrap().filter_map(|entry| {
        let process = entry.ok()?.path();
        process.file_name()?.to_str()?.parse::<u32>().ok().filter(|id| *id != std::process::id())?;
        let read =
            |what: &str| std::fs::read(process.join(what)).map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
        let line = read("cmdline").ok().filter(|line| !line.is_empty())?;
        (line.contains(text) || read("environ").is_ok_and(|all| all.contains(text))).then_some(line)
    });
    found.collect()
}

/// Waits until `done`.
fn until(what: &str, mut done: impl FnMut() -> bool) {
    let begin = Instant::now();
    while !done() {
        assert!(begin.elapsed() < PATIENCE, "{what}: not after {PATIENCE:?}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

fn listens(endpoint: &str) -> bool {
    std::net::TcpStream::connect(endpoint.trim_start_matches("tcp/")).is_ok()
}

/// An endpoint of a server that accepts connections and says nothing.
fn silent_server() -> String {
    let listener = std::net::TcpListener::bind(("127.0.0.1", 0)).unwrap();
    let endpoint = format!("tcp/{}", listener.local_addr().unwrap());
    std::thread::spawn(move || listener.incoming().collect::<Vec<_>>());
    endpoint
}

fn server(signal: &str, folder: &Path) -> (Running, String) {
    let endpoint = free_endpoint().unwrap();
    let data = folder.join(format!("data-{signal}"));
    let server = Running::program("map-server", &["--data", data.to_str().unwrap(), "--listen", &endpoint]);
    until("the server listens", || listens(&endpoint));
    (server, endpoint)
}

#[test]
fn whoever_waits_for_a_server_ends_at_the_first_signal() {
    let nobody = free_endpoint().unwrap();
    let silent = silent_server();
    let waiting: [(&str, &[&str]); 9] = [
        ("mapper", &["explore", "--world", "museum", "--no-cameras"]),
        ("mapper", &["explore", "--world", "museum", "--no-cameras", "--spool", "waiting", "--record", "run.mcap"]),
        ("client-robot", &["path", "--from", "0,0", "--to", "1,1"]),
        ("client-robot", &["go", "--to", "1,1", "--no-cameras"]),
        ("client-robot", &["relocalize", "--no-cameras"]),
        ("map-server", &["robots", "museum"]),
        ("map-server", &["place", "museum", "dock", "1,2"]),
        ("map-server", &["release", "list", "museum"]),
        ("map-server", &["--storages", "3", "--data-is-elsewhere"]),
    ];
    for (signal, code) in SIGNALS {
        for endpoint in [&nobody, &silent] {
            let started: Vec<_> = waiting
                .iter()
                .map(|(name, args)| {
                    let args: Vec<&str> = args.iter().copied().filter(|arg| *arg != "--data-is-elsewhere").collect();
                    (*name, args.join(" "), Running::program(name, &[&args[..], &["--connect", endpoint]].concat()))
                })
                .collect();
            // Signals are handled from the start; here it is the wait that is meant.
            std::thread::sleep(Duration::from_secs(3));
            for (name, args, running) in started {
                running.signal(signal);
                let (ended, said, folder) = running.ends();
                println!("{name} {args}: {said}");
                assert_eq!(ended, code, "{name} {args} at {endpoint}: {said}");
                assert!(said.contains(&format!("{name}: interrupted")), "{name} {args}: {said}");
                assert!(!said.contains("nobody takes"), "{said}");
                assert!(!folder.path().join("run.mcap").exists(), "nothing was recorded");
            }
        }
    }
}

/// Whether Ctrl-C is ignored until a program cares for it, as in a shell's background job.
fn is_interrupt_ignored() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).is_some_and(|mask| mask & 0b10 != 0)
}

#[test]
fn a_program_that_starts_ends_at_once() {
    for (signal, code) in SIGNALS {
        if signal == "INT" && is_interrupt_ignored() {
            println!("left out: SIGINT is ignored here until the program handles it, and may be lost before that");
            continue;
        }
        for wait_ms in [30, 100, 300] {
            let args = ["explore", "--world", "museum", "--offline"];
            let running = Running::program("mapper", &args);
            std::thread::sleep(Duration::from_millis(wait_ms));
            running.signal(signal);
            let mut running = running;
            let number = if signal == "INT" { 2 } else { 15 };
            let status = loop {
                if let Some(status) = running.child.try_wait().unwrap() {
                    break status;
                }
                std::thread::sleep(Duration::from_millis(5));
            };
            // Before its first line, the system ends it.
            let by_system = std::os::unix::process::ExitStatusExt::signal(&status);
            assert!(status.code() == Some(code) || by_system == Some(number), "{status}");
        }
    }
}

#[test]
fn a_server_that_serves_ends_well() {
    let folder = tempfile::tempdir().unwrap();
    for (signal, _) in SIGNALS {
        let (server, endpoint) = server(signal, folder.path());
        // It listens before it serves.
        until("the server answers", || {
            let asked = Running::program("map-server", &["maps", "--connect", &endpoint]);
            asked.child.wait_with_output().unwrap().status.success()
        });
        server.signal(signal);
        let (ended, said, _) = server.ends();
        assert_eq!(ended, 0, "that is how a server ends: {said}");
    }
}

#[test]
fn an_explorer_on_the_way_finishes_its_map_and_says_what_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    for (signal, code) in SIGNALS {
        let (server, endpoint) = server(signal, folder.path());
        let explore = ["explore", "--world", "museum", "--no-cameras", "--progress-json", "--quiet", "--rate", "20"];
        let connect = ["--connect", &endpoint, "--spool", "waiting", "--record", "run.mcap", "--picture"];
        // With its server, and one whose server has gone.
        for has_server in [true, false] {
            let mut mapper = Running::program("mapper", &[&explore[..], &connect].concat());
            mapper.until_printed("\"sim_s\":20");
            if !has_server {
                signal_to("KILL", server.child.id());
                mapper.until_printed("\"sim_s\":40");
            }
            mapper.signal(signal);
            let (ended, said, folder) = mapper.ends();
            println!("{said}");
            assert_eq!(ended, code, "{said}");
            assert!(said.contains("mapper: interrupted: the map is not complete; "), "{said}");
            let is_kept = said.contains(" increments not acknowledged, kept in waiting for the next run of this robot");
            assert!(has_server || is_kept, "{said}");
            let info = Running::program("mapper", &["info", folder.path().join("run.mcap").to_str().unwrap()]);
            assert!(info.child.wait_with_output().unwrap().status.success(), "the recording is whole");
            let picture = std::fs::read(folder.path().join("explore-museum-1.png")).unwrap();
            assert!(picture.starts_with(b"\x89PNG"), "the picture is whole");
        }
    }
}

#[test]
fn what_waits_for_acknowledgement_at_the_end_is_left() {
    // A server that stores nothing: it is stopped.
    let folder = tempfile::tempdir().unwrap();
    let (server, endpoint) = server("STOP", folder.path());
    let explore = ["explore", "--world", "museum", "--no-cameras", "--progress-json", "--quiet", "--max-sim", "60"];
    let connect = ["--connect", &endpoint, "--spool", "waiting", "--rate", "20"];
    let mut mapper = Running::program("mapper", &[&explore[..], &connect].concat());
    mapper.until_printed("\"sim_s\":30");
    server.signal("STOP");
    mapper.until_printed("\"sim_s\":59");
    std::thread::sleep(Duration::from_secs(2));
    mapper.signal("TERM");
    let (ended, said, _) = mapper.ends();
    server.signal("KILL");
    assert_eq!(ended, 143, "{said}");
    assert!(said.contains("increments not acknowledged, kept in waiting"), "{said}");
}

#[test]
fn a_replay_and_a_robot_that_drives_end_in_order() {
    let folder = tempfile::tempdir().unwrap();
    let (server, endpoint) = server("drive", folder.path());
    let bag = folder.path().join("run.mcap");
    let explore = ["explore", "--world", "museum", "--no-cameras", "--quiet", "--max-sim", "40", "--map", "museum"];
    let record = ["--connect", &endpoint, "--record", bag.to_str().unwrap()];
    let explored = Running::program("mapper", &[&explore[..], &record].concat());
    explored.child.wait_with_output().unwrap();
    for (signal, code) in SIGNALS {
        let replay = ["replay", bag.to_str().unwrap(), "--rate", "0.01", "--offline", "--quiet", "--no-cameras"];
        let go = ["go", "--to", "random", "--no-cameras", "--quiet", "--connect", &endpoint, "--record", "drive.mcap"];
        for (name, args) in [("mapper", &replay[..]), ("client-robot", &go)] {
            let running = Running::program(name, args);
            if name == "client-robot" {
                let drive = running.folder.path().join("drive.mcap");
                // Before, the program tries whether it may write there, and takes the file away.
                until("it drives", || std::fs::read(&drive).is_ok_and(|written| written.starts_with(b"\x89MCAP")));
            } else {
                std::thread::sleep(Duration::from_secs(2));
            }
            running.signal(signal);
            let (ended, said, folder) = running.ends();
            println!("{said}");
            assert_eq!(ended, code, "{name}: {said}");
            assert!(said.contains("interrupted"), "{name}: {said}");
            if name == "client-robot" {
                let drive = folder.path().join("drive.mcap");
                let info = Running::program("mapper", &["info", drive.to_str().unwrap()]);
                assert!(info.child.wait_with_output().unwrap().status.success(), "the recording is whole");
            }
        }
    }
    server.signal("KILL");
}

#[test]
fn the_demo_leaves_neither_processes_nor_a_folder() {
    for (signal, code) in SIGNALS.into_iter().chain([("KILL", 0)]) {
        let folder = tempfile::tempdir().unwrap();
        // Server starting; exploring; the second explorer.
        for (number, expected) in [0, 3, 4].into_iter().enumerate() {
            let endpoint = free_endpoint().unwrap();
            let mark = endpoint.trim_start_matches("tcp/").to_owned();
            let crew: &[&str] = if number == 2 { &["--explorers", "2"] } else { &[] };
            let mut demo = Running::start(&[&["--quiet", "--listen", &endpoint], crew].concat());
            until("it has its folder", || std::fs::read_dir(demo.folder.path()).unwrap().count() > 0);
            until("all its programs run", || processes_with(&mark).len() >= expected);
            demo.signal(signal);
            if signal == "KILL" {
                demo.child.wait().unwrap();
            } else {
                let (ended, said, folder) = demo.ends();
                assert_eq!((ended, said.trim()), (code, "handoff: interrupted"));
                let left: Vec<_> = std::fs::read_dir(folder.path()).unwrap().collect();
                assert!(left.is_empty(), "{left:?}");
                assert!(processes_with(&mark).is_empty(), "{:?}", processes_with(&mark));
            }
            // Whoever could not be told sees that nobody is left.
            until("no orphan", || processes_with(&mark).is_empty());
        }
        drop(folder);
    }
}

#[test]
fn the_server_that_the_demo_keeps_ends_with_it() {
    // It is the way to end it: no failure.
    let endpoint = free_endpoint().unwrap();
    let world = ["--world", "museum", "--quiet", "--keep", "--listen", &endpoint];
    let mut demo = Running::start(&world);
    demo.until_printed("Ctrl-C ends it.");
    demo.signal("INT");
    let (ended, said, folder) = demo.ends();
    assert_eq!(ended, 0, "{said}");
    let left: Vec<_> = std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert_eq!(left, ["handoff-museum-1.png"]);
    assert!(!listens(&endpoint));
}
