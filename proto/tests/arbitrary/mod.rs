//! Valid values of all types, over their whole ranges.

use fht_proto::model::compaction::{CompactedSeries, Rest};
use fht_proto::{
    AuthorId, Datum, Descriptor, DescriptorModel, Digest, EdgeKey, FixedPoint, FixedPose, Increment, Label, ModelId,
    NodeId, NodeKind, Op, PlanImage, Rect, Release, ReleaseId, ReleaseName, ScanRecord, Signature, VersionVector, Zone,
    ZoneRule,
};
use proptest::prelude::*;

pub fn author() -> impl Strategy<Value = AuthorId> {
    prop_oneof![Just(AuthorId(7)), any::<u32>().prop_map(AuthorId)]
}

fn node_id() -> impl Strategy<Value = NodeId> {
    (author(), any::<u32>()).prop_map(|(author, number)| NodeId { author, number })
}

fn pose() -> impl Strategy<Value = FixedPose> {
    let coordinate = || -100_000_000..=100_000_000_i32;
    (coordinate(), coordinate(), -31_416..=31_416_i16)
        .prop_map(|(x_mm, y_mm, yaw_e4)| FixedPose { position: FixedPoint { x_mm, y_mm }, yaw_e4 })
}

fn rect() -> impl Strategy<Value = Rect> {
    any::<[u16; 4]>().prop_map(|[west_mm, south_mm, east_mm, north_mm]| Rect { west_mm, south_mm, east_mm, north_mm })
}

pub fn descriptor() -> impl Strategy<Value = Descriptor> {
    let values = prop::collection::vec(any::<i8>(), 1..=Descriptor::MAX_DIMENSION);
    (any::<u32>(), f32::MIN_POSITIVE..1e3, values).prop_map(|(model, scale, values)| Descriptor {
        model: ModelId(model),
        scale,
        values,
    })
}

pub fn scan() -> impl Strategy<Value = ScanRecord> {
    let ranges = prop::collection::vec(any::<u16>(), 1..400);
    (pose(), -6.0..6.0_f32, -1.0..1.0_f32, ranges).prop_map(
        |(base_from_sensor, angle_min, angle_increment, ranges_mm)| ScanRecord {
            base_from_sensor,
            angle_min,
            angle_increment,
            ranges_mm,
        },
    )
}

fn model() -> impl Strategy<Value = DescriptorModel> {
    (any::<u32>(), "\\PC{0,16}", 1..=512_u16, -1000..=1000_i16).prop_map(|(id, name, dimension, match_threshold_e3)| {
        DescriptorModel { id: ModelId(id), name, dimension, match_threshold_e3 }
    })
}

fn edge() -> impl Strategy<Value = EdgeKey> {
    (node_id(), node_id()).prop_filter("two ends", |(a, b)| a != b).prop_map(|(a, b)| EdgeKey::new(a, b))
}

fn op() -> impl Strategy<Value = Op> {
    let kind = prop_oneof![Just(NodeKind::Main), Just(NodeKind::Support)];
    prop_oneof![
        (node_id(), kind, pose()).prop_map(|(id, kind, pose)| Op::PutNode { id, kind, pose }),
        node_id().prop_map(|id| Op::RemoveNode { id }),
        (node_id(), pose()).prop_map(|(id, pose)| Op::SetPose { id, pose }),
        (node_id(), prop::option::of(rect())).prop_map(|(id, rect)| Op::SetFreeSpace { id, rect }),
        (node_id(), prop::option::of(descriptor()), scan())
            .prop_map(|(id, descriptor, scan)| Op::SetSignature { id, signature: Signature { descriptor, scan } }),
        edge().prop_map(|edge| Op::PutEdge { edge }),
        edge().prop_map(|edge| Op::RemoveEdge { edge }),
        model().prop_map(|model| Op::PutModel { model }),
        (node_id(), 0..=100_u8).prop_map(|(id, percent)| Op::SetTrust { id, percent }),
        (edge(), any::<bool>()).prop_map(|(edge, closed)| Op::SetClosed { edge, closed }),
        (label(), prop::option::of(pose())).prop_map(|(name, pose)| Op::SetPlace { name, pose }),
        (label(), prop::option::of(zone())).prop_map(|(name, zone)| Op::SetZone { name, zone }),
        (release_name(), vector(), any::<[u8; 32]>()).prop_map(|(name, vector, hash)| {
            let release = Release { vector, digest: Digest(hash) };
            Op::PutRelease { name, release }
        }),
        release_id().prop_map(|id| Op::RemoveRelease { id }),
        prop::option::of(release_id()).prop_map(|release| Op::Enable { release }),
        prop::option::of(floor_plan()).prop_map(|plan| Op::SetFloorPlan { plan }),
        prop::option::of(datum()).prop_map(|datum| Op::SetDatum { datum }),
    ]
}

