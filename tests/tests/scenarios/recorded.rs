//! A recorded run, replayed through a real server, gives the same map; a recorder that is killed
//! leaves what it had written.

use crate::programs::{executable, start};
use fht_client::ask_head;
use fht_demo::{Role, free_endpoint};
use fht_proto::Digest;
use fht_session::SessionConfig;
use mapper::program::{ExploreReport, ReplayReport};
use serde_json::Value;
use std::process::{Command, Output};
use std::time::Duration;
use zenoh::Wait;

const PATIENCE: Duration = Duration::from_secs(30);

fn mapper(args: &[&str]) -> Output {
    Command::new(executable()).args(["role", "mapper", "--"]).args(args).output().unwrap()
}

fn head_digest(session: &zenoh::Session, map: &str) -> Digest {
    ask_head(session, &map.parse().unwrap(), PATIENCE).unwrap().digest
}

#[test]
fn a_recorded_run_replayed_through_the_server_is_the_same_map() {
    let folder = tempfile::tempdir().unwrap();
    let endpoint = free_endpoint().unwrap();
    let data = folder.path().join("data");
    let server = ["--data".as_ref(), data.as_os_str(), "--listen".as_ref(), endpoint.as_ref()];
    let mut server = start(Role::MapServer, server);
    server.wait_until_listening(&endpoint, PATIENCE).unwrap();

    let bag = folder.path().join("run.mcap").to_string_lossy().into_owned();
    let explore =
        ["explore", "--no-cameras", "--map", "driven", "--record", &bag, "--connect", &endpoint, "--json", "-q"];
    let explored = mapper(&explore);
    let explored: ExploreReport = serde_json::from_slice(&explored.stdout).unwrap();
    assert!(explored.map.delivered && explored.map.closures[0] > 0, "{explored:?}");
    let replayed = mapper(&["replay", &bag, "--map", "replayed", "--connect", &endpoint, "--json", "-q"]);
    assert!(replayed.status.success(), "{}", String::from_utf8_lossy(&replayed.stderr));
    let replayed: ReplayReport = serde_json::from_slice(&replayed.stdout).unwrap();
    assert!(replayed.map.delivered);
    assert_eq!((replayed.map.digest, replayed.map.version), (explored.map.digest, explored.map.version));

    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap();
    let session = runtime.block_on(fht_session::open(&SessionConfig::from_options(vec![endpoint], None))).unwrap();
    assert_eq!(head_digest(&session, "driven"), explored.map.digest);
    assert_eq!(head_digest(&session, "replayed"), explored.map.digest);
    session.close().wait().unwrap();
}

#[test]
fn what_a_killed_recorder_leaves_is_mapped_up_to_there() {
    let folder = tempfile::tempdir().unwrap();
    let bag = folder.path().join("run.mcap").to_string_lossy().into_owned();
    let args = ["explore", "--no-cameras", "--offline", "--record", &bag, "--progress-json", "--rate", "20", "-q"];
    let mut explorer = Command::new(executable())
        .args(["role", "mapper", "--"])
        .args(args)
        .stdout(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    let lines = std::io::BufRead::lines(std::io::BufReader::new(explorer.stdout.take().unwrap()));
    for line in lines {
        let line: Value = serde_json::from_str(&line.unwrap()).unwrap();
        if line["sim_s"].as_f64().unwrap() > 60.0 {
            break;
        }
    }
    explorer.kill().unwrap();
    explorer.wait().unwrap();

    let replayed = mapper(&["replay", &bag, "--map", "cut", "--offline", "--json", "-q"]);
    let report: ReplayReport = serde_json::from_slice(&replayed.stdout).unwrap();
    assert!(!report.bag.broken.is_empty(), "the cut is not told: {report:?}");
    let said = String::from_utf8_lossy(&replayed.stderr).into_owned();
    assert!(replayed.status.code() == Some(1) && said.contains("the bag is broken"), "{said}");
    assert!(report.bag_s > 30.0 && report.map.main_nodes >= 2 && report.free_area_m2 > 20.0, "{report:?}");
}

#[test]
fn a_bag_that_is_broken_is_told_alike_by_all_who_read_it() {
    let folder = tempfile::tempdir().unwrap();
    let bag = folder.path().join("run.mcap");
    let path = bag.to_string_lossy().into_owned();
    mapper(&["explore", "--no-cameras", "--offline", "--record", &path, "--max-sim", "10", "-q"]);
    let whole = std::fs::read(&bag).unwrap();
    let run = |role: &str, args: &[&str]| {
        let output = Command::new(executable()).args(["role", role, "--"]).args(args).output().unwrap();
        let said = [output.stdout, output.stderr].concat();
        (output.status.code(), String::from_utf8(said).unwrap())
    };
    let replay = ["replay", &path, "--offline", "-q"];

    // Another recording behind it.
    std::fs::write(&bag, [&whole[..], &whole].concat()).unwrap();
    for args in [&["info", &path][..], &replay] {
        let (code, said) = run("mapper", args);
        let beyond = format!("can be read up to byte {}", whole.len());
        assert!(code == Some(1) && said.contains(&beyond), "{args:?}: {code:?} {said}");
        assert!(said.contains(&format!(": {} bytes follow the end of the recording", whole.len())), "{said}");
    }

    // Nothing of it can be read. No router is asked before that is known.
    let mut damaged = whole.clone();
    damaged[whole.len() / 3] ^= 1;
    std::fs::write(&bag, &damaged).unwrap();
    for (role, args) in [("mapper", &replay[..]), ("sim", &["play", &path, "--ros", "tcp/127.0.0.1:9"])] {
        let (code, said) = run(role, args);
        assert!(code == Some(2) && said.contains("the bag gave no frame to "), "{role}: {code:?} {said}");
        assert!(said.contains("run.mcap can be read up to byte"), "{role}: {said}");
    }
}
