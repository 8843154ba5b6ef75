//! The codec: what is encoded decodes to itself, no bytes make a decoder panic, messages are small, and format version 1
//! stays what it is.
#![allow(clippy::unwrap_used)] // tests may panic

mod arbitrary;

use arbitrary::{descriptor, increment, scan};
use fht_proto::compact::{CompactNode, CompactNodes, CompactPath, CompactWaypoint};
use fht_proto::envelope::{FORMAT_VERSION, MAGIC, MAX_BODY_BYTES, Message};
use fht_proto::query::Snapshot;
use fht_proto::{
    AuthorId, CodecError, Descriptor, EdgeKey, FixedPoint, FixedPose, Increment, ModelId, NodeId, NodeKind, Op, Rect,
    Signature, decode, encode,
};
use proptest::prelude::*;

fn decode_all(bytes: &[u8]) {
    let _ = decode::<Increment>(bytes);
    let _ = decode::<Descriptor>(bytes);
    let _ = decode::<Snapshot>(bytes);
    let _ = decode::<CompactPath>(bytes);
    let _ = decode::<CompactNodes>(bytes);
}

/// An envelope with a right length and checksum round any body, so that the body's decoder is reached.
fn envelope(kind: u8, body: &[u8]) -> Vec<u8> {
    let mut bytes = MAGIC.to_vec();
    bytes.extend([FORMAT_VERSION, kind]);
    let mut length = body.len();
    while length >= 0x80 {
        bytes.push((length & 0x7f) as u8 | 0x80);
        length >>= 7;
    }
    bytes.push(length as u8);
    bytes.extend(body);
    bytes.extend(crc32fast::hash(&bytes).to_le_bytes());
    bytes
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    #[test]
    fn an_increment_survives_the_wire(increment in increment()) {
        let bytes = encode(&increment).unwrap();
        prop_assert_eq!(decode::<Increment>(&bytes).unwrap(), increment);
    }

    #[test]
    fn a_series_survives_the_wire(increments in prop::collection::vec(increment(), 0..4)) {
        let series = Snapshot { increments };
        prop_assert_eq!(decode::<Snapshot>(&encode(&series).unwrap()).unwrap(), series);
    }

    #[test]
    fn a_descriptor_survives_the_wire(descriptor in descriptor()) {
        prop_assert_eq!(decode::<Descriptor>(&encode(&descriptor).unwrap()).unwrap(), descriptor);
    }

    #[test]
    fn compact_replies_survive_the_wire(
        x in -1_000_000..1_000_000, number: Option<u32>, scan in scan(), cosine in prop::option::of(-1.0_f32..1.0)
    ) {
        let map = "museum".parse().unwrap();
        let point = FixedPoint { x_mm: x, y_mm: -x };
        let node = number.map(|number| NodeId { author: AuthorId(7), number });
        let path = CompactPath { map, version: 3, waypoints: vec![CompactWaypoint { point, node }] };
        prop_assert_eq!(&decode::<CompactPath>(&encode(&path).unwrap()).unwrap(), &path);
        let node = CompactNode {
            id: node.unwrap_or(NodeId { author: AuthorId(0), number: 0 }),
            kind: NodeKind::Main,
            pose: FixedPose { position: point, yaw_e4: 5 },
            free_space: None,
            signature: Some(Signature { descriptor: None, scan }),
            similarity: cosine,
        };
        let nodes = CompactNodes { map: path.map, version: 3, nodes: vec![node] };
        prop_assert_eq!(decode::<CompactNodes>(&encode(&nodes).unwrap()).unwrap(), nodes);
    }

    #[test]
    fn random_bytes_do_not_panic(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        decode_all(&bytes);
    }

    #[test]
    fn random_bodies_do_not_panic(kind in 0_u8..7, body in prop::collection::vec(any::<u8>(), 0..300)) {
        decode_all(&envelope(kind, &body));
    }

    #[test]
    fn damaged_messages_do_not_panic_and_are_refused(increment in increment(), at: prop::sample::Index, flip in 1_u8..) {
        let mut bytes = encode(&increment).unwrap();
        let at = at.index(bytes.len());
        bytes[at] ^= flip;
        decode_all(&bytes);
        prop_assert!(decode::<Increment>(&bytes).is_err());
        decode_all(&bytes[..at]);
        prop_assert!(decode::<Increment>(&bytes[..at]).is_err());
    }

    #[test]
    fn damaged_bodies_with_right_checksums_do_not_panic(
        increment in increment(), at: prop::sample::Index, flip in 1_u8.., cut: prop::sample::Index
    ) {
        let mut body = body_of(&increment);
        let at = at.index(body.len());
        body[at] ^= flip;
        if let Ok(decoded) = decode::<Increment>(&envelope(Increment::KIND, &body)) {
            // Whatever passes is a valid increment, which can be encoded.
            encode(&decoded).unwrap();
        }
        decode_all(&envelope(Increment::KIND, &body[..cut.index(body.len())]));
    }
}

