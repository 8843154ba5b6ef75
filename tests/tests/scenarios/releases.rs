//! What a robot runs: its copy as it grows, or the enabled release, wherever the copy is. What
//! other robots found blocked applies to it at once. A real server and real sessions.

use fht_client::{LiveReplica, ReplicaConfig, ask_head};
use fht_proto::api::keys::{Key, RobotTopic};
use fht_proto::{
    AuthorId, FixedPoint, FixedPose, Increment, MapName, NodeId, NodeKind, Op, Release, ReleaseId, ReleaseName, encode,
};
use fht_session::SessionConfig;
use map_server::ServerConfig;
use std::time::{Duration, Instant};
use tokio::sync::oneshot;
use zenoh::{Session, Wait};

const EXPLORER: AuthorId = AuthorId(1);
const OPERATOR: AuthorId = AuthorId(2);

fn museum() -> MapName {
    "museum".parse().unwrap()
}

fn until(what: &str, mut is_so: impl FnMut() -> bool) {
    let begin = Instant::now();
    while !is_so() {
        assert!(begin.elapsed() < Duration::from_secs(20), "{what}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

fn put(session: &Session, author: AuthorId, number: u64, ops: Vec<Op>) {
    let increment = Increment { author, number, hlc_us: 1000 * number + u64::from(author.0), ops };
    let (key, bytes) = (Key::increment(&museum(), author, number).to_string(), encode(&increment).unwrap());
    // Like a writer: until the server says that it has it.
    until("an increment is stored", || {
        let head = ask_head(session, &museum(), Duration::from_secs(1));
        let is_stored = head.is_ok_and(|head| head.vector.get(author) >= number);
        if !is_stored {
            session.put(&key, bytes.clone()).wait().unwrap();
        }
        is_stored
    });
}

fn drive(session: &Session, from: u64, to: u64) {
    for number in from..=to {
        let id = NodeId { author: EXPLORER, number: number as u32 };
        let pose = FixedPose::from_metres(number as f64, 0.0, 0.0);
        put(session, EXPLORER, number, vec![Op::PutNode { id, kind: NodeKind::Support, pose }]);
    }
}

fn nodes(replica: &LiveReplica) -> usize {
    replica.running().counts().support_nodes
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_robot_runs_what_is_enabled_until_it_is_told_otherwise() {
    let data = tempfile::tempdir().unwrap();
    let endpoint = fht_demo::free_endpoint().unwrap();
    let server_link = map_server::ServerEndpoints { listen: vec![endpoint.clone()], ..Default::default() };
    let (stop, stopped) = oneshot::channel::<()>();
    let config = ServerConfig::new(data.path().to_owned(), server_link);
    let server = tokio::spawn(map_server::run(config, async { _ = stopped.await }));
    let session = fht_session::open(&SessionConfig::from_options(vec![endpoint], None)).await.unwrap();

    tokio::task::spawn_blocking(move || {
        let start = |robot: &str| LiveReplica::start(&session, &museum(), robot, ReplicaConfig::default()).unwrap();
        let early = start("early");
        drive(&session, 1, 30);
        until("thirty nodes", || nodes(&early) == 30);
        let release = {
            let copy = early.read();
            Release { vector: copy.vector().clone(), digest: copy.state().digest() }
        };
        let name: ReleaseName = "opening".parse().unwrap();
        let id = ReleaseId { author: OPERATOR, name: name.clone() };
        put(&session, OPERATOR, 1, vec![Op::PutRelease { name, release: release.clone() }]);
        drive(&session, 31, 40);
        until("what is not enabled changes nothing", || nodes(&early) == 40);

        put(&session, OPERATOR, 2, vec![Op::Enable { release: Some(id.clone()) }]);
        until("the release is fetched and run", || early.release().as_ref() == Some(&id));
        assert_eq!((nodes(&early), early.running().digest()), (30, release.digest));
        drive(&session, 41, 45);
        until("the copy goes on", || early.read().state().counts().support_nodes == 45);
        assert_eq!(nodes(&early), 30, "and the robot does not");
        let porter = Key::robot(&museum(), "porter", RobotTopic::Blocked).to_string();
        session.put(&porter, r#"{"for_s": 600, "places": [[7, 0]]}"#).wait().unwrap();
        until("it is heard", || early.rules().blocked.len() == 1);
        let late = start("late");
        until("who comes late runs it, too", || late.release().as_ref() == Some(&id) && nodes(&late) == 30);
        until("and knows what was blocked before it came", || {
            late.rules()
                .blocked
                .iter()
                .any(|by| by.robot == "porter" && by.places.contains(&FixedPoint::from_metres(7.0, 0.0)))
        });
        session.put(&porter, r#"{"for_s": 0}"#).wait().unwrap();
        until("until it is taken back", || early.rules().blocked.is_empty() && late.rules().blocked.is_empty());

        let blocked = Key::robot(&museum(), "early", RobotTopic::Blocked).to_string();
        session.put(blocked, r#"{"for_s": 1.5, "places": [[3, 0]]}"#).wait().unwrap();
        until("others avoid what one found blocked", || late.rules().blocked.len() == 1);
        assert!(late.rules().blocked[0].places.contains(&FixedPoint::from_metres(3.0, 0.0)));
        assert!(early.rules().blocked.is_empty(), "its own reports it knows better");
        until("for as long as it said", || late.rules().blocked.is_empty());

        put(&session, OPERATOR, 3, vec![Op::Enable { release: None }]);
        until("the newest state again", || nodes(&early) == 45 && nodes(&late) == 45 && late.release().is_none());
    })
    .await
    .unwrap();
    stop.send(()).unwrap();
    server.await.unwrap().unwrap();
}
