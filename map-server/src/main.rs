//! The `map-server` program.

fn main() -> std::process::ExitCode {
    map_server::main_with_args(std::env::args_os())
}
