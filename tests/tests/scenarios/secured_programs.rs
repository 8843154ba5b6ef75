//! The programs under mutual TLS and access control: the commands of `deploy/README.md`, from
//! nothing to a robot that arrives; what others get who try the same, and what is reported about
//! it.

use crate::programs::executable;
use crate::site::{
    PATIENCE, ask, author, certificates, config, free_endpoint, guarded, in_file, make_certificates,
    make_certificates_of_the_readme, museum, put, readme_command, shipped, shipped_with,
};
use fht_demo::{Process, ProcessError, Role};
use fht_proto::api::keys::Key;
use fht_proto::api::reply::{MapsReply, PathReply};
use fht_session::SessionConfig;
use fht_tests::packages::{run, zenoh_cli};
use map_server::ingest::Retained;
use serde_json::Value;
use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::channel;
use std::time::Duration;
use tempfile::TempDir;
use tokio::time::timeout;

/// Enough for an exploration of a minute of robot time, beside other work.
const LONG: Duration = Duration::from_secs(600);

/// A folder with everything that the README mentions, and the site's programs that run in it.
struct Walk {
    folder: TempDir,
    endpoint: String,
    running: Vec<Process>,
}

/// Who has the certificate for each file.
const OWNERS: [(&str, &str); 6] = [
    ("router.json5", "router-a"),
    ("server.json5", "server-maps"),
    ("server-alone.json5", "server-maps"),
    ("explorer.json5", "explorer-explorer"),
    ("client.json5", "client-client"),
    ("operator.json5", "operator-desk"),
];

impl Walk {
    /// Steps 1 and 2, and the files of steps 3 to 5 with this machine's paths and endpoint in them.
    fn begin() -> Self {
        let folder = tempfile::tempdir().unwrap();
        make_certificates_of_the_readme(folder.path());
        let endpoint = free_endpoint();
        let made = folder.path().join("certificates");
        for (file, own) in OWNERS {
            let text = shipped_with(&made, file, own, &[&endpoint], &[&endpoint]);
            std::fs::write(folder.path().join(file), text).unwrap();
        }
        std::fs::write(folder.path().join("roles.json5"), crate::site::read("roles.json5")).unwrap();
        Self { folder, endpoint, running: Vec::new() }
    }

    fn start(&self, role: impl Into<&'static str>, args: &[impl AsRef<str>]) -> Process {
        let role = role.into();
        let mut command = Command::new(executable());
        command.args(["role", role, "--"]).args(args.iter().map(AsRef::as_ref)).current_dir(self.folder.path());
        command.env_remove("RUST_LOG");
        Process::run(role, command).unwrap()
    }

    /// Runs a program to its end; returns its output, or its error text.
    fn try_run(&self, role: impl Into<&'static str>, args: &[impl AsRef<str>]) -> Result<String, String> {
        self.start(role, args).finish(LONG).map_err(|error| match error {
            ProcessError::Failed { stderr, .. } => stderr,
            other => panic!("{other}"),
        })
    }

    /// The same for a program that must succeed.
    fn run(&self, role: impl Into<&'static str>, args: &[impl AsRef<str>]) -> String {
        let role = role.into();
        self.try_run(role, args).unwrap_or_else(|complaint| panic!("{role}: {complaint}"))
    }

    /// An operator's command with JSON.
    fn operate<T: serde::de::DeserializeOwned>(&self, args: &[&str]) -> T {
        let args = [args, &["--operator", "desk", "--zenoh-config", "operator.json5", "--json"]].concat();
        serde_json::from_str(&self.run(Role::MapServer, &args)).unwrap()
    }

    /// Runs the README's question of zenoh-cli, as a shell does; returns what it prints.
    fn ask_with_zenoh_cli(&self) -> String {
        let zenoh = zenoh_cli(env!("CARGO_TARGET_TMPDIR"));
        let question = format!("{} {}", zenoh.display(), readme_command("zenoh ").join(" "));
        let output = run(Command::new("sh").args(["-c", &question]).current_dir(self.folder.path()));
        String::from_utf8(output.stdout).unwrap()
    }

