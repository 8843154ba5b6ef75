//! What people and other programs get wrong is refused by all programs with a sentence that says
//! what is allowed, and no message names a place in somebody's source.
#![allow(clippy::unwrap_used)] // tests may panic

use fht_demo::{Process, free_endpoint};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

const HANDOFF: &str = env!("CARGO_BIN_EXE_handoff");

/// Runs a program; its exit code and what it said on standard error.
fn run(program: &str, args: &[&str]) -> (i32, String) {
    let mut command = Command::new(HANDOFF);
    command.args(["role", program, "--"]).args(args).env_remove("RUST_LOG").stdout(Stdio::null());
    let output = command.output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(!said.contains(".rs:") && !said.contains("registry"), "{program} {args:?}: {said}");
    assert!(!said.contains('\u{1b}'), "colours where nobody sees them: {program} {args:?}: {said}");
    (output.status.code().unwrap(), said)
}

const KEY_SEGMENT: &str = "1 to 64 of the letters a to z and A to Z, digits, _ or -";

#[test]
fn names_that_are_none_are_refused_by_all_programs() {
    let long = "x".repeat(100);
    let bad = ["R 2", "a/b", "*", "**", "$*", "", "ü", "a.b", "a?b", "a#b", "a\nb", long.as_str()];
    let takers: [(&str, &[&str], &str); 13] = [
        ("mapper", &["explore", "--offline", "--robot"], "robot"),
        ("mapper", &["explore", "--offline", "--map"], "map"),
        ("mapper", &["replay", "run.mcap", "--robot"], "robot"),
        ("mapper", &["replay", "run.mcap", "--map"], "map"),
        ("client-robot", &["relocalize", "--robot"], "robot"),
        ("client-robot", &["go", "--to", "1,1", "--robot"], "robot"),
        ("client-robot", &["go", "--to", "1,1", "--map"], "map"),
        ("client-robot", &["path", "--from", "0,0", "--to", "1,1", "--map"], "map"),
        ("map-server", &["maps", "--operator"], "operator"),
        ("map-server", &["robots"], "map"),
        ("map-server", &["place", "museum", "dock", "1,1", "--operator"], "operator"),
        ("map-server", &["release", "create"], "map"),
        ("map-server", &["import", "museum.fht", "--map"], "map"),
    ];
    for name in bad {
        for (program, args, kind) in takers {
            let (code, said) = run(program, &[args, &[name]].concat());
            assert_eq!(code, 2, "{program} {args:?} {name:?}: {said}");
            assert!(said.contains(KEY_SEGMENT) && said.contains(kind), "{program} {args:?} {name:?}: {said}");
        }
    }
    let (code, said) = run("map-server", &["place", "museum", "1st", "1,1"]);
    assert!(code == 2 && said.contains("a letter, then letters and digits of any script, _ or -"), "{said}");
}

#[test]
fn names_in_a_configuration_file_are_refused_as_well() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("robot.toml");
    for name in ["R 2", "a/b", "*", ""] {
        std::fs::write(&file, format!("[robot]\nname = '{name}'\n")).unwrap();
        for (program, args) in [("mapper", &["explore", "--offline"][..]), ("client-robot", &["relocalize"])] {
            let (code, said) = run(program, &[&["--config", file.to_str().unwrap()], args].concat());
            assert!(code == 2 && said.contains("robot.toml:2") && said.contains(KEY_SEGMENT), "{program}: {said}");
        }
    }
}

