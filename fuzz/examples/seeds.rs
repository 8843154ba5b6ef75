//! Writes the first inputs of every target into `corpus/`: small messages of every sort, as robots
//! and tools send them.

use fht_proto::api::compact::{
    CompactNode, CompactNodes, CompactNodesPage, CompactPath, CompactPathWithGoal, CompactWaypoint,
};
use fht_proto::api::reply::Series;
use fht_proto::codec::archive::{ArchiveHeader, header_line};
use fht_proto::codec::envelope::Message;
use fht_proto::model::compaction::Rest;
use fht_proto::{
    AuthorId, CompactedSeries, Datum, Descriptor, DescriptorModel, Digest, EdgeKey, FixedPoint, FixedPose, PlanImage, Increment, ModelId,
    NodeId, NodeKind, Op, Rect, Release, ReleaseId, ScanRecord, SeenArea, Signature, Square, VersionVector, Zone,
    ZoneRule, encode,
};
use fht_ros_messages::cdr;
use fht_ros_messages::msg::{HeaderMsg, Image, LaserScanMsg, OdometryMsg, Pose, TfMessage, Time, TransformStamped};
use std::error::Error;
use std::path::Path;

const ANA: AuthorId = AuthorId(0xa);

fn node(number: u32) -> NodeId {
    NodeId { author: ANA, number }
}

fn signature(seed: u32) -> Signature {
    let components: Vec<f32> = (0..16).map(|i| ((i * (seed + 1)) as f32 * 0.37).sin()).collect();
    let scan = ScanRecord {
        base_from_sensor: FixedPose::default(),
        angle_min: 0.0,
        angle_increment: 0.4,
        ranges_mm: (0..16).map(|i| 1000 + 100 * i).collect(),
    };
    Signature { descriptor: Some(Descriptor::quantise(ModelId(1), &components)), scan }
}

/// A robot that drives along a corridor, a node a metre; every third is a main node.
fn increment(number: u64) -> Increment {
    let index = number as u32 - 1;
    let (id, x) = (node(index), f64::from(index));
    let pose = FixedPose::from_metres(x, 0.0, 0.1);
    let kind = if index.is_multiple_of(3) { NodeKind::Main } else { NodeKind::Support };
    let rect = Rect::around(pose.position, (x - 0.6, -1.0), (x + 0.6, 1.0));
    let mut ops = vec![Op::PutNode { id, kind, pose }, Op::SetFreeSpace { id, rect: Some(rect) }];
    if kind == NodeKind::Main {
        ops.push(Op::SetSignature { id, signature: signature(index) });
    }
    if index > 0 {
        ops.push(Op::PutEdge { edge: EdgeKey::new(node(index - 1), id) });
    }
    Increment { author: ANA, number, hlc_us: 1_000_000 + number, ops }
}

/// What operators write.
fn operated() -> Result<Increment, Box<dyn Error>> {
    let corners = [(2000, -2000), (3000, -2000), (3000, 0), (2000, 0)];
    let corners: Vec<FixedPoint> = corners.iter().map(|&(x_mm, y_mm)| FixedPoint { x_mm, y_mm }).collect();
    let mut vector = VersionVector::default();
    vector.set(ANA, 5);
    let id: ReleaseId = "2026-11-21.1@00000009".parse()?;
    let model = DescriptorModel { id: ModelId(1), name: "net".to_owned(), dimension: 16, match_threshold_e3: 700 };
    let ops = vec![
        Op::PutModel { model },
        Op::SetTrust { id: node(1), percent: 40 },
        Op::SetClosed { edge: EdgeKey::new(node(3), node(4)), closed: true },
        Op::SetPlace { name: "dock".parse()?, pose: Some(FixedPose::from_metres(4.0, 0.0, 1.0)) },
        Op::SetZone { name: "wet".parse()?, zone: Some(Zone { rule: ZoneRule::KeepOut, corners: corners.clone() }) },
        Op::SetZone { name: "lab".parse()?, zone: Some(Zone { rule: ZoneRule::SpeedLimit(300), corners }) },
        Op::SetFloorPlan {
            plan: Some(PlanImage { image: "a.png".to_owned(), um_per_pixel: 50_000, map_from_image: FixedPose::default() }),
        },
        Op::SetDatum { datum: Some(Datum::from_degrees(52.5, 13.4, 0.5)) },
        Op::PutRelease { name: id.name.clone(), release: Release { vector, digest: Digest([7; 32]) } },
        Op::Enable { release: Some(id.clone()) },
        Op::RemoveRelease { id },
        Op::SetPose { id: node(2), pose: FixedPose::from_metres(2.0, 0.1, 0.0) },
        Op::RemoveEdge { edge: EdgeKey::new(node(0), node(1)) },
        Op::RemoveNode { id: node(0) },
    ];
    Ok(Increment { author: AuthorId(9), number: 1, hlc_us: 2_000_000, ops })
}

