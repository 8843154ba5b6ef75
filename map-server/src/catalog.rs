//! The maps in memory, as queries see them. Readers take a shared view and let go of the lock at once; the one
//! writer changes a copy, which shares descriptors and scans, and puts it in the map's place.

use crate::store::{Store, StoreError};
use fht_map::{FreeSpace, MapState, SpaceConfig};
use fht_proto::query::Head;
use fht_proto::{CodecError, Increment, MapName, VersionVector, decode};
use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock, PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};

/// One map at one version.
#[derive(Clone, Debug)]
pub struct MapView {
    /// The map.
    pub state: Arc<MapState>,
    /// Its version, vector, digest and counts.
    pub head: Arc<Head>,
    /// Its free space, once somebody has asked for a path.
    free_space: Arc<OnceLock<FreeSpace>>,
}

impl MapView {
    fn new(state: MapState, head: Head) -> Self {
        Self { state: Arc::new(state), head: Arc::new(head), free_space: Arc::default() }
    }

    /// Its free space; the first question of a version makes it.
    #[must_use]
    pub fn free_space(&self) -> &FreeSpace {
        self.free_space.get_or_init(|| FreeSpace::of(&self.state, &SpaceConfig::default()))
    }
}

/// All maps of the server.
#[derive(Debug, Default)]
pub struct Catalog {
    maps: RwLock<BTreeMap<MapName, MapView>>,
}

impl Catalog {
    /// Reads all maps from the store.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] if increments are missing or unreadable, [`StoreError::IncrementFormat`], [`StoreError::Disk`].
    pub fn load(store: &Store) -> Result<Self, StoreError> {
        let mut maps: BTreeMap<MapName, (MapState, VersionVector, u64)> = BTreeMap::new();
        store.for_each(|name, author, number, bytes| {
            let damaged = |reason: String| StoreError::Damaged { map: name.to_owned(), reason };
            let map: MapName = name.parse().map_err(|error| damaged(format!("{error}")))?;
            let increment: Increment = decode(bytes).map_err(|error| match error {
                CodecError::Version { found } => StoreError::IncrementFormat { map: name.to_owned(), found },
                other => damaged(format!("increment {author}/{number}: {other}")),
            })?;
            let (state, vector, total) = maps.entry(map).or_default();
            if (increment.author, increment.number) != (author, number) || vector.get(author) + 1 != number {
                return Err(damaged(format!("increment {author}/{number} is out of place")));
            }
            state.apply(&increment);
            vector.set(author, number);
            *total += bytes.len() as u64;
            Ok(())
        })?;
        let mut views = BTreeMap::new();
        for (map, (state, vector, bytes)) in maps {
            if store.vector_at(&map, vector.version())? != vector {
                let reason = "its log does not name its increments".to_owned();
                return Err(StoreError::Damaged { map: map.to_string(), reason });
            }
            let head = head_of(&map, &state, vector, bytes, 0);
            views.insert(map, MapView::new(state, head));
        }
        Ok(Self { maps: RwLock::new(views) })
    }

    // A panic while the lock was held is a bug; the maps are replaced by whole operations and stay usable.
    fn read(&self) -> RwLockReadGuard<'_, BTreeMap<MapName, MapView>> {
        self.maps.read().unwrap_or_else(PoisonError::into_inner)
    }

    fn write(&self) -> RwLockWriteGuard<'_, BTreeMap<MapName, MapView>> {
        self.maps.write().unwrap_or_else(PoisonError::into_inner)
    }

    /// A map as it is now.
    #[must_use]
    pub fn view(&self, map: &MapName) -> Option<MapView> {
        self.read().get(map).cloned()
    }

    /// The heads of all maps, by name.
    #[must_use]
    pub fn heads(&self) -> Vec<Arc<Head>> {
        self.read().values().map(|view| Arc::clone(&view.head)).collect()
    }

    /// All maps, by name.
    #[must_use]
    pub fn views(&self) -> Vec<MapView> {
        self.read().values().cloned().collect()
    }

    /// Applies increments that are on the disk, `bytes` long in all; `vector` is what the map then contains. Returns how many
    /// elements it has then ([`MapState::elements`]). For one thread at a time.
    pub fn apply(&self, map: &MapName, increments: &[Increment], vector: VersionVector, bytes: u64) -> usize {
        // On a copy (which shares descriptors and scans), so that readers wait only while it takes the old one's place.
        let old = self.view(map);
        let mut state = old.as_ref().map(|view| view.state.as_ref().clone()).unwrap_or_default();
        increments.iter().for_each(|increment| state.apply(increment));
        let (old_bytes, refused) = old.as_ref().map_or((0, 0), |view| (view.head.bytes, view.head.refused));
        let head = head_of(map, &state, vector, old_bytes + bytes, refused);
        let elements = state.elements();
        let view = MapView::new(state, head);
        let replaced = self.write().insert(map.clone(), view);
        drop(replaced); // a large map takes its time, and the lock is free by now
        elements
    }

    /// Counts refused increments, if there is such a map.
    pub fn count_refused(&self, map: &MapName, count: u64) {
        if let Some(view) = self.write().get_mut(map) {
            Arc::make_mut(&mut view.head).refused += count;
        }
    }
}

fn head_of(map: &MapName, state: &MapState, vector: VersionVector, bytes: u64, refused: u64) -> Head {
    let counts = state.counts();
    Head {
        map: map.clone(),
        version: vector.version(),
        vector,
        digest: state.digest(),
        main_nodes: counts.main_nodes,
        support_nodes: counts.support_nodes,
        edges: counts.edges,
        bytes,
        refused,
    }
}