fn body_of(increment: &Increment) -> Vec<u8> {
    let bytes = encode(increment).unwrap();
    let varint = 1 + bytes[5..].iter().take_while(|&&byte| byte >= 0x80).count();
    bytes[5 + varint..bytes.len() - 4].to_vec()
}

fn node(number: u32) -> NodeId {
    NodeId { author: AuthorId(0x1a2b_3c4d), number }
}

fn main_node() -> Increment {
    let components: Vec<f32> = (0..320).map(|i| (i as f32 * 0.37).sin()).collect();
    let signature = Signature {
        descriptor: Some(Descriptor::quantise(ModelId(0xdead_beef), &components)),
        scan: fht_proto::ScanRecord {
            base_from_sensor: FixedPose::from_metres(-0.032, 0.0, 0.0),
            angle_min: 0.0,
            angle_increment: std::f32::consts::TAU / 360.0,
            ranges_mm: (0..360).map(|i| 1500 + 15 * i as u16).collect(), // up to 6.9 m
        },
    };
    let pose = FixedPose::from_metres(-17.123, 12.345, 2.1);
    let rect = Rect::around(pose.position, (-19.0, 10.0), (-14.0, 15.5));
    let id = node(300);
    Increment {
        author: id.author,
        number: 1234,
        hlc_us: 1_795_000_000_000_000,
        ops: vec![
            Op::PutNode { id, kind: NodeKind::Main, pose },
            Op::SetFreeSpace { id, rect: Some(rect) },
            Op::SetSignature { id, signature },
        ],
    }
}

#[test]
fn a_main_node_takes_at_most_1300_bytes() {
    let bytes = encode(&main_node()).unwrap().len();
    assert!(bytes <= 1300, "{bytes} bytes");
}

fn support_node(number: u32) -> [Op; 2] {
    let pose = FixedPose::from_metres(-17.123, 12.345, 2.1);
    let rect = Rect::around(pose.position, (-19.0, 10.0), (-14.0, 15.5));
    let id = node(number);
    [Op::PutNode { id, kind: NodeKind::Support, pose }, Op::SetFreeSpace { id, rect: Some(rect) }]
}

fn encoded_len(ops: Vec<Op>) -> usize {
    encode(&Increment { author: node(0).author, number: 1234, hlc_us: 1_795_000_000_000_000, ops }).unwrap().len()
}

#[test]
fn a_support_node_takes_at_most_40_bytes() {
    // As an increment of its own; its rectangle follows when the next node is made.
    let [put, _] = support_node(300);
    let alone = encoded_len(vec![put]);
    assert!(alone <= 40, "{alone} bytes");
    // And with its rectangle, among others.
    let ten: Vec<Op> = (300..310).flat_map(support_node).collect();
    let eleven: Vec<Op> = (300..311).flat_map(support_node).collect();
    let each = encoded_len(eleven) - encoded_len(ten);
    assert!(each <= 40, "{each} bytes");
}

