//! The index of the newest state of a large map ([`MapIndex`]): built when somebody first needs it,
//! kept up to date as increments are applied.
//!
//! Readers see a new state while the index is locked for the same change, so whoever reads the
//! index and then takes the newest state gets two that belong together. A separate thread rebuilds
//! what guides searches, and no query waits for it.

use fht_map::{IndexConfig, MapIndex, MapState};
use fht_proto::Op;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};

/// Changes that are noted while an index is being built. With more, the index is given up, and
/// built again for the next reader.
const MAX_NOTED: usize = 1 << 20;

#[derive(Debug, Default)]
enum HeldIndex {
    /// Nobody has needed it.
    #[default]
    Nothing,
    /// It is being built; the changes since then.
    BeingBuilt(Vec<Op>),
    /// It is the index of the newest state.
    Ready(Box<MapIndex>),
}

/// The index of one map's newest state.
#[derive(Debug, Default)]
pub struct HeadIndex {
    kept: RwLock<HeldIndex>,
    building: Mutex<()>,
    is_search_index_being_built: AtomicBool,
}

/// The smallest operation that names the same node or edge: the index looks up in the map what has
/// become of it.
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
    // A panic during a change leaves an index that may find too little, which is better than no
    // answers.
    fn read(&self) -> RwLockReadGuard<'_, HeldIndex> {
        self.kept.read().unwrap_or_else(PoisonError::into_inner)
    }

    fn write(&self) -> RwLockWriteGuard<'_, HeldIndex> {
        self.kept.write().unwrap_or_else(PoisonError::into_inner)
    }

    /// Applies `ops`, which have led to `state`, and makes that state visible with `show`. For one
    /// thread at a time.
    pub fn follow_ops<'a, T>(
        self: &Arc<Self>,
        state: &MapState,
        ops: impl IntoIterator<Item = &'a Op>,
        show: impl FnOnce() -> T,
    ) -> T {
        let mut kept = self.write();
        match &mut *kept {
            HeldIndex::Nothing => {}
            HeldIndex::BeingBuilt(noted) => {
                noted.extend(ops.into_iter().filter_map(named_by));
                if noted.len() > MAX_NOTED {
                    *kept = HeldIndex::Nothing;
                }
            }
            HeldIndex::Ready(index) => {
                index.follow_ops(state, ops);
                if index.is_worn() && !self.is_search_index_being_built.swap(true, Ordering::AcqRel) {
                    self.build_search_index(index);
                }
            }
        }
        show()
    }

    /// Rebuilds the search index in a thread of its own.
    fn build_search_index(self: &Arc<Self>, index: &mut MapIndex) {
        let (job, this) = (index.guide_job(), Arc::clone(self));
        let make = move || {
            let guide = job.run();
            if let HeldIndex::Ready(index) = &mut *this.write() {
                index.adopt(guide);
            }
            this.is_search_index_being_built.store(false, Ordering::Release);
        };
        if let Err(error) = std::thread::Builder::new().name("guide".to_owned()).spawn(make) {
            tracing::warn!("no thread to make a guide for searches: {error}");
            self.is_search_index_being_built.store(false, Ordering::Release);
        }
    }

    /// Reads the index and the state that it belongs to, which `newest` returns; `None` if `newest`
    /// returns none. The first caller builds the index; concurrent callers block.
    pub fn with<S: AsRef<MapState>, T>(
        &self,
        newest: impl Fn() -> Option<S>,
        read: impl FnOnce(&S, &MapIndex) -> T,
    ) -> Option<T> {
        loop {
            let kept = self.read();
            if let HeldIndex::Ready(index) = &*kept {
                return Some(read(&newest()?, index));
            }
            drop(kept);
            self.build(&newest)?;
        }
    }

    fn build<S: AsRef<MapState>>(&self, newest: impl Fn() -> Option<S>) -> Option<()> {
        let _building = self.building.lock().unwrap_or_else(PoisonError::into_inner);
        if matches!(&*self.read(), HeldIndex::Ready(_)) {
            return Some(());
        }
        // From here on changes are noted.
        *self.write() = HeldIndex::BeingBuilt(Vec::new());
        let mut index = MapIndex::new(newest()?.as_ref(), IndexConfig::default());
        let mut kept = self.write();
        if let HeldIndex::BeingBuilt(noted) = &*kept {
            index.follow_ops(newest()?.as_ref(), noted);
            *kept = HeldIndex::Ready(Box::new(index));
        }
        Some(())
    }
}
