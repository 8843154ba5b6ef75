//! Every query, asked over Zenoh as robots and tools ask it; hostile increments over Zenoh.

use crate::support::{
    ANA, BEN, ask, ask_with, bytes, client, expected, free_endpoint, head_when, key, museum, node, signature,
};
use fht_map::Replica;
use fht_proto::api::compact::{CompactNodes, CompactNodesPage, CompactPath, CompactPathWithGoal};
use fht_proto::api::keys::Key;
use fht_proto::api::reply::{ErrorCode, ErrorReply, Head, MapsReply, NodesReply, PathReply, Series, SeriesReply};
use fht_proto::{Descriptor, ModelId, VersionVector, decode, encode};
use map_server::{ServerConfig, ServerEndpoints, run};
use std::time::Duration;
use tokio::sync::oneshot;
use tokio::task::JoinHandle;
use zenoh::Session;
use zenoh::qos::CongestionControl;

struct Running {
    session: Session,
    stop: oneshot::Sender<()>,
    server: JoinHandle<Result<(), map_server::ServerError>>,
    _dir: tempfile::TempDir,
}

impl Running {
    /// A server with a map of `count` increments each of ANA and BEN, 1 m apart along the x axis.
    async fn with(ana: u64, ben: u64) -> Self {
        let dir = tempfile::tempdir().unwrap();
        let endpoint = free_endpoint();
        let link = ServerEndpoints { listen: vec![endpoint.clone()], ..ServerEndpoints::default() };
        let config = ServerConfig::new(dir.path().to_owned(), link);
        let (stop, stopped) = oneshot::channel::<()>();
        let server = tokio::spawn(run(config, async { _ = stopped.await }));
        let session = client(&endpoint).await;
        crate::support::until_up(&session).await;
        for (author, count) in [(ANA, ana), (BEN, ben)] {
            for number in 1..=count {
                session.put(key(author, number), bytes(author, number)).await.unwrap();
            }
        }
        head_when(&session, |head| head.version == ana + ben).await;
        Self { session, stop, server, _dir: dir }
    }

    async fn payload(&self, selector: &str) -> Vec<u8> {
        let mut replies = ask(&self.session, selector).await;
        assert_eq!(replies.len(), 1, "{selector}: {replies:?}");
        replies.remove(0).unwrap()
    }

    async fn json<T: serde::de::DeserializeOwned>(&self, selector: &str) -> T {
        serde_json::from_slice(&self.payload(selector).await).unwrap()
    }

    async fn error(&self, selector: &str) -> ErrorReply {
        let mut replies = ask(&self.session, selector).await;
        assert_eq!(replies.len(), 1, "{selector}: {replies:?}");
        replies.remove(0).unwrap_err()
    }

