//! Any order, repetition and interleaving of increments ends in the same map; a replica with gaps
//! gets there, too.
#![allow(clippy::unwrap_used)] // tests may panic

mod drawn;

use drawn::{increments, shown, state_of};
use fht_map::crdt::reorder_buffer::SequenceConfig;
use fht_map::{Accepted, MapState, Replica};
use fht_proto::{
    AuthorId, Descriptor, DescriptorModel, EdgeKey, FixedPoint, FixedPose, Increment, ModelId, NodeId, NodeKind, Op,
    Rect, ScanRecord, Signature,
};
use proptest::prelude::*;

/// The increments, and the same in any order with some of them repeated.
fn two_deliveries() -> impl Strategy<Value = (Vec<Increment>, Vec<Increment>)> {
    increments().prop_flat_map(|increments| {
        let repeated = prop::collection::vec(prop::sample::select(increments.clone()), 0..8);
        let delivery = repeated.prop_flat_map({
            let increments = increments.clone();
            move |repeated| Just([increments.clone(), repeated].concat()).prop_shuffle()
        });
        (Just(increments), delivery)
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn order_and_repetition_do_not_matter((increments, delivery) in two_deliveries()) {
        let (straight, shuffled) = (state_of(&increments), state_of(&delivery));
        prop_assert_eq!(straight.digest(), shuffled.digest());
        prop_assert_eq!(shown(&straight), shown(&shuffled));
    }

    #[test]
    fn a_replica_with_gaps_gets_there((increments, delivery) in two_deliveries()) {
        let mut replica = Replica::default();
        let mut applied = 0;
        // Stamps that do not rise with the numbers look like those of two runs: what is dropped
        // then is asked for.
        for increment in delivery.into_iter().chain(increments.clone()) {
            match replica.accept(increment) {
                Accepted::Applied(count) => applied += count,
                Accepted::Duplicate | Accepted::Early => {}
                other => prop_assert!(false, "{:?}", other),
            }
        }
        prop_assert_eq!(applied, increments.len());
        prop_assert_eq!(replica.vector().version(), increments.len() as u64);
        prop_assert_eq!(replica.waiting(), 0);
        prop_assert_eq!(replica.state().digest(), state_of(&increments).digest());
    }

    #[test]
    fn equal_digests_mean_equal_maps(a in increments(), b in increments()) {
        let (a, b) = (state_of(&a), state_of(&b));
        prop_assert_eq!(state_of(&[]).digest(), MapState::new().digest());
        if a.digest() == b.digest() {
            prop_assert_eq!(shown(&a), shown(&b));
        }
    }

    #[test]
    fn the_index_of_edges_agrees_with_the_edges(increments in increments()) {
        let state = state_of(&increments);
        let edges: Vec<EdgeKey> = state.edges().collect();
        for node in state.nodes() {
            let joined: Vec<NodeId> = state.neighbours(node.id).map(|other| other.id).collect();
            let mut expected: Vec<NodeId> = edges
                .iter()
                .filter_map(|edge| match node.id {
                    id if id == edge.low() => Some(edge.high()),
                    id if id == edge.high() => Some(edge.low()),
                    _ => None,
                })
                .collect();
            expected.sort();
            prop_assert_eq!(joined, expected);
        }
        let counts = state.counts();
        prop_assert_eq!(counts.edges, edges.len());
        prop_assert_eq!(counts.main_nodes + counts.support_nodes, state.nodes().count());
        prop_assert_eq!(counts.main_nodes, state.main_nodes().count());
    }
}

fn node(number: u32) -> NodeId {
    NodeId { author: AuthorId(0), number }
}

fn increment(number: u64, hlc_us: u64, ops: Vec<Op>) -> Increment {
    Increment { author: AuthorId(0), number, hlc_us, ops }
}

fn put(number: u32, x_mm: i32) -> Op {
    let pose = FixedPose { position: FixedPoint { x_mm, y_mm: 0 }, yaw_e4: 0 };
    Op::PutNode { id: node(number), kind: NodeKind::Support, pose }
}

/// Two nodes with all that nodes can have, an edge and a model, all written with one clock.
fn furnished() -> Vec<Op> {
    let signature = |value: i8, range: u16| Signature {
        descriptor: Some(Descriptor { model: ModelId(1), scale: 1.0, values: vec![value; 4] }),
        scan: ScanRecord {
            base_from_sensor: FixedPose::default(),
            angle_min: 0.0,
            angle_increment: 0.1,
            ranges_mm: vec![range; 4],
        },
    };
    let model = DescriptorModel { id: ModelId(1), name: "model".to_owned(), dimension: 4, match_threshold_e3: 700 };
    vec![
        put(0, 1),
        put(1, 2),
        Op::SetFreeSpace { id: node(0), rect: Some(Rect { east_mm: 5, ..Rect::default() }) },
        Op::SetSignature { id: node(0), signature: signature(1, 1000) },
        Op::PutEdge { edge: EdgeKey::new(node(0), node(1)) },
        Op::PutModel { model },
    ]
}

#[test]
fn a_change_of_anything_visible_changes_the_digest() {
    let state = |ops: &[Op]| state_of(&[increment(1, 1, ops.to_vec())]);
    let before = state(&furnished());
    let mut digests = vec![before.digest()];
    let mut check = |what: &str, change: &dyn Fn(&mut Vec<Op>)| {
        let mut ops = furnished();
        change(&mut ops);
        let after = state(&ops);
        assert_ne!(shown(&after), shown(&before), "{what} is to be seen");
        assert!(!digests.contains(&after.digest()), "{what} does not change the digest");
        digests.push(after.digest());
    };
    let signature_of = |ops: &mut Vec<Op>, change: &dyn Fn(&mut Signature)| match &mut ops[3] {
        Op::SetSignature { signature, .. } => change(signature),
        other => panic!("{other:?}"),
    };
    let pose = FixedPose { position: FixedPoint { x_mm: 1, y_mm: 0 }, yaw_e4: 0 };
    // The same stamps throughout: the content alone is what differs.
    check("a position", &|ops| ops[0] = put(0, 9));
    check("a heading", &|ops| {
        ops[0] = Op::PutNode { id: node(0), kind: NodeKind::Support, pose: FixedPose { yaw_e4: 1, ..pose } };
    });
    check("a kind", &|ops| ops[0] = Op::PutNode { id: node(0), kind: NodeKind::Main, pose });
    check("a node's id", &|ops| ops[0] = put(2, 1));
    check("a rectangle", &|ops| {
        ops[2] = Op::SetFreeSpace { id: node(0), rect: Some(Rect { east_mm: 6, ..Rect::default() }) };
    });
    check("no rectangle", &|ops| ops[2] = Op::SetFreeSpace { id: node(0), rect: None });
    check("a descriptor's value", &|ops| {
        signature_of(ops, &|signature| signature.descriptor.as_mut().unwrap().values[3] = 2);
    });
    check("a descriptor's scale", &|ops| {
        signature_of(ops, &|signature| signature.descriptor.as_mut().unwrap().scale = 2.0);
    });
    check("no descriptor", &|ops| signature_of(ops, &|signature| signature.descriptor = None));
    check("a range", &|ops| signature_of(ops, &|signature| signature.scan.ranges_mm[3] = 1));
    check("a scan's angle", &|ops| signature_of(ops, &|signature| signature.scan.angle_min = 0.1));
    check("an edge", &|ops| ops[4] = Op::RemoveEdge { edge: EdgeKey::new(node(0), node(1)) });
    check("a model's name", &|ops| {
        if let Op::PutModel { model } = &mut ops[5] {
            model.name.push('2');
        }
    });
    check("a removed node", &|ops| ops.push(Op::RemoveNode { id: node(1) }));
    check("one operation less", &|ops| _ = ops.pop());
}

#[test]
fn a_removed_node_hides_its_edges_and_comes_back_bare() {
    let rect = Op::SetFreeSpace { id: node(0), rect: Some(Rect { east_mm: 5, ..Rect::default() }) };
    let edge = Op::PutEdge { edge: EdgeKey::new(node(0), node(1)) };
    let mut state = state_of(&[increment(1, 1, vec![put(0, 1), put(1, 2), rect, edge])]);
    assert_eq!(state.edges().count(), 1);
    state.apply(&increment(2, 2, vec![Op::RemoveNode { id: node(0) }]));
    assert_eq!((state.nodes().count(), state.edges().count()), (1, 0));
    assert!(state.node(node(0)).is_none());
    state.apply(&increment(3, 3, vec![put(0, 7)]));
    assert_eq!(state.edges().count(), 1, "the edge is an element of its own");
    assert_eq!(state.node(node(0)).unwrap().free_space, None, "what was written before the removal stays removed");
    // An older write that arrives late changes nothing.
    let digest = state.digest();
    state.apply(&increment(1, 1, vec![put(0, 1), put(1, 2)]));
    assert_eq!(state.digest(), digest);
}

#[test]
fn a_correction_moves_a_node_and_keeps_the_rest() {
    let moved = FixedPose { position: FixedPoint { x_mm: 50, y_mm: 60 }, yaw_e4: 70 };
    let rect = Some(Rect { east_mm: 5, ..Rect::default() });
    let set = Op::SetFreeSpace { id: node(0), rect };
    let state = state_of(&[
        increment(1, 1, vec![put(0, 1), set]),
        increment(2, 2, vec![Op::SetPose { id: node(0), pose: moved }]),
    ]);
    let node = state.node(node(0)).unwrap();
    assert_eq!((node.pose, node.free_space), (moved, rect));
    assert_eq!(state.max_hlc_us(), 2);
}

#[test]
fn a_copy_does_not_change_with_its_original() {
    let mut state = state_of(&[increment(1, 1, vec![put(0, 1)])]);
    let copy = state.clone();
    state.apply(&increment(2, 2, vec![put(1, 1)]));
    assert_eq!((copy.nodes().count(), state.nodes().count()), (1, 2));
    assert_ne!(copy.digest(), state.digest());
}

#[test]
fn a_replica_tells_repetition_from_conflict() {
    let mut replica = Replica::default();
    let first = increment(1, 1, vec![put(0, 1)]);
    let third = increment(3, 3, vec![put(2, 1)]);
    assert_eq!(replica.accept(third.clone()), Accepted::Early);
    assert_eq!(replica.accept(third), Accepted::Duplicate);
    assert_eq!(replica.accept(increment(3, 3, vec![put(2, 99)])), Accepted::Conflict);
    assert_eq!(replica.accept(first.clone()), Accepted::Applied(1));
    assert_eq!(replica.accept(first), Accepted::Duplicate);
    assert_eq!(replica.accept(increment(1, 1, vec![put(0, 99)])), Accepted::Conflict);
    assert_eq!(replica.accept(increment(2, 2, vec![put(1, 1)])), Accepted::Applied(2));
    assert_eq!(replica.vector().get(AuthorId(0)), 3);
    assert_eq!(replica.state().node(node(2)).unwrap().pose.position.x_mm, 1);
}

#[test]
fn what_waits_is_bounded() {
    let config = SequenceConfig { max_ahead: 10, max_waiting_bytes: 2000 };
    let mut replica = Replica::new(config);
    assert_eq!(replica.accept(increment(11, 1, vec![put(0, 1)])), Accepted::Dropped, "too far ahead");
    let outcomes: Vec<Accepted> =
        (2..=10).map(|number| replica.accept(increment(number, 1, vec![put(0, 1); 10]))).collect();
    assert!(outcomes.contains(&Accepted::Early) && outcomes.contains(&Accepted::Dropped), "{outcomes:?}");
    let kept = replica.waiting();
    // What was dropped comes again and goes in.
    assert_eq!(replica.accept(increment(1, 1, vec![put(0, 1)])), Accepted::Applied(1 + kept));
    assert_eq!(replica.accept(increment(u64::MAX, 1, vec![put(0, 1)])), Accepted::Dropped);
}
