//! Work on a file that may be damaged: the storage library takes much for granted of what it reads,
//! and panics where that does not hold. Here that is an error like any other.

use crate::store::error::StoreError;
use std::cell::RefCell;
use std::io::{Write, stderr};
use std::panic::{AssertUnwindSafe, PanicHookInfo, catch_unwind, set_hook, take_hook};
use std::path::Path;
use std::sync::{Arc, Once};

/// A work that is being done.
struct Guard {
    file: Arc<Path>,
    /// What its first panic said.
    panic: Option<String>,
}

thread_local! {
    /// The works that this thread is in, the innermost last.
    static GUARDS: RefCell<Vec<Guard>> = const { RefCell::new(Vec::new()) };
}

/// Does `work` on a file; if it panics, the error is what it said. Nothing is printed then.
///
/// A second panic, while what the first one left is cleaned up, cannot be caught: Rust aborts. The
/// program then says that the file is damaged, and ends with exit code 1. The file is as a crash
/// would have left it: the last commit stands.
///
/// # Errors
/// What the panic said.
pub(crate) fn guarded<T>(file: &Arc<Path>, work: impl FnOnce() -> T) -> Result<T, String> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let usual = take_hook();
        set_hook(Box::new(move |panic| match note(panic) {
            Noted::Elsewhere => usual(panic),
            Noted::ToBeCaught => {}
            Noted::Fatal(error) => {
                // Where standard error takes nothing the exit code says it.
                let _ = writeln!(stderr(), "map-server: {error}");
                std::process::exit(1);
            }
        }));
    });
    GUARDS.with_borrow_mut(|guards| guards.push(Guard { file: Arc::clone(file), panic: None }));
    let outcome = catch_unwind(AssertUnwindSafe(work));
    let guard = GUARDS.with_borrow_mut(Vec::pop);
    outcome.map_err(|_| guard.and_then(|guard| guard.panic).unwrap_or_else(|| "a panic".to_owned()))
}

/// What a panic over a damaged file is called.
pub(crate) fn damage(panic: &str) -> String {
    format!("the file is damaged ({panic})")
}

/// What becomes of a panic.
enum Noted {
    /// It is of no work on a file.
    Elsewhere,
    ToBeCaught,
    /// Nobody can catch it.
    Fatal(StoreError),
}

/// Keeps what the first panic of a work said.
fn note(panic: &PanicHookInfo<'_>) -> Noted {
    let said = panic.payload_as_str().unwrap_or("a panic");
    let of_guard = |guards: &RefCell<Vec<Guard>>| match guards.borrow_mut().last_mut() {
        None => Noted::Elsewhere,
        Some(Guard { file, panic: Some(first) }) => {
            Noted::Fatal(StoreError::Broken { file: file.to_path_buf(), reason: damage(first) })
        }
        Some(guard) => {
            guard.panic = Some(said.lines().next().unwrap_or_default().chars().take(200).collect());
            Noted::ToBeCaught
        }
    };
    // A thread that ends has none any more.
    GUARDS.try_with(of_guard).unwrap_or(Noted::Elsewhere)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::env;
    use std::process::Command;

    fn file() -> Arc<Path> {
        Path::new("/data/maps.redb").into()
    }

    #[test]
    fn a_panic_is_an_error() {
        let file = file();
        assert_eq!(guarded(&file, || 7), Ok(7));
        let broken = guarded(&file, || -> u32 { panic!("page {} is no page\nat all", 3) });
        assert_eq!(broken, Err("page 3 is no page".to_owned()));
        let inner = guarded(&file, || guarded(&file, || panic!("inner")));
        assert_eq!(inner, Ok(Err::<(), _>("inner".to_owned())));
    }

    /// Panics when it is dropped.
    struct Stumbles;

    impl Drop for Stumbles {
        fn drop(&mut self) {
            panic!("page 4 is no page");
        }
    }

    #[test]
    fn a_panic_that_cannot_be_caught_names_the_file() {
        const CHILD: &str = "GUARD_STUMBLES_TWICE";
        if env::var_os(CHILD).is_some() {
            let _ = guarded(&file(), || {
                let _stumbles = Stumbles;
                panic!("page 3 is no page");
            });
        }
        let test = "store::guard::tests::a_panic_that_cannot_be_caught_names_the_file";
        let arguments = [test, "--exact", "--nocapture"];
        let ended = Command::new(env::current_exe().unwrap()).args(arguments).env(CHILD, "1").output().unwrap();
        let said = String::from_utf8_lossy(&ended.stderr);
        assert_eq!(ended.status.code(), Some(1), "{said}");
        for part in ["/data/maps.redb", "page 3 is no page", "map-server rescue"] {
            assert!(said.contains(part), "{said}");
        }
    }
}
