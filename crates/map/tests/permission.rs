//! Who may write what: the table in `docs/security.md` is what the code says, and whatever an
//! explorer writes leaves alone what is not an explorer's.
#![allow(clippy::unwrap_used)] // tests may panic

use fht_map::{MapState, WriterRole, WriterRoles, may_write, takes_from_others};
use fht_proto::{
    AuthorId, Datum, DescriptorModel, Digest, EdgeKey, FixedPoint, FixedPose, Increment, ModelId, NodeId, NodeKind, Op,
    Rect, Release, ReleaseId, ScanRecord, Signature, VersionVector, Zone, ZoneRule,
};
use proptest::prelude::*;
use std::fmt::Write;
use std::path::Path;

const ANA: AuthorId = AuthorId(0xa);
const BEN: AuthorId = AuthorId(0xb);
const DESK: AuthorId = AuthorId(0xd);

fn node(author: AuthorId, number: u32) -> NodeId {
    NodeId { author, number }
}

fn pose(x: f64) -> FixedPose {
    FixedPose::from_metres(x, 0.0, 0.0)
}

fn signature(beams: usize) -> Signature {
    let base_from_sensor = FixedPose::default();
    let scan = ScanRecord { base_from_sensor, angle_min: 0.0, angle_increment: 0.1, ranges_mm: vec![1000; beams] };
    Signature { descriptor: None, scan }
}

fn zone(side_mm: i32) -> Zone {
    let corners = [(0, 0), (side_mm, 0), (side_mm, side_mm)].map(|(x_mm, y_mm)| FixedPoint { x_mm, y_mm });
    Zone { rule: ZoneRule::KeepOut, corners: corners.to_vec() }
}

fn release(author: AuthorId, name: &str) -> ReleaseId {
    ReleaseId { author, name: name.parse().unwrap() }
}

fn model(threshold: i16) -> DescriptorModel {
    DescriptorModel { id: ModelId(1), name: "net".to_owned(), dimension: 8, match_threshold_e3: threshold }
}

/// Every operation on a node, on an edge, and on the whole map. `number` makes them differ.
fn on_node(id: NodeId, number: u32) -> [Op; 7] {
    let rect = Rect { west_mm: 500, south_mm: 500, east_mm: 500, north_mm: 500 };
    [
        Op::PutNode { id, kind: NodeKind::Main, pose: pose(f64::from(number)) },
        Op::SetPose { id, pose: pose(f64::from(number)) },
        Op::SetSignature { id, signature: signature(1 + number as usize % 7) },
        Op::SetFreeSpace { id, rect: Some(rect) },
        Op::SetFreeSpace { id, rect: None },
        Op::SetTrust { id, percent: (number % 100) as u8 },
        Op::RemoveNode { id },
    ]
}

fn on_edge(edge: EdgeKey, number: u32) -> [Op; 3] {
    [Op::PutEdge { edge }, Op::RemoveEdge { edge }, Op::SetClosed { edge, closed: number.is_multiple_of(2) }]
}

fn on_map(author: AuthorId, number: u32) -> [Op; 10] {
    let (vector, digest) = (VersionVector::default(), Digest([number as u8; 32]));
    let enabled = Some(release(DESK, "first")).filter(|_| number.is_multiple_of(2));
    [
        Op::PutModel { model: model(number as i16 % 1000) },
        Op::SetPlace { name: "dock".parse().unwrap(), pose: Some(pose(f64::from(number))) },
        Op::SetPlace { name: "dock".parse().unwrap(), pose: None },
        Op::SetZone { name: "stairs".parse().unwrap(), zone: Some(zone(1000 + number as i32)) },
        Op::SetZone { name: "stairs".parse().unwrap(), zone: None },
        Op::PutRelease { name: "second".parse().unwrap(), release: Release { vector, digest } },
        Op::RemoveRelease { id: release(if number.is_multiple_of(2) { DESK } else { author }, "first") },
        Op::Enable { release: enabled },
        Op::SetFloorPlan { plan: None },
        Op::SetDatum { datum: Some(Datum::from_degrees(52.5, 13.4, 0.0)) },
    ]
}

