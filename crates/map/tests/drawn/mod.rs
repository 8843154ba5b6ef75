//! Drawn logs: few ids, poses and clocks, so that writes meet.
#![allow(dead_code)] // each test uses a part

use fht_map::MapState;
use fht_proto::{
    AuthorId, Datum, Descriptor, DescriptorModel, Digest, EdgeKey, FixedPoint, FixedPose, Increment, Label, ModelId,
    NodeId, NodeKind, Op, PlanImage, Rect, Release, ReleaseId, ReleaseName, ScanRecord, Signature, VersionVector, Zone,
    ZoneRule,
};
use proptest::prelude::*;

/// Few ids, poses and clocks, so that writes meet: equal stamps with different contents, removals
/// older and newer.
pub fn id() -> impl Strategy<Value = NodeId> {
    (0..2_u32, 0..4_u32).prop_map(|(author, number)| NodeId { author: AuthorId(author), number })
}

pub fn pose() -> impl Strategy<Value = FixedPose> {
    (0..3_i32, 0..3_i32).prop_map(|(x, y)| FixedPose { position: FixedPoint { x_mm: x, y_mm: y }, yaw_e4: 0 })
}

pub fn signature() -> impl Strategy<Value = Signature> {
    (0..3_i8).prop_map(|value| Signature {
        descriptor: Some(Descriptor { model: ModelId(1), scale: 1.0, values: vec![value; 4] }),
        scan: ScanRecord {
            base_from_sensor: FixedPose::default(),
            angle_min: 0.0,
            angle_increment: 0.1,
            ranges_mm: vec![1000; 4],
        },
    })
}

pub fn edge() -> impl Strategy<Value = EdgeKey> {
    (id(), id()).prop_filter("two ends", |(a, b)| a != b).prop_map(|(a, b)| EdgeKey::new(a, b))
}

pub fn op() -> impl Strategy<Value = Op> {
    let kind = prop_oneof![Just(NodeKind::Main), Just(NodeKind::Support)];
    let rect = prop::option::of((0..3_u16).prop_map(|east_mm| Rect { east_mm, ..Rect::default() }));
    let model = (0..2_u32, 1..4_u16).prop_map(|(id, dimension)| DescriptorModel {
        id: ModelId(id),
        name: "model".to_owned(),
        dimension,
        match_threshold_e3: 700,
    });
    prop_oneof![
        4 => (id(), kind, pose()).prop_map(|(id, kind, pose)| Op::PutNode { id, kind, pose }),
        2 => id().prop_map(|id| Op::RemoveNode { id }),
        2 => (id(), pose()).prop_map(|(id, pose)| Op::SetPose { id, pose }),
        2 => (id(), rect).prop_map(|(id, rect)| Op::SetFreeSpace { id, rect }),
        2 => (id(), signature()).prop_map(|(id, signature)| Op::SetSignature { id, signature }),
        3 => edge().prop_map(|edge| Op::PutEdge { edge }),
        1 => edge().prop_map(|edge| Op::RemoveEdge { edge }),
        1 => model.prop_map(|model| Op::PutModel { model }),
        1 => (id(), 0..3_u8).prop_map(|(id, percent)| Op::SetTrust { id, percent }),
        1 => (edge(), any::<bool>()).prop_map(|(edge, closed)| Op::SetClosed { edge, closed }),
        1 => annotation(),
    ]
}

/// What operators write.
fn annotation() -> impl Strategy<Value = Op> {
    let name = || prop::sample::select(vec!["a", "b"]);
    let label = move || name().prop_map(|name| name.parse::<Label>().unwrap());
    let release_name = move || name().prop_map(|name| name.parse::<ReleaseName>().unwrap());
    let release_id =
        move || (0..3_u32, release_name()).prop_map(|(author, name)| ReleaseId { author: AuthorId(author), name });
    let zone = (1..3_u16).prop_map(|speed| Zone {
        rule: ZoneRule::SpeedLimit(speed),
        corners: [(0, 0), (1, 0), (0, 1)].map(|(x_mm, y_mm)| FixedPoint { x_mm, y_mm }).to_vec(),
    });
    let release = (1..3_u64).prop_map(|count| {
        let mut vector = VersionVector::default();
        vector.set(AuthorId(0), count);
        Release { vector, digest: Digest([0; 32]) }
    });
    prop_oneof![
        (label(), prop::option::of(pose())).prop_map(|(name, pose)| Op::SetPlace { name, pose }),
        (label(), prop::option::of(zone)).prop_map(|(name, zone)| Op::SetZone { name, zone }),
        (release_name(), release).prop_map(|(name, release)| Op::PutRelease { name, release }),
        release_id().prop_map(|id| Op::RemoveRelease { id }),
        prop::option::of(release_id()).prop_map(|release| Op::Enable { release }),
        prop::option::of(1..3_u32).prop_map(|um_per_pixel| Op::SetFloorPlan {
            plan: um_per_pixel.map(|um_per_pixel| PlanImage {
                image: "plan.png".to_owned(),
                um_per_pixel,
                map_from_image: FixedPose::default(),
            }),
        }),
        prop::option::of(1..3_i64).prop_map(|latitude_e9| Op::SetDatum {
            datum: latitude_e9.map(|latitude_e9| Datum { latitude_e9, longitude_e9: 0, yaw_e4: 0 }),
        }),
    ]
}

/// Up to three authors with contents and clocks of any kind, hostile ones too, numbered without
/// gaps.
pub fn increments() -> impl Strategy<Value = Vec<Increment>> {
    let one = (0..3_u32, 0..4_u64, prop::collection::vec(op(), 1..5));
    prop::collection::vec(one, 1..12).prop_map(|drawn| {
        let mut counts = [0; 3];
        let number = |(author, hlc_us, ops): (u32, u64, Vec<Op>)| {
            counts[author as usize] += 1;
            Increment { author: AuthorId(author), number: counts[author as usize], hlc_us, ops }
        };
        drawn.into_iter().map(number).collect()
    })
}

pub fn state_of<'a>(increments: impl IntoIterator<Item = &'a Increment>) -> MapState {
    let mut state = MapState::new();
    increments.into_iter().for_each(|increment| state.apply(increment));
    state
}

/// All that can be seen of a map, as text.
pub fn shown(state: &MapState) -> String {
    let nodes: Vec<_> = state.nodes().collect();
    let neighbours: Vec<Vec<NodeId>> =
        nodes.iter().map(|node| state.neighbours(node.id).map(|other| other.id).collect()).collect();
    let edges: Vec<_> = state.edges().collect();
    let models: Vec<_> = state.models().collect();
    let closed: Vec<_> = state.closed_edges().collect();
    let places: Vec<_> = state.annotations().places().collect();
    let zones: Vec<_> = state.annotations().zones().collect();
    let releases: Vec<_> = state.annotations().releases().collect();
    let enabled = state.annotations().enabled();
    let counts = (state.counts(), state.elements(), state.max_hlc_us());
    format!(
        "{nodes:?} {neighbours:?} {edges:?} {closed:?} {models:?} {places:?} {zones:?} {releases:?} {enabled:?} {counts:?}"
    )
}
