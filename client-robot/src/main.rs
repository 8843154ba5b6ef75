//! The client robot's program.

fn main() -> std::process::ExitCode {
    client_robot::program::main_with_args(std::env::args_os())
}
