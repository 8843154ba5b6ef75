//! Increments as JSON say all that the binary form says: they can be read back.
#![allow(clippy::unwrap_used)] // tests may panic

mod arbitrary;

use arbitrary::{fold, increment};
use fht_proto::api::reply::{DescriptorView, OpView, RuleView, ScanView, Series, SeriesReply, ZoneShape};
use fht_proto::model::compaction::Rest;
use fht_proto::{
    CompactedSeries, Datum, Descriptor, DescriptorModel, EdgeKey, FixedPoint, FixedPose, Increment, ModelId, NodeId,
    Op, PlanImage, Rect, Release, ScanRecord, Signature, VersionVector, Zone, ZoneRule,
};
use proptest::prelude::*;

fn whole(value: f64, units: f64) -> i32 {
    (value * units).round() as i32
}

fn point([x, y]: [f64; 2]) -> FixedPoint {
    FixedPoint { x_mm: whole(x, 1000.0), y_mm: whole(y, 1000.0) }
}

fn pose([x, y, yaw]: [f64; 3]) -> FixedPose {
    FixedPose { position: point([x, y]), yaw_e4: whole(yaw, 10_000.0) as i16 }
}

fn rect(reach: [f64; 4]) -> Rect {
    let [west_mm, south_mm, east_mm, north_mm] = reach.map(|metres| whole(metres, 1000.0) as u16);
    Rect { west_mm, south_mm, east_mm, north_mm }
}

fn node(text: &str) -> NodeId {
    text.parse().unwrap()
}

fn edge([a, b]: &[String; 2]) -> EdgeKey {
    EdgeKey::new(node(a), node(b))
}

fn model(text: &str) -> ModelId {
    ModelId(u32::from_str_radix(text, 16).unwrap())
}

fn signature(descriptor: Option<DescriptorView>, scan: ScanView) -> Signature {
    let ScanView { base_from_sensor, angle_min, angle_increment, ranges_mm } = scan;
    let descriptor =
        descriptor.map(|view| Descriptor { model: model(&view.model), scale: view.scale, values: view.values });
    let base_from_sensor = pose(base_from_sensor);
    Signature { descriptor, scan: ScanRecord { base_from_sensor, angle_min, angle_increment, ranges_mm } }
}

fn zone(ZoneShape { rule, corners }: ZoneShape) -> Zone {
    let rule = match rule {
        RuleView::KeepOut => ZoneRule::KeepOut,
        RuleView::SpeedLimit(mps) => ZoneRule::SpeedLimit(whole(mps, 1000.0) as u16),
    };
    Zone { rule, corners: corners.into_iter().map(point).collect() }
}

fn op(view: OpView) -> Op {
    match view {
        OpView::PutNode { id, kind, pose: at } => Op::PutNode { id: node(&id), kind, pose: pose(at) },
        OpView::RemoveNode { id } => Op::RemoveNode { id: node(&id) },
        OpView::SetPose { id, pose: at } => Op::SetPose { id: node(&id), pose: pose(at) },
        OpView::SetFreeSpace { id, reach } => Op::SetFreeSpace { id: node(&id), rect: reach.map(rect) },
        OpView::SetSignature { id, descriptor, scan } => {
            Op::SetSignature { id: node(&id), signature: signature(descriptor, scan) }
        }
        OpView::PutEdge { edge: ends } => Op::PutEdge { edge: edge(&ends) },
        OpView::RemoveEdge { edge: ends } => Op::RemoveEdge { edge: edge(&ends) },
        OpView::PutModel { model: id, name, dimension, match_threshold } => {
            let match_threshold_e3 = whole(match_threshold, 1000.0) as i16;
            Op::PutModel { model: DescriptorModel { id: model(&id), name, dimension, match_threshold_e3 } }
        }
        OpView::SetTrust { id, percent } => Op::SetTrust { id: node(&id), percent },
        OpView::SetClosed { edge: ends, closed } => Op::SetClosed { edge: edge(&ends), closed },
        OpView::SetPlace { name, pose: at } => Op::SetPlace { name: name.parse().unwrap(), pose: at.map(pose) },
        OpView::SetZone { name, zone: shape } => Op::SetZone { name: name.parse().unwrap(), zone: shape.map(zone) },
        OpView::PutRelease { name, vector, digest } => {
            Op::PutRelease { name: name.parse().unwrap(), release: Release { vector, digest } }
        }
        OpView::RemoveRelease { release } => Op::RemoveRelease { id: release.parse().unwrap() },
        OpView::Enable { release } => Op::Enable { release: release.map(|id| id.parse().unwrap()) },
        OpView::SetFloorPlan { plan } => Op::SetFloorPlan {
            plan: plan.map(|plan| PlanImage {
                image: plan.image,
                um_per_pixel: PlanImage::um_per_pixel(plan.metres_per_pixel).unwrap(),
                map_from_image: pose(plan.map_from_image),
            }),
        },
        OpView::SetDatum { datum } => Op::SetDatum {
            datum: datum.map(|datum| Datum {
                yaw_e4: whole(datum.yaw, 1e4) as i16,
                ..Datum::from_degrees(datum.latitude, datum.longitude, 0.0)
            }),
        },
    }
}