/// What stands between length and checksum.
fn body<M: Message>(message: &M) -> Result<Vec<u8>, Box<dyn Error>> {
    let bytes = encode(message)?;
    let varint = 1 + bytes[5..].iter().take_while(|&&byte| byte >= 0x80).count();
    Ok(bytes[5 + varint..bytes.len() - 4].to_vec())
}

/// Queries as tools put them.
const SELECTORS: [&str; 11] = [
    "fht/maps",
    "fht/museum/path?from=0,0;to=5,3",
    "fht/museum/path?from=0000000a.1;to=dock;release=head;fmt=postcard",
    "fht/museum/nodes?near=0,0;radius=3;limit=5",
    "fht/museum/since?vector=0000000a:3,00000009:1;max_bytes=600;piece_bytes=200",
    "fht/museum/snapshot?release=2026-11-21.1@00000009;have=0000000a:3",
    "fht/museum/diff?from=17;to=0000000a:3",
    "fht/museum/admin/retain?keep=100",
    "fht/museum/match?limit=3\nFHT",
    "fht/museum/robots/r1/blocked",
    "fht/museum/inc/0000000a/17",
];
/// What servers and robots say as JSON.
const MESSAGES: [&str; 6] = [
    r#"{"map":"m","version":3,"vector":{"0000000a":3},"digest":"0707070707070707070707070707070707070707070707070707070707070707","clock_us":9,"enabled":"a@0000000a","main_nodes":3,"support_nodes":4,"edges":5,"bytes":6,"refused":0}"#,
    r#"{"for_s":60,"edges":[["0000000a.1","0000000a.2"]],"places":[[1.5,-2]]}"#,
    r#"{"robot":"r1","role":"client","map":"m","version":3,"vector":{"0000000a":3},"state":"LOCALIZED","map_from_base":[1,2,0.5]}"#,
    r#"{"map":"m","version":1,"length_m":1.5,"waypoints":[{"x":0,"y":1,"node":"0000000a.1"}],"obeyed":[{"rule":"keep_out","zone":"wet"}],"speed_limits":[{"zone":"lab","max_mps":0.3,"along_m":[0,1]}]}"#,
    r#"{"code":"NO_PATH","message":"no"}"#,
    r#"{"at":[0,1],"target":[2,3],"remaining_m":4}"#,
];

