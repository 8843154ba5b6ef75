//! The programs in one executable: which `main` each role calls.

use crate::process::Role;
use fht_program::stop::end_with_parent;
use std::ffi::OsString;
use std::process::ExitCode;

/// Runs one of the programs with these arguments. It ends with the program that started it.
#[must_use]
pub fn run_role(role: Role, args: Vec<OsString>) -> ExitCode {
    if let Err(error) = end_with_parent(role.name()) {
        fht_program::tell_line!("{}: {error}", role.name());
        return ExitCode::FAILURE;
    }
    let args = std::iter::once(OsString::from(role.name())).chain(args).collect();
    fht_program::exit_code(match role {
        Role::MapServer => map_server::main_with_args(args),
        Role::Mapper => mapper::program::main_with_args(args),
        Role::ClientRobot => client_robot::program::main_with_args(args),
        Role::Sim => fht_ros_sim::program::main_with_args(args),
    })
}
