//! The product's programs, run as processes of their own.

use fht_demo::{Process, Role};
use std::ffi::OsStr;
use std::path::Path;
use std::process::{Command, Output};

/// The file that holds all of them.
pub(crate) fn executable() -> &'static Path {
    Path::new(env!("CARGO_BIN_EXE_programs"))
}

/// Starts one.
pub(crate) fn start<A: AsRef<OsStr>>(role: Role, args: impl IntoIterator<Item = A>) -> Process {
    Process::start(executable(), role, args).unwrap()
}

/// Runs one to its end.
pub(crate) fn run(role: Role, args: &[&str]) -> Output {
    Command::new(executable()).args(["role", role.name(), "--"]).args(args).output().unwrap()
}
