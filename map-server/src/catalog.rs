//! The maps in memory, as queries see them. Readers take a shared view and let go of the lock at once; the one
//! writer changes a copy, which shares all that stays as it is, and puts it in the map's place.

use crate::basis::Basis;
use crate::head_index::HeadIndex;
use crate::log::{IncrementLog, Piece, StoreError};
use fht_map::{MapIndex, MapState};
use fht_proto::query::Head;
use fht_proto::{CodecError, Fold, Increment, MapName, ReleaseId, VersionVector, decode};
use std::collections::BTreeMap;
use std::sync::{Arc, PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};

/// One map at one version.
#[derive(Clone, Debug)]
pub struct MapView {
    /// The newest state.
    pub state: Arc<MapState>,
    /// Its version, vector, digest and counts.
    pub head: Arc<Head>,
    /// What robots use: the release that is enabled, or else the newest state.
    pub running: Arc<Basis>,
    /// What finds things in the newest state, if it is large.
    index: Arc<HeadIndex>,
    /// A release that is enabled and whose increments, though all here, do not add up to it: they were folded before it came.
    broken: Option<ReleaseId>,
}

impl MapView {
    /// `before` is the view that this one replaces: its release need not be read again.
    fn new(state: MapState, head: Head, before: Option<&Self>, log: &dyn IncrementLog) -> Result<Self, StoreError> {
        let state = Arc::new(state);
        let enabled = state.annotations().enabled().map(|release| (release.id.clone(), release.release.clone()));
        let mut broken = None;
        let of_release = match enabled {
            None => None,
            Some((id, release)) => match before.filter(|view| view.running.release() == Some(&id)) {
                Some(before) => Some(Arc::clone(&before.running)),
                // A release that is not all here: until it is, robots go on with what they ran, and so does the server.
                None => {
                    // To make it the whole log is read: not with every batch in vain.
                    let is_broken = before.is_some_and(|view| view.broken.as_ref() == Some(&id));
                    let is_here = head.vector.covers(&release.vector);
                    let made = if is_here && !is_broken {
                        Basis::of_release(&head.map, &id, &release, log)?.map(Arc::new)
                    } else {
                        None
                    };
                    broken = Some(id).filter(|_| is_here && made.is_none());
                    let ran = before.map(|view| &view.running).filter(|running| running.release().is_some());
                    made.or_else(|| ran.map(Arc::clone))
                }
            },
        };
        let running = of_release.unwrap_or_else(|| Arc::new(Basis::of_head(&state, head.version)));
        if let Some(before) = before {
            running.prepare_as(&before.running);
        }
        let index = before.map(|view| Arc::clone(&view.index)).unwrap_or_default();
        Ok(Self { state, head: Arc::new(head), running, index, broken })
    }
}

/// All maps of the server.
#[derive(Debug, Default)]
pub struct Catalog {
    maps: RwLock<BTreeMap<MapName, MapView>>,
}

/// What is read of a map at the start.
#[derive(Default)]
struct Loading {
    state: MapState,
    vector: VersionVector,
    bytes: u64,
}

impl Loading {
    /// Takes the piece of `author` that ends at `last`; each author's must come in order. On failure, says why.
    fn take(&mut self, (author, last): (fht_proto::AuthorId, u64), piece: Piece<'_>) -> Result<(), CodecOrPlace> {
        let bytes = match piece {
            Piece::Fold(bytes) => {
                let fold: Fold = decode(bytes)?;
                if (fold.author, fold.last) != (author, last) || self.vector.get(author) + 1 != fold.first {
                    return Err(CodecOrPlace::Place);
                }
                self.state.apply_fold(&fold);
                bytes
            }
            Piece::Increment(bytes) => {
                let increment: Increment = decode(bytes)?;
                let is_next = self.vector.get(author) + 1 == last;
                if (increment.author, increment.number) != (author, last) || !is_next {
                    return Err(CodecOrPlace::Place);
                }
                self.state.apply(&increment);
                bytes
            }
        };
        self.vector.set(author, last);
        self.bytes += bytes.len() as u64;
        Ok(())
    }
}

enum CodecOrPlace {
    Codec(CodecError),
    Place,
}

impl From<CodecError> for CodecOrPlace {
    fn from(error: CodecError) -> Self {
        Self::Codec(error)
    }
}