    /// Writes the access control into a configuration.
    fn guard(&self, args: &[impl AsRef<str>], into: &str) {
        std::fs::write(self.folder.path().join(into), self.run(Role::MapServer, args)).unwrap();
    }

    /// Starts what is the site's router.
    fn listen(&mut self, role: impl Into<&'static str>, args: &[&str]) {
        let mut router = self.start(role, args);
        router.wait_until_listening(&self.endpoint.replace("tls/", "tcp/"), PATIENCE).unwrap();
        self.running.push(router);
    }

    /// The README's explorer command with `more`, until it has seen the README's
    /// places.
    fn explore(&self, more: &[&str]) {
        let mut args = words("mapper ", "explore --world museum");
        args.extend(["--quiet", "--max-sim", "260"].iter().chain(more).map(|&word| word.to_owned()));
        // Its exit code says that the map is not complete; what there is has been acknowledged.
        let complaint = self.try_run(Role::Mapper, &args).unwrap_err();
        assert!(complaint.contains("the map is not complete: out of time"), "{complaint}");
    }
}

/// A command of the README, without its program.
fn words(program: &str, command: &str) -> Vec<String> {
    let rest = readme_command(&format!("{program}{command}"));
    command.split_whitespace().map(str::to_owned).chain(rest).collect()
}

#[test]
fn the_readmes_steps_lead_from_nothing_to_a_robot_that_arrives() {
    let mut walk = Walk::begin();
    let access = words("map-server ", "access-control roles.json5");
    let [command @ .., into, zenohd] = access.as_slice() else { panic!("{access:?}") };
    assert_eq!((into.as_str(), zenohd.as_str()), (">", "zenohd-a.json5"));
    walk.guard(command, zenohd);
    walk.listen(fht_tests::router::NAME, &["-c", "zenohd-a.json5"]);
    walk.running.push(
        walk.start(Role::MapServer, &["--data", "maps", "--zenoh-config", "server.json5", "--roles", "roles.json5"]),
    );

    walk.explore(&[]);
    let go = words("client-robot ", "go");
    // A place that it has seen, and scores that tell whether it is there.
    let more = ["--start", &near_the_start(), "--quiet", "--json"].map(str::to_owned);
    let report: Value = serde_json::from_str(&walk.run(Role::ClientRobot, &[go.as_slice(), &more].concat())).unwrap();
    assert_eq!((&report["arrived"], &report["planner"]), (&true.into(), &"server".into()), "{report}");
    assert!(report["goal_distance_m"].as_f64().unwrap() < 0.5, "{report}");

    let before: MapsReply = walk.operate(&["maps"]);
    let asked: MapsReply = serde_json::from_str(&walk.ask_with_zenoh_cli()).unwrap();
    assert_eq!(asked.maps, before.maps);
    let place = walk.run(Role::MapServer, &words("map-server ", "place"));
    assert!(place.starts_with("written; map museum is at version"), "{place}");
    let made: Value = walk.operate(&["release", "create", "museum", "opening"]);
    assert_eq!(made["available"], true, "{made}");
    let retained: Retained = walk.operate(&["retain", "museum", "--keep", "5"]);
    let after: MapsReply = walk.operate(&["maps"]);
    let version = after.maps[0].version;
    assert_eq!((version, retained.oldest_version), (before.maps[0].version + 2, version - 5));
    for (args, version) in [(&[][..], version), (&["--release", "opening"][..], version - 1)] {
        let exported: Value = walk.operate(&[&["export", "museum", "museum.fht"], args].concat());
        let file = std::fs::metadata(walk.folder.path().join("museum.fht")).unwrap();
        assert_eq!((&exported["version"], &exported["bytes"]), (&version.into(), &file.len().into()));
    }
    let args = ["path", "--map", "museum", "--from", "0,0", "--to", "dock", "--zenoh-config", "client.json5", "--json"];
    let path: PathReply = serde_json::from_str(&walk.run(Role::ClientRobot, &args)).unwrap();
    let end = path.waypoints.last().unwrap();
    assert_eq!((end.x, end.y), (5.0, 3.0), "{path:?}");
}

/// Where the map begins, but turned: world frame.
fn near_the_start() -> String {
    let start = fht_sim::load("museum", None, 1).unwrap().start();
    format!("{},{},{}rad", start.translation.x, start.translation.y, start.rotation.angle() + 2.0)
}

