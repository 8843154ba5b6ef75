//! A robot's network goes for ten seconds in the middle of exploring, twice, and the map-server
//! restarts meanwhile: the robot stands, goes on, the map is complete, and nothing is lost.

use crate::programs::{executable, start};
use fht_client::ask_head;
use fht_demo::{Process, Role, free_endpoint};
use fht_proto::api::reply::Head;
use fht_session::SessionConfig;
use serde_json::Value;
use std::path::Path;
use std::time::{Duration, Instant};

const PATIENCE: Duration = Duration::from_secs(60);
/// How long the network is gone.
const CUT: Duration = Duration::from_secs(10);
/// Free area on the grid at which it goes, square metres; the museum has 348.
const CUT_AT_M2: [f64; 2] = [60.0, 180.0];

fn router(endpoint: &str) -> Process {
    let mut router = start(Role::Sim, ["router", "--listen", endpoint]);
    router.wait_until_listening(endpoint, PATIENCE).unwrap();
    router
}

fn head(endpoint: &str) -> Head {
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap();
    let link = SessionConfig::from_options(vec![endpoint.to_owned()], None);
    let session = runtime.block_on(fht_session::open(&link)).unwrap();
    let began = Instant::now();
    loop {
        match ask_head(&session, &"lab".parse().unwrap(), Duration::from_secs(2)) {
            Ok(head) => return head,
            Err(error) => assert!(began.elapsed() < PATIENCE, "no head: {error}"),
        }
    }
}

fn json(file: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(file).unwrap()).unwrap()
}

#[test]
fn a_robot_whose_network_goes_twice_makes_a_whole_map() {
    let folder = tempfile::tempdir().unwrap();
    let [data, explored, lived] = ["data", "explorer.json", "robot.json"].map(|name| folder.path().join(name));
    let (graph, maps) = (free_endpoint().unwrap(), free_endpoint().unwrap());
    let mut server = Process::map_server(executable(), &data, &maps, PATIENCE).unwrap();
    let mut at = router(&graph);
    let robot = ["robot", "--ros", &graph, "--in-step", "--quiet", "--report", lived.to_str().unwrap()];
    let robot = start(Role::Sim, robot);
    let report = explored.to_str().unwrap();
    let explorer =
        ["explore", "--ros", &graph, "--map", "lab", "--connect", &maps, "--progress-json", "--report", report];
    let explorer = start(Role::Mapper, explorer);
    let (mut cuts, mut acknowledged) = (0, 0);
    let followed = explorer.follow(|line| {
        let line: Value = serde_json::from_str(line).unwrap();
        let free_m2 = line["free_area_m2"].as_f64().unwrap();
        if CUT_AT_M2.get(cuts).is_some_and(|cut_at_m2| free_m2 >= *cut_at_m2) {
            acknowledged = line["acknowledged"].as_u64().unwrap();
            at.kill().unwrap();
            if cuts == 0 {
                server.kill().unwrap();
            }
            std::thread::sleep(CUT);
            at = router(&graph);
            if cuts == 0 {
                server = Process::map_server(executable(), &data, &maps, PATIENCE).unwrap();
                let kept = head(&maps).version;
                assert!(kept >= acknowledged, "{acknowledged} were acknowledged, {kept} are left");
            }
            cuts += 1;
        }
    });
    followed.unwrap();
    robot.ask_to_end();
    robot.finish(PATIENCE).unwrap();
    let (explored, lived) = (json(&explored), json(&lived));
    println!("{explored}\n{lived}");
    assert_eq!((cuts, &explored["ending"]), (2, &Value::from("complete")), "{explored}");
    assert!(explored["free_area_m2"].as_f64().unwrap() > 0.95 * 348.0, "{explored}");
    assert_eq!(explored["delivered"], true, "{explored}");
    // It stood while nobody told it where to drive, and ran into nothing.
    assert!(lived["watchdog_stops"].as_u64().unwrap() >= 1, "{lived}");
    assert_eq!(lived["collisions"], 0, "{lived}");
    let head = head(&maps);
    assert_eq!(head.version, explored["version"].as_u64().unwrap(), "{explored}");
    assert_eq!(serde_json::to_value(head.digest).unwrap(), explored["digest"], "{explored}");
}
