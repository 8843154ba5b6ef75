//! The codec: what is encoded decodes to itself, no bytes make a decoder panic, messages are small,
//! and format version 2 is still read, and versions 3 and 4 stay what they are.
#![allow(clippy::unwrap_used)] // tests may panic

mod arbitrary;

use arbitrary::{descriptor, fold, increment, scan};
use fht_proto::api::compact::{
    CompactNode, CompactNodes, CompactNodesPage, CompactPath, CompactPathWithGoal, CompactWaypoint,
};
use fht_proto::api::reply::{NodesCursor, Series};
use fht_proto::codec::envelope::{
    FORMAT_VERSION, MAGIC, MAX_BODY_BYTES, Message, OLDEST_FORMAT_VERSION, is_canonical, seal,
};
use fht_proto::model::compaction::Rest;
use fht_proto::{
    AuthorId, CodecError, CompactedSeries, Datum, Descriptor, DescriptorModel, Digest, EdgeKey, FixedPoint, FixedPose,
    Increment, ModelId, NodeId, NodeKind, Op, PlanImage, Rect, Release, ReleaseId, ReleaseName, Signature,
    VersionVector, Zone, ZoneRule, decode, encode,
};
use proptest::prelude::*;

fn decode_all(bytes: &[u8]) {
    let _ = decode::<Increment>(bytes);
    let _ = decode::<Descriptor>(bytes);
    let _ = decode::<Series>(bytes);
    let _ = decode::<CompactedSeries>(bytes);
    let _ = decode::<CompactPath>(bytes);
    let _ = decode::<CompactPathWithGoal>(bytes);
    let _ = decode::<CompactNodes>(bytes);
    let _ = decode::<CompactNodesPage>(bytes);
}