impl Catalog {
    /// Reads all maps from the log.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] if increments are missing or unreadable, [`StoreError::IncrementFormat`], [`StoreError::Disk`].
    pub fn load(log: &dyn IncrementLog) -> Result<Self, StoreError> {
        let mut maps: BTreeMap<MapName, Loading> = BTreeMap::new();
        log.for_each(None, &mut |name, author, last, piece| {
            let damaged = |reason: String| StoreError::Damaged { map: name.to_owned(), reason };
            let map: MapName = name.parse().map_err(|error| damaged(format!("{error}")))?;
            maps.entry(map).or_default().take((author, last), piece).map_err(|error| match error {
                CodecOrPlace::Codec(CodecError::Version { found }) => {
                    StoreError::IncrementFormat { map: name.to_owned(), found }
                }
                CodecOrPlace::Codec(other) => damaged(format!("increment {author}/{last}: {other}")),
                CodecOrPlace::Place => damaged(format!("increment {author}/{last} is out of place")),
            })
        })?;
        let mut views = BTreeMap::new();
        for (map, Loading { state, vector, bytes }) in maps {
            if log.vector_at(&map, vector.version())?.as_ref() != Some(&vector) {
                let reason = "its log does not name its increments".to_owned();
                return Err(StoreError::Damaged { map: map.to_string(), reason });
            }
            let head = head_of(&map, &state, vector, bytes, 0);
            views.insert(map, MapView::new(state, head, None, log)?);
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

    /// Reads the index of a map's newest state, and that state; `None` if there is no such map.
    pub fn with_index<T>(&self, map: &MapName, read: impl FnOnce(&MapView, &MapIndex) -> T) -> Option<T> {
        let index = self.view(map)?.index;
        index.with(|| self.view(map), read)
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

    /// Applies folds and increments that are durable, `bytes` long in all; `vector` is what the map then contains. Returns how many
    /// elements it has then ([`MapState::elements`]). For one thread at a time.
    ///
    /// # Errors
    /// [`StoreError`] when the release that is enabled now cannot be read.
    pub fn apply(
        &self,
        map: &MapName,
        folds: &[Fold],
        increments: &[Increment],
        vector: VersionVector,
        bytes: u64,
        log: &dyn IncrementLog,
    ) -> Result<usize, StoreError> {
        // On a copy, so that readers wait only while it takes the old one's place.
        let old = self.view(map);
        let mut state = old.as_ref().map(|view| view.state.as_ref().clone()).unwrap_or_default();
        folds.iter().for_each(|fold| state.apply_fold(fold));
        increments.iter().for_each(|increment| state.apply(increment));
        let (old_bytes, refused) = old.as_ref().map_or((0, 0), |view| (view.head.bytes, view.head.refused));
        let head = head_of(map, &state, vector, old_bytes + bytes, refused);
        let elements = state.elements();
        let view = MapView::new(state, head, old.as_ref(), log)?;
        drop(old);
        let of_folds = folds.iter().flat_map(|fold| &fold.rests).flat_map(|rest| rest.ops.iter().map(|(_, op)| op));
        let ops = of_folds.chain(increments.iter().flat_map(|increment| &increment.ops));
        let (index, state) = (Arc::clone(&view.index), Arc::clone(&view.state));
        let replaced = index.follow(&state, ops, || self.write().insert(map.clone(), view));
        drop(replaced); // a large map takes its time, and the lock is free by now
        Ok(elements)
    }

    /// Counts refused increments, if there is such a map.
    pub fn count_refused(&self, map: &MapName, count: u64) {
        if let Some(view) = self.write().get_mut(map) {
            Arc::make_mut(&mut view.head).refused += count;
        }
    }

    /// A map's increments take up another number of bytes now: they were folded.
    pub fn set_bytes(&self, map: &MapName, bytes: u64) {
        if let Some(view) = self.write().get_mut(map) {
            Arc::make_mut(&mut view.head).bytes = bytes;
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
        clock_us: state.max_hlc_us(),
        enabled: state.annotations().enabled().map(|release| release.id.to_string()),
        main_nodes: counts.main_nodes,
        support_nodes: counts.support_nodes,
        edges: counts.edges,
        bytes,
        refused,
    }
}

/// The id of a release that a text names: `name@author`, or the name alone if only one author has used it.
///
/// # Errors
/// In a sentence, when there is none, or more than one.
pub fn find_release(state: &MapState, text: &str) -> Result<ReleaseId, String> {
    let releases = || state.annotations().releases().map(|release| release.id);
    if let Ok(id) = text.parse::<ReleaseId>() {
        return if releases().any(|known| *known == id) { Ok(id) } else { Err(format!("there is no release {id}")) };
    }
    let named: Vec<&ReleaseId> = releases().filter(|id| id.name.as_str() == text).collect();
    match named.as_slice() {
        [id] => Ok((*id).clone()),
        [] => {
            let known: Vec<String> = releases().take(10).map(ToString::to_string).collect();
            let known = if known.is_empty() { "there are none".to_owned() } else { known.join(", ") };
            Err(format!("there is no release {text} ({known})"))
        }
        several => {
            let several: Vec<String> = several.iter().map(ToString::to_string).collect();
            Err(format!("more than one release is called {text}: {}", several.join(", ")))
        }
    }
}
