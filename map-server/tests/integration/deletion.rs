//! Maps that are deleted and renamed, with a server process: readable in the grace period, gone
//! after it, also for the next server; writers and robots are told.

use crate::support::site::Site;
use crate::support::{ANA, BEN, Server, ask, ask_with, bytes, expected, head, head_when, key, museum, until_up};
use fht_proto::api::deletion::{DeletionOrder, MapDeletion};
use fht_proto::api::keys::Key;
use fht_proto::api::reply::{ErrorCode, ErrorReply, Head, MapsReply, PathReply};
use serde_json::Value;
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};
use zenoh::Session;
use zenoh::sample::Sample;

const PATIENCE: Duration = Duration::from_secs(30);

async fn maps(session: &Session) -> Vec<Head> {
    let reply = ask(session, "fht/maps").await.remove(0).unwrap();
    serde_json::from_slice::<MapsReply>(&reply).unwrap().maps
}

async fn until_gone(session: &Session) -> ErrorReply {
    let begin = Instant::now();
    loop {
        if let Some(Err(refused)) = ask(session, "fht/museum/head").await.into_iter().next() {
            return refused;
        }
        assert!(begin.elapsed() < PATIENCE, "the map is there for ever");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
}

/// Puts an increment until its writer is told why not.
async fn refusal(session: &Session, author: fht_proto::AuthorId, number: u64) -> ErrorReply {
    let told = session.declare_subscriber(Key::refused(&museum(), author).to_string()).await.unwrap();
    let begin = Instant::now();
    loop {
        session.put(key(author, number), bytes(author, number)).await.unwrap();
        if let Ok(Ok(sample)) = tokio::time::timeout(Duration::from_secs(1), told.recv_async()).await {
            return serde_json::from_slice(&sample.payload().to_bytes()).unwrap();
        }
        assert!(begin.elapsed() < PATIENCE, "nobody tells its writer");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn in_the_grace_period_a_map_is_read_and_not_written() {
    let site = Site::with(8).await;
    site.run(&["place", "museum", "dock", "5,0"]);
    let reason = "the building is torn down";
    let told = site.run(&["delete", "museum", "--reason", reason, "--operator", "desk"]);
    let deletion: MapDeletion = serde_json::from_value(told["deletion"].clone()).unwrap();
    assert_eq!((deletion.by.as_str(), deletion.reason.as_str(), deletion.done), ("desk", reason, false));
    let sentence = format!("map museum will be deleted at {} by desk: {reason}", deletion.at);

    assert_eq!(maps(&site.session).await[0].deletion.as_ref(), Some(&deletion));
    assert_eq!(head(&site.session).await.unwrap().deletion, Some(deletion));
    assert!(site.path("from=0,0;to=dock").await.is_ok());
    let output = Command::new(env!("CARGO_BIN_EXE_map-server"))
        .args(["rules", "museum", "--connect", &site.endpoint])
        .output()
        .unwrap();
    let said = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    assert!(said(output.stderr).contains(&sentence) && said(output.stdout).contains("place dock at"));
    let output = Command::new(env!("CARGO_BIN_EXE_map-server")).args(["maps", "--connect", &site.endpoint]).output();
    assert!(said(output.unwrap().stdout).contains(&sentence));

    for (author, number) in [(BEN, 1), (ANA, 9)] {
        let refused = refusal(&site.session, author, number).await;
        assert_eq!((refused.code, refused.message), (ErrorCode::Deleted, sentence.clone()));
    }
    for args in
        [&["place", "museum", "dock", "6,0"][..], &["undo", "museum"][..], &["release", "create", "museum", "last"][..]]
    {
        assert!(site.complaint(args).contains(&sentence), "{args:?}");
    }
    for (args, reason) in [
        (&["delete", "museum"][..], "--reason"),
        (&["delete", "museum", "--reason", " "][..], "a deletion needs a reason"),
        (&["delete", "museum", "--reason", "x", "--grace", "99y"][..], "ten years at most"),
        (&["delete", "museum", "--reason", "x", "--grace", "soon"][..], "write 12h, 7d or 0s"),
        (&["delete", "louvre", "--reason", "x"][..], "there is no map louvre"),
        (&["undelete", "louvre"][..], "there is no map louvre"),
    ] {
        let complaint = site.complaint(args);
        assert!(complaint.contains(reason), "{args:?}: {complaint}");
    }
    let order = |text: &str| ask_with(&site.session, "fht/museum/admin/delete", text.as_bytes().to_vec());
    for text in ["", "{}", r#"{"grace_s": 1, "reason": "", "by": "desk"}"#, r#"{"grace_s": -1}"#] {
        assert_eq!(order(text).await[0].as_ref().unwrap_err().code, ErrorCode::BadRequest, "{text}");
    }

    let kept = site.run(&["undelete", "museum"]);
    assert_eq!(kept["deletion"], Value::Null);
    assert!(site.complaint(&["undelete", "museum"]).contains("is not going to be deleted"));
    site.run(&["place", "museum", "dock", "6,0"]);
    site.drive(9, 9).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn after_it_the_map_is_gone_also_for_the_next_server() {
    let mut site = Site::with(10).await;
    let data = site.dir.path().join("data");
    site.run(&["delete", "museum", "--reason", "mistyped", "--grace", "2s"]);
    site.server.kill();
    site.server = Server::start(&data, &site.endpoint);
    let gone = until_gone(&site.session).await;
    assert_eq!(gone.code, ErrorCode::UnknownMap);
    assert!(gone.message.contains("map museum was deleted at") && gone.message.contains("mistyped"), "{gone}");
    assert!(maps(&site.session).await.is_empty());
    assert!(site.complaint(&["undelete", "museum"]).contains("was deleted at"));

    assert_eq!(site.server.terminate(), Some(0));
    site.server = Server::start(&data, &site.endpoint);
    until_up(&site.session).await;
    assert!(maps(&site.session).await.is_empty(), "a restart does not bring it back");
    // Whoever goes on is told, and begins nothing.
    let refused = refusal(&site.session, ANA, 11).await;
    assert!(refused.code == ErrorCode::Deleted && refused.message.contains("was deleted at"), "{refused}");
    assert!(maps(&site.session).await.is_empty());

    // A map of the same name begins, also with the same writer.
    site.drive(1, 12).await;
    let (state, vector) = expected(&[(ANA, 12)]);
    let new = head(&site.session).await.unwrap();
    assert_eq!((new.digest, new.vector, new.deletion), (state.digest(), vector, None));
    site.server.kill();
    site.server = Server::start(&data, &site.endpoint);
    until_up(&site.session).await;
    assert_eq!(head(&site.session).await.unwrap().digest, state.digest());

    // The time is up while no server runs.
    site.run(&["delete", "museum", "--reason", "again", "--grace", "1s"]);
    assert_eq!(site.server.terminate(), Some(0));
    tokio::time::sleep(Duration::from_millis(1100)).await;
    site.server = Server::start(&data, &site.endpoint);
    until_up(&site.session).await;
    assert!(maps(&site.session).await.is_empty(), "it is not shown for a moment");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn without_a_grace_period_it_goes_at_once_and_its_room_is_used_again() {
    let site = Site::with(200).await;
    let file = site.dir.path().join("data/maps.redb");
    let size = || std::fs::metadata(&file).unwrap().len();
    let full = size();
    let last_heads = Arc::new(AtomicUsize::new(0));
    let counted = Arc::clone(&last_heads);
    let count = move |sample: Sample| {
        let head: Head = serde_json::from_slice(&sample.payload().to_bytes()).unwrap();
        counted.fetch_add(usize::from(head.deletion.is_some_and(|deletion| deletion.done)), Ordering::Relaxed);
    };
    let _heads = site.session.declare_subscriber("fht/museum/head").callback(count).await.unwrap();
    for _ in 0..4 {
        let told = site.run(&["delete", "museum", "--reason", "a trial", "--grace", "0s"]);
        assert_eq!(told["deletion"]["done"], true);
        assert_eq!(until_gone(&site.session).await.code, ErrorCode::UnknownMap);
        site.drive(1, 200).await;
    }
    assert!(size() <= 2 * full, "{} bytes instead of {full}", size());
    assert_eq!(last_heads.load(Ordering::Relaxed), 4, "each is told once");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_renamed_map_has_everything_and_the_old_one_says_where_it_went() {
    let site = Site::with(30).await;
    site.run(&["place", "museum", "dock", "5,0"]);
    site.run(&["release", "create", "museum", "opening"]);
    site.run(&["release", "enable", "museum", "opening"]);
    site.run(&["retain", "museum", "--keep", "4"]);
    site.drive(31, 33).await;
    let before = head_when(&site.session, |_| true).await;
    let path_on = async |map: &str| {
        let reply = ask(&site.session, &format!("fht/{map}/path?from=0,0;to=dock")).await.remove(0);
        reply.map(|bytes| serde_json::from_slice::<PathReply>(&bytes).unwrap())
    };
    let path = path_on("museum").await.unwrap();

    let renamed = site.run(&["rename", "museum", "hall", "--reason", "mistyped", "--operator", "desk"]);
    assert_eq!(renamed["new"]["digest"], renamed["old"]["digest"]);
    assert_eq!(renamed["old"]["deletion"]["moved_to"], "hall");
    let on_hall = path_on("hall").await.unwrap();
    assert_eq!((on_hall.length_m, on_hall.release), (path.length_m, path.release));
    let releases = site.run(&["release", "list", "hall"]);
    assert_eq!(
        (&releases["releases"][0]["name"], &releases["releases"][0]["available"]),
        (&"opening".into(), &true.into())
    );
    assert_eq!(renamed["new"]["vector"], serde_json::to_value(&before.vector).unwrap());
    assert!(path_on("museum").await.is_ok(), "in the grace period");
    let refused = refusal(&site.session, BEN, 1).await;
    assert!(refused.message.contains("it has moved to hall"), "{refused}");

    // Given again, nothing else is done; another map is not overwritten.
    site.run(&["rename", "museum", "hall", "--reason", "mistyped"]);
    assert!(site.complaint(&["rename", "hall", "museum", "--reason", "x"]).contains("there is a map museum already"));
    let taken = ["rename", "hall", "museum", "--reason", "x", "--connect", &site.endpoint];
    let code = std::process::Command::new(env!("CARGO_BIN_EXE_map-server")).args(taken).status().unwrap().code();
    assert_eq!(code, Some(2), "the same would fail again");
    assert!(site.complaint(&["rename", "hall", "hall", "--reason", "x"]).contains("is its name already"));
    let order = DeletionOrder {
        grace_s: 60,
        reason: "letters".to_owned(),
        by: "desk".parse().unwrap(),
        moved_to: Some("foyer".parse().unwrap()),
    };
    ask_with(&site.session, "fht/hall/admin/delete", serde_json::to_vec(&order).unwrap()).await.remove(0).unwrap();
    let renamed = site.run(&["rename", "hall", "foyer", "--reason", "letters", "--grace", "0s"]);
    assert_eq!(renamed["old"]["deletion"]["done"], true);
    assert_eq!(path_on("foyer").await.unwrap().length_m, path.length_m);
    assert!(path_on("hall").await.unwrap_err().message.contains("it has moved to foyer"));
}

fn move_order(new: &str) -> Vec<u8> {
    move_order_within(60, new)
}

fn move_order_within(grace_s: u64, new: &str) -> Vec<u8> {
    let order = DeletionOrder {
        grace_s,
        reason: "letters".to_owned(),
        by: "desk".parse().unwrap(),
        moved_to: Some(new.parse().unwrap()),
    };
    serde_json::to_vec(&order).unwrap()
}

/// A rename that is given again finds that the copy is gone, is to go, or is another map by now.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_rename_given_again_never_deletes_the_last_copy() {
    let site = Site::with(20).await;
    let whole = head(&site.session).await.unwrap();
    let give = async |map: &str, grace_s: u64, new: &str| {
        let key = format!("fht/{map}/admin/delete");
        let reply = ask_with(&site.session, &key, move_order_within(grace_s, new)).await.remove(0);
        reply.map(|bytes| serde_json::from_slice::<Head>(&bytes).unwrap())
    };
    let names = |heads: &[Head]| heads.iter().map(|head| head.map.to_string()).collect::<Vec<_>>();
    give("museum", 60, "hall").await.unwrap();
    site.run(&["delete", "hall", "--reason", "a slip", "--grace", "0s"]);
    assert_eq!(head(&site.session).await.unwrap().deletion.unwrap().moved_to, None, "it is nowhere else any more");
    give("museum", 0, "hall").await.unwrap();
    let heads = maps(&site.session).await;
    assert_eq!((names(&heads), heads[0].digest), (vec!["hall".to_owned()], whole.digest));

    // What has moved on is found where it is.
    give("hall", 60, "foyer").await.unwrap();
    give("foyer", 0, "annex").await.unwrap();
    let of = |map: &str, heads: &[Head]| heads.iter().find(|head| head.map.as_str() == map).unwrap().clone();
    let hall = of("hall", &maps(&site.session).await);
    assert_eq!(hall.deletion.unwrap().moved_to, Some("annex".parse().unwrap()));
    // Another map takes the name that was given up.
    let file = site.dir.path().join("annex.fht");
    site.run(&["export", "annex", file.to_str().unwrap()]);
    site.run(&["import", file.to_str().unwrap(), "--map", "foyer"]);
    assert_eq!(give("hall", 0, "foyer").await.unwrap_err().code, ErrorCode::Conflict);
    // A copy that will be deleted itself is none.
    site.run(&["delete", "annex", "--reason", "a slip", "--grace", "1h"]);
    let refused = give("hall", 0, "annex").await.unwrap_err();
    assert!(refused.code == ErrorCode::Conflict && refused.message.contains("map-server undelete annex"), "{refused}");
    assert_eq!(names(&maps(&site.session).await), ["annex", "foyer", "hall"]);

    // When the old one is deleted can be said anew; where it went stays.
    site.run(&["undelete", "annex"]);
    site.run(&["delete", "hall", "--reason", "letters", "--grace", "2h"]);
    assert!(of("hall", &maps(&site.session).await).deletion.unwrap().moved_to.is_some());
    give("hall", 0, "annex").await.unwrap();
    assert_eq!(names(&maps(&site.session).await), ["annex", "foyer"]);
    // A reason that turns the sentence round is none.
    let turned = r#"{"grace_s": 1, "reason": "a\u202eb", "by": "desk"}"#;
    let reply = ask_with(&site.session, "fht/foyer/admin/delete", turned.as_bytes().to_vec()).await.remove(0);
    assert_eq!(reply.unwrap_err().code, ErrorCode::BadRequest);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn two_maps_do_not_become_one_and_one_does_not_become_two() {
    let site = Site::with(20).await;
    let file = site.dir.path().join("museum.fht");
    site.run(&["export", "museum", file.to_str().unwrap()]);
    site.run(&["import", file.to_str().unwrap(), "--map", "annex"]);
    site.run(&["place", "annex", "desk", "5,0"]);
    let give = async |map: &str, new: &str| {
        let key = format!("fht/{map}/admin/delete");
        let reply = ask_with(&site.session, &key, move_order(new)).await.remove(0);
        reply.map(|_| ()).map_err(|refused| refused.code)
    };
    // Both at once: the second one is refused, and stays as it is.
    let both = tokio::join!(give("museum", "hall"), give("annex", "hall"));
    let kept = match both {
        (Ok(()), Err(ErrorCode::Conflict)) => "annex",
        (Err(ErrorCode::Conflict), Ok(())) => "museum",
        other => panic!("{other:?}"),
    };
    let digest = |map: &str, heads: &[Head]| heads.iter().find(|head| head.map.as_str() == map).unwrap().digest;
    let heads = maps(&site.session).await;
    let moved = if kept == "annex" { "museum" } else { "annex" };
    assert_eq!(digest("hall", &heads), digest(moved, &heads));
    assert!(heads.iter().all(|head| head.deletion.is_some() == (head.map.as_str() == moved)), "{heads:?}");
    // To two names.
    assert_eq!(give(moved, "foyer").await, Err(ErrorCode::Conflict));
    assert_eq!(give(kept, "foyer").await, Ok(()));
    assert_eq!(maps(&site.session).await.len(), 4);
}

/// Half a map under a new name would be worse than none: the old one is deleted some day.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_rename_is_whole_or_nothing_when_the_server_is_killed() {
    let mut site = Site::with(300).await;
    let data = site.dir.path().join("data");
    let whole = head(&site.session).await.unwrap();
    let mut moved = 0;
    for wait_ms in [0, 1, 2, 4, 7, 12, 20, 50] {
        let session = site.session.clone();
        let asked =
            tokio::spawn(async move { ask_with(&session, "fht/museum/admin/delete", move_order("hall")).await });
        tokio::time::sleep(Duration::from_millis(wait_ms)).await;
        site.server.kill();
        site.server = Server::start(&data, &site.endpoint);
        until_up(&site.session).await;
        asked.abort();
        let heads = maps(&site.session).await;
        assert!(heads.iter().all(|head| (head.version, head.digest) == (whole.version, whole.digest)), "{heads:?}");
        let is_moved = heads.len() == 2;
        assert_eq!(head(&site.session).await.unwrap().deletion.is_some(), is_moved, "after {wait_ms} ms");
        if is_moved {
            moved += 1;
            site.run(&["undelete", "museum"]);
            site.run(&["delete", "hall", "--reason", "once more", "--grace", "0s"]);
        }
    }
    println!("moved {moved} of 8 times");
}
