//! What finds things in the newest state of a large map ([`MapIndex`]): made when somebody first needs it, kept up as increments are
//! applied.
//!
//! The state is shown to readers while the index is locked for its change, so whoever reads the index and then takes the newest state
//! has two that belong together. What guides searches is made anew by a thread beside, and no query waits for it.

use crate::catalog::MapView;
use fht_map::{IndexConfig, MapIndex, MapState};
use fht_proto::Op;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};

/// Changes that are noted while an index is being made. With more it is given up, and made again for the next who asks.
const MAX_NOTED: usize = 1 << 20;

#[derive(Debug, Default)]
enum Kept {
    /// Nobody has needed it.
    #[default]
    Nothing,
    /// It is being made; what has been changed meanwhile.
    Awaited(Vec<Op>),
    /// It is that of the newest state.
    Ready(Box<MapIndex>),
}

/// The index of one map's newest state.
#[derive(Debug, Default)]
pub struct HeadIndex {
    kept: RwLock<Kept>,
    making: Mutex<()>,
    is_guide_being_made: AtomicBool,
}

/// The least that names the same node or edge: an index looks up in the map what has become of it.
fn named_by(op: &Op) -> Option<Op> {
    match op {
        Op::PutNode { id, .. }
        | Op::RemoveNode { id }
        | Op::SetPose { id, .. }
        | Op::SetFreeSpace { id, .. }
        | Op::SetSignature { id, .. } => Some(Op::RemoveNode { id: *id }),
        Op::PutEdge { edge } | Op::RemoveEdge { edge } => Some(Op::RemoveEdge { edge: *edge }),
        _ => None,
    }
}

impl HeadIndex {
    // A panic while it was changed leaves an index that may find less than there is, which is better than no answers.
    fn read(&self) -> RwLockReadGuard<'_, Kept> {
        self.kept.read().unwrap_or_else(PoisonError::into_inner)
    }

    fn write(&self) -> RwLockWriteGuard<'_, Kept> {
        self.kept.write().unwrap_or_else(PoisonError::into_inner)
    }

    /// Follows `ops`, which have led to `state`, and lets readers see that state with `show`. For one thread at a time.
    pub fn follow<'a, T>(
        self: &Arc<Self>,
        state: &MapState,
        ops: impl IntoIterator<Item = &'a Op>,
        show: impl FnOnce() -> T,
    ) -> T {
        let mut kept = self.write();
        match &mut *kept {
            Kept::Nothing => {}
            Kept::Awaited(noted) => {
                noted.extend(ops.into_iter().filter_map(named_by));
                if noted.len() > MAX_NOTED {
                    *kept = Kept::Nothing;
                }
            }
            Kept::Ready(index) => {
                index.follow_ops(state, ops);
                if index.is_worn() && !self.is_guide_being_made.swap(true, Ordering::AcqRel) {
                    self.make_guide(index);
                }
            }
        }
        show()
    }

    /// Makes a guide in a thread of its own.
    fn make_guide(self: &Arc<Self>, index: &mut MapIndex) {
        let (job, this) = (index.guide_job(), Arc::clone(self));
        let make = move || {
            let guide = job.run();
            if let Kept::Ready(index) = &mut *this.write() {
                index.adopt(guide);
            }
            this.is_guide_being_made.store(false, Ordering::Release);
        };
        if let Err(error) = std::thread::Builder::new().name("guide".to_owned()).spawn(make) {
            tracing::warn!("no thread to make a guide for searches: {error}");
            self.is_guide_being_made.store(false, Ordering::Release);
        }
    }

    /// Reads the index and the state that it belongs to, which `newest` gives; `None` if that gives none. Who needs the index first makes
    /// it, and others who need it meanwhile wait.
    pub fn with<T>(
        &self,
        newest: impl Fn() -> Option<MapView>,
        read: impl FnOnce(&MapView, &MapIndex) -> T,
    ) -> Option<T> {
        loop {
            let kept = self.read();
            if let Kept::Ready(index) = &*kept {
                return Some(read(&newest()?, index));
            }
            drop(kept);
            self.make(&newest)?;
        }
    }

    fn make(&self, newest: impl Fn() -> Option<MapView>) -> Option<()> {
        let _making = self.making.lock().unwrap_or_else(PoisonError::into_inner);
        if matches!(&*self.read(), Kept::Ready(_)) {
            return Some(());
        }
        // From now on it is noted what changes.
        *self.write() = Kept::Awaited(Vec::new());
        let mut index = MapIndex::new(&newest()?.state, IndexConfig::default());
        let mut kept = self.write();
        if let Kept::Awaited(noted) = &*kept {
            index.follow_ops(&newest()?.state, noted);
            *kept = Kept::Ready(Box::new(index));
        }
        Some(())
    }
}
