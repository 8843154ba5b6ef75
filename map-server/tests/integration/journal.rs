//! The journal of operators' changes: who changed what when, also before a restart, by any way in;
//! pages of it are asked by clients that are not ours, and nothing is read from the log for them.

use crate::support::site::Site;
use crate::support::{ANA, BEN, Server, ask, head_when, key, museum, node, until_up};
use fht_client::author::{Authorship, write};
use fht_proto::api::keys::Key;
use fht_proto::api::reply::{ErrorCode, ErrorReply, JournalReply};
use fht_proto::api::request::parse;
use fht_proto::{AuthorId, FixedPose, Increment, NodeId, NodeKind, Op, encode};
use map_server::catalog::Catalog;
use map_server::config::Limits;
use map_server::ingest::{Arrival, Ingest};
use map_server::query::{AnswerSources, answer};
use map_server::store::{IncrementLog, MemoryLog};
use serde_json::Value;
use std::process::Command;
use std::sync::Arc;
use std::time::{Duration, UNIX_EPOCH};

/// Author, name and words of each change, the newest first.
fn told(journal: &Value) -> Vec<(String, Option<String>, String)> {
    let text = |value: &Value| value.as_str().map(str::to_owned);
    let words = |entry: &Value| {
        entry["words"].as_array().unwrap().iter().filter_map(Value::as_str).collect::<Vec<_>>().join("; ")
    };
    let entries = journal["entries"].as_array().unwrap().iter();
    entries.map(|entry| (text(&entry["author"]).unwrap(), text(&entry["name"]), words(entry))).collect()
}

async fn asked(site: &Site, parameters: &str) -> Result<Value, ErrorReply> {
    let reply = ask(&site.session, &format!("fht/museum/journal{parameters}")).await.remove(0);
    reply.map(|bytes| serde_json::from_slice(&bytes).unwrap())
}

