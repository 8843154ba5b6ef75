//! Maps from files go only where they belong, and a command that has failed says what of its order
//! may be there.

use crate::support::site::Site;
use crate::support::{ANA, BEN, free_endpoint, increment, museum};
use fht_proto::api::keys::Key;
use fht_proto::api::reply::Head;
use fht_proto::{MapName, encode};
use std::process::Command;
use std::time::{Duration, Instant};

/// Runs a command; its exit code and what it said on standard error.
fn ended(args: &[&str]) -> (Option<i32>, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_map-server")).args(args).output().unwrap();
    (output.status.code(), String::from_utf8(output.stderr).unwrap())
}

/// The version of a map; 0: there is none.
fn version(site: &Site, map: &str) -> u64 {
    let maps = site.run(&["maps"]);
    let of_map = maps["maps"].as_array().unwrap().iter().find(|head| head["map"] == map);
    of_map.map_or(0, |head| head["version"].as_u64().unwrap())
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_map_of_others_is_not_mixed_with_what_is_imported() {
    let site = Site::with(6).await;
    let file = site.dir.path().join("museum.fht");
    let file = file.to_str().unwrap();
    site.run(&["export", "museum", file]);
    let other: MapName = "other".parse().unwrap();
    let begin = Instant::now();
    while version(&site, "other") != 2 {
        assert!(begin.elapsed() < Duration::from_secs(30));
        for number in 1..=2 {
            let key = Key::increment(&other, BEN, number).to_string();
            site.session.put(key, encode(&increment(BEN, number)).unwrap()).await.unwrap();
        }
    }
    let (code, said) = ended(&["import", file, "--map", "other", "--connect", &site.endpoint]);
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("map other is there") && said.contains("map-server merge other NAME"), "{said}");
    assert!(!said.contains("delete"), "nothing of it is there: {said}");
    assert_eq!(version(&site, "other"), 2);
    // What is its own goes on.
    site.run(&["import", file, "--map", "copy"]);
    site.drive(7, 8).await;
    site.run(&["export", "museum", file]);
    assert_eq!(site.run(&["import", file, "--map", "copy"])["version"], 8);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn operators_of_one_name_do_not_make_two_maps_one() {
    let site = Site::with(6).await;
    let file = site.dir.path().join("museum.fht");
    let file = file.to_str().unwrap();
    let other: MapName = "other".parse().unwrap();
    let begin = Instant::now();
    while version(&site, "other") != 1 {
        assert!(begin.elapsed() < Duration::from_secs(30));
        let key = Key::increment(&other, BEN, 1).to_string();
        site.session.put(key, encode(&increment(BEN, 1)).unwrap()).await.unwrap();
    }
    for map in ["museum", "other"] {
        site.run(&["place", map, "dock", "0,0"]);
    }
    site.run(&["export", "museum", file]);
    let (code, said) = ended(&["import", file, "--map", "other", "--connect", &site.endpoint]);
    assert!(code == Some(1) && said.contains("the same name has written both maps"), "{code:?}: {said}");
    assert_eq!(version(&site, "other"), 2, "nothing of the file is there");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_map_to_which_nothing_was_brought_is_not_called_a_part() {
    let site = Site::with(3).await;
    let [early, folded] = ["early", "folded"].map(|name| site.dir.path().join(name).to_str().unwrap().to_owned());
    site.run(&["export", "museum", &early]);
    site.run(&["import", &early, "--map", "copy"]);
    site.drive(4, 6).await;
    site.run(&["retain", "museum", "--keep", "2"]);
    site.run(&["export", "museum", &folded]);
    let (code, said) = ended(&["import", &folded, "--map", "copy", "--connect", &site.endpoint]);
    assert!(code == Some(1) && said.contains("folded increments go only into a new map"), "{code:?}: {said}");
    assert!(!said.contains("delete") && !said.contains("part of"), "{said}");
    assert_eq!(version(&site, "copy"), 3);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_file_whose_vector_is_wrong_says_of_whom() {
    let site = Site::with(3).await;
    let file = site.dir.path().join("museum.fht");
    site.run(&["export", "museum", file.to_str().unwrap()]);
    let bytes = std::fs::read(&file).unwrap();
    let end = bytes.iter().position(|byte| *byte == b'\n').unwrap();
    let mut line: serde_json::Value = serde_json::from_slice(&bytes[..end]).unwrap();
    line["vector"][ANA.to_string()] = 4.into();
    line["version"] = 4.into();
    std::fs::write(&file, [line.to_string().as_bytes(), &bytes[end..]].concat()).unwrap();
    let (code, said) = ended(&["import", file.to_str().unwrap(), "--map", "copy", "--connect", &site.endpoint]);
    assert!(code == Some(2) && said.contains(&format!("3 increments of author {ANA} instead of 4")), "{said}");
    assert!(!said.contains("digest"), "{said}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_order_without_an_answer_may_have_been_carried_out() {
    // A server that is gone as soon as it has the order.
    let endpoint = free_endpoint();
    let mut config = zenoh::Config::default();
    for (name, value) in [
        ("mode", "\"router\"".to_owned()),
        ("listen/endpoints", format!("[\"{endpoint}\"]")),
        ("scouting/multicast/enabled", "false".to_owned()),
    ] {
        config.insert_json5(name, &value).unwrap();
    }
    let router = zenoh::open(config).await.unwrap();
    let head = serde_json::to_vec(&Head { version: 1, ..Head::of_nothing(museum()) }).unwrap();
    let answering = router.declare_queryable("fht/museum/head").callback(move |query| {
        let (key, head) = (query.key_expr().clone(), head.clone());
        zenoh::Wait::wait(query.reply(key, head)).unwrap();
    });
    let _answering = answering.await.unwrap();
    let _silent = router.declare_queryable("fht/museum/admin/*").callback(drop).await.unwrap();
    for args in [&["rename", "museum", "hall", "--reason", "test"][..], &["retain", "museum", "--keep", "1"]] {
        let args: Vec<String> = args.iter().chain(&["--connect", &endpoint]).map(|&arg| arg.to_owned()).collect();
        let run = move || ended(&args.iter().map(String::as_str).collect::<Vec<_>>());
        let (code, said) = tokio::task::spawn_blocking(run).await.unwrap();
        assert_eq!(code, Some(1), "{said}");
        assert!(said.contains("it may have been carried out: see `map-server maps`"), "{said}");
    }
}
