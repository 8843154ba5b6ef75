//! The programs and a router with storages in one executable, for scenarios that start them as
//! processes: `programs role NAME -- ARGS`.

use clap::{Parser, Subcommand, ValueEnum};
use fht_demo::Role;
use fht_demo::run_role;
use fht_tests::router;
use std::ffi::OsString;
use std::process::ExitCode;

#[derive(Debug, Parser)]
#[command(name = "programs", version)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Runs one of the programs: map-server, mapper, client-robot or router.
    Role {
        /// Which.
        name: String,
        /// Its arguments.
        #[arg(last = true)]
        args: Vec<OsString>,
    },
}

fn main() -> ExitCode {
    fht_program::zenoh_threads::one_thread_for_tls(std::env::args_os());
    let Command::Role { name, args } = Cli::parse().command;
    if name == router::NAME {
        return router::main_with_args(std::iter::once(OsString::from(name)).chain(args).collect());
    }
    match Role::from_str(&name, false) {
        Ok(role) => run_role(role, args),
        Err(_) => {
            eprintln!("programs: no program is called {name}");
            ExitCode::from(2)
        }
    }
}