#[test]
fn programs_with_a_clients_certificate_change_nothing_and_say_that_they_failed() {
    let mut walk = Walk::begin();
    // The README's small site: the server is the router, and its certificate names the host.
    let made = walk.folder.path().join("certificates");
    for file in ["server-maps.pem", "server-maps.key"] {
        std::fs::remove_file(made.join(file)).unwrap();
    }
    assert!(make_certificates(&made, &["server", "maps", "127.0.0.1"]).status.success());
    walk.guard(&["access-control", "roles.json5", "--into", "server-alone.json5"], "guarded.json5");
    walk.listen(Role::MapServer, &["--data", "maps", "--zenoh-config", "guarded.json5", "--roles", "roles.json5"]);
    walk.explore(&["--no-cameras"]);
    let before: MapsReply = walk.operate(&["maps"]);
    assert!(before.maps[0].version > 20);

    let not_ordered = "is of client:client, which may not give orders or change maps";
    let not_written = "which may not write maps";
    let explore = "explore --world museum --no-cameras --quiet --max-sim 20 --linger 2";
    let tries = [
        (Role::MapServer, "place museum trap 5,3,90 --operator client".to_owned(), not_ordered),
        // Under the operator's own name.
        (Role::MapServer, "place museum trap 5,3,90 --operator desk".to_owned(), not_ordered),
        (Role::MapServer, "release create museum mine --operator desk".to_owned(), not_ordered),
        (Role::MapServer, "retain museum --keep 5 --operator desk".to_owned(), not_ordered),
        (Role::Mapper, format!("{explore} --map annex --robot client"), not_written),
        (Role::Mapper, format!("{explore} --map wing --robot explorer"), not_written),
        (Role::Mapper, format!("{explore} --map museum --robot client"), not_written),
    ];
    std::thread::scope(|scope| {
        for (role, args, complaint) in &tries {
            let walk = &walk;
            scope.spawn(move || {
                let words: Vec<&str> = args.split(' ').chain(["--zenoh-config", "client.json5"]).collect();
                let said = walk.try_run(*role, &words).expect_err(args);
                assert!(said.contains(complaint) && !said.contains("panicked"), "{args}: {said}");
            });
        }
    });

    let after: MapsReply = walk.operate(&["maps"]);
    assert_eq!(after.maps, before.maps, "nothing came as far as the server");
    // It may look, under whatever name.
    let looked = walk.run(Role::MapServer, &["maps", "--operator", "desk", "--zenoh-config", "client.json5", "--json"]);
    let looked: MapsReply = serde_json::from_str(&looked).unwrap();
    assert_eq!(looked.maps, before.maps);
    // If it had been compacted, the oldest version would be gone.
    let diff: Value = walk.operate(&["diff", "museum", "1"]);
    assert_eq!(diff["to"]["version"], before.maps[0].version, "{diff}");
}

