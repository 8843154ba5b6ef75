//! The codec: what is encoded decodes to itself, no bytes make a decoder panic, messages are small, and format version 1
//! stays what it is.
#![allow(clippy::unwrap_used)] // tests may panic

mod arbitrary;

use arbitrary::{descriptor, increment, scan};
use fht_proto::compact::{CompactNode, CompactNodes, CompactPath, CompactWaypoint};
use fht_proto::envelope::{FORMAT_VERSION, MAGIC, MAX_BODY_BYTES, Message};
use fht_proto::query::Snapshot;
use fht_proto::{
    AuthorId, CodecError, Descriptor, DescriptorModel, EdgeKey, FixedPoint, FixedPose, Increment, ModelId, NodeId,
    NodeKind, Op, Rect, Signature, decode, encode,
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

fn hex<M: Message>(message: &M) -> String {
    encode(message).unwrap().iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Every operation once, with small contents.
fn one_of_each() -> Increment {
    let id = node(1);
    let edge = EdgeKey::new(node(1), NodeId { author: AuthorId(9), number: 4 });
    let pose = FixedPose::from_metres(1.5, -2.0, 0.5);
    let descriptor = Some(Descriptor { model: ModelId(3), scale: 0.5, values: vec![-1, 2] });
    let scan = fht_proto::ScanRecord {
        base_from_sensor: FixedPose::from_metres(-0.032, 0.0, 0.0),
        angle_min: -1.0,
        angle_increment: 0.25,
        ranges_mm: vec![0, 1500],
    };
    let model = DescriptorModel { id: ModelId(3), name: "net".to_owned(), dimension: 2, match_threshold_e3: -700 };
    Increment {
        author: id.author,
        number: 2,
        hlc_us: 1_000_000,
        ops: vec![
            Op::PutNode { id, kind: NodeKind::Main, pose },
            Op::RemoveNode { id: node(0) },
            Op::SetPose { id, pose },
            Op::SetFreeSpace { id, rect: None },
            Op::SetSignature { id, signature: Signature { descriptor, scan } },
            Op::PutEdge { edge },
            Op::RemoveEdge { edge },
            Op::PutModel { model },
        ],
    }
}

#[test]
fn every_message_of_format_version_1_is_unchanged() {
    let increment = one_of_each();
    let descriptor = Descriptor { model: ModelId(3), scale: 0.5, values: vec![-1, 2] };
    let series = Snapshot { increments: vec![increment.clone(), Increment { number: 3, ..increment.clone() }] };
    for (bytes, golden) in [
        (hex(&increment), GOLDEN_INCREMENT),
        (hex(&descriptor), GOLDEN_DESCRIPTOR),
        (hex(&Snapshot::default()), GOLDEN_EMPTY_SERIES),
        (hex(&series), GOLDEN_SERIES),
    ] {
        assert_eq!(bytes, golden, "bytes of format version 1 have changed: increase FORMAT_VERSION instead");
    }
    let bytes = |hex: &str| -> Vec<u8> {
        (0..hex.len()).step_by(2).map(|at| u8::from_str_radix(&hex[at..at + 2], 16).unwrap()).collect()
    };
    assert_eq!(decode::<Increment>(&bytes(GOLDEN_INCREMENT)).unwrap(), increment);
    assert_eq!(decode::<Descriptor>(&bytes(GOLDEN_DESCRIPTOR)).unwrap(), descriptor);
    assert_eq!(decode::<Snapshot>(&bytes(GOLDEN_SERIES)).unwrap(), series);
}

const GOLDEN_INCREMENT: &str = "\
    464854010154cdf8acd10102c0843d0800000100b8179f1f904e010000020001b8179f1f904e030001000400010103000000\
    3f02ff023f0000000080bf0000803e0200dc0b0500010109040600010109040703036e657402f70a95036470";
const GOLDEN_DESCRIPTOR: &str = "464854010208030000003f02ff02f4ecf996";
const GOLDEN_EMPTY_SERIES: &str = "464854010301004a96ce37";
const GOLDEN_SERIES: &str = "\
    4648540103a90102cdf8acd10102c0843d0800000100b8179f1f904e010000020001b8179f1f904e03000100040001010300\
    00003f02ff023f0000000080bf0000803e0200dc0b0500010109040600010109040703036e657402f70acdf8acd10103c084\
    3d0800000100b8179f1f904e010000020001b8179f1f904e0300010004000101030000003f02ff023f0000000080bf000080\
    3e0200dc0b0500010109040600010109040703036e657402f70a38492296";

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

/// Greatest virtual memory of this process so far, KiB, where the system tells.
fn peak_kib() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmPeak"))?;
    line.split_whitespace().nth(1)?.parse().ok()
}

#[test]
fn a_stated_length_reserves_no_memory() {
    let varint = |mut count: u64| {
        let mut bytes = Vec::new();
        while count >= 0x80 {
            bytes.push(count as u8 | 0x80);
            count >>= 7;
        }
        bytes.push(count as u8);
        bytes
    };
    // What comes before each count: an increment's author, number, clock; then, for the later ones, one operation that sets
    // the signature of node 0.
    let increment = vec![1, 1, 1];
    let signature = [increment.clone(), vec![1, 4, 0, 0]].concat();
    let descriptor = [vec![1], 1.0_f32.to_le_bytes().to_vec()].concat();
    let scan = vec![0; 3 + 8];
    let before_peak = peak_kib();
    // Sixteen thousand million are 16 GiB of the smallest items: a system that promises more than it has would give them.
    for count in [1 << 20, 1 << 34, 1 << 60] {
        let with = |parts: &[&[u8]]| [parts.concat(), varint(count)].concat();
        let refused = |what: &str, error: Option<CodecError>| {
            assert!(matches!(error, Some(CodecError::Body(_))), "{count} {what}: {error:?}");
        };
        let as_increment = |parts: &[&[u8]]| decode::<Increment>(&envelope(Increment::KIND, &with(parts))).err();
        refused("operations", as_increment(&[&increment]));
        refused("beams", as_increment(&[&signature, &[0], &scan]));
        refused("descriptor values", as_increment(&[&signature, &[1], &descriptor]));
        refused("letters of a model's name", as_increment(&[&increment, &[1, 7, 1]]));
        refused("increments", decode::<Snapshot>(&envelope(Snapshot::KIND, &with(&[]))).err());
        refused("values", decode::<Descriptor>(&envelope(Descriptor::KIND, &with(&[&descriptor]))).err());
        let name = [1, b'm', 1];
        refused("waypoints", decode::<CompactPath>(&envelope(CompactPath::KIND, &with(&[&name]))).err());
        refused("nodes", decode::<CompactNodes>(&envelope(CompactNodes::KIND, &with(&[&name]))).err());
    }
    // That the bodies are right up to the count shows when the count is.
    let fine = [signature, vec![0], scan, vec![1, 0]].concat();
    assert!(decode::<Increment>(&envelope(Increment::KIND, &fine)).is_ok());
    if let (Some(before), Some(after)) = (before_peak, peak_kib()) {
        assert!(after - before < 12 << 20, "{} MiB were reserved", (after - before) >> 10);
    }
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
