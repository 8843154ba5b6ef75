//! Maps to try servers and clients on: explored or drawn.

use fht_eval::{Survey, SurveyTask};
use fht_proto::{
    AuthorId, Descriptor, EdgeKey, FixedPose, Increment, ModelId, NodeId, NodeKind, Op, Rect, ScanRecord, Signature,
    decode,
};
use std::path::Path;

/// Where explored worlds are kept.
const KEPT: &str = "target/evaluation";

/// The increments of an explored world (`museum`, `office`, a file), which is explored once and
/// then kept.
///
/// # Errors
/// Why it cannot be explored or read, as a text.
pub fn explored(world: &str) -> Result<Vec<Increment>, String> {
    let survey = Survey::of(&SurveyTask::usual(world), Path::new(KEPT)).map_err(|error| error.to_string())?;
    survey.increments.iter().map(|bytes| decode(bytes).map_err(|error| error.to_string())).collect()
}

/// A hall of `rows` and `columns` of nodes with overlapping rectangles.
#[must_use]
pub fn hall(rows: u32, columns: u32) -> Vec<Increment> {
    let author = AuthorId::of_robot("hall");
    let id = |row: u32, column: u32| NodeId { author, number: row * columns + column };
    let places = (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column)));
    let increment = |((row, column), number): ((u32, u32), u64)| {
        let (x, y) = (f64::from(column) * 2.0, f64::from(row) * 2.0);
        let pose = FixedPose::from_metres(x, y, 0.0);
        let rect = Rect::around(pose.position, (x - 1.1, y - 1.1), (x + 1.1, y + 1.1));
        let mut ops = vec![
            Op::PutNode { id: id(row, column), kind: NodeKind::Support, pose },
            Op::SetFreeSpace { id: id(row, column), rect: Some(rect) },
        ];
        let before = [(column > 0).then(|| id(row, column - 1)), (row > 0).then(|| id(row - 1, column))];
        let edges = before.into_iter().flatten();
        ops.extend(edges.map(|other| Op::PutEdge { edge: EdgeKey::new(other, id(row, column)) }));
        Increment { author, number, hlc_us: number, ops }
    };
    places.zip(1..).map(increment).collect()
}

/// A map as long as an explored office, or so many `times` that: 138 main nodes of typical size in
/// a hall of 716 nodes.
#[must_use]
pub fn office(times: u32) -> Vec<Increment> {
    /// Nodes in a row.
    const COLUMNS: u32 = 28;
    let author = AuthorId::of_robot("surveyor");
    let node = |number: u32| NodeId { author, number };
    let increment = |(index, number): (u32, u64)| {
        let (x, y) = (f64::from(index % COLUMNS) * 2.0, f64::from(index / COLUMNS) * 2.0);
        let pose = FixedPose::from_metres(x, y, 0.0);
        let is_main = index.is_multiple_of(5);
        let rect = Rect::around(pose.position, (x - 1.1, y - 1.1), (x + 1.1, y + 1.1));
        let kind = if is_main { NodeKind::Main } else { NodeKind::Support };
        let mut ops =
            vec![Op::PutNode { id: node(index), kind, pose }, Op::SetFreeSpace { id: node(index), rect: Some(rect) }];
        if is_main {
            let components: Vec<f32> = (0..256).map(|i| ((i * (index + 1)) as f32 * 0.37).sin()).collect();
            // Walls at some distance, as rough as measured ones.
            let range = |beam: u32| {
                let wall_mm = 4000.0 / f64::from(beam).mul_add(0.0175, 0.3).cos().abs().max(0.4);
                (wall_mm as u32 + (beam * 7 + index * 13) % 20) as u16 / 5 * 5
            };
            let scan = ScanRecord {
                base_from_sensor: FixedPose::default(),
                angle_min: 0.0,
                angle_increment: 0.0175,
                ranges_mm: (0..360).map(range).collect(),
            };
            let descriptor = Some(Descriptor::quantise(ModelId(1), &components));
            ops.push(Op::SetSignature { id: node(index), signature: Signature { descriptor, scan } });
        }
        let before = [(!index.is_multiple_of(COLUMNS)).then(|| index - 1), index.checked_sub(COLUMNS)];
        let edges = before.into_iter().flatten();
        ops.extend(edges.map(|other| Op::PutEdge { edge: EdgeKey::new(node(other), node(index)) }));
        Increment { author, number, hlc_us: number, ops }
    };
    (0..716 * times).zip(1..).map(increment).collect()
}