/// Reads a process's output until a line satisfies `wanted`; `false` when it ends before, or is
/// silent for long.
fn says_until(child: &mut Child, said: &mut String, wanted: impl Fn(&str) -> bool) -> bool {
    let (line_to, lines) = channel();
    let stderr = BufReader::new(child.stderr.take().unwrap());
    std::thread::spawn(move || stderr.lines().map_while(Result::ok).try_for_each(|line| line_to.send(line)));
    while let Ok(line) = lines.recv_timeout(PATIENCE) {
        *said += &format!("{line}\n");
        if wanted(&line) {
            return true;
        }
    }
    false
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_is_denied_is_counted_and_told_to_the_operator() {
    let dir = tempfile::tempdir().unwrap();
    let endpoint = free_endpoint();
    let file = in_file(dir.path(), "server", &guarded("server-alone.json5", "server-maps", &[&endpoint]));
    let mut server = Command::new(executable())
        .args(["role", "map-server", "--", "--data"])
        .arg(dir.path().join("data"))
        .arg("--zenoh-config")
        .arg(file)
        .env_remove("RUST_LOG")
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let file = in_file(dir.path(), "tug", &shipped("client.json5", "client-tug", &[], &[&endpoint]));
    let tug = fht_session::open(&SessionConfig::from_options(Vec::new(), Some(file))).await.unwrap();
    assert!(timeout(PATIENCE, ask(&tug, "fht/maps")).await.is_ok(), "what is allowed is not counted");
    put(&tug, "tug", "tug", 1).await;
    let check = tokio::task::spawn_blocking(move || {
        let mut said = String::new();
        let key = Key::increment(&museum(), author("tug"), 1).to_string();
        let found = says_until(&mut server, &mut said, |line| {
            line.contains("denied 1 message(s)") && line.contains("client:tug") && line.contains(&key)
        });
        let _ = server.kill();
        server.wait().unwrap();
        assert!(found, "{said}");
    });
    check.await.unwrap();
    tug.close().await.unwrap();
}

/// Its routers would let it answer nobody, and say nothing.
#[test]
fn a_server_that_its_own_list_does_not_have_says_so() {
    let dir = tempfile::tempdir().unwrap();
    let file = in_file(dir.path(), "server", &shipped("server.json5", "server-maps", &[], &[&free_endpoint()]));
    for (servers, is_told) in [("['elsewhere']", true), ("['maps']", false)] {
        let roles = in_file(dir.path(), "roles", &format!("{{servers: {servers}, explorers: ['ana']}}"));
        let mut server = Command::new(executable())
            .args(["role", "map-server", "--", "--wait", "1", "--data"])
            .arg(dir.path().join("data"))
            .args(["--zenoh-config".as_ref(), file.as_os_str(), "--roles".as_ref(), roles.as_os_str()])
            .env_remove("RUST_LOG")
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut said = String::new();
        let wanted = "of server:maps, and ";
        let found =
            says_until(&mut server, &mut said, |line| line.contains(wanted) && line.contains("no server 'maps'"));
        let _ = server.kill();
        server.wait().unwrap();
        assert_eq!(found, is_told, "{said}");
    }
}

/// Starts `client-robot path` with a configuration and reads its output until a line contains
/// `expected`.
fn says(text: &str, expected: &str) {
    let dir = tempfile::tempdir().unwrap();
    let file = in_file(dir.path(), "robot", text);
    let mut robot = Command::new(executable())
        .args(["role", "client-robot", "--", "path", "--from", "0,0", "--to", "1,1", "--zenoh-config"])
        .arg(file)
        .env_remove("RUST_LOG")
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut said = String::new();
    let found = says_until(&mut robot, &mut said, |line| line.contains(expected));
    let _ = robot.kill();
    robot.wait().unwrap();
    assert!(found, "not said: {expected}\n{said}");
    assert!(!said.contains(".rs:") && said.lines().count() == 1, "{said}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_robot_says_why_it_has_no_server() {
    let endpoint = free_endpoint();
    let router = zenoh::open(config(&shipped("router.json5", "router-a", &[&endpoint], &[]))).await.unwrap();
    let ours = shipped("client.json5", "client-tug", &[], &[&endpoint]);
    let path = |name: &str| certificates().join(name).to_str().unwrap().to_owned();
    let cases = [
        (ours.replace("enable_mtls: true", "enable_mtls: false"), "refuses our certificate, or the lack of one"),
        (ours.replace(&path("client-tug"), &path("elsewhere/explorer-ana")), "refuses our certificate"),
        (ours.replace(&path("ca.pem"), &path("elsewhere/ca.pem")), "is not from our authority"),
        (ours.replace("127.0.0.1", "127.0.0.2"), "nobody listens there"),
        (ours.replace(&path("client-tug"), &path("client-gone")), "client-gone.pem cannot be read"),
        (ours.replace("client-tug.key", "client-tug.pem"), "holds no PRIVATE KEY"),
        (ours.replace("connect_certificate:", "// connect_certificate:"), "connect_certificate is not"),
        (ours.replace("protocols: [\"tls\"]", "protocols: [\"tcp\"]"), "needs the protocol tls"),
    ];
    let checks = cases.map(|(text, expected)| tokio::task::spawn_blocking(move || says(&text, expected)));
    for check in checks {
        check.await.unwrap();
    }
    router.close().await.unwrap();
}
