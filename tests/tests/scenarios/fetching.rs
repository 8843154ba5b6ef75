//! The ONNX Runtime library: what is fetched, by whom, and what is loaded. Real processes.
#![cfg(all(target_os = "linux", target_env = "gnu"))]
use crate::programs::executable;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

const LIBRARY: &str = "libonnxruntime.so.1.28.0";

/// A folder to start in, a cache, and a folder of programs.
struct Place {
    folder: tempfile::TempDir,
}

impl Place {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        for name in ["here", "cache", "bin"] {
            std::fs::create_dir(folder.path().join(name)).unwrap();
        }
        Self { folder }
    }

    fn at(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// An explorer that needs the library and has none but the cache's.
    fn mapper(&self, args: &[&str], path: &str) -> Output {
        let explore = ["role", "mapper", "--", "explore", "--world", "office", "--offline", "--max-sim", "1", "-q"];
        Command::new(executable())
            .args(explore)
            .args(args)
            .current_dir(self.at("here"))
            .env("XDG_CACHE_HOME", self.at("cache"))
            .env("PATH", path)
            // Nothing is fetched from anywhere: pip runs, and finds no wheel.
            .env("PIP_NO_INDEX", "1")
            .envs(["ORT_DYLIB_PATH", "LD_LIBRARY_PATH", "FHT_NO_FETCH", "PIP_FIND_LINKS"].map(|name| (name, "")))
            .output()
            .unwrap()
    }

    fn library(&self) -> PathBuf {
        self.at("cache/fht-map/onnxruntime-1.28.0").join(LIBRARY)
    }
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn make_executable(path: &Path, text: &str) {
    std::fs::write(path, text).unwrap();
    std::fs::set_permissions(path, std::fs::Permissions::from_mode(0o755)).unwrap();
}

/// Whether a library of the system goes before the cache's.
fn has_library_of_the_system() -> bool {
    let folders =
        ["/usr/local/lib", "/usr/lib", "/usr/lib64", "/usr/lib/x86_64-linux-gnu", "/usr/lib/aarch64-linux-gnu"];
    let entries = folders.iter().filter_map(|folder| std::fs::read_dir(folder).ok()).flatten().filter_map(Result::ok);
    let found = entries.into_iter().any(|entry| entry.file_name().to_string_lossy().starts_with("libonnxruntime.so"));
    if found {
        eprintln!("skipped: this system has an ONNX Runtime library of its own");
    }
    found
}

#[test]
fn nothing_of_the_current_folder_is_executed_to_fetch_the_library() {
    if has_library_of_the_system() {
        return;
    }
    let place = Place::new();
    let mark = place.at("executed");
    let python = format!("open({:?}, 'a').write(__file__)\n", mark.to_str().unwrap());
    for module in ["pip.py", "site.py", "sitecustomize.py", "zipfile.py", "encodings.py"] {
        std::fs::write(place.at("here").join(module), &python).unwrap();
    }
    make_executable(&place.at("here/python3"), &format!("#!/bin/sh\necho python3 >> {}\n", mark.display()));
    // Folders of PATH that are not absolute are the current one, too.
    let path = format!(".::{}", std::env::var("PATH").unwrap());
    let output = place.mapper(&[], &path);
    assert_eq!(std::fs::read_to_string(&mark).unwrap_or_default(), "", "{}", said(&output));
    assert_eq!(output.status.code(), Some(2), "{}", said(&output));
    assert!(
        said(&output).contains("pip download failed") && said(&output).contains("ORT_DYLIB_PATH"),
        "{}",
        said(&output)
    );
    let left: Vec<_> = std::fs::read_dir(place.library().parent().unwrap()).unwrap().collect();
    assert!(left.is_empty(), "{left:?}");
}

#[test]
fn an_altered_library_is_refused_by_name() {
    if has_library_of_the_system() {
        return;
    }
    let place = Place::new();
    std::fs::create_dir_all(place.library().parent().unwrap()).unwrap();
    std::fs::write(place.library(), b"\x7fELF, but another").unwrap();
    let output = place.mapper(&[], &std::env::var("PATH").unwrap());
    let expected = format!("{} is not the library that was fetched", place.library().display());
    assert_eq!(output.status.code(), Some(2), "{}", said(&output));
    assert!(said(&output).contains(&expected), "{}", said(&output));
}

#[test]
fn with_no_fetch_no_process_is_started() {
    if has_library_of_the_system() {
        return;
    }
    let place = Place::new();
    let mark = place.at("executed");
    make_executable(&place.at("bin/python3"), &format!("#!/bin/sh\necho started >> {}\nexit 1\n", mark.display()));
    let path = place.at("bin").display().to_string();
    let config = place.at("here/robot.toml");
    std::fs::write(&config, "robot.fetch = false\n").unwrap();
    for args in [&["--no-fetch"][..], &["--config", "robot.toml"]] {
        let output = place.mapper(args, &path);
        assert!(!mark.exists(), "{args:?}: {}", said(&output));
        assert_eq!(output.status.code(), Some(2), "{}", said(&output));
        let expected = format!("{} is not there, and --no-fetch", place.library().display());
        assert!(said(&output).contains(&expected), "{}", said(&output));
    }
    // Without it the process is started.
    let output = place.mapper(&[], &path);
    assert!(mark.exists(), "{}", said(&output));
}