#[test]
fn failures_name_no_place_in_the_source() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let (nobody, endpoint) = (free_endpoint().unwrap(), free_endpoint().unwrap());
    std::fs::write(at("wrong.json5"), "{mode: 'captain'}").unwrap();
    std::fs::write(at("tls.json5"), "{transport: {link: {tls: {root_ca_certificate: 'gone.pem'}}}}").unwrap();
    let _server =
        Process::map_server(Path::new(HANDOFF), Path::new(&at("data")), &endpoint, Duration::from_secs(30)).unwrap();
    let (wrong, tls) = (at("wrong.json5"), at("tls.json5"));
    let places: [&[&str]; 7] = [
        &["--connect", &nobody, "--wait", "1"],
        &["--connect", "tcp/256.1.1.1:7447", "--wait", "1"],
        &["--connect", "nonsense", "--wait", "1"],
        &["--connect", "tls/localhost:1", "--zenoh-config", &tls, "--wait", "1"],
        &["--zenoh-config", &wrong, "--wait", "1"],
        &["--zenoh-config", "nowhere.json5", "--wait", "1"],
        &["--connect", &endpoint, "--wait", "1"],
    ];
    let commands: [(&str, &[&str]); 5] = [
        ("mapper", &["explore", "--no-cameras", "--quiet", "--max-sim", "1", "--linger", "1"]),
        ("client-robot", &["path", "--from", "0,0", "--to", "dock"]),
        ("client-robot", &["go", "--to", "dock", "--no-cameras"]),
        ("map-server", &["robots", "elsewhere"]),
        ("map-server", &["place", "elsewhere", "dock", "1,1"]),
    ];
    for place in places {
        for (program, args) in commands {
            let (code, said) = run(program, &[args, place].concat());
            assert!(code != 0 && !said.trim().is_empty(), "{program} {args:?} {place:?}: {code} {said}");
        }
    }
    for args in [
        &["--data", &at("data"), "--listen", "tcp/127.0.0.1:0"][..],
        &["--data", &at("other"), "--listen", &endpoint],
        &["--data", &at("other"), "--listen", "nonsense"],
        &["--data", &at("other"), "--listen", "tcp/256.1.1.1:1"],
        &["--data", &at("other"), "--listen", "tls/127.0.0.1:0"],
    ] {
        let (code, said) = run("map-server", args);
        assert!(code != 0 && !said.trim().is_empty(), "{args:?}: {code} {said}");
    }
}

#[test]
fn bad_input_ends_with_2_and_a_run_that_failed_with_1() {
    let nobody = free_endpoint().unwrap();
    let silent = ["--connect", &nobody, "--wait", "1"];
    let cases: [(&str, &[&str], i32, &str); 15] = [
        ("mapper", &["explore", "--offline", "--world", "nowhere.yaml"], 2, "nowhere.yaml"),
        ("mapper", &["explore", "--offline", "--start", "-1e6,0"], 2, "cannot start at"),
        ("mapper", &["replay", "nowhere.mcap", "--offline"], 2, "nowhere.mcap"),
        ("mapper", &["info", "nowhere.mcap"], 2, "nowhere.mcap"),
        ("mapper", &["explore", "--connect", "nonsense"], 2, "is not an endpoint"),
        ("map-server", &["maps", "--connect", "tcp:127.0.0.1:1"], 2, "is not an endpoint"),
        ("client-robot", &["relocalize", "--connect", "udp/hall:1"], 2, "tcp, tls, unixsock-stream"),
        ("map-server", &["--listen", "tcp/127.0.0.1:99999"], 2, "up to 65535"),
        ("client-robot", &["go", "--to", "1e9,1"], 2, "1e9,1 lies outside of all maps"),
        ("client-robot", &["relocalize", "--world", "nowhere.yaml"], 2, "nowhere.yaml"),
        ("map-server", &["--listen", "nonsense"], 2, "is not an endpoint"),
        ("map-server", &["import", "nowhere.fht", "--connect", "nonsense"], 2, "is not an endpoint"),
        ("mapper", &["explore", "--no-cameras"], 1, "127.0.0.1"),
        ("client-robot", &["path", "--from", "0,0", "--to", "1,1"], 1, "127.0.0.1"),
        ("map-server", &["maps"], 1, "127.0.0.1"),
    ];
    for (program, args, expected, reason) in cases {
        let args = if expected == 1 { [args, &silent].concat() } else { args.to_vec() };
        let (code, said) = run(program, &args);
        assert!(code == expected && said.contains(reason), "{program} {args:?}: {code}: {said}");
    }
    let output = Command::new(HANDOFF).args(["--world", "a b", "--listen", &nobody]).output().unwrap();
    assert_eq!(output.status.code(), Some(2), "{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn no_run_destroys_what_it_reads_or_writes() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    for file in ["run.mcap", "robot.toml"] {
        std::fs::write(at(file), "").unwrap();
    }
    let (bag, config, detour) = (at("run.mcap"), at("robot.toml"), at("./run.mcap"));
    let (picture, new) = (at("same.png"), at("new.mcap"));
    let cases: [(&str, &[&str], &str); 8] = [
        ("mapper", &["replay", &bag, "--offline", "--report", &detour], "--report would write over the bag"),
        ("mapper", &["explore", "--config", &config, "--report", &config], "would write over the configuration"),
        ("mapper", &["explore", "--picture", &picture, "--report", &picture], "would both write"),
        ("mapper", &["explore", "--offline", "--record", &bag], "it is there already"),
        ("mapper", &["explore", "--offline", "--record", folder.path().to_str().unwrap()], "it is there already"),
        ("mapper", &["explore", "--spool", &bag], "it is no folder"),
        ("client-robot", &["go", "--to", "1,1", "--record", &new, "--report", &new], "would both write"),
        ("client-robot", &["relocalize", "--config", &config, "--report", &config], "would write over"),
    ];
    for (program, args, reason) in cases {
        let (code, said) = run(program, args);
        assert!(code == 2 && said.contains(reason), "{program} {args:?}: {code}: {said}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2, "nothing was written");
}

#[test]
fn worlds_in_which_no_robot_can_be_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let pixels = "P2\n4 4\n255\n0 0 0 0\n0 254 254 0\n0 254 254 0\n0 0 0 0\n";
    std::fs::write(at("pit.pgm"), pixels).unwrap();
    let map = |origin: &str| {
        format!("image: pit.pgm\nresolution: 0.05\norigin: {origin}\noccupied_thresh: 0.65\nfree_thresh: 0.25\n")
    };
    std::fs::write(at("pit.yaml"), map("[0, 0, 0]")).unwrap();
    std::fs::write(at("utm.yaml"), map("[500000, 5400000, 0]")).unwrap();
    let nothing = "<sdf version='1.6'><world name='w'><include><uri>model://nope</uri></include></world></sdf>";
    std::fs::write(at("nothing.world"), nothing).unwrap();
    let cases: [(String, &[&str], &str); 4] = [
        (at("pit.yaml"), &[], "no place where it fits"),
        (at("utm.yaml"), &[], "shift the origin"),
        (at("nothing.world"), &[], "model://nope"),
        ("museum".to_owned(), &["--textures", "nowhere"], "has looks of its own"),
    ];
    for (world, flags, reason) in cases {
        let explore = ["explore", "--offline", "--no-cameras", "--quiet", "--world", world.as_str()];
        let relocalize = ["relocalize", "--no-cameras", "--connect", "tcp/127.0.0.1:9", "--world", world.as_str()];
        for (program, args) in [("mapper", &explore[..]), ("client-robot", &relocalize[..])] {
            let (code, said) = run(program, &[args, flags].concat());
            assert!(code == 2 && said.contains(reason), "{program} {world}: {code}: {said}");
        }
    }
}

#[test]
fn what_a_world_lacks_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let world = folder.path().join("lacking.world");
    let text = "<sdf version='1.6'><world name='w'><include><uri>model://nope</uri></include><model name='box'>
        <pose>3 0 0.5 0 0 0</pose><link name='l'><visual name='v'><geometry><box><size>1 1 1</size></box></geometry>
        </visual></link></model></world></sdf>";
    std::fs::write(&world, text).unwrap();
    let explore = ["explore", "--offline", "--no-cameras", "--quiet", "--max-sim", "1", "--world"];
    let (_, said) = run("mapper", &[&explore[..], &[world.to_str().unwrap()]].concat());
    assert!(said.contains("models not found, left out: model://nope") && said.contains("closed by a fence"), "{said}");
}

