//! How much a node takes: in the state, in the index, on the disk. The map is a grid in which every
//! fifth node is a main node of typical size.
//!
//! ```text
//! cargo run --release -p map-server --example size -- 1000000
//! ```
#![allow(clippy::unwrap_used)] // a measurement may panic

use fht_map::{IndexConfig, MapIndex};
use fht_proto::{
    AuthorId, Descriptor, EdgeKey, FixedPose, Increment, MapName, ModelId, NodeId, NodeKind, Op, Rect, ScanRecord,
    Signature, encode,
};
use map_server::catalog::Catalog;
use map_server::store::{IncrementLog, IncrementOrigin, Record, RedbLog};
use std::time::Instant;

/// Nodes in an increment.
const PART: u32 = 10;
/// Increments in a commit.
const COMMIT: usize = 200;

fn node_ops(index: u32, side: u32, main_every: u32) -> Vec<Op> {
    let id = |number: u32| NodeId { author: AuthorId(1), number };
    let (x, y) = (f64::from(index % side), f64::from(index / side));
    let pose = FixedPose::from_metres(x, y, 0.0);
    let is_main = main_every > 0 && index.is_multiple_of(main_every);
    let kind = if is_main { NodeKind::Main } else { NodeKind::Support };
    let rect = Rect::around(pose.position, (x - 0.4, y - 0.4), (x + 0.4, y + 0.4));
    let mut ops = vec![Op::PutNode { id: id(index), kind, pose }, Op::SetFreeSpace { id: id(index), rect: Some(rect) }];
    if is_main {
        let components: Vec<f32> = (0..256).map(|i| ((i * (index % 1000 + 1)) as f32 * 0.37).sin()).collect();
        let scan = ScanRecord {
            base_from_sensor: FixedPose::default(),
            angle_min: 0.0,
            angle_increment: 0.0175,
            ranges_mm: (0..360).map(|beam| 4000 + (beam * 7 + index as u16 % 13) % 20 * 5).collect(),
        };
        let descriptor = Some(Descriptor::quantise(ModelId(1), &components));
        ops.push(Op::SetSignature { id: id(index), signature: Signature { descriptor, scan } });
    }
    let before = [(!index.is_multiple_of(side)).then(|| index - 1), index.checked_sub(side)];
    ops.extend(before.into_iter().flatten().map(|other| Op::PutEdge { edge: EdgeKey::new(id(other), id(index)) }));
    ops
}

fn resident_bytes() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).unwrap_or("0 kB");
    line.trim().trim_end_matches(" kB").parse::<u64>().unwrap_or(0) * 1024
}

fn main() {
    let argument = |at: usize, default: u32| std::env::args().nth(at).map_or(default, |text| text.parse().unwrap());
    let (count, main_every) = (argument(1, 1_000_000), argument(2, 0));
    let side = f64::from(count).sqrt().ceil() as u32;
    let map: MapName = "size".parse().unwrap();
    let dir = tempfile::tempdir_in(".").unwrap();
    let mut wire = 0;
    {
        let store = RedbLog::open(dir.path()).unwrap();
        let mut records = Vec::new();
        for (number, first) in (1..).zip((0..count).step_by(PART as usize)) {
            let ops = (first..count.min(first + PART)).flat_map(|index| node_ops(index, side, main_every)).collect();
            let increment = Increment { author: AuthorId(1), number, hlc_us: number, ops };
            let bytes = encode(&increment).unwrap();
            wire += bytes.len();
            let origin = IncrementOrigin::Writer;
            records.push(Record { map: map.clone(), sequence: number, author: AuthorId(1), number, bytes, origin });
            if records.len() == COMMIT {
                store.append(&std::mem::take(&mut records)).unwrap();
            }
        }
        store.append(&records).unwrap();
    }
    let disk: u64 = std::fs::read_dir(dir.path()).unwrap().map(|file| file.unwrap().metadata().unwrap().len()).sum();
    let each = |bytes: f64| bytes / f64::from(count);
    println!(
        "{count} nodes, {}",
        if main_every == 0 { "all support".to_owned() } else { format!("a main node in {main_every}") }
    );
    println!("on the wire   {:.0} B a node, {PART} nodes an increment", each(wire as f64));
    println!("on the disk   {:.0} B a node", each(disk as f64));

    let store = RedbLog::open(dir.path()).unwrap();
    let (before, begin) = (resident_bytes(), Instant::now());
    let catalog = Catalog::load(&store).unwrap();
    let (loaded, took) = (resident_bytes(), begin.elapsed());
    println!(
        "state         {:.0} B a node resident, read in {:.1} s",
        each((loaded - before) as f64),
        took.as_secs_f64()
    );
    let view = catalog.view(&map).unwrap();
    let begin = Instant::now();
    let index = MapIndex::new(&view.state, IndexConfig::default());
    println!(
        "index         {:.0} B a node resident, made in {:.1} s",
        each(resident_bytes().saturating_sub(loaded) as f64),
        begin.elapsed().as_secs_f64()
    );
    let (landmarks, cells) = index.guide().bytes();
    println!(
        "              {:.0} B roads, {:.0} B landmarks, {:.0} B cells, {:.0} B appearance",
        each(index.roads().bytes() as f64),
        each(landmarks as f64),
        each(cells as f64),
        each(index.appearance().bytes() as f64)
    );
}
