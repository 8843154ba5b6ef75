//! The `sim` program.

use std::process::ExitCode;

fn main() -> ExitCode {
    fht_program::zenoh_threads::one_thread_for_tls(std::env::args_os());
    fht_program::exit_code(fht_ros_sim::program::main_with_args(std::env::args_os().collect()))
}
