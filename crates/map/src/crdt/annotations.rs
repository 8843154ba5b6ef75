//! What a map says beside its nodes and edges: descriptor models, named places, zones, releases and
//! which of them is enabled.

use crate::crdt::register::{ContentHash, Register, content_hash, join_into};
use fht_proto::{
    AuthorId, Datum, DescriptorModel, FixedPose, Label, ModelId, Op, PlanImage, Release, ReleaseId, Stamp, Zone,
};
use serde::Serialize;
use std::collections::BTreeMap;
use std::sync::OnceLock;

/// A release, deleted or not.
#[derive(Clone, Debug, Default, Serialize)]
struct ReleaseState {
    /// The first of its author under this name: number of the increment, stamp.
    put: Option<(u64, Stamp, Release)>,
    removed: Option<Stamp>,
}

impl ReleaseState {
    /// Of several the first counts, so that a release stays what it is whatever its author writes
    /// later.
    fn put(&mut self, number: u64, stamp: Stamp, release: &Release) {
        if self.put.as_ref().is_none_or(|(first, at, _)| (number, stamp) < (*first, *at)) {
            self.put = Some((number, stamp, release.clone()));
        }
    }

    /// The release, if it is not deleted.
    fn kept<'a>(&'a self, id: &'a ReleaseId) -> Option<ReleaseRef<'a>> {
        let (_, stamp, release) = self.put.as_ref().filter(|_| self.removed.is_none())?;
        Some(ReleaseRef { id, release, made_us: stamp.hlc_us })
    }

    fn remove(&mut self, stamp: Stamp) {
        self.removed = self.removed.max(Some(stamp));
    }
}

/// A release that is not deleted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReleaseRef<'a> {
    /// Which.
    pub id: &'a ReleaseId,
    /// The state that it names.
    pub release: &'a Release,
    /// When it was made, by its author's clock: microseconds.
    pub made_us: u64,
}

/// Where the map lies.
#[derive(Clone, Debug, Default, Serialize)]
struct Siting {
    floor_plan: Option<Register<Option<PlanImage>>>,
    datum: Option<Register<Option<Datum>>>,
}

/// All annotations of a map.
#[derive(Clone, Debug, Default)]
pub struct Annotations {
    models: BTreeMap<ModelId, Register<DescriptorModel>>,
    places: BTreeMap<Label, Register<Option<FixedPose>>>,
    zones: BTreeMap<Label, Register<Option<Zone>>>,
    releases: BTreeMap<ReleaseId, ReleaseState>,
    enabled: Option<Register<Option<ReleaseId>>>,
    siting: Siting,
    digest: OnceLock<ContentHash>,
}

fn join_at<K: Ord + Clone, T: Serialize>(map: &mut BTreeMap<K, Register<T>>, key: &K, register: Register<T>) {
    match map.get_mut(key) {
        Some(current) => current.join(register),
        None => _ = map.insert(key.clone(), register),
    }
}

impl Annotations {
    /// Joins an operation of increment `number`; those on nodes and edges are passed over.
    pub(crate) fn apply(&mut self, number: u64, stamp: Stamp, op: &Op) {
        self.digest = OnceLock::new();
        match op {
            Op::PutModel { model } => join_at(&mut self.models, &model.id, Register::new(stamp, model.clone())),
            Op::SetPlace { name, pose } => join_at(&mut self.places, name, Register::new(stamp, *pose)),
            Op::SetZone { name, zone } => join_at(&mut self.zones, name, Register::new(stamp, zone.clone())),
            Op::PutRelease { name, release } => {
                let id = ReleaseId { author: stamp.author, name: name.clone() };
                self.releases.entry(id).or_default().put(number, stamp, release);
            }
            Op::RemoveRelease { id } => self.releases.entry(id.clone()).or_default().remove(stamp),
            Op::Enable { release } => join_into(&mut self.enabled, Register::new(stamp, release.clone())),
            Op::SetFloorPlan { plan } => join_into(&mut self.siting.floor_plan, Register::new(stamp, plan.clone())),
            Op::SetDatum { datum } => join_into(&mut self.siting.datum, Register::new(stamp, *datum)),
            Op::PutNode { .. }
            | Op::RemoveNode { .. }
            | Op::SetPose { .. }
            | Op::SetFreeSpace { .. }
            | Op::SetSignature { .. }
            | Op::SetTrust { .. }
            | Op::PutEdge { .. }
            | Op::RemoveEdge { .. }
            | Op::SetClosed { .. } => {}
        }
    }