fn floor_plan() -> impl Strategy<Value = PlanImage> {
    ("[^\\p{Cc}]{0,20}", 1..=PlanImage::MAX_UM_PER_PIXEL, pose())
        .prop_map(|(image, um_per_pixel, map_from_image)| PlanImage { image, um_per_pixel, map_from_image })
}

fn datum() -> impl Strategy<Value = Datum> {
    (-89_899_999_999..=89_899_999_999_i64, -180_000_000_000..=180_000_000_000_i64, -31_416..=31_416_i16)
        .prop_map(|(latitude_e9, longitude_e9, yaw_e4)| Datum { latitude_e9, longitude_e9, yaw_e4 })
}

pub fn label() -> impl Strategy<Value = Label> {
    "[a-zA-Z][a-zA-Z0-9_-]{0,63}".prop_map(|text| text.parse().unwrap())
}

fn release_name() -> impl Strategy<Value = ReleaseName> {
    "[a-zA-Z_-][a-zA-Z0-9_-]{4,20}(\\.[a-zA-Z0-9_-]{1,20}){0,2}".prop_map(|text| text.parse().unwrap())
}

fn release_id() -> impl Strategy<Value = ReleaseId> {
    (author(), release_name()).prop_map(|(author, name)| ReleaseId { author, name })
}

pub fn zone() -> impl Strategy<Value = Zone> {
    let rule = prop_oneof![Just(ZoneRule::KeepOut), (1..=u16::MAX).prop_map(ZoneRule::SpeedLimit)];
    (rule, prop::collection::vec(pose(), 3..20))
        .prop_map(|(rule, corners)| Zone { rule, corners: corners.into_iter().map(|pose| pose.position).collect() })
}

pub fn vector() -> impl Strategy<Value = VersionVector> {
    prop::collection::vec((any::<u32>(), 1..=1_u64 << 48), 0..5).prop_map(|counts| {
        let mut vector = VersionVector::default();
        counts.into_iter().for_each(|(author, count)| vector.set(AuthorId(author), count));
        vector
    })
}

/// What is left of some increments: any part of their operations.
pub fn fold() -> impl Strategy<Value = CompactedSeries> {
    let rest = (1..5_u64, 0..=1_u64 << 53, prop::collection::btree_map(0..4096_u16, op(), 1..4));
    (author(), 1..=1_u64 << 47, 0..20_u64, prop::collection::vec(rest, 0..5)).prop_map(
        |(author, first, more, rests)| {
            let mut number = first - 1;
            let mut placed = Vec::new();
            for (step, hlc_us, ops) in rests {
                number += step;
                placed.push(Rest { number, hlc_us, ops: ops.into_iter().collect() });
            }
            CompactedSeries { author, first, last: number.max(first) + more, rests: placed }
        },
    )
}

pub fn increment() -> impl Strategy<Value = Increment> {
    (author(), 1..=1_u64 << 48, 0..=1_u64 << 53, prop::collection::vec(op(), 1..12))
        .prop_map(|(author, number, hlc_us, ops)| Increment { author, number, hlc_us, ops })
}
