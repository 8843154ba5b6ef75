//! A site under fire that is interrupted leaves no router, no server and no folder behind.
#![cfg(unix)]
use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// How long it may take to end, on a machine that is busy with all other tests; with nothing else
/// to do it is some 100 ms.
const SOON: Duration = Duration::from_secs(15);

/// Processes that have this folder in their environment.
fn processes_in(folder: &str) -> usize {
    let ids = std::fs::read_dir("/proc").unwrap().filter_map(|entry| Some(entry.ok()?.path()));
    let is_in = |process: &std::path::Path| {
        std::fs::read(process.join("environ")).is_ok_and(|all| String::from_utf8_lossy(&all).contains(folder))
    };
    ids.filter(|process| is_in(process)).count()
}

#[test]
fn it_ends_with_all_its_machines() {
    for (signal, code) in [("INT", 130), ("TERM", 143)] {
        let folder = tempfile::tempdir().unwrap();
        let mut site = Command::new(env!("CARGO_BIN_EXE_site"))
            .args(["--minutes", "5"])
            .env("TMPDIR", folder.path())
            .stdin(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let lines = BufReader::new(site.stderr.take().unwrap()).lines().map_while(Result::ok);
        let begun = lines.take_while(|line| !line.contains("all servers are there")).count();
        println!("{begun} lines before it began");
        let mark = folder.path().to_str().unwrap().to_owned();
        assert!(processes_in(&mark) >= 7, "{}", processes_in(&mark));
        let asked = Instant::now();
        assert!(Command::new("kill").args([format!("-{signal}"), site.id().to_string()]).status().unwrap().success());
        let status = loop {
            if let Some(status) = site.try_wait().unwrap() {
                break status;
            }
            assert!(asked.elapsed() < SOON, "it is still there");
            std::thread::sleep(Duration::from_millis(5));
        };
        println!("ended after {:?}", asked.elapsed());
        assert_eq!(status.code(), Some(code), "{status}");
        assert_eq!(processes_in(&mark), 0);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
