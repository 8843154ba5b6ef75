//! Robots report what is blocked to a real server: no robot closes a building, reports end with
//! their robot, operators open and keep them, and a flood of reports does not slow paths down.

use crate::support::site::Site;
use crate::support::{ask, client, museum};
use fht_client::{LiveReplica, ReplicaConfig};
use fht_proto::api::fleet::BlockedReport;
use fht_proto::api::keys::{Key, RobotTopic};
use fht_proto::api::reply::{ErrorCode, RulesReply};
use serde_json::Value;
use std::time::{Duration, Instant};
use zenoh::Session;
use zenoh::liveliness::LivelinessToken;

const LONG: f64 = 86_400.0;

fn report(for_s: f64, places: &[[f64; 2]]) -> BlockedReport {
    BlockedReport { for_s, edges: Vec::new(), places: places.to_vec() }
}

async fn say(session: &Session, robot: &str, report: &BlockedReport) {
    let key = Key::robot(&museum(), robot, RobotTopic::Blocked).to_string();
    session.put(key, serde_json::to_vec(report).unwrap()).await.unwrap();
}

async fn token(session: &Session, robot: &str) -> LivelinessToken {
    let token = session.liveliness().declare_token(format!("fht/museum/robots/{robot}")).await.unwrap();
    // Reports of robots that are not there are cut: the server is to know first.
    tokio::time::sleep(Duration::from_millis(300)).await;
    token
}

async fn rules(session: &Session) -> RulesReply {
    let answer = ask(session, "fht/museum/rules").await.remove(0).unwrap();
    serde_json::from_slice(&answer).unwrap()
}

