//! Programs refuse a start where the robot cannot stand, at once and with the nearest place where
//! it can; the starts in the documents and in `--help` are free.

use crate::programs::run;
use fht_demo::Role;
use fht_perception::pose::parse;
use fht_sim::{SimConfig, check_start, load};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

#[test]
fn every_program_refuses_a_start_in_a_wall_and_outside() {
    let museum = load("museum", None, 1).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let bag = folder.path().join("run.mcap");
    // Nobody listens there: no server is asked before the start is looked at.
    let link = ["--connect", "tcp/127.0.0.1:9"];
    for start in ["2,1,0", "500,0,0", "-3,40,1.5"] {
        let here = ["--start", start, "--quiet"];
        let explore = ["explore", "--offline", "--no-cameras", "--record", bag.to_str().unwrap()];
        let programs = [
            (Role::Mapper, [&explore[..], &here].concat()),
            (Role::ClientRobot, [&["relocalize"][..], &link, &here].concat()),
            (Role::ClientRobot, [&["go", "--to", "0,0"][..], &link, &here].concat()),
        ];
        for (role, args) in programs {
            let begin = Instant::now();
            let output = run(role, &args);
            let said = String::from_utf8(output.stderr).unwrap();
            println!("{said}");
            assert!(!output.status.success() && output.stdout.is_empty(), "{args:?}: {said}");
            assert!(begin.elapsed() < Duration::from_secs(60), "{args:?} took {:?}", begin.elapsed());
            assert!(said.contains(&format!("cannot start at {start} in museum")), "{args:?}: {said}");
            let nearest = said.split("the nearest free place is ").nth(1).unwrap().trim();
            check_start(&museum, &parse(nearest).unwrap(), SimConfig::default().radius_m).unwrap();
        }
    }
    assert!(!bag.exists(), "nothing was recorded");
}

/// The documents of the repository, by folder.
fn documents(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if path.is_dir() {
            if !name.starts_with('.') && name != "target" {
                documents(&path, found);
            }
        } else if name.ends_with(".md") || name == "justfile" {
            found.push(path);
        }
    }
}

/// The value of a flag in a command line.
fn value_of<'a>(line: &'a str, flag: &str) -> Option<&'a str> {
    let mut words = line.split_whitespace().map(|word| word.trim_matches(['`', '\'', '"']));
    words.find(|word| *word == flag)?;
    words.next()
}

#[test]
fn the_starts_in_documents_and_help_are_free() {
    let mut files = Vec::new();
    documents(&Path::new(env!("CARGO_MANIFEST_DIR")).join(".."), &mut files);
    let mut texts: Vec<String> = files.iter().map(|file| std::fs::read_to_string(file).unwrap()).collect();
    for (role, command) in [(Role::Mapper, "explore"), (Role::ClientRobot, "relocalize"), (Role::ClientRobot, "go")] {
        texts.push(String::from_utf8(run(role, &[command, "--help"]).stdout).unwrap());
    }
    let lines = texts.iter().flat_map(|text| text.lines());
    let starts: Vec<(&str, &str)> = lines
        .filter_map(|line| Some((line, parse(value_of(line, "--start")?).ok().and(value_of(line, "--start"))?)))
        .collect();
    assert!(starts.len() >= 2, "of {} documents: {starts:?}", files.len());
    for (line, start) in starts {
        println!("{line}");
        let world = load(value_of(line, "--world").unwrap_or("museum"), None, 1).unwrap();
        check_start(&world, &parse(start).unwrap(), SimConfig::default().radius_m)
            .unwrap_or_else(|error| panic!("{line}: {error}"));
    }
}