/// The server is killed and started with a list of roles.
async fn start_anew(site: &mut Site, roles: &str) {
    site.server.kill();
    let file = site.dir.path().join("roles.json5");
    std::fs::write(&file, roles).unwrap();
    let args = ["--roles", file.to_str().unwrap()];
    site.server = Server::with(&site.dir.path().join("data"), &site.endpoint, &args, &site.dir.path().join("log"));
    until_up(&site.session).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn who_changed_what_is_known_after_a_restart_and_to_foreign_clients() {
    let mut site = Site::with(12).await;
    let begun_us = UNIX_EPOCH.elapsed().unwrap().as_micros() as u64;
    site.run(&["place", "museum", "dock", "9,0,180"]);
    site.run(&["zone", "museum", "wet", "3,-1.5 4,-1.5 4,0.3 3,0.3", "--speed-limit", "0.3", "--operator", "desk"]);
    site.drive(13, 14).await;
    site.run(&["close", "museum", "0000000a.5", "0000000a.6", "--operator", "desk"]);
    site.run(&["release", "create", "museum", "first"]);
    site.run(&["release", "enable", "museum", "first"]);
    site.run(&["undo", "museum", "--operator", "desk"]);
    // Somebody who does not say who.
    let place = Op::SetPlace { name: "quay".parse().unwrap(), pose: Some(FixedPose::from_metres(2.0, 0.0, 0.0)) };
    let later_us = UNIX_EPOCH.elapsed().unwrap().as_micros() as u64 + 1_000_000;
    let increment = Increment { author: BEN, number: 1, hlc_us: later_us, ops: vec![place] };
    site.session.put(key(BEN, 1), encode(&increment).unwrap()).await.unwrap();
    head_when(&site.session, |head| head.vector.get(BEN) == 1).await;
    let unknown = BEN.to_string();
    let (operator, desk): (String, String) =
        ["operator", "desk"].map(|name| AuthorId::of_robot(name).to_string()).into();
    let release = format!("first@{operator}");
    let expected = [
        (&unknown, None, "place quay is at 2.00,0.00, 0°".to_owned()),
        (&desk, Some("desk"), "the edge 0000000a.5 0000000a.6 is open".to_owned()),
        (&operator, Some("operator"), format!("robots use release {release}")),
        (&operator, Some("operator"), format!("release {release} is made of version 17")),
        (&desk, Some("desk"), "the edge 0000000a.5 0000000a.6 is closed".to_owned()),
        (&desk, Some("desk"), "zone wet: at most 0.3 m/s, 4 corners".to_owned()),
        (&operator, Some("operator"), "place dock is at 9.00,0.00, 180°".to_owned()),
    ]
    .map(|(author, name, words)| (author.clone(), name.map(str::to_owned), words));
    let journal = asked(&site, "").await.unwrap();
    assert_eq!(told(&journal), expected, "no robots' increments");
    assert!(journal["entries"].as_array().unwrap().iter().all(|entry| entry["at_us"].as_u64() >= Some(begun_us)));
    assert_eq!(told(&site.run(&["journal", "museum", "--last", "2"])).len(), 2);

    start_anew(&mut site, "{explorers: ['ana'], operators: ['desk', 'operator']}").await;
    assert_eq!(told(&asked(&site, "").await.unwrap()), expected, "the list of roles names them");

    // Page by page, by somebody else's program.
    let zenoh = crate::packages::zenoh_cli(env!("CARGO_TARGET_TMPDIR"));
    let (mut after, mut all) = (String::new(), Vec::new());
    loop {
        let selector = format!("fht/museum/journal?limit=4{after}");
        let output = crate::packages::run(Command::new(&zenoh).args([
            "--connect",
            &site.endpoint,
            "get",
            "-s",
            &selector,
            "--decoder",
            "json",
        ]));
        let page: Value = serde_json::from_slice(&output.stdout).unwrap();
        all.extend(told(&page));
        match page["next"].as_str() {
            Some(next) => after = format!(";after={next}"),
            None => break,
        }
    }
    assert_eq!(all, expected);
    for (parameters, reason) in [
        ("?limit=0", "limit must be 1 to 200"),
        ("?after=yesterday", "is not what a reply gave as next"),
        ("?fmt=postcard", "answered in JSON only"),
        ("?by=desk", "unknown parameter by"),
    ] {
        let refusal = asked(&site, parameters).await.unwrap_err();
        assert!(refusal.code == ErrorCode::BadRequest && refusal.message.contains(reason), "{parameters}: {refusal}");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn of_folded_changes_those_are_told_that_still_count() {
    let mut site = Site::with(6).await;
    for x in ["1,0", "2,0", "3,0"] {
        site.run(&["place", "museum", "dock", x, "--operator", "desk"]);
    }
    site.run(&["place", "museum", "quay", "4,0", "--operator", "desk"]);
    site.run(&["place", "museum", "quay", "--remove", "--operator", "desk"]);
    site.run(&["retain", "museum", "--keep", "2"]);
    let words = |journal: &Value| {
        let entries = journal["entries"].as_array().unwrap().iter();
        entries
            .map(|entry| (entry["words"][0].as_str().unwrap().to_owned(), entry["folded"] == true))
            .collect::<Vec<_>>()
    };
    let expected = [
        ("place quay is taken away", false),
        ("place quay is at 4.00,0.00, 0°", false),
        ("place dock is at 3.00,0.00, 0°", true),
    ]
    .map(|(words, folded)| (words.to_owned(), folded));
    assert_eq!(words(&asked(&site, "").await.unwrap()), expected);
    site.server.kill();
    site.server = Server::start(&site.dir.path().join("data"), &site.endpoint);
    until_up(&site.session).await;
    // Who asks knows the own name.
    let of_desk = site.run(&["journal", "museum", "--operator", "desk"]);
    assert!(told(&of_desk).iter().all(|(_, name, _)| name.as_deref() == Some("desk")), "{of_desk}");
    assert_eq!(told(&asked(&site, "").await.unwrap())[0].1, None, "and the server does not, without a list");
    assert_eq!(words(&asked(&site, "").await.unwrap()), expected, "after a restart, too");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_operators_do_to_nodes_alone_is_told_and_what_robots_do_is_not() {
    let mut site = Site::with(6).await;
    assert_eq!(told(&site.run(&["journal", "museum"])), []);
    // As a merge does: nothing in it is for operators only.
    let desk = AuthorId::of_robot("desk");
    let by = Authorship { name: "desk", may_begin: false, timeout: Duration::from_secs(60) };
    let put = |number| Op::PutNode {
        id: NodeId { author: desk, number },
        kind: NodeKind::Support,
        pose: FixedPose::from_metres(f64::from(number), 0.5, 0.0),
    };
    write(&site.session, &museum(), by, vec![put(0), put(1)]).await.unwrap();
    write(&site.session, &museum(), by, vec![Op::RemoveNode { id: node(ANA, 3) }]).await.unwrap();
    site.run(&["undo", "museum", "--last", "2", "--operator", "desk"]);
    site.drive(7, 8).await;
    let journal = asked(&site, "").await.unwrap();
    let lines = told(&journal);
    assert!(lines.iter().all(|(_, name, _)| name.as_deref() == Some("desk")), "{lines:?}");
    let words: Vec<&str> = lines.iter().map(|(_, _, words)| words.as_str()).collect();
    assert_eq!((words.len(), &words[1..]), (3, &["1 node is taken away", "2 nodes are put"][..]), "{words:?}");
    assert!(words[0].contains("2 nodes are taken away"), "{words:?}");

    // Who is listed is known at once.
    start_anew(&mut site, "{explorers: ['ana'], operators: ['desk']}").await;
    assert_eq!(told(&asked(&site, "").await.unwrap()), lines);
}

#[test]
fn the_log_is_not_read_for_it() {
    let log: Arc<dyn IncrementLog> = Arc::new(MemoryLog::new());
    let catalog = Arc::new(Catalog::load(log.as_ref()).unwrap());
    let mut ingest = Ingest::new(Arc::clone(&log), Arc::clone(&catalog), Limits::default());
    let ada = AuthorId::of_robot("ada");
    let erase = |number: u64| {
        let ops = vec![Op::RemoveNode { id: node(ANA, number as u32) }];
        let increment = Increment { author: ada, number, hlc_us: 2_000_000 + number, ops };
        let key = Key::increment(&museum(), ada, number).to_string();
        Arrival { key, payload: Ok(encode(&increment).unwrap()) }
    };
    let drive =
        |number| Arrival { key: crate::support::key(ANA, number), payload: Ok(crate::support::bytes(ANA, number)) };
    ingest.take_arrivals((1..=1500).map(drive).collect(), 3_000_000).unwrap();
    ingest.take_arrivals((1..=1200).map(erase).collect(), 3_000_000).unwrap();
    assert_eq!(catalog.view(&museum()).unwrap().head.version, 2700);
    let sources = AnswerSources {
        writers: None,
        catalog,
        // There is nothing in it.
        log: Arc::new(MemoryLog::new()),
        active_rules: Arc::default(),
        fleet: Arc::default(),
        operators: Arc::default(),
        config: Arc::default(),
    };
    sources.operators.learn("ada");
    let ask = |after: Option<String>| -> JournalReply {
        let pairs = [("limit", "200"), ("after", after.as_deref().unwrap_or_default())];
        let given = pairs.into_iter().filter(|(_, value)| !value.is_empty());
        let question = parse("fht/museum/journal".parse().unwrap(), given, None).unwrap();
        serde_json::from_slice(&answer(question, &sources, 0).unwrap()[0].bytes).unwrap()
    };
    let (mut after, mut numbers) = (None, Vec::new());
    loop {
        let page = ask(after);
        assert!(page.entries.iter().all(|entry| entry.name.as_deref() == Some("ada")));
        numbers.extend(page.entries.iter().map(|entry| entry.number));
        after = page.next;
        if after.is_none() {
            break;
        }
    }
    assert!(
        numbers.iter().copied().eq((201..=1200).rev()),
        "the newest thousand: {} from {:?}",
        numbers.len(),
        numbers.last()
    );
}