/// A row for each kind of operation, and what each role may do.
fn table() -> String {
    let names = ["put node", "set pose", "set signature", "set free space", "take free space away", "set trust"];
    let mut rows: Vec<(String, Vec<Op>)> = Vec::new();
    for (whose, id) in [("own", node(ANA, 1)), ("others'", node(BEN, 1))] {
        let names = names.into_iter().chain(["remove node"]);
        rows.extend(names.zip(on_node(id, 1)).map(|(name, op)| (format!("{name}, {whose}"), vec![op])));
    }
    let edges = [(ANA, ANA), (ANA, BEN), (BEN, BEN)].map(|(a, b)| EdgeKey::new(node(a, 1), node(b, 2)));
    for (index, name) in ["put edge", "remove edge", "set closed"].into_iter().enumerate() {
        rows.push((name.to_owned(), edges.iter().map(|edge| on_edge(*edge, 1)[index].clone()).collect()));
    }
    let [put, place, no_place, zone, no_zone, make, remove, enable, plan, datum] = on_map(ANA, 1);
    let rest = [
        ("put model", vec![put]),
        ("set place", vec![place, no_place]),
        ("set zone", vec![zone, no_zone]),
        ("put release", vec![make]),
        ("remove release", vec![remove]),
        ("enable", vec![enable]),
        ("set floor plan", vec![plan]),
        ("set datum", vec![datum]),
    ];
    rows.extend(rest.map(|(name, ops)| (name.to_owned(), ops)));
    let mut text = String::from("| operation | explorer | client | operator |\n| --- | --- | --- | --- |\n");
    for (name, ops) in rows {
        let cells = WriterRole::ALL.map(|role| {
            let allowed = ops.iter().filter(|op| may_write(role, ANA, op).is_ok()).count();
            assert!(allowed == 0 || allowed == ops.len(), "{name} is several kinds");
            let is_bounded = role == WriterRole::Explorer && ops.iter().any(|op| takes_from_others(ANA, op).is_some());
            match (allowed > 0, is_bounded) {
                (true, true) => "within a quota",
                (true, false) => "yes",
                (false, _) => "–",
            }
        });
        writeln!(text, "| {name} | {} |", cells.join(" | ")).unwrap();
    }
    text
}

/// `FHT_WRITE_SECURITY=1 cargo test --test permission` writes it.
#[test]
fn the_table_in_the_document_is_what_the_code_says() {
    const MARKS: [&str; 2] = ["<!-- made from the code: crates/map/tests/permission.rs -->\n\n", "\n<!-- end -->"];
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/security.md");
    let text = std::fs::read_to_string(&file).unwrap();
    let (before, rest) = text.split_once(MARKS[0]).expect("where the table begins");
    let (written, after) = rest.split_once(MARKS[1]).expect("where it ends");
    if std::env::var_os("FHT_WRITE_SECURITY").is_some() {
        std::fs::write(&file, [before, MARKS[0], &table(), MARKS[1], after].concat()).unwrap();
    } else {
        assert_eq!(written, table(), "docs/security.md is not what the code says: see the head of this test");
    }
}

#[test]
fn a_list_of_roles_judges_by_names_and_whoever_is_not_in_it_writes_nothing() {
    let roles: WriterRoles =
        [(WriterRole::Explorer, "ana"), (WriterRole::Client, "tug"), (WriterRole::Operator, "desk")]
            .into_iter()
            .collect();
    let by = |name: &str, op: fn(AuthorId) -> Op| {
        let author = AuthorId::of_robot(name);
        roles.check(&Increment { author, number: 1, hlc_us: 1, ops: vec![op(author)] }).map_err(|why| why.to_string())
    };
    let puts: fn(AuthorId) -> Op =
        |author| Op::PutNode { id: node(author, 0), kind: NodeKind::Support, pose: pose(0.0) };
    let names: fn(AuthorId) -> Op = |_| Op::SetPlace { name: "dock".parse().unwrap(), pose: None };
    assert_eq!(by("ana", puts), Ok(()));
    assert_eq!(by("desk", names), Ok(()));
    assert_eq!(by("ana", names), Err("ana: explorers may not name, move or remove places".to_owned()));
    assert_eq!(by("tug", puts), Err("tug: clients may not write".to_owned()));
    assert!(by("eve", puts).unwrap_err().contains("is nobody in the list of roles"));
    assert_eq!(roles.name(AuthorId::of_robot("desk")), Some("desk"));
}

