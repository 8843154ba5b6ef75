//! The `mapper` program.

use std::process::ExitCode;

fn main() -> ExitCode {
    mapper::main_with_args(std::env::args_os())
}
