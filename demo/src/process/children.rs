//! The children of this process that still run, so that an interrupted program leaves none behind.

use fht_program::Stop;
use std::path::Path;
use std::process::{Child, Command};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};

struct Children {
    /// The program ends: nothing is started any more.
    is_over: bool,
    running: Vec<Weak<Mutex<Child>>>,
}

static CHILDREN: Mutex<Children> = Mutex::new(Children { is_over: false, running: Vec::new() });

pub(super) fn lock(child: &Mutex<Child>) -> MutexGuard<'_, Child> {
    child.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Starts a child; with it comes its process id.
pub(super) fn spawn(command: &mut Command) -> std::io::Result<(Arc<Mutex<Child>>, u32)> {
    let mut children = CHILDREN.lock().unwrap_or_else(PoisonError::into_inner);
    if children.is_over {
        return Err(std::io::Error::other("the program that starts it was told to end"));
    }
    let child = command.spawn()?;
    let id = child.id();
    let child = Arc::new(Mutex::new(child));
    children.running.retain(|child| child.strong_count() > 0);
    children.running.push(Arc::downgrade(&child));
    Ok((child, id))
}

/// Whether this program has been interrupted, and its children are killed.
pub(crate) fn is_over() -> bool {
    CHILDREN.lock().unwrap_or_else(PoisonError::into_inner).is_over
}

/// When this program is interrupted, its children are killed, and `folder`, in which they work, is
/// removed.
pub fn leave_nothing_behind(stop: &Stop, folder: &Path) {
    let folder = folder.to_owned();
    stop.finally(move || {
        let mut children = CHILDREN.lock().unwrap_or_else(PoisonError::into_inner);
        children.is_over = true;
        for child in children.running.iter().filter_map(Weak::upgrade) {
            let mut child = lock(&child);
            // It may have ended already.
            let _ = child.kill();
            let _ = child.wait();
        }
        // Whoever removes it first.
        let _ = std::fs::remove_dir_all(&folder);
    });
}
