//! Other projects' ROS 2 programs, those of `tests/foreign_ros`, built where they are first asked
//! for.

use crate::packages::run;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The executable of a program, `hiroz-peer` or `dds-bridge`. Its build is not that of the
/// workspace: it needs Zenoh with other features. The first one takes minutes.
///
/// # Panics
/// When it cannot be built; the bridge needs CMake and libclang.
#[must_use]
pub fn program(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/foreign_ros");
    let executable = std::env::current_exe().unwrap_or_default();
    // Where `cargo xtask test` has built it.
    let target = executable.ancestors().nth(3).unwrap_or(Path::new("target")).join("tmp/foreign-ros");
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    for (name, _) in std::env::vars_os() {
        // Build scripts look at these, and would build everything again.
        let is_of_this_package =
            name.to_str().is_some_and(|name| name.starts_with("CARGO_PKG_") || name.starts_with("CARGO_MANIFEST_"));
        if is_of_this_package {
            command.env_remove(name);
        }
    }
    command.args(["build", "--locked", "--quiet"]);
    if has_cmake() {
        command.args(["--features", "dds"]);
    }
    run(command.current_dir(folder).env("CARGO_TARGET_DIR", &target));
    target.join("debug").join(name)
}

fn has_cmake() -> bool {
    let folders = std::env::var_os("PATH").unwrap_or_default();
    std::env::split_paths(&folders).any(|folder| folder.join("cmake").is_file())
}