#[test]
#[cfg(target_os = "linux")]
fn a_program_whose_output_is_lost_fails_and_says_so() {
    for (program, args) in [
        ("mapper", &["completions", "bash"][..]),
        ("mapper", &["--print-config"]),
        ("client-robot", &["completions", "zsh"]),
        ("map-server", &["completions", "fish"]),
    ] {
        let full = std::fs::File::options().write(true).open("/dev/full").unwrap();
        let mut command = Command::new(HANDOFF);
        let output = command.args(["role", program, "--"]).args(args).stdout(full).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{program} {args:?}: {said}");
        assert_eq!(said.matches("standard output cannot be written").count(), 1, "{program} {args:?}: {said}");
    }
}

#[test]
fn a_robot_with_the_certificate_of_another_is_told_before_it_connects() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let cases: [(&str, &str, &[&str]); 3] = [
        ("mapper", "explorer", &["explore", "--robot", "amr-8"]),
        ("client-robot", "client", &["go", "--to", "dock", "--robot", "amr-8"]),
        ("client-robot", "client", &["serve", "--robot", "amr-8"]),
    ];
    for (program, role, args) in cases {
        let (pem, key) = (at(&format!("{role}.pem")), at(&format!("{role}.key")));
        let mut openssl = Command::new("openssl");
        openssl.args(["req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes"]);
        let made =
            openssl.args(["-subj", &format!("/CN={role}:amr-7"), "-keyout", &key, "-out", &pem]).output().unwrap();
        assert!(made.status.success(), "{made:?}");
        let tls =
            format!("{{root_ca_certificate: {pem:?}, connect_certificate: {pem:?}, connect_private_key: {key:?}}}");
        std::fs::write(at("zenoh.json5"), format!("{{transport: {{link: {{tls: {tls}}}}}}}")).unwrap();
        let link = ["--connect", "tls/localhost:1", "--zenoh-config", &at("zenoh.json5")];
        let (code, said) = run(program, &[args, &link].concat());
        assert_eq!(code, 2, "{program}: {said}");
        let owner = format!("is of {role}:amr-7");
        for part in [owner.as_str(), "is called amr-8", "--robot amr-7"] {
            assert!(said.contains(part), "{program}: {said}");
        }
    }
}

