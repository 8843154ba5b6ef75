//! The foreign ROS 2 node of `tests/ros_hiroz`, built where it is first asked for.

use crate::python::run;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The node's executable. Its build is not that of the workspace: it needs Zenoh with other
/// features. The first one takes minutes.
///
/// # Panics
/// When it cannot be built.
#[must_use]
pub fn peer() -> PathBuf {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/ros_hiroz");
    let executable = std::env::current_exe().unwrap_or_default();
    // Where `cargo xtask test` has built it.
    let target = executable.ancestors().nth(3).unwrap_or(Path::new("target")).join("tmp/hiroz");
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    for (name, _) in std::env::vars_os() {
        // Build scripts look at these, and would build everything again.
        let is_of_this_package =
            name.to_str().is_some_and(|name| name.starts_with("CARGO_PKG_") || name.starts_with("CARGO_MANIFEST_"));
        if is_of_this_package {
            command.env_remove(name);
        }
    }
    run(command.args(["build", "--locked", "--quiet"]).current_dir(folder).env("CARGO_TARGET_DIR", &target));
    target.join("debug/hiroz-peer")
}
