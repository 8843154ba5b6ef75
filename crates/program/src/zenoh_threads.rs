//! Zenoh's threads: one for all of its links in a program that speaks TLS, and the end of a server
//! of which one has failed.
//!
//! Zenoh reads and writes a TLS connection on several threads at once, which ends the process when
//! the connection fails at a bad moment (`docs/upstream.md`). It takes the number of its threads
//! from the environment alone, and the environment of a process that runs can only be changed
//! unsafely. So the program is started again in its place, with the same process id.

use std::ffi::OsString;
use std::path::Path;

/// What the names of Zenoh's threads begin with.
const NAMES: [&str; 5] = ["acc-", "app-", "net-", "rx-", "tx-"];
/// The variable that Zenoh reads.
const VARIABLE: &str = "ZENOH_RUNTIME";
/// One thread reads, writes, accepts and routes.
const ONE_THREAD: &str = "(rx: (worker_threads: 1), tx: (handover: rx), acc: (handover: rx), net: (handover: rx))";
/// What TLS endpoints begin with.
const TLS: &str = "tls/";

/// From now on a panic in a thread of Zenoh ends the process (SIGABRT), as it ends zenohd. What
/// goes on after one routes nothing any more and answers nobody, while those who look after it see
/// it run (`docs/upstream.md`). For servers: a robot drives on without its session. Hooks that are
/// set later, and catch what they expect, go before it.
pub fn end_with_panics() {
    let usual = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        usual(panic);
        if std::thread::current().name().is_some_and(|name| NAMES.iter().any(|begin| name.starts_with(begin))) {
            crate::tell_line!("a thread of Zenoh has failed: this program ends, to be started again");
            std::process::abort();
        }
    }));
}

/// Starts this program again on one thread of Zenoh, if `args` name a TLS endpoint or a file with
/// one. Call it first in `main`. It returns if that is not so, if the variable is set already, or
/// if the system does not start the program again, which is said.
pub fn one_thread_for_tls(args: impl IntoIterator<Item = OsString>) {
    let args: Vec<OsString> = args.into_iter().collect();
    if speaks_tls(&args) {
        one_thread(args);
    }
}

/// The same, whatever the arguments say.
pub fn one_thread(args: impl IntoIterator<Item = OsString>) {
    if std::env::var_os(VARIABLE).is_some() {
        return;
    }
    if let Err(error) = start_again(args.into_iter().skip(1)) {
        crate::tell_line!("Set {VARIABLE}='{ONE_THREAD}': with TLS, Zenoh may crash on more threads ({error})");
    }
}

#[cfg(unix)]
fn start_again(args: impl Iterator<Item = OsString>) -> std::io::Result<()> {
    use std::os::unix::process::CommandExt;
    let program = std::env::current_exe()?;
    Err(std::process::Command::new(program).args(args).env(VARIABLE, ONE_THREAD).exec())
}

#[cfg(not(unix))]
fn start_again(_args: impl Iterator<Item = OsString>) -> std::io::Result<()> {
    Err(std::io::Error::other("this system cannot start a program in another's place"))
}

/// Whether an endpoint of TLS is among `args`, or in a file that they name.
fn speaks_tls(args: &[OsString]) -> bool {
    args.iter().filter_map(|arg| arg.to_str()).any(|arg| {
        let value = match arg.split_once('=') {
            Some((flag, value)) if flag.starts_with("--") => value,
            _ => arg,
        };
        value.starts_with(TLS) || names_tls(Path::new(value))
    })
}

/// Whether a configuration has an endpoint of TLS, or names a file of Zenoh's that may have one.
fn names_tls(file: &Path) -> bool {
    let is_configuration =
        file.extension().is_some_and(|end| ["json5", "json", "toml", "yaml"].iter().any(|e| end == *e));
    is_configuration
        && std::fs::read_to_string(file).is_ok_and(|text| text.contains(TLS) || text.contains("zenoh_config"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn a_panic_in_a_thread_of_zenoh_ends_the_process_and_one_elsewhere_does_not() {
        use std::os::unix::process::ExitStatusExt;
        const THREAD: &str = "FHT_TEST_THREAD";
        if let Ok(name) = std::env::var(THREAD) {
            end_with_panics();
            let thread = std::thread::Builder::new().name(name).spawn(|| panic!("on purpose"));
            assert!(thread.unwrap().join().is_err());
            return;
        }
        for (name, signal) in [("rx-0", Some(6)), ("net-12", Some(6)), ("writer", None)] {
            let mut again = std::process::Command::new(std::env::current_exe().unwrap());
            let this = "zenoh_threads::tests::a_panic_in_a_thread_of_zenoh_ends_the_process_and_one_elsewhere_does_not";
            let output = again.args(["--exact", this]).env(THREAD, name).output().unwrap();
            assert_eq!(output.status.signal(), signal, "{name}: {output:?}");
        }
    }

    #[test]
    fn tls_is_found_in_arguments_and_files() {
        let dir = tempfile::tempdir().unwrap();
        let file = |name: &str, text: &str| {
            let file = dir.path().join(name);
            std::fs::write(&file, text).unwrap();
            file.display().to_string()
        };
        let secured = file("secured.json5", r#"{connect: {endpoints: ["tls/hall:7447"]}}"#);
        let open = file("open.json5", r#"{connect: {endpoints: ["tcp/hall:7447"]}}"#);
        let nested = file("robot.toml", "[connect]\nzenoh_config = \"secured.json5\"\n");
        let speaks = |args: &[&str]| speaks_tls(&args.iter().map(OsString::from).collect::<Vec<_>>());
        assert!(speaks(&["mapper", "--connect", "tls/hall:7447"]));
        assert!(speaks(&["mapper", "--connect=tls/hall:7447"]));
        assert!(speaks(&["mapper", "--zenoh-config", &secured]));
        assert!(speaks(&["mapper", &format!("--zenoh-config={secured}")]));
        assert!(speaks(&["mapper", "--config", &nested]));
        assert!(!speaks(&["mapper", "--connect", "tcp/hall:7447"]));
        assert!(!speaks(&["mapper", "--zenoh-config", &open, "--config", "nowhere.toml"]));
    }
}
