//! The operators' commands as processes against a server process: path queries obey what they
//! write, robots are told to use releases, maps go to files and back, and robots' reports are
//! shown.

use crate::support::site::Site;
use crate::support::{ANA, BEN, Server, ask, client, free_endpoint, head_when, key, museum, until_up};
use fht_proto::api::compact::{CompactPath, CompactPathWithGoal};
use fht_proto::api::fleet::{FleetReply, LocalizationState, RobotRole, RobotStatus};
use fht_proto::api::keys::{Key, RobotTopic};
use fht_proto::api::reply::{ErrorCode, ErrorReply, Obeyed, ReleasesReply};
use fht_proto::{
    AuthorId, Digest, FixedPoint, Increment, Op, Release, ReleaseId, VersionVector, Zone, ZoneRule, decode, encode,
};
use serde_json::Value;
use std::process::{Command, Stdio};
use std::time::Duration;

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn paths_obey_what_operators_write() {
    let site = Site::with(12).await;
    assert_eq!(site.refused("from=0,0;to=dock").await.code, ErrorCode::UnknownPlace);
    site.run(&["place", "museum", "dock", "9,0,180"]);
    let free = site.path("from=0,0;to=dock").await.unwrap();
    assert!((free.length_m - 9.0).abs() < 0.01 && free.obeyed.is_empty(), "{free:?}");
    assert_eq!(free.goal_yaw.map(|yaw| (yaw * 1e4).round()), Some(31_416.0));

    // Half of the corridor is closed: the path goes around.
    site.run(&["zone", "museum", "wet", "3,-1.5 4,-1.5 4,0.3 3,0.3"]);
    let round = site.path("from=0,0;to=dock").await.unwrap();
    assert!(round.length_m > 9.02 && round.length_m < 9.5, "{round:?}");
    assert!(round.waypoints.iter().any(|waypoint| waypoint.y > 0.4), "{round:?}");
    assert_eq!(round.obeyed, [Obeyed::KeepOut { zone: "wet".to_owned() }]);
    assert_eq!(site.refused("from=0,0;to=3.5,0").await.code, ErrorCode::KeepOut);
    // All of it is closed: there is no path, and the reply says why.
    site.run(&["zone", "museum", "wet", "3,-1.5 4,-1.5 4,1.5 3,1.5"]);
    let refused = site.refused("from=0,0;to=dock").await;
    assert!(refused.code == ErrorCode::NoPath && refused.message.contains("zone wet"), "{refused}");
    site.run(&["zone", "museum", "wet", "--remove"]);
    assert_eq!(site.path("from=0,0;to=dock").await.unwrap().length_m, free.length_m);

    site.run(&["zone", "museum", "lab", "5,-2 7,-2 7,2 5,2", "--speed", "0.3"]);
    let rules = ask(&site.session, "fht/museum/rules").await.remove(0).unwrap();
    assert!(String::from_utf8_lossy(&rules).contains(r#""rule":{"speed_limit":0.3}"#));
    let slow = site.path("from=0,0;to=dock").await.unwrap();
    assert_eq!(slow.speed_limits.len(), 1);
    assert_eq!((slow.speed_limits[0].max_mps, slow.speed_limits[0].along_m), (0.3, [5.0, 7.0]));

    site.run(&["close", "museum", "0000000a.5", "0000000a.6"]);
    let refused = site.refused("from=0,0;to=dock").await;
    assert!(refused.message.contains("edge 0000000a.5 0000000a.6"), "{refused}");
    assert!(site.path("from=0,0;to=5,0").await.is_ok(), "on this side");
    site.run(&["open", "museum", "0000000a.5", "0000000a.6"]);
    assert!(site.path("from=0,0;to=dock").await.is_ok());
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_is_wrong_is_told_and_what_changes_nothing_is_not_written() {
    let site = Site::with(12).await;
    site.run(&["place", "museum", "dock", "9,0,180"]);
    site.run(&["zone", "museum", "lab", "5,-2 7,-2 7,2 5,2", "--speed", "0.3"]);
    for (args, reason) in [
        (&["close", "museum", "0000000a.1", "0000000a.6"][..], "no edge joins"),
        (&["close", "museum", "0000000a.1", "0000000a.99"][..], "has no node 0000000a.99"),
        (&["open", "museum", "0000000b.5", "0000000a.6"][..], "has no node 0000000b.5"),
        (&["open", "museum", "0000000b.5", "0000000b.6"][..], "neither a node 0000000b.5 nor a node 0000000b.6"),
        (&["open", "museum", "0000000a.1", "0000000a.6"][..], "no edge joins"),
        (&["zone", "museum", "knot", "0,0 1,1 1,0 0,1"][..], "crosses itself"),
        (&["zone", "museum", "line", "0,0 1,1"][..], "three corners"),
        (&["place", "museum", "1st", "0,0"][..], "is not a name"),
        (&["place", "louvre", "dock", "0,0"][..], "there is no map louvre"),
        (&["place", "museum", "far", "500,500"][..], "no robot can be at (500.00, 500.00)"),
        (&["place", "museum", "turned", "5,0,900"][..], "a yaw of 900° is none"),
        (&["place", "museum", "nan", "nan,0"][..], "nan,0"),
        (&["place", "museum", "beyond", "200000,0"][..], "200000,0 lies outside of all maps"),
        (&["place", "museum", "beyond", "200000,0", "--force"][..], "200000,0 lies outside of all maps"),
        (&["place", "museum", "quay", "--remove"][..], "map museum has no place called quay (there is: dock)"),
        (&["zone", "museum", "attic", "--remove"][..], "has no zone attic (there is: lab)"),
        (&["zone", "museum", "line", "0,0 1,1 2,2"][..], "less than 0.01 m² is none"),
        (&["zone", "museum", "line", "0,0 1,1 2,2", "--force"][..], "less than 0.01 m² is none"),
        (&["zone", "museum", "far", "500,0 501,0 501,1"][..], "does not touch the map"),
        (&["zone", "museum", "huge", "-9000,-9000 9000,-9000 9000,9000 -9000,9000"][..], "beyond the map"),
        (&["close", "museum", "0000000b.5", "0000000a.6"][..], "has no node 0000000b.5"),
        (&["release", "enable", "museum", "spring"][..], "has no release spring (there is none)"),
        (&["release", "delete", "museum", "spring"][..], "has no release spring (there is none)"),
    ] {
        let complaint = site.complaint(args);
        assert!(complaint.contains(reason), "{args:?}: {complaint}");
    }
    for topic in ["maps", "museum/head", "museum/rules", "museum/fleet", "museum/releases", "museum/diff?from=1"] {
        let query = |more: &str| format!("fht/{topic}{}{more}", if topic.contains('?') { ";" } else { "?" });
        assert!(ask(&site.session, &query("fmt=json")).await.remove(0).is_ok(), "{topic}");
        for wrong in ["fmt=postcard", "colour=red"] {
            let refused = ask(&site.session, &query(wrong)).await.remove(0).unwrap_err();
            assert!(refused.message.contains("in JSON only") || refused.message.contains("takes: "), "{refused}");
        }
    }
    let before = head_when(&site.session, |_| true).await.version;
    for args in [
        &["place", "museum", "dock", "9,0,180"][..],
        &["zone", "museum", "lab", "5,-2 7,-2 7,2 5,2", "--speed-limit", "0.3"][..],
        &["open", "museum", "0000000a.5", "0000000a.6"][..],
        &["release", "enable", "museum", "head"][..],
    ] {
        assert_eq!(site.run(args)["version"], before, "{args:?} changes nothing");
    }
    site.run(&["place", "museum", "island", "500,500", "--force"]);
    site.run(&["zone", "museum", "far", "500,0 501,0 501,1", "--force"]);
    assert_eq!(head_when(&site.session, |_| true).await.version, before + 2, "nothing else was written");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn whoever_does_not_ask_first_is_told_by_the_server() {
    let site = Site::with(12).await;
    for corners in [&[(0, 0), (1000, 1000), (2000, 2000)][..], &[(0, 0), (1000, 1000), (1000, 0), (0, 1000)][..]] {
        let refusals = site.session.declare_subscriber(Key::refused(&museum(), BEN).to_string()).await.unwrap();
        let corners = corners.iter().map(|&(x_mm, y_mm)| FixedPoint { x_mm, y_mm }).collect();
        let zone = Some(Zone { rule: ZoneRule::KeepOut, corners });
        let ops = vec![Op::SetZone { name: "bad".parse().unwrap(), zone }];
        let increment = Increment { author: BEN, number: 1, hlc_us: 1, ops };
        site.session.put(key(BEN, 1), encode(&increment).unwrap()).await.unwrap();
        let told = tokio::time::timeout(Duration::from_secs(10), refusals.recv_async()).await.unwrap().unwrap();
        let told: ErrorReply = serde_json::from_slice(&told.payload().to_bytes()).unwrap();
        assert!(told.code == ErrorCode::BadRequest && told.message.starts_with("increment 1: zone bad: "), "{told}");
        tokio::time::sleep(Duration::from_millis(1100)).await; // it is told each reason once a second
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_path_to_a_named_place_tells_the_heading_there() {
    let site = Site::with(12).await;
    site.run(&["place", "museum", "north", "9,0,90"]);
    site.run(&["place", "museum", "south", "9,0,-90"]);
    let binary = async |parameters: &str| {
        let mut replies = ask(&site.session, &format!("fht/museum/path?from=0,0;{parameters};fmt=postcard")).await;
        replies.remove(0).unwrap()
    };
    for (place, yaw_e4) in [("north", 15_708), ("south", -15_708)] {
        let path = site.path(&format!("from=0,0;to={place}")).await.unwrap();
        assert_eq!(path.goal_yaw, Some(f64::from(yaw_e4) / 10_000.0), "{place}");
        // Readers of before get what they know; who asks for the heading gets another message.
        let before: CompactPath = decode(&binary(&format!("to={place}")).await).unwrap();
        let turned: CompactPathWithGoal = decode(&binary(&format!("to={place};goal_yaw=true")).await).unwrap();
        assert_eq!((&turned.path, turned.goal_yaw_e4), (&before, Some(yaw_e4)));
    }
    for elsewhere in ["to=9,0", "to=0000000a.9"] {
        assert_eq!(site.path(&format!("from=0,0;{elsewhere}")).await.unwrap().goal_yaw, None);
        let turned: CompactPathWithGoal = decode(&binary(&format!("{elsewhere};goal_yaw=true")).await).unwrap();
        assert_eq!(turned.goal_yaw_e4, None);
    }
    let refused = site.refused("from=0,0;to=north;goal_yaw=90").await;
    assert!(refused.message.contains("true or false"), "{refused}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_release_that_does_not_add_up_to_its_digest_is_not_used() {
    let site = Site::with(6).await;
    // A foreign operator's, who counts wrongly and enables what came of it.
    let stranger = AuthorId(77);
    let id = ReleaseId { author: stranger, name: "spring".parse().unwrap() };
    let mut vector = VersionVector::default();
    vector.set(ANA, 3);
    let release = Release { vector, digest: Digest([7; 32]) };
    let ops = vec![Op::PutRelease { name: id.name.clone(), release }, Op::Enable { release: Some(id) }];
    let wrong = Increment { author: stranger, number: 1, hlc_us: 9_000_000, ops };
    site.session.put(key(stranger, 1), encode(&wrong).unwrap()).await.unwrap();
    head_when(&site.session, |head| head.vector.get(stranger) == 1).await;
    let releases: ReleasesReply = serde_json::from_value(site.run(&["release", "list", "museum"])).unwrap();
    assert!(releases.releases[0].enabled && !releases.releases[0].available, "{releases:?}");
    let words = |command: &[&str]| {
        let mut program = Command::new(env!("CARGO_BIN_EXE_map-server"));
        program.args(command).args(["--connect", &site.endpoint]);
        String::from_utf8(program.output().unwrap().stdout).unwrap()
    };
    for command in [&["maps"][..], &["robots", "museum"], &["release", "list", "museum"]] {
        let said = words(command);
        assert!(said.contains("not used: not all of it is here") && !said.contains("robots use"), "{said}");
    }
    // The newest state is what robots get, and it is said that it is not the release.
    let path = site.path("from=0,0;to=5,0").await.unwrap();
    assert!(path.version == 7 && path.release.is_none(), "{path:?}");
    assert_eq!(site.refused("from=0,0;to=5,0;release=spring").await.code, ErrorCode::UnknownVersion);
    assert!(site.complaint(&["release", "enable", "museum", "spring"]).contains("not with its digest"));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn robots_use_the_release_that_is_enabled() {
    let site = Site::with(6).await;
    let first = site.run(&["release", "create", "museum", "first"]);
    assert_eq!((&first["version"], &first["available"]), (&Value::from(6), &Value::from(true)));
    site.drive(7, 12).await;
    site.run(&["release", "create", "museum", "second"]);
    assert!(site.complaint(&["release", "create", "museum", "first"]).contains("never change"));
    assert!(site.path("from=0,0;to=11,0").await.is_ok(), "nothing is enabled: the newest state");

    site.run(&["release", "enable", "museum", "first"]);
    let path = site.path("from=0,0;to=5,0").await.unwrap();
    assert_eq!(path.version, 6);
    assert!(path.release.is_some_and(|release| release.starts_with("first@")));
    assert_eq!(site.refused("from=0,0;to=11,0").await.code, ErrorCode::OutOfMap);
    assert!(site.path("from=0,0;to=11,0;release=head").await.is_ok());
    assert!(site.path("from=0,0;to=11,0;release=second").await.is_ok());
    // What an operator closes is closed on every release at once.
    site.run(&["zone", "museum", "wet", "3,-1.5 4,-1.5 4,1.5 3,1.5"]);
    assert_eq!(site.refused("from=0,0;to=5,0").await.code, ErrorCode::NoPath);
    site.run(&["zone", "museum", "wet", "--remove"]);

    assert!(site.complaint(&["release", "delete", "museum", "first"]).contains("enable another one"));
    site.run(&["release", "enable", "museum", "second"]);
    let back = site.run(&["release", "rollback", "museum"]);
    let releases: ReleasesReply = serde_json::from_value(back).unwrap();
    let enabled: Vec<&str> = releases.releases.iter().filter(|it| it.enabled).map(|it| it.name.as_str()).collect();
    assert_eq!(enabled, ["first"]);
    assert!(site.complaint(&["release", "rollback", "museum"]).contains("no earlier release"));
    assert!(site.complaint(&["release", "create", "museum", "old", "--version", "0"]).contains("is empty"));
    site.run(&["release", "enable", "museum", "head"]);
    site.run(&["release", "delete", "museum", "first"]);
    assert!(site.complaint(&["release", "enable", "museum", "first"]).contains("has no release first"));
    // Its name never comes back, and nothing is written in the attempt.
    let before = site.run(&["release", "list", "museum"]);
    assert!(site.complaint(&["release", "create", "museum", "first"]).contains("choose another name"));
    assert_eq!(site.run(&["release", "list", "museum"]), before);

    let diff = site.run(&["diff", "museum", "6", "second"]);
    assert_eq!(diff["added_nodes"].as_array().unwrap().len(), 6);
    assert!(diff["words"].as_str().unwrap().starts_with("6 nodes added, 6 edges added"), "{diff}");
}

#[cfg(unix)]
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn exports_replace_no_links_and_no_devices() {
    let site = Site::with(3).await;
    let (link, file) = (site.dir.path().join("link"), site.dir.path().join("file"));
    site.run(&["export", "museum", file.to_str().unwrap()]);
    site.drive(4, 4).await;
    std::os::unix::fs::symlink(&file, &link).unwrap();
    let old = std::fs::read(&file).unwrap();
    site.run(&["export", "museum", link.to_str().unwrap()]);
    assert_ne!(std::fs::read(&file).unwrap(), old, "the newer one");
    let exported = std::fs::read(&file).unwrap();
    assert!(link.is_symlink() && exported.len() > 100);
    let printed = std::process::Command::new(env!("CARGO_BIN_EXE_map-server"))
        .args(["export", "museum", "-", "--connect", &site.endpoint])
        .output()
        .unwrap();
    assert_eq!(printed.stdout, exported);
    // What is no exported map stays, such as the store that is served.
    let store = site.dir.path().join("data/maps.redb");
    assert!(store.is_file(), "{}", store.display());
    let refused = site.complaint(&["export", "museum", store.to_str().unwrap()]);
    assert!(refused.contains("is no exported map: it is not written over"), "{refused}");
    site.drive(5, 5).await;
    let device = site.complaint(&["export", "museum", "/dev/full"]);
    assert!(device.contains("No space left"), "{device}");
    assert!(!std::path::Path::new("/dev/full").is_file());
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_map_is_folded_moved_and_goes_on() {
    let site = Site::with(40).await;
    site.run(&["release", "create", "museum", "opening"]);
    site.drive(41, 60).await;
    let before = head_when(&site.session, |_| true).await;
    let folded = site.run(&["retain", "museum", "--keep", "5"]);
    assert_eq!((&folded["folded"], &folded["oldest_version"]), (&Value::from(56), &Value::from(56)));
    assert_eq!(head_when(&site.session, |_| true).await.digest, before.digest);
    assert!(site.complaint(&["diff", "museum", "10"]).contains("is folded up to version 56"));
    assert!(site.try_run(&["diff", "museum", "opening"]).is_ok(), "a release stays");

    let file = site.dir.path().join("museum.fht");
    let file = file.to_str().unwrap();
    let exported = site.run(&["export", "museum", file]);
    let imported = site.run(&["import", file, "--map", "copy"]);
    assert_eq!((&exported["digest"], &exported["version"]), (&imported["digest"], &imported["version"]));
    let releases = site.run(&["release", "list", "copy"]);
    assert_eq!(
        (&releases["releases"][0]["name"], &releases["releases"][0]["available"]),
        (&"opening".into(), &true.into())
    );
    assert_eq!(site.run(&["import", file, "--map", "copy"])["digest"], imported["digest"], "again: nothing changes");

    // Whole, and another map than it says: nobody notices before everything is added up.
    let whole = std::fs::read(file).unwrap();
    let digest = exported["digest"].as_str().unwrap();
    let at = whole.windows(64).position(|window| window == digest.as_bytes()).unwrap();
    let mut other = whole.clone();
    other[at] = if other[at] == b'0' { b'1' } else { b'0' };
    std::fs::write(file, other).unwrap();
    assert!(site.complaint(&["import", file, "--map", "other"]).contains("the map is not what the file says it is"));
    assert!(site.complaint(&["release", "list", "other"]).contains("there is no map other"), "nothing of it was taken");

    let mut damaged = whole;
    let middle = damaged.len() / 2;
    damaged[middle] ^= 1;
    std::fs::write(file, damaged).unwrap();
    assert!(site.complaint(&["import", file, "--map", "other"]).contains("the file is damaged at byte"));
    assert!(site.complaint(&["release", "list", "other"]).contains("there is no map other"), "nothing of it was taken");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_robots_report_is_obeyed_for_as_long_as_they_say_and_shown() {
    let site = Site::with(12).await;
    let blocked = Key::robot(&museum(), "r1", RobotTopic::Blocked).to_string();
    let report = r#"{"for_s": 2, "edges": [["0000000a.5", "0000000a.6"]]}"#;
    // What is not there cannot be blocked.
    let beyond = r#"{"for_s": 60, "edges": [["0000000a.5", "0000000a.99"]]}"#;
    site.session.put(Key::robot(&museum(), "r2", RobotTopic::Blocked).to_string(), beyond).await.unwrap();
    let begin = std::time::Instant::now();
    site.session.put(&blocked, report).await.unwrap();
    loop {
        match site.path("from=0,0;to=9,0").await {
            Err(refused) if refused.message.contains("what r1 found blocked") => break,
            outcome => assert!(begin.elapsed() < Duration::from_secs(2), "{outcome:?}"),
        }
    }
    let rules = site.run(&["rules", "museum"]);
    assert_eq!(rules["blocked"][0]["robot"], "r1");
    assert_eq!(rules["blocked"].as_array().map(Vec::len), Some(1), "{rules}");
    tokio::time::sleep(Duration::from_secs(2).saturating_sub(begin.elapsed()) + Duration::from_millis(200)).await;
    assert!(site.path("from=0,0;to=9,0").await.is_ok(), "it was for two seconds");

    let token = site.session.liveliness().declare_token("fht/museum/robots/r1").await.unwrap();
    let head = head_when(&site.session, |_| true).await;
    let status = RobotStatus {
        robot: "r1".to_owned(),
        role: RobotRole::Client,
        map: museum(),
        version: head.version,
        vector: head.vector,
        release: None,
        state: LocalizationState::Localized,
        map_from_base: Some([1.0, 2.0, 0.5]),
        stamp_us: None,
    };
    let key = Key::robot(&museum(), "r1", RobotTopic::Status).to_string();
    let nonsense = RobotStatus { map_from_base: Some([1e300, 0.0, 0.0]), ..status.clone() };
    for said in [&status, &nonsense] {
        site.session.put(&key, serde_json::to_vec(said).unwrap()).await.unwrap();
    }
    let fleet = || -> FleetReply { serde_json::from_value(site.run(&["robots", "museum"])).unwrap() };
    let robot = fleet().robots.remove(0);
    assert_eq!((robot.status, robot.alive, robot.behind), (status, true, 0));
    site.drive(13, 15).await;
    assert_eq!(fleet().robots[0].behind, 3);
    token.undeclare().await.unwrap();
    let begin = std::time::Instant::now();
    while fleet().robots[0].alive {
        assert!(begin.elapsed() < Duration::from_secs(10), "its session is gone");
    }
    // More than one reply tells of: all of them are shown.
    let status = fleet().robots.remove(0).status;
    for number in 0..450 {
        let status = RobotStatus { robot: format!("x{number:03}"), ..status.clone() };
        let key = Key::robot(&museum(), &status.robot, RobotTopic::Status).to_string();
        site.session.put(&key, serde_json::to_vec(&status).unwrap()).await.unwrap();
    }
    while fleet().robots.len() < 451 {
        assert!(begin.elapsed() < Duration::from_secs(20), "{}", fleet().robots.len());
    }
    let page = ask(&site.session, "fht/museum/fleet?limit=300;after=x001").await.remove(0).unwrap();
    let page: FleetReply = serde_json::from_slice(&page).unwrap();
    assert_eq!((page.robots.len(), page.truncated, page.next.as_deref()), (300, true, Some("x301")));
}

/// Runs a command; its exit code and what it said on standard error.
fn ended(args: &[&str]) -> (Option<i32>, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_map-server")).args(args).output().unwrap();
    (output.status.code(), String::from_utf8(output.stderr).unwrap())
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_import_that_ends_early_says_what_of_the_map_is_there() {
    let site = Site::with(60).await;
    let (file, log) = (site.dir.path().join("museum.fht"), site.dir.path().join("log"));
    let file = file.to_str().unwrap();
    site.run(&["export", "museum", file]);
    let endpoint = free_endpoint();
    let _small = Server::with(&site.dir.path().join("small"), &endpoint, &["--max-map-elements", "50"], &log);
    until_up(&client(&endpoint).await).await;
    let (code, said) = ended(&["import", file, "--connect", &endpoint]);
    assert!(code == Some(1) && said.contains("part of map museum is there (version "), "{code:?}: {said}");
    assert!(said.contains(" of 60)") && said.contains("map-server delete museum"), "{said}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_address_in_use_is_named_wherever_it_was_said() {
    let site = Site::with(1).await;
    let file = site.dir.path().join("router.json5");
    std::fs::write(&file, format!("{{mode: 'router', listen: {{endpoints: ['{}']}}}}", site.endpoint)).unwrap();
    let (file, data) = (file.to_str().unwrap(), site.dir.path().join("other"));
    let named = format!("cannot listen on {}: the address is in use", site.endpoint);
    let (code, said) = ended(&["--zenoh-config", file, "--data", data.to_str().unwrap()]);
    assert!(code == Some(1) && said.contains(&named), "{code:?}: {said}");
    let (code, said) = ended(&["maps", "--zenoh-config", file]);
    assert!(code == Some(2) && said.contains(&named) && said.contains("only connects"), "{code:?}: {said}");
}

#[test]
fn what_cannot_be_listened_on_or_reached_is_told_in_words() {
    let (dir, nobody) = (tempfile::tempdir().unwrap(), free_endpoint());
    let data = dir.path().join("data");
    let serve = |more: &[&str]| ended(&[&["--data", data.to_str().unwrap(), "--open"][..], more].concat());
    for (listen, expected, why) in [
        ("tcp/192.0.2.1:17502", 2, "no interface of this machine has this address"),
        ("tcp/nosuch.invalid:17502", 2, "no computer has this name"),
        ("unixsock-stream//nonexistent/x", 1, "there is no such folder"),
    ] {
        let (code, said) = serve(&["--listen", listen]);
        assert!(code == Some(expected) && said.contains(&format!("cannot listen on {listen}: {why}")), "{said}");
    }
    let (code, said) = serve(&["--listen", &free_endpoint(), "--connect", &nobody, "--wait", "1"]);
    let expected = format!("no server or router at {nobody} within 1 s: {nobody}: nobody listens there");
    assert!(code == Some(1) && said.contains(&expected), "{code:?}: {said}");
}

#[test]
fn a_command_that_waits_for_a_server_is_interrupted_while_it_waits() {
    let args = ["health", "--wait", "inf", "--connect", &free_endpoint()];
    let mut command = Command::new(env!("CARGO_BIN_EXE_map-server"));
    let waiting = command.args(args).stderr(Stdio::piped()).spawn().unwrap();
    std::thread::sleep(Duration::from_secs(1));
    let number = waiting.id().to_string();
    assert!(Command::new("kill").args(["-s", "INT", &number]).status().unwrap().success());
    let output = waiting.wait_with_output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.code() == Some(130) && said.contains("interrupted while waiting for a map-server"), "{said}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_map_says_where_it_lies() {
    let site = Site::with(12).await;
    site.run(&["floor-plan", "museum", "ground floor.png", "--scale", "0.05", "--at=-12.5,-8,80"]);
    site.run(&["datum", "museum", "52.5186,-13.3973,40"]);
    let rules = async || -> Value {
        serde_json::from_slice(&ask(&site.session, "fht/museum/rules").await.remove(0).unwrap()).unwrap()
    };
    let said = rules().await;
    let plan = serde_json::json!({
        "image": "ground floor.png", "metres_per_pixel": 0.05, "map_from_image": [-12.5, -8.0, 1.3963],
    });
    assert_eq!(said["floor_plan"], plan);
    let datum = serde_json::json!({"latitude": 52.5186, "longitude": -13.3973, "yaw": 0.6981});
    assert_eq!(said["datum"], datum);
    let again = site.run(&["datum", "museum", "52.5186,-13.3973,40"]);
    assert_eq!(again["version"], said["version"], "nothing to change");
    for (args, reason) in [
        (&["datum", "museum", "95,0"][..], "a latitude of 95°"),
        (&["datum", "museum", "north"][..], "is not latitude,longitude"),
        (&["floor-plan", "museum", "a.png", "--scale", "0"][..], "is not the side of a pixel"),
        (&["floor-plan", "museum", "a\nb.png", "--scale", "1"][..], "control characters"),
    ] {
        let complaint = site.complaint(args);
        assert!(complaint.contains(reason), "{args:?}: {complaint}");
    }
    let undone = site.run(&["undo", "museum"]).to_string();
    assert!(undone.contains("the place of the map on earth is taken away again"), "{undone}");
    site.run(&["floor-plan", "museum", "--remove"]);
    let said = rules().await;
    assert!(said.get("floor_plan").is_none() && said.get("datum").is_none(), "{said}");
}
