//! The `mapper` program.

use std::process::ExitCode;

fn main() -> ExitCode {
    mapper::program::main_with_args(std::env::args_os())
}
