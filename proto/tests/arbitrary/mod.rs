//! Valid values of all types, over their whole ranges.

use fht_proto::{
    AuthorId, Descriptor, DescriptorModel, EdgeKey, FixedPoint, FixedPose, Increment, ModelId, NodeId, NodeKind, Op,
    Rect, ScanRecord, Signature,
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
    ]
}

pub fn increment() -> impl Strategy<Value = Increment> {
    (author(), 1..=u64::MAX, 0..=1_u64 << 53, prop::collection::vec(op(), 1..12))
        .prop_map(|(author, number, hlc_us, ops)| Increment { author, number, hlc_us, ops })
}
