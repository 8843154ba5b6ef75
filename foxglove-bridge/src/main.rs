//! The `foxglove-bridge` program.

fn main() -> std::process::ExitCode {
    fht_program::zenoh_threads::one_thread_for_tls(std::env::args_os());
    fht_program::exit_code(foxglove_bridge::main_with_args(std::env::args_os().collect()))
}