#[test]
fn format_version_1_is_unchanged() {
    let increment = Increment {
        author: AuthorId(0x1a2b_3c4d),
        number: 2,
        hlc_us: 1_000_000,
        ops: vec![
            Op::PutNode { id: node(1), kind: NodeKind::Support, pose: FixedPose::from_metres(1.5, -2.0, 0.5) },
            Op::SetFreeSpace { id: node(1), rect: Some(Rect { west_mm: 1, south_mm: 2, east_mm: 3, north_mm: 300 }) },
            Op::PutEdge { edge: EdgeKey::new(node(1), NodeId { author: AuthorId(9), number: 4 }) },
            Op::RemoveNode { id: node(0) },
        ],
    };
    let bytes = encode(&increment).unwrap();
    let hex: String = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
    assert_eq!(hex, GOLDEN, "bytes of format version 1 have changed: increase FORMAT_VERSION instead");
    assert_eq!(decode::<Increment>(&bytes).unwrap(), increment);
}

const GOLDEN: &str = "464854010126cdf8acd10102c0843d0400000101b8179f1f904e03000101010203ac02050001010904010000a420379e";

#[test]
fn foreign_bytes_are_named() {
    let bytes = encode(&main_node()).unwrap();
    let mut newer = bytes.clone();
    newer[3] = 2;
    assert_eq!(decode::<Increment>(&newer), Err(CodecError::Version { found: 2 }));
    assert_eq!(decode::<Increment>(b"{\"a\":1}"), Err(CodecError::Magic));
    assert_eq!(decode::<Descriptor>(&bytes), Err(CodecError::Kind { found: 1, expected: 2 }));
    let mut damaged = bytes.clone();
    damaged[100] ^= 1;
    assert_eq!(decode::<Increment>(&damaged), Err(CodecError::Checksum));
    let mut long = MAGIC.to_vec();
    long.extend([FORMAT_VERSION, Increment::KIND, 0xff, 0xff, 0xff, 0xff, 0x0f]);
    assert_eq!(decode::<Increment>(&long), Err(CodecError::TooLong { bytes: u32::MAX as usize }));
    assert!(MAX_BODY_BYTES < u32::MAX as usize);
}

#[test]
fn a_stated_length_reserves_no_memory() {
    // A body that announces 2^60 operations, and then a scan of 2^60 beams.
    let lots = [0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0x0f];
    let mut body = vec![1, 1, 1];
    body.extend(lots);
    assert!(matches!(decode::<Increment>(&envelope(Increment::KIND, &body)), Err(CodecError::Body(_))));
}

#[test]
fn what_makes_no_sense_is_refused() {
    let good = main_node();
    let refused = |change: &dyn Fn(&mut Increment)| {
        let mut bad = good.clone();
        change(&mut bad);
        assert!(matches!(encode(&bad), Err(CodecError::Invalid(_))), "{:?}", bad.ops.first());
    };
    refused(&|bad| bad.number = 0);
    refused(&|bad| bad.hlc_us = u64::MAX);
    refused(&|bad| bad.ops.clear());
    refused(&|bad| bad.ops = vec![Op::RemoveNode { id: node(1) }; Increment::MAX_OPS + 1]);
    refused(&|bad| bad.ops = vec![Op::PutEdge { edge: EdgeKey::new(node(1), node(1)) }]);
    refused(&|bad| {
        let pose = FixedPose { position: FixedPoint { x_mm: i32::MIN, y_mm: 0 }, yaw_e4: 0 };
        bad.ops = vec![Op::SetPose { id: node(1), pose }];
    });
    let signature_refused = |change: &dyn Fn(&mut Signature)| {
        refused(&|bad| {
            if let Some(Op::SetSignature { signature, .. }) = bad.ops.last_mut() {
                change(signature);
            }
        });
    };
    signature_refused(&|signature| signature.scan.angle_min = f32::NAN);
    signature_refused(&|signature| signature.scan.angle_increment = f32::INFINITY);
    signature_refused(&|signature| signature.scan.ranges_mm.clear());
    signature_refused(&|signature| signature.descriptor.as_mut().unwrap().scale = -1.0);
    signature_refused(&|signature| signature.descriptor.as_mut().unwrap().values = vec![0; 513]);
}
