//! A program that another one has started ends with it, however that ends: nobody is left who would
//! end it.

use super::{Stop, StopSignal};
use std::time::Duration;

/// The environment variable in which a program tells its children its process id.
pub const PARENT_VARIABLE: &str = "FHT_PARENT";
/// Time between two looks at who the parent is.
const LOOK_EVERY: Duration = Duration::from_millis(100);

/// If the environment names the program that has started this one ([`PARENT_VARIABLE`]): asks this
/// one to end, as SIGTERM would, once the other is gone. Does nothing on systems without parents.
///
/// # Errors
/// When the system gives no thread or no signal handler.
pub fn end_with_parent(program: &str) -> std::io::Result<()> {
    #[cfg(unix)]
    if let Some(parent) = std::env::var(PARENT_VARIABLE).ok().and_then(|text| text.parse::<u32>().ok()) {
        let stop = Stop::on_signal(program)?;
        std::thread::Builder::new().name("parent".to_owned()).spawn(move || {
            // An orphan gets another parent.
            while std::os::unix::process::parent_id() == parent {
                std::thread::sleep(LOOK_EVERY);
            }
            stop.request(StopSignal::Terminate);
        })?;
    }
    #[cfg(not(unix))]
    let _ = (program, Stop::default(), StopSignal::Terminate, LOOK_EVERY);
    Ok(())
}