fn main() -> Result<(), Box<dyn Error>> {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus");
    let write = |target: &str, name: &str, bytes: &[u8]| -> Result<(), Box<dyn Error>> {
        std::fs::create_dir_all(corpus.join(target))?;
        Ok(std::fs::write(corpus.join(target).join(name), bytes)?)
    };
    let increments: Vec<Increment> = (1..=6).map(increment).chain([operated()?]).collect();
    let mut row = Vec::new();
    for (index, increment) in increments.iter().enumerate() {
        let bytes = body(increment)?;
        write("increment", &format!("seed-{index}"), &bytes)?;
        row.extend(u16::try_from(bytes.len())?.to_le_bytes());
        row.extend(bytes);
    }
    write("map", "seed-corridor", &row)?;
    let rest = |increment: &Increment| Rest {
        number: increment.number,
        hlc_us: increment.hlc_us,
        ops: increment.ops.iter().cloned().zip(0..).map(|(op, index)| (index, op)).collect(),
    };
    let rests = increments.iter().take(4).map(rest).collect();
    let fold = CompactedSeries { author: ANA, first: 1, last: 4, rests };
    write("fold", "seed-0", &body(&fold)?)?;
    let series = Series { folds: vec![fold], increments: increments[4..].to_vec() };
    write("series", "seed-0", &body(&series)?)?;
    let mut judged = increments.clone();
    judged.push(Increment { author: AuthorId(0xb), ..increments[4].clone() });
    write("roles", "seed-0", &body(&Series { folds: Vec::new(), increments: judged })?)?;
    write_commands()?;
    if let Some(descriptor) = &signature(3).descriptor {
        write("replies", "seed-descriptor", &body(descriptor)?)?;
    }
    let (map, point) = ("museum".parse()?, FixedPoint { x_mm: 5, y_mm: -7 });
    let path = CompactPath { map, version: 3, waypoints: vec![CompactWaypoint { point, node: Some(node(1)) }] };
    write("replies", "seed-path", &body(&path)?)?;
    let with_goal =
        CompactPathWithGoal { path: path.clone(), goal_moved_mm: 1660, unmapped_mm: 0, goal_yaw_e4: Some(15_708) };
    write("replies", "seed-path-with-goal", &body(&with_goal)?)?;
    let compact = CompactNode {
        id: node(1),
        kind: NodeKind::Main,
        pose: FixedPose { position: point, yaw_e4: 5 },
        free_space: Some(Rect::default()),
        signature: Some(signature(1)),
        similarity: Some(0.5),
    };
    let nodes = CompactNodes { map: path.map.clone(), version: 3, nodes: vec![compact] };
    write("replies", "seed-nodes", &body(&nodes)?)?;
    let page = CompactNodesPage { nodes, next: Some("25000000_0000000a.1".to_owned()) };
    write("replies", "seed-nodes-page", &body(&page)?)?;
    use Square::{Free, Occupied, Unseen};
    let runs = SeenArea::runs_of([Unseen, Free, Free, Occupied, Unseen, Free]);
    let seen = SeenArea { author: ANA, upto: 6, square_mm: 200, west: -1, south: 2, width: 3, runs };
    write("replies", "seed-seen", &body(&seen)?)?;
    let mut vector = VersionVector::default();
    vector.set(ANA, 6);
    let mut file = header_line(&ArchiveHeader::new(path.map, vector, Digest([1; 32])))?;
    file.extend(encode(&series)?);
    write("archive", "seed-0", &file)?;
    for (index, selector) in SELECTORS.iter().enumerate() {
        write("selector", &format!("seed-{index}"), selector.as_bytes())?;
    }
    for (index, json) in MESSAGES.iter().enumerate() {
        write("json", &format!("seed-{index}"), json.as_bytes())?;
    }
    write("bag", "seed-0", &recorded()?)?;
    for (index, file) in buildings().iter().enumerate() {
        write("world", &format!("seed-{index}"), file)?;
    }
    Ok(())
}

/// What the targets of the server read: writers that take turns, and changes to a file.
fn write_commands() -> Result<(), Box<dyn Error>> {
    let turns =
        |map: u8| (0..120_u8).flat_map(move |turn| [0x80 | (turn % 5), map.wrapping_mul(turn), turn & 0x87, 40]);
    write("quotas", "seed-0", &turns(0).collect::<Vec<_>>())?;
    write("quotas", "seed-1", &turns(1).collect::<Vec<_>>())?;
    let change = |page: u32, at: u32| [&(page * 4096 + at).to_le_bytes()[..], &[0xff, 3]].concat();
    write("rescue", "seed-0", &[change(0, 9), change(3, 100), change(7, 2000)].concat())?;
    write("rescue", "seed-1", &[0, 0x80, 1])
}