fn any_op(author: AuthorId) -> impl Strategy<Value = Op> {
    (0..3_usize, 0..4_u32, 0..4_u32, any::<bool>(), 0..8_usize, 0..1000_u32).prop_map(
        move |(what, a, b, is_own, index, number)| {
            let owner = if is_own { author } else { BEN };
            let of = |ops: &[Op]| ops[index % ops.len()].clone();
            match what {
                0 => of(&on_node(node(owner, a), number)),
                1 => of(&on_edge(EdgeKey::new(node(owner, a), node(BEN, 4 + b)), number)),
                _ => of(&on_map(author, number)),
            }
        },
    )
}

/// A map that Ben made and on which an operator has written.
fn base() -> MapState {
    let mut map = MapState::new();
    let mut ops: Vec<Op> = (0..8).flat_map(|number| on_node(node(BEN, number), number)[..4].to_vec()).collect();
    ops.extend((0..7).map(|number| Op::PutEdge { edge: EdgeKey::new(node(BEN, number), node(BEN, number + 1)) }));
    map.apply(&Increment { author: BEN, number: 1, hlc_us: 1, ops });
    let release_of = Release { vector: VersionVector::default(), digest: Digest([1; 32]) };
    let ops = vec![
        Op::SetPlace { name: "dock".parse().unwrap(), pose: Some(pose(3.0)) },
        Op::SetZone { name: "stairs".parse().unwrap(), zone: Some(zone(1000)) },
        Op::SetClosed { edge: EdgeKey::new(node(BEN, 1), node(BEN, 2)), closed: true },
        Op::PutRelease { name: "first".parse().unwrap(), release: release_of },
        Op::Enable { release: Some(release(DESK, "first")) },
    ];
    map.apply(&Increment { author: DESK, number: 1, hlc_us: 2, ops });
    map
}

/// What people have decided.
fn decided(map: &MapState) -> String {
    let notes = map.annotations();
    let (places, zones): (Vec<_>, Vec<_>) = (notes.places().collect(), notes.zones().collect());
    format!("{places:?} {zones:?} {:?} {:?}", notes.release(&release(DESK, "first")), notes.enabled())
}

proptest! {
    #[test]
    fn whatever_an_explorer_may_write_leaves_people_and_others_poses_alone(
        ops in prop::collection::vec(any_op(ANA), 1..60)
    ) {
        let before = base();
        let ops: Vec<Op> = ops.into_iter().filter(|op| may_write(WriterRole::Explorer, ANA, op).is_ok()).collect();
        let taken: Vec<NodeId> = ops.iter().filter_map(|op| takes_from_others(ANA, op)).collect();
        let mut after = before.clone();
        after.apply(&Increment { author: ANA, number: 1, hlc_us: 1000, ops });
        prop_assert_eq!(decided(&before), decided(&after));
        for was in before.nodes() {
            match after.node(was.id) {
                Some(is) => {
                    prop_assert_eq!((was.kind, was.pose, was.signature), (is.kind, is.pose, is.signature));
                    prop_assert!(is.free_space.is_some() || taken.contains(&was.id));
                }
                None => prop_assert!(taken.contains(&was.id), "{} went unnoticed", was.id),
            }
        }
        for edge in before.closed_edges().filter(|edge| after.has_edge(*edge)) {
            prop_assert!(after.closed_edges().any(|closed| closed == edge));
        }
        prop_assert_eq!(after.nodes().filter(|node| node.id.author == BEN && before.node(node.id).is_none()).count(), 0);
    }

    #[test]
    fn every_element_is_there_for_somebody(ops in prop::collection::vec(any_op(ANA), 1..60)) {
        let mut map = base();
        map.apply(&Increment { author: ANA, number: 1, hlc_us: 1000, ops });
        prop_assert_eq!(map.elements_by_writer().values().sum::<usize>(), map.elements());
    }

    #[test]
    fn a_client_may_write_nothing_and_an_operator_everything(op in any_op(ANA)) {
        prop_assert!(may_write(WriterRole::Client, ANA, &op).is_err());
        prop_assert!(may_write(WriterRole::Operator, ANA, &op).is_ok());
    }
}
