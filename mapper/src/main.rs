//! The `mapper` program.

use std::process::ExitCode;

fn main() -> ExitCode {
    fht_program::zenoh_threads::one_thread_for_tls(std::env::args_os());
    fht_program::exit_code(mapper::program::main_with_args(std::env::args_os().collect()))
}