/// What a client reads.
fn series(reply: SeriesReply) -> Series {
    let increments = reply.increments.into_iter().map(|view| {
        let ops = view.ops.into_iter().map(op).collect();
        Increment { author: view.author, number: view.number, hlc_us: view.hlc_us, ops }
    });
    let folds = reply.compacted.into_iter().map(|view| {
        let rests = view.increments.into_iter().map(|rest| {
            let ops = rest.ops.into_iter().map(|placed| (placed.index, op(placed.op))).collect();
            Rest { number: rest.number, hlc_us: rest.hlc_us, ops }
        });
        CompactedSeries { author: view.author, first: view.first, last: view.last, rests: rests.collect() }
    });
    Series { folds: folds.collect(), increments: increments.collect() }
}

proptest! {
    #[test]
    fn nothing_is_lost(
        folds in prop::collection::vec(fold(), 0..3),
        increments in prop::collection::vec(increment(), 0..3),
    ) {
        let sent = Series { folds, increments };
        let reply = SeriesReply::new("museum".parse().unwrap(), VersionVector::default(), &sent);
        let text = serde_json::to_string(&reply).unwrap();
        prop_assert_eq!(series(serde_json::from_str(&text).unwrap()), sent);
    }
}

#[test]
fn an_increment_looks_as_the_reference_shows_it() {
    let increment: Increment = {
        let id = node("1a2b3c4d.0");
        let at = FixedPose::from_metres(1.5, -2.0, 0.5);
        let free_space = Rect::around(at.position, (0.5, -2.8), (2.5, -1.2));
        let ops = vec![
            Op::PutNode { id, kind: fht_proto::NodeKind::Support, pose: at },
            Op::SetFreeSpace { id, rect: Some(free_space) },
            Op::PutEdge { edge: EdgeKey::new(id, node("1a2b3c4d.1")) },
        ];
        Increment { author: id.author, number: 7, hlc_us: 1_700_000_000_000_000, ops }
    };
    let mut vector = VersionVector::default();
    vector.set(increment.author, 7);
    let one = Series { folds: Vec::new(), increments: vec![increment] };
    let text = serde_json::to_string(&SeriesReply::new("museum".parse().unwrap(), vector, &one)).unwrap();
    assert_eq!(
        text,
        concat!(
            r#"{"map":"museum","vector":{"1a2b3c4d":7},"compacted":[],"increments":["#,
            r#"{"author":"1a2b3c4d","number":7,"hlc_us":1700000000000000,"ops":["#,
            r#"{"op":"put_node","id":"1a2b3c4d.0","kind":"support","pose":[1.5,-2.0,0.5]},"#,
            r#"{"op":"set_free_space","id":"1a2b3c4d.0","reach":[1.0,0.8,1.0,0.8]},"#,
            r#"{"op":"put_edge","edge":["1a2b3c4d.0","1a2b3c4d.1"]}]}]}"#,
        )
    );
}