/// Waits until what is blocked satisfies `done`.
async fn until(session: &Session, what: &str, done: impl Fn(&RulesReply) -> bool) -> RulesReply {
    let begin = Instant::now();
    loop {
        let now = rules(session).await;
        if done(&now) {
            return now;
        }
        assert!(begin.elapsed() < Duration::from_secs(30), "{what}: {now:?}");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
}

/// A path that passes x = 20, or the refusal's code.
async fn path(site: &Site) -> Result<f64, ErrorCode> {
    site.path("from=0,0;to=40,0").await.map(|reply| reply.length_m).map_err(|refusal| refusal.code)
}

async fn until_path(site: &Site, expected: Result<(), ErrorCode>) {
    let begin = Instant::now();
    loop {
        let found = path(site).await.map(|_| ());
        if found == expected {
            return;
        }
        assert!(begin.elapsed() < Duration::from_secs(30), "{found:?}");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
}

/// Across the corridor.
const BARRIER: [[f64; 2]; 5] = [[20.0, -0.8], [20.0, -0.4], [20.0, 0.0], [20.0, 0.4], [20.0, 0.8]];

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn one_robot_does_not_close_a_building() {
    let site = Site::with(100).await;
    let rogue = client(&site.endpoint).await;
    let _token = token(&rogue, "rogue").await;
    for batch in 0..43 {
        let places: Vec<[f64; 2]> = (0..64).map(|i| [f64::from(batch) * 2.0 + f64::from(i) * 0.03, 0.0]).collect();
        say(&rogue, "rogue", &report(LONG, &places)).await;
    }
    say(&rogue, "rogue", &report(LONG, &[[90.0, 0.0]])).await;
    let at_the_end = |rules: &RulesReply| rules.blocked.iter().any(|view| view.places == [[90.0, 0.0]]);
    let blocked = until(&site.session, "the last report", at_the_end).await.blocked;
    let things: usize = blocked.iter().map(|view| view.places.len()).sum();
    assert!(things <= 64, "{things} places");
    assert!(blocked.iter().all(|view| view.for_s <= 600.0), "for ten minutes at most");
    let far = blocked.iter().flat_map(|view| &view.places).filter(|[x, _]| *x < 60.0).count();
    assert_eq!(far, 0, "and only near each other");
    until_path(&site, Ok(())).await;

    // One that is not there closes nothing for long.
    say(&rogue, "nobody", &report(LONG, &[[50.0, 0.0]])).await;
    let is_there = |rules: &RulesReply| rules.blocked.iter().any(|view| view.robot == "nobody");
    let of_nobody = until(&site.session, "the report of nobody", is_there).await.blocked;
    assert!(of_nobody.iter().find(|view| view.robot == "nobody").unwrap().for_s <= 60.0);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn operators_open_what_was_reported_and_copies_hear_of_it() {
    let site = Site::with(60).await;
    let robot = client(&site.endpoint).await;
    let held = token(&robot, "tug").await;
    let listening = client(&site.endpoint).await;
    let copy = LiveReplica::start(&listening, &museum(), "other", ReplicaConfig::default()).unwrap();
    assert!(copy.wait_for(&crate::support::expected(&[(crate::support::ANA, 60)]).1, Duration::from_secs(30)));
    let copy_knows = async |count: usize, said: Option<&BlockedReport>| {
        let (begin, mut spoken) = (Instant::now(), Instant::now());
        while copy.rules().blocked.len() != count {
            assert!(begin.elapsed() < Duration::from_secs(60), "{:?}", copy.rules().blocked);
            tokio::time::sleep(Duration::from_millis(50)).await;
            // A busy machine drops what is put, and robots say it again.
            if let Some(report) = said.filter(|_| spoken.elapsed() >= Duration::from_secs(1)) {
                say(&robot, "tug", report).await;
                spoken = Instant::now();
            }
        }
    };
    let barrier = report(LONG, &BARRIER);
    say(&robot, "tug", &barrier).await;
    until_path(&site, Err(ErrorCode::NoPath)).await;
    copy_knows(1, Some(&barrier)).await;

    let cleared = site.run(&["blocked", "clear", "museum", "--robot", "tug", "--ignore", "1h"]);
    assert_eq!(cleared["blocked"], Value::Array(Vec::new()));
    let ignored = &cleared["ignored"][0];
    assert!(ignored["robot"] == "tug" && ignored["for_s"].as_f64().is_some_and(|for_s| for_s > 3590.0), "{cleared}");
    let listed = site.run(&["blocked", "list", "museum"]);
    assert_eq!(listed["ignored"][0]["robot"], "tug", "{listed}");
    assert!(path(&site).await.is_ok(), "at once");
    copy_knows(0, None).await;
    say(&robot, "tug", &report(LONG, &BARRIER)).await;
    tokio::time::sleep(Duration::from_secs(1)).await;
    assert!(path(&site).await.is_ok(), "what it says does not count now");

    // What an operator keeps stays when its robot goes, and takes nothing back.
    site.run(&["blocked", "clear", "museum", "--robot", "tug"]);
    say(&robot, "tug", &report(LONG, &BARRIER)).await;
    until_path(&site, Err(ErrorCode::NoPath)).await;
    site.run(&["blocked", "keep", "museum", "--robot", "tug", "--for", "2h"]);
    say(&robot, "tug", &BlockedReport::default()).await;
    held.undeclare().await.unwrap();
    tokio::time::sleep(Duration::from_secs(1)).await;
    let listed = site.run(&["blocked", "list", "museum"]);
    assert!(listed["blocked"][0]["for_s"].as_f64().unwrap() > 7000.0, "{listed}");
    let nothing = site.complaint(&["blocked", "keep", "museum", "--robot", "other", "--for", "2h"]);
    assert!(nothing.contains("other reports nothing blocked"), "{nothing}");
    let nothing = site.complaint(&["blocked", "clear", "museum", "--robot", "other"]);
    assert!(nothing.contains("other reports nothing blocked"), "{nothing}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_robot_that_goes_takes_its_reports_along() {
    let site = Site::with(60).await;
    let robot = client(&site.endpoint).await;
    let held = token(&robot, "tug").await;
    say(&robot, "tug", &report(LONG, &BARRIER)).await;
    let is_there = |rules: &RulesReply| rules.blocked.iter().any(|view| view.for_s > 500.0);
    until(&site.session, "the report", is_there).await;
    held.undeclare().await.unwrap();
    until(&site.session, "a minute is left", |rules| rules.blocked.iter().all(|view| view.for_s <= 60.0)).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_flood_of_reports_changes_the_free_space_twice_a_second() {
    let site = Site::with(60).await;
    let rogue = client(&site.endpoint).await;
    let _token = token(&rogue, "rogue").await;
    let (begin, mut lengths) = (Instant::now(), Vec::new());
    // Each report moves the obstacle, and with it the path.
    for number in 0..100_u32 {
        let y = f64::from(number % 40) * 0.03 - 0.6;
        say(&rogue, "rogue", &BlockedReport::default()).await;
        say(&rogue, "rogue", &report(600.0, &[[20.0, y]])).await;
        if let Ok(reply) = site.path("from=0,0;to=40,0").await {
            lengths.push(format!("{:.6} {:?}", reply.length_m, reply.waypoints));
        }
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    lengths.dedup();
    let most = (begin.elapsed().as_secs_f64() / 0.5).ceil() as usize + 1;
    assert!(lengths.len() <= most, "{} different paths, and {most} at most", lengths.len());
    assert!(lengths.len() > 1, "reports take effect all the same");
}