    async fn end(self) {
        self.session.close().await.unwrap();
        self.stop.send(()).unwrap();
        self.server.await.unwrap().unwrap();
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn paths_nodes_and_heads() {
    let server = Running::with(12, 0).await;
    let (state, vector) = expected(&[(ANA, 12)]);

    let head: Head = server.json("fht/museum/head").await;
    assert_eq!((head.version, head.vector, head.digest, head.edges), (12, vector, state.digest(), 11));
    let maps: MapsReply = server.json("fht/maps").await;
    assert_eq!(maps.maps.len(), 1);
    let by_wildcard: Head = server.json("fht/*/head").await;
    assert_eq!(by_wildcard, maps.maps[0]);

    let path: PathReply = server.json("fht/museum/path?from=0.2,0.5;to=9,-0.5").await;
    // The rectangles along the way form one space: the path is straight.
    let ends: Vec<(f64, f64)> = path.waypoints.iter().map(|waypoint| (waypoint.x, waypoint.y)).collect();
    assert_eq!((path.version, ends), (12, vec![(0.2, 0.5), (9.0, -0.5)]));
    assert!((path.length_m - 8.8_f64.hypot(1.0)).abs() < 2e-3, "{}", path.length_m);
    let between: PathReply = server.json(&format!("fht/museum/path?from={};to={}", node(ANA, 2), node(ANA, 5))).await;
    assert_eq!(between.length_m, 3.0);
    let compact: CompactPath = decode(&server.payload("fht/museum/path?from=2,0;to=5,0;fmt=postcard").await).unwrap();
    assert_eq!(compact.waypoints.len(), between.waypoints.len());

    let near: NodesReply = server.json("fht/museum/nodes?near=3.2,0;radius=1.5").await;
    assert_eq!(near.nodes.iter().map(|node| node.x).collect::<Vec<_>>(), [3.0, 4.0, 2.0]);
    assert_eq!(near.nodes[0].neighbours.len(), 2);
    let one: NodesReply = server.json("fht/museum/nodes?near=3.2,0;radius=1.5;limit=1").await;
    assert_eq!(one.nodes.len(), 1);
    let compact: CompactNodes =
        decode(&server.payload("fht/museum/nodes?near=3.2,0;radius=1.5;fmt=postcard").await).unwrap();
    assert_eq!((compact.nodes.len(), compact.nodes[0].id), (3, node(ANA, 3)));
    server.end().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn paths_for_other_footprints() {
    let server = Running::with(12, 0).await;
    let plain = server.payload("fht/museum/path?from=0.2,0.5;to=9,-0.5").await;
    for small in ["0.05", "0.105", "0.1,0_0,0.1_-0.1,0_0,-0.1"] {
        let path = server.payload(&format!("fht/museum/path?from=0.2,0.5;to=9,-0.5;footprint={small}")).await;
        assert_eq!(path, plain, "{small}: a robot that needs no more room than the explorers gets the same path");
    }
    // The strip is 2 m wide. From the second question on the answer comes at once; more footprints
    // than are kept do no harm.
    for radius_cm in (30..=90).step_by(5).chain([30, 30]) {
        let selector = format!("fht/museum/path?from=0.5,0;to=9,0;footprint=0.{radius_cm}");
        let path: PathReply = server.json(&selector).await;
        assert!((path.length_m - 8.5).abs() < 1e-6, "{radius_cm}");
    }
    let cart = "0.4,0.2_-0.4,0.2_-0.4,-0.2_0.4,-0.2";
    let path: PathReply = server.json(&format!("fht/museum/path?from=0.5,0;to=9,0;footprint={cart}")).await;
    assert_eq!(path.waypoints.len(), 2);
    let refusal = server.error("fht/museum/path?from=0.5,0;to=9,0;footprint=0.95").await;
    assert_eq!(refusal.code, ErrorCode::NoPath);
    assert!(refusal.message.ends_with("it must be free for a robot of 0.95 m radius"), "{}", refusal.message);
    let far = server.error("fht/museum/path?from=0.5,0;to=90,0;footprint=0.3").await;
    assert_eq!(far.code, ErrorCode::OutOfMap);
    for bad in ["", "x", "3", "-0.3", "NaN", "0.3,0.3", "0.1,0_0.2,0_0.1,0.1"] {
        let refusal = server.error(&format!("fht/museum/path?from=0.5,0;to=9,0;footprint={bad}")).await;
        assert_eq!(refusal.code, ErrorCode::BadRequest, "{bad}");
        assert!(refusal.message.starts_with("footprint="), "{}", refusal.message);
    }
    server.end().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn increments_come_as_json_too_and_in_parts() {
    let server = Running::with(12, 3).await;
    let whole: Series = decode(&server.payload("fht/museum/since").await).unwrap();
    let same: SeriesReply = server.json("fht/museum/since?fmt=json;max_bytes=1048576").await;
    let (_, vector) = expected(&[(ANA, 12), (BEN, 3)]);
    assert_eq!(same, SeriesReply::new(museum(), vector.clone(), &whole));
    assert_eq!(same, server.json("fht/museum/snapshot?version=15;fmt=json;max_bytes=1048576").await);

    let (mut have, mut increments, mut questions) = (VersionVector::default(), Vec::new(), 0);
    loop {
        let selector = format!("fht/museum/since?fmt=json;vector={have};max_bytes=6000");
        let text = server.payload(&selector).await;
        let part: SeriesReply = serde_json::from_slice(&text).unwrap();
        if part.increments.is_empty() {
            break;
        }
        // The longest increment alone takes some 3 kB.
        assert!(text.len() < 6500, "{} bytes", text.len());
        part.increments.iter().for_each(|increment| have.set(increment.author, increment.number));
        increments.extend(part.increments);
        questions += 1;
    }
    assert_eq!(have, vector);
    assert!(questions > 2, "{questions} questions");
    // Those of whom the least is lacking come first, each in order.
    increments.sort_by_key(|increment| (increment.author, increment.number));
    let mut expected = same.increments;
    expected.sort_by_key(|increment| (increment.author, increment.number));
    assert_eq!(increments, expected);

    let pieces = ask(&server.session, "fht/museum/since?fmt=json;piece_bytes=4000").await;
    assert!(pieces.len() > 1, "{} pieces", pieces.len());
    server.end().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn nodes_that_look_alike() {
    let server = Running::with(12, 0).await;
    let asked = encode(&signature(5).descriptor.unwrap()).unwrap();
    let mut replies = ask_with(&server.session, "fht/museum/match?limit=2", asked.clone()).await;
    let found: NodesReply = serde_json::from_slice(&replies.remove(0).unwrap()).unwrap();
    assert_eq!((found.nodes.len(), &found.nodes[0].id), (2, &node(ANA, 5).to_string()));
    assert!(found.nodes[0].similarity.unwrap() > 0.999);
    let mut replies = ask_with(&server.session, "fht/museum/match?fmt=postcard", asked).await;
    let compact: CompactNodes = decode(&replies.remove(0).unwrap()).unwrap();
    assert_eq!(compact.nodes[0].signature, Some(signature(5)));

    let foreign = encode(&Descriptor::quantise(ModelId(2), &[1.0; 320])).unwrap();
    let error = ask_with(&server.session, "fht/museum/match", foreign).await.remove(0).unwrap_err();
    assert_eq!(error.code, ErrorCode::IncompatibleModel);
    let error = ask_with(&server.session, "fht/museum/match", b"junk".to_vec()).await.remove(0).unwrap_err();
    assert_eq!(error.code, ErrorCode::BadRequest);
    server.end().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_late_replica_catches_up_in_pieces() {
    let server = Running::with(60, 25).await;
    let mut replica = Replica::default();
    let mut questions = 0;
    loop {
        let selector = format!("fht/museum/since?vector={};max_bytes=1000", replica.vector());
        let series: Series = decode(&server.payload(&selector).await).unwrap();
        if series.increments.is_empty() {
            break;
        }
        questions += 1;
        for increment in series.increments {
            replica.accept(increment);
        }
    }
    let (state, vector) = expected(&[(ANA, 60), (BEN, 25)]);
    assert_eq!((replica.state().digest(), replica.vector()), (state.digest(), &vector));
    assert!(questions > 5, "{questions}");

    // Past states of the map: by the server's order of storing, and by vector.
    let then: Series = decode(&server.payload("fht/museum/snapshot?version=10").await).unwrap();
    assert_eq!(then.increments.len(), 10);
    let selector = format!("fht/museum/snapshot?vector={ANA}:3,{BEN}:2");
    let then: Series = decode(&server.payload(&selector).await).unwrap();
    let mut old = Replica::default();
    then.increments.into_iter().for_each(|increment| _ = old.accept(increment));
    assert_eq!(old.state().digest(), expected(&[(ANA, 3), (BEN, 2)]).0.digest());
    let rest: Series = decode(&server.payload(&format!("{selector};have={ANA}:3,{BEN}:1")).await).unwrap();
    assert_eq!(rest.increments.len(), 1);
    for unknown in ["version=86".to_owned(), format!("vector={ANA}:61")] {
        let error = server.error(&format!("fht/museum/snapshot?{unknown}")).await;
        assert_eq!(error.code, ErrorCode::UnknownVersion, "{error}");
    }
    server.end().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn wrong_questions_get_a_reason() {
    let server = Running::with(3, 0).await;
    use ErrorCode::{BadRequest, NoPath, OutOfMap, UnknownMap, UnknownNode, UnknownPlace, UnknownVersion};
    server.session.put(key(BEN, 1), encode(&far_node()).unwrap()).await.unwrap();
    head_when(&server.session, |head| head.version == 4).await;
    for (selector, code) in [
        ("fht/nowhere/path?from=0,0;to=1,0", UnknownMap),
        ("fht/nowhere/head", UnknownMap),
        ("fht/museum/path", BadRequest),
        ("fht/museum/path?from=0,0", BadRequest),
        ("fht/museum/path?from=0,0;to=north", UnknownPlace),
        ("fht/museum/path?from=0,0;to=no/th", BadRequest),
        ("fht/museum/path?from=0,0;to=1,0;release=x", UnknownVersion),
        ("fht/museum/diff", BadRequest),
        ("fht/museum/diff?from=99", UnknownVersion),
        ("fht/museum/admin/retain", BadRequest),
        ("fht/museum/admin/import", BadRequest),
        ("fht/museum/path?from=0,0;to=nan,1", BadRequest),
        ("fht/museum/path?from=0,0;to=1,0;via=2,0", BadRequest),
        ("fht/museum/path?from=0,0;to=1,0;fmt=xml", BadRequest),
        ("fht/museum/path?from=0,0;to=0000000a.77", UnknownNode),
        ("fht/museum/path?from=0,0;to=20,20", OutOfMap),
        ("fht/museum/path?from=0,0;to=50,0", NoPath),
        ("fht/museum/nodes", BadRequest),
        ("fht/museum/nodes?near=0,0;radius=-1", BadRequest),
        ("fht/museum/nodes?near=0,0;radius=x", BadRequest),
        ("fht/museum/nodes?near=0,0;limit=0", BadRequest),
        ("fht/museum/since?vector=x", BadRequest),
        ("fht/museum/since?vector=0000000a:1;max_bytes=99999999999999999999", BadRequest),
        ("fht/museum/snapshot?version=1;vector=0000000a:1", BadRequest),
        ("fht/museum/snapshot?version=-1", BadRequest),
        ("fht/museum/match", BadRequest),
        ("fht/museum/map", BadRequest),
        ("fht/museum/path/extra", BadRequest),
        ("fht/museum/refused/0000000a", BadRequest),
        ("fht/museum", BadRequest),
        ("fht/*/path?from=0,0;to=1,0", BadRequest),
    ] {
        let error = server.error(selector).await;
        assert_eq!(error.code, code, "{selector}: {error}");
        assert!(error.message.len() > 10, "{selector}: {error}");
    }
    let joined = server.error("fht/museum/path?from=0,0&to=1,0").await;
    assert!(joined.message.contains("joined by ;"), "{joined}");
    // What is put, and not asked for: the answer says what to ask.
    for (key, instead) in [
        ("fht/museum/inc/**", "fht/museum/since"),
        ("fht/museum/inc/0000000a/1", "fht/museum/since"),
        ("fht/museum/kept/0000000a/1", "since"),
        ("fht/museum/refused/0000000a", "fht/museum/head"),
        ("fht/museum/robots", "fht/museum/fleet"),
        ("fht/museum/robots/*", "fht/museum/fleet"),
        ("fht/museum/robots/r1", "fht/museum/fleet"),
        ("fht/museum/robots/r1/pose", "fht/museum/fleet"),
        ("fht/museum/robots/r1/status", "fht/museum/fleet"),
        ("fht/museum/robots/r1/blocked", "fht/museum/fleet"),
        ("fht/museum/robots/r1/seen", "fht/museum/fleet"),
        ("fht/museum/admin/sleep", "admin/ACTION"),
    ] {
        let error = server.error(key).await;
        assert!(error.code == BadRequest && error.message.contains(instead), "{key}: {error}");
    }
    // What a robot would answer that may come.
    let error = server.error("fht/museum/robots/r1/goal").await;
    assert!(error.code == ErrorCode::UnknownRobot && error.message.contains("fht/museum/fleet"), "{error}");
    server.end().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn all_nodes_can_be_had_page_by_page() {
    let server = Running::with(120, 40).await;
    let all: NodesReply = server.json("fht/museum/nodes?near=20,0;radius=100000;limit=1000").await;
    assert_eq!((all.nodes.len(), all.truncated, &all.next), (160, false, &None));
    let usual: NodesReply = server.json("fht/museum/nodes?near=20,0;radius=100000").await;
    assert_eq!((usual.nodes.len(), usual.truncated), (100, true));
    for limit in [1, 7, 40, 159, 160] {
        let (mut ids, mut after, mut pages) = (Vec::new(), String::new(), 0);
        loop {
            let selector = format!("fht/museum/nodes?near=20,0;radius=100000;limit={limit};after={after}");
            let page: NodesReply = server.json(&selector).await;
            let compact: CompactNodesPage = decode(&server.payload(&format!("{selector};fmt=postcard")).await).unwrap();
            let same: Vec<String> = compact.nodes.nodes.iter().map(|node| node.id.to_string()).collect();
            ids.extend(page.nodes.iter().map(|node| node.id.clone()));
            assert!(ids.ends_with(&same) && compact.next == page.next);
            pages += 1;
            match page.next {
                Some(next) => after = next,
                None => break,
            }
        }
        // Two nodes lie at each of many distances: their order is that of their ids.
        assert!(ids.iter().eq(all.nodes.iter().map(|node| &node.id)), "pages of {limit}");
        assert_eq!(pages, 160_usize.div_ceil(limit));
    }
    assert_eq!(server.error("fht/museum/nodes?near=0,0;after=there").await.code, ErrorCode::BadRequest);
    server.end().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_goal_that_cannot_be_reached_is_refused_or_moved() {
    let server = Running::with(6, 0).await;
    // A room of which nobody has a scan: beyond its south side, at y = -1, nobody knows anything.
    let (id, pose) = (node(BEN, 0), fht_proto::FixedPose::from_metres(3.0, 0.0, 0.0));
    let rect = Some(fht_proto::Rect::around(pose.position, (0.0, -1.0), (6.0, 1.0)));
    let put = fht_proto::Op::PutNode { id, kind: fht_proto::NodeKind::Support, pose };
    let ops = vec![put, fht_proto::Op::SetFreeSpace { id, rect }];
    let room = fht_proto::Increment { author: BEN, number: 1, hlc_us: 1, ops };
    server.session.put("fht/room/inc/0000000b/1", encode(&room).unwrap()).await.unwrap();
    while server.json::<MapsReply>("fht/maps").await.maps.len() < 2 {}
    let unseen: PathReply = server.json("fht/room/path?from=1,0;to=3,-2").await;
    assert!((0.9..1.1).contains(&unseen.unmapped_m) && unseen.goal_moved_m == 0.0, "{unseen:?}");
    let text = String::from_utf8(server.payload("fht/museum/path?from=0,0;to=3,0").await).unwrap();
    assert!(!text.contains("unmapped") && !text.contains("moved"), "{text}");

    server.session.put(key(BEN, 1), encode(&far_node()).unwrap()).await.unwrap();
    head_when(&server.session, |head| head.version == 7).await;
    let refused = server.error("fht/museum/path?from=0,0;to=50,0").await;
    assert!(refused.code == ErrorCode::NoPath && refused.message.contains("to_nearest=true"), "{refused}");
    assert!(refused.message.contains("44.56 m from the goal"), "{refused}");
    let refused = server.error("fht/museum/path?from=0,0;to=20,30").await;
    assert!(refused.code == ErrorCode::OutOfMap && refused.message.contains("to_nearest=true"), "{refused}");
    let moved: PathReply = server.json("fht/museum/path?from=0,0;to=50,0;to_nearest=true").await;
    assert_eq!((moved.goal_moved_m, moved.waypoints.last().map(|it| (it.x, it.y))), (44.56, Some((5.44, 0.0))));
    // The compact form tells of it to those who ask for it.
    let selector = "fht/museum/path?from=0,0;to=50,0;fmt=postcard;to_nearest=true";
    let compact: CompactPathWithGoal = decode(&server.payload(selector).await).unwrap();
    assert_eq!((compact.goal_moved_mm, compact.unmapped_mm, compact.path.waypoints.len()), (44_560, 0, 2));
    let compact: CompactPath = decode(&server.payload("fht/room/path?from=1,0;to=3,-2;fmt=postcard").await).unwrap();
    assert_eq!(compact.waypoints.len(), unseen.waypoints.len());
    assert_eq!(server.error("fht/museum/path?from=0,0;to=3,0;to_nearest=yes").await.code, ErrorCode::BadRequest);
    server.end().await;
}

/// A node at (50, 0) that nothing joins.
fn far_node() -> fht_proto::Increment {
    let pose = fht_proto::FixedPose::from_metres(50.0, 0.0, 0.0);
    let put = fht_proto::Op::PutNode { id: node(BEN, 0), kind: fht_proto::NodeKind::Support, pose };
    fht_proto::Increment { author: BEN, number: 1, hlc_us: 1, ops: vec![put] }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn hostile_increments_change_nothing() {
    let server = Running::with(5, 0).await;
    let before: Head = server.json("fht/museum/head").await;
    let refusals = server.session.declare_subscriber(Key::refused(&museum(), ANA).to_string()).await.unwrap();
    let good = bytes(ANA, 6);
    // On a busy machine nothing is dropped on the way.
    let put =
        |key: String, payload: Vec<u8>| server.session.put(key, payload).congestion_control(CongestionControl::Block);
    let mut sent = 0;
    for at in (0..good.len()).step_by(7) {
        let mut damaged = good.clone();
        damaged[at] ^= 0x10;
        put(key(ANA, 6), damaged).await.unwrap();
        sent += 1;
    }
    for (name, payload) in [
        (key(ANA, 6), bytes(BEN, 6)),
        (key(ANA, 3), bytes(ANA, 4)),
        ("fht/museum/inc/x/1".to_owned(), good.clone()),
        ("fht/museum/inc/0000000a/6/7".to_owned(), good.clone()),
        (key(ANA, 6), vec![0; 2 << 20]),
    ] {
        put(name, payload).await.unwrap();
        sent += 1;
    }
    server.session.delete(key(ANA, 1)).await.unwrap();
    sent += 1;
    let after = head_when(&server.session, |head| head.refused >= sent).await;
    let told = tokio::time::timeout(Duration::from_secs(10), refusals.recv_async()).await.unwrap().unwrap();
    let told: ErrorReply = serde_json::from_slice(&told.payload().to_bytes()).unwrap();
    assert_eq!(told.code, ErrorCode::BadRequest, "{told}");
    assert_eq!(Head { refused: 0, ..after }, before);
    // The server goes on as if nothing had happened.
    server.session.put(key(ANA, 6), good).await.unwrap();
    let last = head_when(&server.session, |head| head.version == 6).await;
    assert_eq!((last.digest, last.refused), (expected(&[(ANA, 6)]).0.digest(), sent));
    assert_eq!(last.vector, "0000000a:6".parse::<VersionVector>().unwrap());
    server.end().await;
}
