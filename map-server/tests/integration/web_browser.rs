//! The operators' page in a browser, used as a person uses it: what is done there by clicking,
//! dragging and typing is seen by a Zenoh client that is not ours, and the other way round. The
//! scenarios are in `browser/`.

use crate::support::{ANA, bytes, free_endpoint, node};
use fht_proto::api::keys::Key;
use fht_proto::{EdgeKey, FixedPose, Increment, MapName, NodeKind, Op, Rect, encode};
use serde_json::{Value, json};
use std::fmt::Write;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The browsers that Debian and others have, by their names.
const BROWSERS: [&str; 3] = ["chromium", "chromium-browser", "google-chrome"];

/// Where a program lies, if it is installed.
fn program(names: &[&str]) -> Option<PathBuf> {
    let folders: Vec<PathBuf> = std::env::split_paths(&std::env::var_os("PATH")?).collect();
    let places = names.iter().flat_map(|name| folders.iter().map(move |folder| folder.join(name)));
    places.into_iter().find(|place| place.is_file())
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        write!(text, "{byte:02x}").unwrap();
        text
    })
}

/// Increments as the foreign client puts them.
fn increments(map: &str, numbers: RangeInclusive<u64>) -> Vec<Value> {
    let key = |number| Key::increment(&map.parse().unwrap(), ANA, number).to_string();
    numbers.map(|number| json!({ "key": key(number), "bytes": hex(&bytes(ANA, number)) })).collect()
}

/// A map of many rectangles, `row` in a row, in so many increments of 250 each.
fn rectangles(map: &str, parts: u32, row: u32) -> Vec<Value> {
    let map: MapName = map.parse().unwrap();
    let increment = |number: u32| {
        let mut ops = Vec::new();
        for index in 250 * (number - 1)..250 * number {
            let (id, x, y) = (node(ANA, index), index % row, index / row);
            let pose = FixedPose::from_metres(f64::from(x), f64::from(y), 0.0);
            let (x, y) = (f64::from(x), f64::from(y));
            let rect = Rect::around(pose.position, (x - 0.6, y - 0.6), (x + 0.6, y + 0.6));
            ops.push(Op::PutNode { id, kind: NodeKind::Support, pose });
            ops.push(Op::SetFreeSpace { id, rect: Some(rect) });
            let before = [(index % row > 0).then(|| index - 1), index.checked_sub(row)];
            ops.extend(
                before.into_iter().flatten().map(|other| Op::PutEdge { edge: EdgeKey::new(node(ANA, other), id) }),
            );
        }
        Increment { author: ANA, number: u64::from(number), hlc_us: 1_000_000 + u64::from(number), ops }
    };
    let put = |number| {
        let key = Key::increment(&map, ANA, u64::from(number)).to_string();
        json!({ "key": key, "bytes": hex(&encode(&increment(number)).unwrap()) })
    };
    (1..=parts).map(put).collect()
}

/// Runs a script with a server of its own, with more flags, and files in a folder; what it prints.
fn run(script: &str, flags: &[String], folder: Option<&Path>) -> String {
    let chromium = program(&BROWSERS).expect("this test needs a browser: apt-get install -y chromium");
    assert!(program(&["npm"]).is_some(), "this test needs Node.js 20 or newer with npm: apt-get install -y nodejs npm");
    let scripts = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/browser");
    crate::packages::node_packages(&scripts);
    let folder_of_python = Path::new(env!("CARGO_TARGET_TMPDIR")).join("web-browser");
    let python = crate::packages::environment(&folder_of_python, &["eclipse-zenoh==1.10.2"]).join("python");

    let dir = tempfile::tempdir().unwrap();
    let address = fht_reserved_port::reserve().unwrap();
    let mut begin = increments("museum", 1..=12);
    begin.extend(increments("lab", 1..=3));
    let measured = script == "speed.mjs";
    let config = json!({
        "program": env!("CARGO_BIN_EXE_map-server"),
        "python": python,
        "chromium": chromium,
        "data": dir.path().join("data"),
        "endpoint": free_endpoint(),
        "address": address.to_string(),
        "begin": begin,
        "later": increments("museum", 13..=16),
        "last": increments("museum", 17..=17),
        "hall": measured.then(|| rectangles("hall", 20, 100)),
        "city": measured.then(|| rectangles("city", 400, 400)),
        "flags": flags,
        "folder": folder,
    });
    let file = dir.path().join("config.json");
    std::fs::write(&file, config.to_string()).unwrap();
    let run = Command::new("node").arg(scripts.join(script)).arg(&file).output().unwrap();
    let said = String::from_utf8_lossy(&run.stdout).into_owned();
    assert!(run.status.success(), "{said}{}", String::from_utf8_lossy(&run.stderr));
    said
}

#[test]
fn people_see_and_steer_maps_in_a_browser() {
    println!("{}", run("run.mjs", &[], None));
}

#[test]
fn certificates_decide_what_the_page_offers() {
    let folder = tempfile::tempdir().unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../deploy/make-certificates.sh");
    for arguments in [&["authority"][..], &["server", "maps", "localhost"], &["operator", "ada"], &["client", "tug"]] {
        let mut make = Command::new("sh");
        crate::packages::run(make.arg(&script).arg("--out").arg(folder.path()).arg("--no-passphrase").args(arguments));
    }
    let files = [("certificate", "server-maps.pem"), ("key", "server-maps.key"), ("authority", "ca.pem")];
    let flag = |(name, file): (&str, &str)| [format!("--web-{name}"), folder.path().join(file).display().to_string()];
    let flags: Vec<String> = files.into_iter().flat_map(flag).collect();
    println!("{}", run("secured.mjs", &flags, Some(folder.path())));
}

#[test]
#[ignore = "it measures, for docs/web.md"]
fn a_large_map_with_many_robots_is_drawn_fast() {
    println!("{}", run("speed.mjs", &[], None));
}