    /// Who each of them is there for: who wrote it last.
    pub(crate) fn writers(&self) -> impl Iterator<Item = AuthorId> {
        let models = self.models.values().map(Register::stamp);
        let places = self.places.values().map(Register::stamp);
        let zones = self.zones.values().map(Register::stamp);
        let releases = self
            .releases
            .values()
            .filter_map(|release| release.put.as_ref().map(|(_, stamp, _)| *stamp).or(release.removed));
        models.chain(places).chain(zones).chain(releases).map(|stamp| stamp.author)
    }

    /// The descriptor models used, in the order of their ids.
    pub fn models(&self) -> impl Iterator<Item = &DescriptorModel> {
        self.models.values().map(Register::value)
    }

    /// The named places, by name.
    pub fn places(&self) -> impl Iterator<Item = (&Label, FixedPose)> {
        self.places.iter().filter_map(|(name, register)| Some((name, (*register.value())?)))
    }

    /// The place of this name.
    #[must_use]
    pub fn place(&self, name: &Label) -> Option<FixedPose> {
        self.places.get(name).and_then(|register| *register.value())
    }

    /// The zones, by name.
    pub fn zones(&self) -> impl Iterator<Item = (&Label, &Zone)> {
        self.zones.iter().filter_map(|(name, register)| Some((name, register.value().as_ref()?)))
    }

    /// The releases that are not deleted, by author and name.
    pub fn releases(&self) -> impl Iterator<Item = ReleaseRef<'_>> {
        self.releases.iter().filter_map(|(id, state)| state.kept(id))
    }

    /// The releases that were deleted, by author and name: nobody can make them again.
    pub fn deleted_releases(&self) -> impl Iterator<Item = &ReleaseId> {
        self.releases.iter().filter_map(|(id, state)| state.removed.is_some().then_some(id))
    }

    /// The release of this id, if it is not deleted.
    #[must_use]
    pub fn release(&self, id: &ReleaseId) -> Option<ReleaseRef<'_>> {
        self.releases.get_key_value(id).and_then(|(id, state)| state.kept(id))
    }

    /// The release that robots are to use, if one is enabled and not deleted.
    #[must_use]
    pub fn enabled(&self) -> Option<ReleaseRef<'_>> {
        self.enabled.as_ref().and_then(|register| register.value().as_ref()).and_then(|id| self.release(id))
    }

    /// How a floor plan's image lies in the map.
    #[must_use]
    pub fn floor_plan(&self) -> Option<&PlanImage> {
        self.siting.floor_plan.as_ref().and_then(|register| register.value().as_ref())
    }

    /// Where on earth the map is.
    #[must_use]
    pub fn datum(&self) -> Option<Datum> {
        self.siting.datum.as_ref().and_then(|register| *register.value())
    }

    /// How many take up memory, removed ones included.
    pub(crate) fn count(&self) -> usize {
        self.models.len() + self.places.len() + self.zones.len() + self.releases.len()
    }

    pub(crate) fn digest(&self) -> ContentHash {
        let hash = || {
            let before = (&self.models, &self.places, &self.zones, &self.releases, &self.enabled);
            // A map that was written before these were there has the digest that its releases name.
            match &self.siting {
                Siting { floor_plan: None, datum: None } => content_hash(&before),
                siting => content_hash(&(before, siting)),
            }
        };
        *self.digest.get_or_init(hash)
    }
}