/// Two rounds of what a robot with a scanner records.
fn recorded() -> Result<Vec<u8>, Box<dyn Error>> {
    let mut run = Vec::new();
    let mut add = |topic: u8, bytes: Vec<u8>| -> Result<(), Box<dyn Error>> {
        run.push(topic);
        run.extend(u16::try_from(bytes.len())?.to_le_bytes());
        run.extend(bytes);
        Ok(())
    };
    for round in 0..2 {
        let header = |frame: &str| HeaderMsg {
            stamp: Time { sec: 1, nanosec: 100_000_000 * round },
            frame_id: frame.to_owned(),
        };
        let link = |parent: &str, child: &str| TransformStamped {
            header: header(parent),
            child_frame_id: child.to_owned(),
            transform: Pose::default(),
        };
        add(3, cdr::encode(&TfMessage { transforms: vec![link("base_link", "laser")] })?)?;
        add(2, cdr::encode(&TfMessage { transforms: vec![link("odom", "base_link")] })?)?;
        add(
            1,
            cdr::encode(&OdometryMsg {
                header: header("odom"),
                child_frame_id: "base_link".to_owned(),
                ..OdometryMsg::default()
            })?,
        )?;
        let scan = LaserScanMsg {
            header: header("laser"),
            angle_max: 3.0,
            angle_increment: 0.5,
            range_min: 0.1,
            range_max: 7.0,
            ranges: vec![1.0, 2.0, f32::INFINITY, 3.0, f32::NAN, 1.5, 2.5],
            ..LaserScanMsg::default()
        };
        add(0, cdr::encode(&scan)?)?;
        let picture = Image {
            header: header("camera_front"),
            height: 2,
            width: 2,
            encoding: "rgb8".to_owned(),
            is_bigendian: 0,
            step: 6,
            data: &[7; 12],
        };
        add(4, cdr::encode(&picture)?)?;
    }
    Ok(run)
}

/// A floor plan, a room in SDF, and a board as a mesh of each sort.
fn buildings() -> [Vec<u8>; 5] {
    let mut floor = b"\x00image: map.pgm\nresolution: 0.5\norigin: [-1, -1, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.2\n\0".to_vec();
    floor.extend(b"P5 6 6 255\n");
    floor.extend((0..36).map(|cell| if matches!(cell % 6, 0 | 5) || !(6..30).contains(&cell) { 0 } else { 255 }));
    let wall = |pose: &str, size: &str| {
        format!(
            "<collision name='c'><pose>{pose} 0 0 0</pose><geometry><box><size>{size}</size></box></geometry></collision>"
        )
    };
    let room = format!(
        "\x01<sdf version='1.6'><world name='w'><model name='m'><static>true</static><link name='l'>{}{}</link></model>\
         <include><uri>model://none</uri><pose>1 2 0 0 0 0</pose></include></world></sdf>",
        wall("2 0 0.5", "0.1 4 1"),
        wall("-2 0 0.5", "0.1 4 1")
    );
    let collada = "\x02<COLLADA version='1.4.1'><asset><unit meter='0.01'/><up_axis>Z_UP</up_axis></asset>\
        <library_geometries><geometry id='g'><mesh>\
        <source id='p'><float_array id='a' count='9'>0 0 0 100 0 0 0 0 100</float_array>\
        <technique_common><accessor source='#a' count='3' stride='3'/></technique_common></source>\
        <vertices id='v'><input semantic='POSITION' source='#p'/></vertices>\
        <triangles count='1'><input semantic='VERTEX' offset='0' source='#v'/><p>0 1 2</p></triangles></mesh></geometry></library_geometries>\
        <library_visual_scenes><visual_scene id='s'><node><matrix>1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1</matrix><instance_geometry url='#g'/></node></visual_scene>\
        </library_visual_scenes><scene><instance_visual_scene url='#s'/></scene></COLLADA>";
    let obj = "\x03v 0 0 0\nv 1 0 0\nv 0 0 1\nvt 0 0\nf 1/1 2/1 3/1\n";
    let mut stl = vec![4];
    stl.extend([b' '; 80]);
    stl.extend(1_u32.to_le_bytes());
    let corners = [0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0_f32];
    stl.extend(corners.iter().flat_map(|value| value.to_le_bytes()));
    stl.extend([0, 0]);
    [floor, room.into_bytes(), collada.into(), obj.into(), stl]
}