#[test]
fn a_server_whose_port_is_taken_leaves_no_directory() {
    let folder = tempfile::tempdir().unwrap();
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let (new, endpoint) = (folder.path().join("new"), format!("tcp/{}", taken.local_addr().unwrap()));
    let (code, said) = run("map-server", &["--data", new.to_str().unwrap(), "--listen", &endpoint]);
    assert!(code == 1 && said.contains("the address is in use") && !new.exists(), "{code}: {said}");
}

#[test]
fn what_is_waited_for_is_said_and_the_wait_ends() {
    let (nobody, folder) = (free_endpoint().unwrap(), tempfile::tempdir().unwrap());
    let endpoint = free_endpoint().unwrap();
    let _server = Process::map_server(Path::new(HANDOFF), folder.path(), &endpoint, Duration::from_secs(30)).unwrap();
    let ask: [(&str, &[&str]); 4] = [
        ("client-robot", &["path", "--from", "0,0", "--to", "1,1"]),
        ("client-robot", &["go", "--to", "1,1", "--no-cameras"]),
        ("map-server", &["rules", "museum"]),
        ("mapper", &["explore", "--no-cameras"]),
    ];
    for (program, args) in ask {
        // A robot first gets ready, which takes its time on a busy machine.
        let wait = if args[0] == "go" { "20" } else { "7" };
        let (code, said) = run(program, &[args, &["--connect", &nobody, "--wait", wait]].concat());
        assert!(code != 0 && said.contains("waiting for a server"), "{program}: {said}");
        if program == "mapper" {
            continue; // it makes the map that is not there
        }
        let began = std::time::Instant::now();
        let (code, said) = run(program, &[args, &["--connect", &endpoint]].concat());
        assert!(code != 0 && said.contains("there is no map museum"), "{program}: {said}");
        assert!(!said.contains("waiting for"), "it was not asked to wait for the map: {said}");
        let at_once = began.elapsed();
        let (code, said) = run(program, &[args, &["--connect", &endpoint, "--wait", wait]].concat());
        assert!(code != 0 && said.contains("waiting for") && said.contains("museum"), "{program}: {said}");
        println!("{program}: {at_once:?} without --wait");
    }
}

#[test]
fn a_goal_that_the_map_does_not_have_is_refused_before_the_robot_drives() {
    let (folder, endpoint) = (tempfile::tempdir().unwrap(), free_endpoint().unwrap());
    let _server = Process::map_server(Path::new(HANDOFF), folder.path(), &endpoint, Duration::from_secs(30)).unwrap();
    let at = |program: &str, args: &[&str]| run(program, &[args, &["--connect", &endpoint]].concat());
    at("mapper", &["explore", "--no-cameras", "--quiet", "--max-sim", "20"]);
    for place in ["dock", "Küche"] {
        let (code, said) = at("map-server", &["place", "museum", place, "0.5,0,90"]);
        assert_eq!(code, 0, "{said}");
    }
    let (code, said) = at("client-robot", &["path", "--from", "dock", "--to", "Küche"]);
    assert_eq!(code, 0, "{said}");
    let (code, said) = at("client-robot", &["go", "--to", "kitchen", "--no-cameras"]);
    assert!(
        code == 2 && said.contains("map museum has no place called kitchen (there is: ") && said.contains("Küche"),
        "{said}"
    );
    let (code, said) = at("client-robot", &["go", "--to", "00000000.7", "--no-cameras"]);
    assert!(code == 2 && said.contains("has no node 00000000.7"), "{said}");
    // A place that comes while it is waited for.
    let late = std::thread::scope(|scope| {
        let asked = scope.spawn(|| at("client-robot", &["path", "--from", "dock", "--to", "late", "--wait", "60"]));
        std::thread::sleep(Duration::from_secs(7));
        assert_eq!(at("map-server", &["place", "museum", "late", "0.2,0"]).0, 0);
        asked.join().unwrap()
    });
    assert!(late.0 == 0 && late.1.contains("waiting for the place"), "{late:?}");
}
