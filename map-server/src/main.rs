//! The `map-server` program.

fn main() -> std::process::ExitCode {
    fht_program::zenoh_threads::one_thread_for_tls(std::env::args_os());
    fht_program::exit_code(map_server::main_with_args(std::env::args_os().collect()))
}
