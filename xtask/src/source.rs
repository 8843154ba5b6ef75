//! The workspace's Rust files, read and parsed.

use std::path::{Path, PathBuf};
use std::process::Command;

/// Why the house cannot be looked at.
#[derive(Debug, thiserror::Error)]
pub(crate) enum SourceError {
    /// A file cannot be read.
    #[error("{path}: {source}", path = path.display())]
    Read {
        /// Which.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// A file cannot be written.
    #[error("{path} cannot be written: {source}", path = path.display())]
    Write {
        /// Which.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// A policy or lock file is not understood.
    #[error("{path}: {reason}", path = path.display())]
    Policy {
        /// Which.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// A file is no Rust.
    #[error("{path}: {source}", path = path.display())]
    Parse {
        /// Which.
        path: PathBuf,
        /// What is wrong.
        source: syn::Error,
    },
    /// A command failed.
    #[error("{command} failed: {reason}")]
    Command {
        /// Which.
        command: &'static str,
        /// What it said.
        reason: String,
    },
    /// A document lacks what is checked.
    #[error("{path} has no {what}", path = path.display())]
    Lacks {
        /// The document.
        path: PathBuf,
        /// What it should have.
        what: &'static str,
    },
}

/// A Rust file.
pub(crate) struct Source {
    /// From the repository's root, with slashes.
    pub(crate) path: String,
    pub(crate) text: String,
    pub(crate) syntax: syn::File,
}

/// Reads a text file.
pub(crate) fn read(path: &Path) -> Result<String, SourceError> {
    std::fs::read_to_string(path).map_err(|source| SourceError::Read { path: path.to_owned(), source })
}

/// What a command prints.
pub(crate) fn output(root: &Path, command: &'static str, args: &[&str]) -> Result<String, SourceError> {
    let failed = |reason: String| SourceError::Command { command, reason };
    let output = Command::new(command).args(args).current_dir(root).output().map_err(|e| failed(e.to_string()))?;
    if !output.status.success() {
        return Err(failed(String::from_utf8_lossy(&output.stderr).into_owned()));
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

/// The repository's files with this ending, but for deleted ones.
pub(crate) fn files(root: &Path, ending: &str) -> Result<Vec<String>, SourceError> {
    let list = output(root, "git", &["ls-files", "--cached", "--others", "--exclude-standard"])?;
    let wanted = |name: &&str| name.ends_with(ending) && root.join(name).exists();
    Ok(list.lines().filter(wanted).map(str::to_owned).collect())
}

impl Source {
    /// All Rust files of the repository.
    pub(crate) fn all(root: &Path) -> Result<Vec<Self>, SourceError> {
        files(root, ".rs")?.into_iter().map(|path| Self::open(root, path)).collect()
    }

    fn open(root: &Path, path: String) -> Result<Self, SourceError> {
        let text = read(&root.join(&path))?;
        let syntax =
            syn::parse_file(&text).map_err(|source| SourceError::Parse { path: PathBuf::from(&path), source })?;
        Ok(Self { path, text, syntax })
    }

    /// The folder of its crate, and the rest of its path under `src`, if it is part of a library or
    /// program.
    pub(crate) fn in_crate(&self) -> Option<(&str, &str)> {
        let at = self.path.find("/src/")?;
        Some((&self.path[..at], &self.path[at + 5..]))
    }

    /// Whether it is a file of tests, or of what only tests use.
    pub(crate) fn is_test(&self) -> bool {
        self.path.starts_with("fuzz/") || self.path.contains("/tests/") || self.path.ends_with("/tests.rs")
    }
}

/// Whether an item is compiled for tests only.
pub(crate) fn is_for_tests(attributes: &[syn::Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        attribute.path().is_ident("test")
            || attribute.path().is_ident("cfg")
                && attribute.meta.require_list().is_ok_and(|list| list.tokens.to_string() == "test")
    })
}