/// A right envelope round any body, so that the body's decoder is reached.
fn envelope(kind: u8, body: &[u8]) -> Vec<u8> {
    seal(FORMAT_VERSION, kind, body).unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    #[test]
    fn an_increment_survives_the_wire(increment in increment()) {
        let bytes = encode(&increment).unwrap();
        prop_assert_eq!(decode::<Increment>(&bytes).unwrap(), increment);
    }

    #[test]
    fn a_series_survives_the_wire(
        folds in prop::collection::vec(fold(), 0..4), increments in prop::collection::vec(increment(), 0..4)
    ) {
        let series = Series { folds, increments };
        prop_assert_eq!(decode::<Series>(&encode(&series).unwrap()).unwrap(), series);
    }

    #[test]
    fn a_fold_survives_the_wire(fold in fold()) {
        prop_assert_eq!(decode::<CompactedSeries>(&encode(&fold).unwrap()).unwrap(), fold);
    }

    #[test]
    fn increments_of_the_format_before_are_read(increment in increment()) {
        let mut bytes = encode(&increment).unwrap();
        bytes[3] = OLDEST_FORMAT_VERSION;
        let end = bytes.len() - 4;
        let checksum = crc32fast::hash(&bytes[..end]).to_le_bytes();
        bytes[end..].copy_from_slice(&checksum);
        prop_assert_eq!(&decode::<Increment>(&bytes).unwrap(), &increment);
        prop_assert_eq!(is_canonical(&increment, &bytes).unwrap(), increment.ops.iter().all(|op| op.format() == 3));
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
        let alone = encode(&path).unwrap();
        prop_assert_eq!(&decode::<CompactPath>(&alone).unwrap(), &path);
        let (goal_moved_mm, unmapped_mm) = (1_660, x.unsigned_abs());
        let with_goal =
            |goal_yaw_e4| CompactPathWithGoal { path: path.clone(), goal_moved_mm, unmapped_mm, goal_yaw_e4 };
        for turned in [with_goal(None), with_goal(Some(-15_708))] {
            let bytes = encode(&turned).unwrap();
            prop_assert_eq!(&decode::<CompactPathWithGoal>(&bytes).unwrap(), &turned);
            // Either is refused where the other is expected, and not misread.
            prop_assert!(decode::<CompactPath>(&bytes).is_err() && decode::<CompactPathWithGoal>(&alone).is_err());
        }
        prop_assert!(encode(&with_goal(Some(31_417))).is_err());
        let node = CompactNode {
            id: node.unwrap_or(NodeId { author: AuthorId(0), number: 0 }),
            kind: NodeKind::Main,
            pose: FixedPose { position: point, yaw_e4: 5 },
            free_space: None,
            signature: Some(Signature { descriptor: None, scan }),
            similarity: cosine,
        };
        let nodes = CompactNodes { map: path.map, version: 3, nodes: vec![node] };
        prop_assert_eq!(&decode::<CompactNodes>(&encode(&nodes).unwrap()).unwrap(), &nodes);
        let next = number.map(|number| NodesCursor::Behind(u64::from(number), NodeId { author: AuthorId(7), number }));
        prop_assert!(next.is_none_or(|next| next.to_string().parse() == Ok(next)));
        let page = CompactNodesPage { nodes, next: next.map(|next| next.to_string()) };
        prop_assert_eq!(decode::<CompactNodesPage>(&encode(&page).unwrap()).unwrap(), page);
    }

    #[test]
    fn random_bytes_do_not_panic(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        decode_all(&bytes);
    }

    #[test]
    fn random_bodies_do_not_panic(kind in 0_u8..11, body in prop::collection::vec(any::<u8>(), 0..300)) {
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

/// About normal, of unit variance, and the same everywhere.
fn noise() -> impl FnMut() -> f64 {
    let mut state = 1_u64;
    move || {
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as f64 / f64::from(1_u32 << 31)
        };
        (0..12).map(|_| uniform()).sum::<f64>() - 6.0
    }
}

/// What the paper's scanner (360 beams, 7 m, 1 cm of noise) sees from a place in a hall of 5.2 m ×
/// 16 m with two columns.
fn hall_ranges_mm(noise: &mut impl FnMut() -> f64) -> Vec<u16> {
    let column = |(x, y): (f64, f64), (cos, sin): (f64, f64)| {
        let (along, across) = (x * cos + y * sin, y * cos - x * sin);
        if across.abs() < 0.3 && along > 0.0 { along - (0.09 - across * across).sqrt() } else { f64::INFINITY }
    };
    let range_m = |beam: u16| {
        let (sin, cos) = (f64::from(beam) * std::f64::consts::TAU / 360.0).sin_cos();
        let to_wall = |direction: f64, below: f64, above: f64| {
            if direction > 0.0 { above / direction } else { -below / direction.min(-1e-9) }
        };
        let walls = to_wall(cos, 8.0, 8.0).min(to_wall(sin, 2.2, 3.0));
        walls.min(column((2.0, 1.5), (cos, sin))).min(column((-3.0, -1.0), (cos, sin)))
    };
    let step = f64::from(fht_proto::ScanRecord::STEP_MM);
    let measured = |range: f64, noise: f64| ((1000.0 * range + 10.0 * noise) / step).round() * step;
    (0..360).map(range_m).map(|r| if r < 7.0 { measured(r, noise()) as u16 } else { 0 }).collect()
}

fn main_node() -> Increment {
    let mut noise = noise();
    let components: Vec<f32> = (0..256).map(|_| noise() as f32).collect();
    let signature = Signature {
        descriptor: Some(Descriptor::quantise(ModelId(0xdead_beef), &components)),
        scan: fht_proto::ScanRecord {
            base_from_sensor: FixedPose::from_metres(-0.032, 0.0, 0.0),
            angle_min: 0.0,
            angle_increment: std::f32::consts::TAU / 360.0,
            ranges_mm: hall_ranges_mm(&mut noise),
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
fn a_main_node_takes_at_most_450_bytes() {
    let bytes = encode(&main_node()).unwrap().len();
    assert!(bytes <= 450, "{bytes} bytes");
}

#[test]
fn a_quantised_descriptor_is_as_good_as_the_components() {
    let mut noise = noise();
    let components: Vec<f32> = (0..256).map(|_| noise() as f32).collect();
    let quantised = Descriptor::quantise(ModelId(1), &components).components();
    let dot = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f32>();
    let cosine = dot(&components, &quantised) / (dot(&components, &components) * dot(&quantised, &quantised)).sqrt();
    assert!(cosine > 0.997, "{cosine}");
    let alone: Vec<f32> = (0..Descriptor::MAX_DIMENSION).map(|at| f32::from(u8::from(at == 7))).collect();
    assert!((Descriptor::quantise(ModelId(1), &alone).components()[7] - 1.0).abs() < 0.01, "one component alone");
    assert_eq!(Descriptor::quantise(ModelId(1), &[0.0, f32::NAN]).values, [0, 0]);
}

#[test]
fn little_never_unpacks_to_much() {
    let none = fht_proto::ScanRecord {
        base_from_sensor: FixedPose::default(),
        angle_min: 0.0,
        angle_increment: 0.001,
        ranges_mm: vec![0; fht_proto::ScanRecord::MAX_BEAMS],
    };
    let signature = Signature { descriptor: None, scan: none };
    let ops = vec![Op::SetSignature { id: node(0), signature }];
    let increment = Increment { ops, ..main_node() };
    let bytes = encode(&increment).unwrap();
    assert!(increment.memory_bytes() < 40 * bytes.len(), "{} bytes", bytes.len());
    assert_eq!(decode::<Increment>(&bytes).unwrap(), increment);
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
fn a_support_node_takes_at_most_40_bytes_alone_and_24_among_others() {
    // As an increment of its own; its rectangle follows when the next node is made.
    let [put, _] = support_node(300);
    let alone = encoded_len(vec![put]);
    assert!(alone <= 40, "{alone} bytes");
    // And with its rectangle, among others.
    let ten: Vec<Op> = (300..310).flat_map(support_node).collect();
    let eleven: Vec<Op> = (300..311).flat_map(support_node).collect();
    let each = encoded_len(eleven) - encoded_len(ten);
    assert!(each <= 24, "{each} bytes");
}

fn hex<M: Message>(message: &M) -> String {
    encode(message).unwrap().iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Every operation once, with small contents.
fn one_of_each() -> Increment {
    let id = node(1);
    let edge = EdgeKey::new(node(1), NodeId { author: AuthorId(9), number: 4 });
    let pose = FixedPose::from_metres(1.5, -2.0, 0.5);
    let descriptor = Some(Descriptor { model: ModelId(3), scale: 0.5, values: vec![-1, 2, 0, 127, -128] });
    let scan = fht_proto::ScanRecord {
        base_from_sensor: FixedPose::from_metres(-0.032, 0.0, 0.0),
        angle_min: -1.0,
        angle_increment: 0.25,
        ranges_mm: vec![0, 1500, 1510, 1520, 1535, 4000, 0, 0, 5],
    };
    let model = DescriptorModel { id: ModelId(3), name: "net".to_owned(), dimension: 5, match_threshold_e3: -700 };
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

/// The operations that came with format 3, with small contents.
fn one_of_each_since_3() -> Increment {
    let edge = EdgeKey::new(node(1), NodeId { author: AuthorId(9), number: 4 });
    let pose = FixedPose::from_metres(1.5, -2.0, 0.5);
    let corners = [(0, 0), (1000, 0), (0, -1000)].map(|(x_mm, y_mm)| FixedPoint { x_mm, y_mm }).to_vec();
    let mut vector = VersionVector::default();
    vector.set(node(1).author, 300);
    let name: ReleaseName = "2026-11-21.1".parse().unwrap();
    let id = ReleaseId { author: AuthorId(9), name: name.clone() };
    Increment {
        ops: vec![
            Op::SetTrust { id: node(1), percent: 40 },
            Op::SetClosed { edge, closed: true },
            Op::SetPlace { name: "dock".parse().unwrap(), pose: Some(pose) },
            Op::SetPlace { name: "dock".parse().unwrap(), pose: None },
            Op::SetZone { name: "lab".parse().unwrap(), zone: Some(Zone { rule: ZoneRule::SpeedLimit(300), corners }) },
            Op::SetZone { name: "lab".parse().unwrap(), zone: None },
            Op::PutRelease { name, release: Release { vector, digest: Digest([7; 32]) } },
            Op::RemoveRelease { id: id.clone() },
            Op::Enable { release: Some(id) },
            Op::Enable { release: None },
        ],
        ..one_of_each()
    }
}

/// The operations that came with format 4.
fn one_of_each_since_4() -> Increment {
    let map_from_image = FixedPose::from_metres(1.5, -2.0, 0.5);
    let plan = PlanImage { image: "plan.png".to_owned(), um_per_pixel: 50_000, map_from_image };
    Increment {
        ops: vec![
            Op::SetFloorPlan { plan: Some(plan) },
            Op::SetFloorPlan { plan: None },
            Op::SetDatum { datum: Some(Datum::from_degrees(52.5186, -13.3973, 0.25)) },
            Op::SetDatum { datum: None },
        ],
        ..one_of_each()
    }
}

#[test]
fn what_needs_format_4_is_written_in_it_and_nothing_else() {
    let since = one_of_each_since_4();
    let bytes = encode(&since).unwrap();
    assert_eq!(hex(&since), GOLDEN_INCREMENT_SINCE_4);
    assert_eq!(decode::<Increment>(&from_hex(GOLDEN_INCREMENT_SINCE_4)).unwrap(), since);
    assert!(is_canonical(&since, &bytes).unwrap());
    let rests = vec![Rest { number: 4, hlc_us: 9, ops: vec![(1, Op::SetDatum { datum: None })] }];
    let fold = CompactedSeries { author: node(1).author, first: 3, last: 300, rests };
    let series = Series { folds: Vec::new(), increments: vec![one_of_each(), since.clone()] };
    let formats = [bytes[3], encode(&fold).unwrap()[3], encode(&series).unwrap()[3]];
    assert_eq!(formats, [4, 4, 4]);
    // Neither is what says that it is older than its operations, nor what says that it is newer.
    let said = |increment: &Increment, version: u8| {
        let bytes = encode(increment).unwrap();
        let body = &bytes[6..bytes.len() - 4];
        seal(version, Increment::KIND, body).unwrap()
    };
    assert!(!is_canonical(&since, &said(&since, 3)).unwrap());
    let plain = Increment { ops: vec![Op::RemoveNode { id: node(0) }], ..one_of_each() };
    for (version, is_so) in [(2, true), (3, true), (4, false)] {
        assert_eq!(is_canonical(&plain, &said(&plain, version)).unwrap(), is_so, "{version}");
    }
}

fn from_hex(hex: &str) -> Vec<u8> {
    (0..hex.len()).step_by(2).map(|at| u8::from_str_radix(&hex[at..at + 2], 16).unwrap()).collect()
}

#[test]
fn every_message_of_format_version_3_is_unchanged() {
    let (before, since) = (one_of_each(), one_of_each_since_3());
    let descriptor = Descriptor { model: ModelId(3), scale: 0.5, values: vec![-1, 2, 0, 127, -128] };
    let rests = vec![Rest { number: 4, hlc_us: 9, ops: vec![(1, Op::RemoveNode { id: node(1) })] }];
    let fold = CompactedSeries { author: node(1).author, first: 3, last: 300, rests };
    let series = Series { folds: vec![fold.clone()], increments: vec![before.clone(), since.clone()] };
    for (bytes, golden) in [
        (hex(&before), GOLDEN_INCREMENT),
        (hex(&since), GOLDEN_INCREMENT_SINCE_3),
        (hex(&descriptor), GOLDEN_DESCRIPTOR),
        (hex(&fold), GOLDEN_FOLD),
        (hex(&Series::default()), GOLDEN_EMPTY_SERIES),
        (hex(&series), GOLDEN_SERIES),
    ] {
        assert_eq!(bytes, golden, "bytes of format version 3 have changed: increase FORMAT_VERSION instead");
    }
    assert_eq!(decode::<Increment>(&from_hex(GOLDEN_INCREMENT)).unwrap(), before);
    assert_eq!(decode::<Increment>(&from_hex(GOLDEN_INCREMENT_SINCE_3)).unwrap(), since);
    assert_eq!(decode::<Descriptor>(&from_hex(GOLDEN_DESCRIPTOR)).unwrap(), descriptor);
    assert_eq!(decode::<CompactedSeries>(&from_hex(GOLDEN_FOLD)).unwrap(), fold);
    assert_eq!(decode::<Series>(&from_hex(GOLDEN_SERIES)).unwrap(), series);
}

#[test]
fn increments_stored_in_format_version_2_are_read() {
    let bytes = from_hex(GOLDEN_INCREMENT_2);
    assert_eq!(decode::<Increment>(&bytes).unwrap(), one_of_each());
    assert!(is_canonical(&one_of_each(), &bytes).unwrap());
}

const GOLDEN_INCREMENT_2: &str = "\
    464854020161cdf8acd10102c0843d08000400b8179f1f904e01020204b8179f1f904e030000040001030000003f0508181f\
    fe0d2fff0a703f0000000080bf0000803e0509100025fff02002017ff81bf083ffe058d005090900060909000703036e6574\
    05f70a806411d3";
const GOLDEN_INCREMENT: &str = "\
    464854030161cdf8acd10102c0843d08000400b8179f1f904e01020204b8179f1f904e030000040001030000003f0508181f\
    fe0d2fff0a703f0000000080bf0000803e0509100025fff02002017ff81bf083ffe058d005090900060909000703036e6574\
    05f70a1da28ea6";
const GOLDEN_INCREMENT_SINCE_3: &str = "\
    46485403019501cdf8acd10102c0843d0a08042809090900010a04646f636b01b8179f1f904e0a04646f636b000b036c6162\
    0101ac02030000d00f0000cf0f0b036c6162000c0c323032362d31312d32312e3101cdf8acd101ac02070707070707070707\
    07070707070707070707070707070707070707070707070d090c323032362d31312d32312e310e01090c323032362d31312d\
    32312e310e0089902467";
const GOLDEN_INCREMENT_SINCE_4: &str = "\
    464854040131cdf8acd10102c0843d040f0108706c616e2e706e67d08603b8179f1f904e0f00100180f5d1a58703bfccd4e8\
    6388271000d5d03367";
const GOLDEN_DESCRIPTOR: &str = "46485403020f030000003f0508181ffe0d2fff0a70eadf741e";
const GOLDEN_FOLD: &str = "46485403070fcdf8acd10103ac020104090101010495335589";
const GOLDEN_EMPTY_SERIES: &str = "46485403060200009e94640b";
const GOLDEN_SERIES: &str = "\
    4648540306870201cdf8acd10103ac020104090101010402cdf8acd10102c0843d08000400b8179f1f904e01020204b8179f\
    1f904e030000040001030000003f0508181ffe0d2fff0a703f0000000080bf0000803e0509100025fff02002017ff81bf083\
    ffe058d005090900060909000703036e657405f70acdf8acd10102c0843d0a08042809090900010a04646f636b01b8179f1f\
    904e0a04646f636b000b036c61620101ac02030000d00f0000cf0f0b036c6162000c0c323032362d31312d32312e3101cdf8\
    acd101ac0207070707070707070707070707070707070707070707070707070707070707070d090c323032362d31312d3231\
    2e310e01090c323032362d31312d32312e310e00574b0be3";

#[test]
fn foreign_bytes_are_named() {
    let bytes = encode(&main_node()).unwrap();
    let mut newer = bytes.clone();
    newer[3] = FORMAT_VERSION + 1;
    assert_eq!(decode::<Increment>(&newer), Err(CodecError::Version { found: FORMAT_VERSION + 1 }));
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
    // What comes before each count: an increment's author, number, clock; then, for the later ones,
    // one operation that sets the signature of node 0.
    let increment = vec![1, 1, 1];
    let signature = [increment.clone(), vec![1, 4, 0]].concat();
    let descriptor = [vec![1], 1.0_f32.to_le_bytes().to_vec()].concat();
    let scan = [vec![0; 3 + 8], vec![1]].concat();
    let before_peak = peak_kib();
    // Sixteen thousand million are 16 GiB of the smallest items: a system that promises more than
    // it has would give them.
    for count in [1 << 20, 1 << 34, 1 << 60] {
        let with = |parts: &[&[u8]]| [parts.concat(), varint(count)].concat();
        let refused = |what: &str, error: Option<CodecError>| {
            assert!(matches!(error, Some(CodecError::Body(_))), "{count} {what}: {error:?}");
        };
        let as_increment = |parts: &[&[u8]]| decode::<Increment>(&envelope(Increment::KIND, &with(parts))).err();
        refused("operations", as_increment(&[&increment]));
        refused("beams", as_increment(&[&signature, &[0], &scan]));
        refused("bytes of a scan", as_increment(&[&signature, &[0], &scan, &[16]]));
        refused("descriptor values", as_increment(&[&signature, &[1], &descriptor]));
        refused("bytes of a descriptor", as_increment(&[&signature, &[1], &descriptor, &[8]]));
        refused("letters of a model's name", as_increment(&[&increment, &[1, 7, 1]]));
        refused("increments", decode::<Series>(&envelope(Series::KIND, &with(&[]))).err());
        refused("values", decode::<Descriptor>(&envelope(Descriptor::KIND, &with(&[&descriptor]))).err());
        // With a stream that is too short for them, too.
        let beams = [with(&[&signature, &[0], &scan]), vec![1, 0]].concat();
        refused("beams in a byte", decode::<Increment>(&envelope(Increment::KIND, &beams)).err());
        let name = [1, b'm', 1];
        refused("waypoints", decode::<CompactPath>(&envelope(CompactPath::KIND, &with(&[&name]))).err());
        refused(
            "waypoints",
            decode::<CompactPathWithGoal>(&envelope(CompactPathWithGoal::KIND, &with(&[&name]))).err(),
        );
        refused("nodes", decode::<CompactNodes>(&envelope(CompactNodes::KIND, &with(&[&name]))).err());
    }
    // That the bodies are right up to the count shows when the count is.
    // One beam without a return: an empty run of returns, then a run of one.
    let fine = [signature, vec![0], scan, vec![1, 2, 0, 0b0010_0000]].concat();
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
