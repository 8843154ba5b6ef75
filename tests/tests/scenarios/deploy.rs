//! Every file of `deploy/`, as far as it can be tested without Docker and without the network.
mod check_site;

use crate::programs::executable;
use crate::site::{
    certificates, config, deploy, free_endpoint, make_certificates, make_certificates_of_the_readme, read, shipped,
};
use fht_proto::AuthorId;
use map_server::access::{Roles, parse};
use serde_json::Value;
use std::collections::BTreeSet;
use std::net::{TcpListener, TcpStream};
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::Duration;

fn map_server(args: &[&str]) -> Output {
    Command::new(executable()).args(["role", "map-server", "--"]).args(args).output().unwrap()
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn roles() -> Roles {
    parse(&read("roles.json5")).unwrap()
}

/// Role and name of every member, as in file names.
fn members() -> Vec<String> {
    let roles = roles();
    let lists = [
        ("router", &roles.routers),
        ("server", &roles.servers),
        ("explorer", &roles.explorers),
        ("client", &roles.clients),
        ("operator", &roles.operators),
    ];
    lists.iter().flat_map(|(role, names)| names.iter().map(move |name| format!("{role}-{name}"))).collect()
}

#[test]
fn the_script_makes_what_its_help_says_and_overwrites_nothing() {
    assert!(Command::new("sh").arg("-n").arg(deploy("make-certificates.sh")).status().unwrap().success());
    let mode = |file: &Path| std::fs::metadata(file).unwrap().permissions().mode() & 0o777;
    assert_eq!(mode(&deploy("make-certificates.sh")) & 0o111, 0o111);
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("new folder");
    let make = |args: &str| make_certificates(&out, &args.split(' ').collect::<Vec<_>>());
    assert!(said(&make("explorer ana")).contains("has no authority"));
    assert!(make("authority").status.success() && make("--days 30 explorer ana").status.success());
    let is_private = |name: &str| mode(&out.join(name)) == 0o600 && mode(&out) == 0o700;
    assert!(is_private("ca.key") && is_private("explorer-ana.key"));

    let openssl = |args: &[&str]| Command::new("openssl").args(args).current_dir(&out).output().unwrap();
    let shown = openssl(&["x509", "-in", "explorer-ana.pem", "-noout", "-subject", "-ext", "extendedKeyUsage"]);
    let shown = String::from_utf8(shown.stdout).unwrap();
    assert!(shown.contains("explorer:ana") && !shown.contains("Server"), "{shown}");
    assert!(
        openssl(&["x509", "-in", "explorer-ana.pem", "-noout", "-checkend", "2505600"]).status.success(),
        "29 days"
    );
    assert!(
        !openssl(&["x509", "-in", "explorer-ana.pem", "-noout", "-checkend", "2678400"]).status.success(),
        "31 days"
    );
    assert!(openssl(&["verify", "-CAfile", "ca.pem", "explorer-ana.pem"]).status.success());

    let before = std::fs::read(out.join("explorer-ana.pem")).unwrap();
    let long = format!("explorer {}", "a".repeat(56));
    for (args, reason) in [
        ("authority", "move ca.key and ca.pem away"),
        ("explorer ana", "exists; move it away"),
        ("client ana", "ana is explorer already"),
        ("operator ana", "ana is explorer already"),
        ("captain ana", "unknown role captain"),
        ("explorer", "needs a NAME"),
        ("explorer ana/../ben", "is not made of"),
        ("explorer a:b", "is not made of"),
        ("explorer ben host", "names no hosts"),
        ("router hall", "needs at least one HOST"),
        ("router hall a,b", "neither a DNS name nor"),
        ("router hall hall..example", "neither a DNS name nor"),
        ("router hall 10.0.1", "neither a DNS name nor"),
        ("router hall 10.0.0.256", "neither a DNS name nor"),
        ("router hall localhost:7447", "neither a DNS name nor"),
        ("router hall cafe:7447", "neither a DNS name nor"),
        ("router hall :::1", "not all DNS names and IP addresses"),
        ("router hall 1::2::3", "not all DNS names and IP addresses"),
        ("router hall 10.0.0.1\nbasicConstraints=critical,CA:TRUE", "neither a DNS name nor"),
        ("router hall 10.0.0.1\n[name]\nCN=operator:desk", "neither a DNS name nor"),
        ("--days 0 explorer ben", "not a number of days"),
        ("--days 1e3 explorer ben", "not a number of days"),
        ("--days 08 explorer ben", "not a number of days"),
        ("--nights 3 explorer ben", "unknown option"),
        (&long, "longer than 55"),
    ] {
        let output = make(args);
        assert!(!output.status.success() && said(&output).contains(reason), "{args}: {}", said(&output));
    }
    assert_eq!(std::fs::read(out.join("explorer-ana.pem")).unwrap(), before);
    let files: BTreeSet<_> = std::fs::read_dir(&out).unwrap().map(|file| file.unwrap().file_name()).collect();
    assert_eq!(files, ["ca.key", "ca.pem", "explorer-ana.key", "explorer-ana.pem"].map(Into::into).into());
    let help = make("--help");
    assert!(help.status.success() && String::from_utf8_lossy(&help.stdout).contains("ROLE:NAME"));
}

#[test]
fn the_key_of_the_authority_is_encrypted_with_a_passphrase() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("certificates");
    let file = dir.path().join("passphrase");
    std::fs::write(&file, "Pass phrase, 'quoted' \"twice\" $HOME").unwrap();
    let make = |words: &[&str], passphrase: &str| {
        let mut command = Command::new("sh");
        command.arg(deploy("make-certificates.sh")).arg("--out").arg(&out).args(words);
        command.env("FHT_CA_PASSPHRASE", passphrase).output().unwrap()
    };
    let of_file = ["--passphrase-file", file.to_str().unwrap()];
    assert!(said(&make(&["authority"], "short")).contains("shorter than 8"));
    assert!(make(&[&of_file[..], &["authority"]].concat(), "").status.success());
    let key = std::fs::read_to_string(out.join("ca.key")).unwrap();
    assert!(key.starts_with("-----BEGIN ENCRYPTED PRIVATE KEY-----"), "{key}");
    assert!(said(&make(&["explorer", "ana"], "")).contains("ca.key is encrypted"));
    assert!(said(&make(&["explorer", "ana"], "another passphrase")).contains("the passphrase of"));
    assert!(!out.join("explorer-ana.pem").exists());
    let output = make(&["explorer", "ana"], &std::fs::read_to_string(&file).unwrap());
    assert!(output.status.success(), "{}", said(&output));
    let robot = std::fs::read_to_string(out.join("explorer-ana.key")).unwrap();
    assert!(robot.starts_with("-----BEGIN PRIVATE KEY-----"), "robots start without a person");
    let verify = ["verify", "-CAfile", "ca.pem", "explorer-ana.pem"];
    assert!(Command::new("openssl").args(verify).current_dir(&out).output().unwrap().status.success());
    // A renewal that fails leaves the old authority where it is.
    let files = || {
        let entries = std::fs::read_dir(&out).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
        entries.collect::<BTreeSet<String>>()
    };
    let before = files();
    for (passphrase, told) in [("short", "shorter than 8"), ("", "is encrypted: give the new one a passphrase")] {
        let output = make(&["renew-authority"], passphrase);
        assert!(!output.status.success() && said(&output).contains(told), "{}", said(&output));
        assert_eq!(files(), before);
    }
    for wait_ms in [20, 60, 120] {
        let mut renewal = Command::new("sh");
        renewal.arg(deploy("make-certificates.sh")).arg("--out").arg(&out).args(of_file).arg("renew-authority");
        let mut renewal = renewal.stdout(Stdio::null()).spawn().unwrap();
        std::thread::sleep(Duration::from_millis(wait_ms));
        Command::new("kill").arg(renewal.id().to_string()).status().unwrap();
        if renewal.wait().unwrap().success() {
            // It was faster: back to the old one.
            std::fs::remove_file(out.join("ca.pem")).unwrap();
            std::fs::remove_file(out.join("ca.key")).unwrap();
            for file in std::fs::read_dir(out.join("old")).unwrap().map(|entry| entry.unwrap().path()) {
                std::fs::rename(&file, out.join(file.file_name().unwrap())).unwrap();
            }
            std::fs::remove_dir(out.join("old")).unwrap();
        }
        assert_eq!(files(), before, "after {wait_ms} ms");
    }
    // A new authority's key is stored as the old one was.
    for words in [&["renew-authority"][..], &["explorer", "ben"]] {
        let output = make(&[&of_file[..], words].concat(), "");
        assert!(output.status.success(), "{words:?}: {}", said(&output));
    }
    let key = std::fs::read_to_string(out.join("ca.key")).unwrap();
    assert!(key.starts_with("-----BEGIN ENCRYPTED PRIVATE KEY-----"), "{key}");
}

#[test]
fn the_walk_through_makes_every_file_that_the_compose_file_mounts() {
    let dir = tempfile::tempdir().unwrap();
    make_certificates_of_the_readme(dir.path());
    let made = |name: &str| dir.path().join("certificates").join(name).exists();
    for member in members() {
        assert!(made(&format!("{member}.pem")) && made(&format!("{member}.key")), "{member}");
    }
    let command = "map-server access-control roles.json5 --router a --into router.json5 > zenohd-a.json5";
    assert!(read("README.md").contains(command));
    let zenohd = for_router("a", &["router.json5"]);
    assert!(zenohd.contains(&AuthorId::of_robot(&roles().explorers[0]).to_string()));
    let with_storages = for_router("a", &["router.json5", "storages.json5"]);
    config(&with_storages);

    // Further servers are made in the same way.
    let stateless = ["maps-1", "maps-2", "maps-3"].map(|name| format!("server-{name}"));
    for name in &stateless {
        assert!(
            make_certificates(&dir.path().join("certificates"), &["server", &name["server-".len()..]]).status.success()
        );
    }
    for (file, zenohd) in [("compose.yaml", &zenohd), ("compose-stateless.yaml", &with_storages)] {
        mounts_what_there_is(file, zenohd, &made);
    }
}

/// What `map-server access-control` writes for a router of `deploy/roles.json5`.
fn for_router(name: &str, into: &[&str]) -> String {
    guarded(&["--router", name], into)
}

/// These files with who may do what.
fn guarded(flags: &[&str], into: &[&str]) -> String {
    let files = into.iter().flat_map(|file| ["--into".to_owned(), deploy(file).to_str().unwrap().to_owned()]);
    let roles = deploy("roles.json5");
    let words = ["access-control", roles.to_str().unwrap()].into_iter().chain(flags.iter().copied());
    let words: Vec<String> = words.map(str::to_owned).chain(files).collect();
    let written = map_server(&words.iter().map(String::as_str).collect::<Vec<_>>());
    assert!(written.status.success(), "{}", said(&written));
    String::from_utf8(written.stdout).unwrap()
}

/// Everything that a compose file mounts is made by the README's commands or lies in this folder,
/// where the routers' configuration looks for it; except the plugins' libraries, which come from
/// elsewhere.
fn mounts_what_there_is(file: &str, zenohd: &str, made: &impl Fn(&str) -> bool) {
    let compose: Value = serde_saphyr::from_str(&read(file)).unwrap();
    let services = compose["services"].as_object().unwrap();
    let volumes = compose["volumes"].as_object().unwrap();
    let mut used = BTreeSet::new();
    let is_of_router = |service: &str, file: &str| {
        Some(file) == service.strip_prefix("router-").map(|name| format!("zenohd-{name}.json5")).as_deref()
    };
    let runs_zenohd = |service: &Value| service["command"].to_string().contains("zenohd.json5");
    let zenohd_needs: Vec<&str> =
        ["/etc/fht-map/tls/ca.pem", "/etc/fht-map/tls/own.pem", "/etc/fht-map/tls/own.key", "/opt/fht-map/plugins"]
            .into_iter()
            .filter(|path| zenohd.contains(path))
            .collect();
    for (name, service) in services {
        let mounts: Vec<&str> = service["volumes"].as_array().unwrap().iter().map(|it| it.as_str().unwrap()).collect();
        // Each of the routers: if two of three lacked a library, no increment would ever be
        // acknowledged.
        for path in zenohd_needs.iter().filter(|_| runs_zenohd(service)) {
            let there = mounts.iter().any(|mount| mount.ends_with(&format!(":{path}:ro")));
            assert!(there, "{file}: {name} does not mount {path}");
        }
        for mount in &mounts {
            let parts: Vec<&str> = mount.split(':').collect();
            if let Some(file) = parts[0].strip_prefix("./") {
                assert_eq!(parts.len(), 3, "{name}: {file} is mounted for writing");
                let there = file
                    .strip_prefix("certificates/")
                    .map_or_else(|| file == "plugins" || is_of_router(name, file) || deploy(file).exists(), made);
                assert!(there, "{name}: {file} is nowhere");
                // Where the configuration looks for it.
                let target = parts[1].trim_end_matches(".json5");
                let is_own = ["/etc/fht-map/zenohd", "/etc/fht-map/server", "/etc/fht-map/roles"].contains(&target);
                assert!(is_own || zenohd.contains(target));
            } else {
                assert!(volumes.contains_key(parts[0]) && used.insert(parts[0].to_owned()), "{name}: {mount}");
            }
        }
    }
    assert_eq!(used.len(), volumes.len());
}

/// The replacement for RocksDB's volume where there is none.
fn in_memory(config: &str) -> Value {
    let mut config: Value = json5::from_str(config).unwrap();
    let storages = &mut config["plugins"]["storage_manager"];
    assert!(storages["volumes"]["rocksdb"].is_object(), "{storages}");
    assert_eq!(storages["storages"]["increments"]["volume"]["id"], "rocksdb");
    storages["volumes"] = serde_json::json!({});
    storages["storages"]["increments"]["volume"] = "memory".into();
    config
}

#[test]
fn the_storages_keep_what_servers_put_and_nothing_else() {
    let text = in_memory(&read("storages.json5"));
    let storage = &text["plugins"]["storage_manager"]["storages"]["increments"];
    assert_eq!(storage["key_expr"], fht_proto::api::keys::ALL_KEPT);
    assert!(storage["replication"]["interval"].as_f64().unwrap() > 0.5, "twice the delay of propagation at least");
    assert_eq!(text["plugins_loading"]["enabled"], true, "zenohd loads no plugin otherwise");
    let router: Value = json5::from_str(&read("router.json5")).unwrap();
    assert_eq!(router["timestamping"]["enabled"], true, "the storage manager does not start otherwise");
}

fn names_what_it_runs(file: &str) {
    let compose: Value = serde_saphyr::from_str(&read(file)).unwrap();
    let services = compose["services"].as_object().unwrap();
    let lock = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../Cargo.lock")).unwrap();
    let zenoh = lock.split("[[package]]\nname = \"zenoh\"\nversion = \"").nth(1).unwrap().split('"').next().unwrap();
    let (mut ports, mut routers) = (BTreeSet::new(), Vec::new());
    for (name, service) in services {
        let image = service["image"].as_str().unwrap();
        let tag = image.split_once(':').map_or("latest", |(_, tag)| tag);
        assert!(tag != "latest", "{image}");
        assert_eq!(service["restart"], "always", "{name}");
        assert!(service["healthcheck"]["test"].is_array() && service["read_only"] == true, "{name}");
        assert!(service["mem_limit"].is_string() && service["pids_limit"].is_number(), "{name}");
        if image.starts_with("eclipse/zenoh:") {
            assert_eq!(tag, zenoh, "routers and programs have one version");
            let port = service["ports"][0].as_str().unwrap().to_owned();
            assert!(port.ends_with(":7447") && ports.insert(port), "{name}");
            routers.push(name.as_str());
        }
    }
    assert_eq!(routers.len(), 3);
    for (name, service) in services {
        let command: Vec<&str> =
            service["command"].as_array().unwrap().iter().map(|word| word.as_str().unwrap()).collect();
        if routers.contains(&name.as_str()) {
            let others: BTreeSet<String> =
                routers.iter().filter(|other| *other != name).map(|other| format!("tls/{other}:7447")).collect();
            let connects = command.windows(2).filter(|pair| pair[0] == "-e").map(|pair| pair[1].to_owned());
            assert_eq!(connects.collect::<BTreeSet<_>>(), others);
            // Sessions look for the routers under these names.
            assert!(read("explorer.json5").contains(&format!("tls/{name}:7447")));
        } else {
            // The server judges by the list that is mounted.
            let roles = command.iter().skip_while(|word| **word != "--roles").nth(1).unwrap();
            let mounts = service["volumes"].as_array().unwrap();
            assert!(mounts.contains(&format!("./roles.json5:{roles}:ro").into()), "{name}");
            // Words that the parser does not know come before the help.
            assert!(map_server(&[&command[..], &["--help"]].concat()).status.success(), "{command:?}");
        }
    }
}

#[test]
fn the_compose_files_name_what_they_run() {
    names_what_it_runs("compose.yaml");
    names_what_it_runs("compose-stateless.yaml");
    assert!(!map_server(&["--nonsense", "--help"]).status.success());
    let dockerfile = read("Dockerfile");
    let images = dockerfile.lines().filter_map(|line| line.strip_prefix("FROM "));
    assert!(
        images.clone().count() == 2 && images.clone().all(|image| image.contains(':') && !image.contains(":latest"))
    );
    let manifest = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../Cargo.toml")).unwrap();
    let rust = manifest.split("rust-version = \"").nth(1).unwrap().split('"').next().unwrap();
    assert!(dockerfile.contains(&format!("FROM rust:{rust}.")), "the toolchain that the workspace needs");
    // A digest, or a version that nobody moves: three numbers, or a day.
    let is_exact = |image: &&str| {
        let tag = image.split_once(':').map_or("", |(_, tag)| tag.split(' ').next().unwrap());
        let numbers = tag.split(|c: char| !c.is_ascii_digit()).filter(|number| !number.is_empty());
        image.contains("@sha256:") || numbers.clone().count() == 3 || numbers.into_iter().any(|day| day.len() == 8)
    };
    assert!(images.clone().all(|image| is_exact(&image)), "{dockerfile}");
}

#[test]
fn the_health_checks_see_a_listener_a_connection_and_an_answer() {
    let compose = |file: &str| serde_saphyr::from_str::<Value>(&read(file)).unwrap();
    let (site, stateless) = (compose("compose.yaml"), compose("compose-stateless.yaml"));
    let of = |compose: &Value, service: &str| compose["services"][service]["healthcheck"]["test"].clone();
    let address = fht_reserved_port::reserve().unwrap();
    let healthy = |test: Value| {
        let test = test[1].as_str().unwrap();
        assert!(test.contains("1D17"), "7447");
        let test = test.replace("1D17", &format!("{:04X}", address.port()));
        Command::new("sh").args(["-c", &test]).status().unwrap().success()
    };
    assert!(!healthy(of(&site, "router-a")), "nobody listens");
    let _listener = TcpListener::bind(address).unwrap();
    assert!(healthy(of(&site, "router-a")) && !healthy(of(&stateless, "maps-1")));
    let _connection = TcpStream::connect(address).unwrap();
    assert!(healthy(of(&stateless, "maps-1")));
    // The server itself is asked.
    let asked: Vec<String> = serde_json::from_value(of(&site, "maps")).unwrap();
    assert_eq!((asked[0].as_str(), asked[1].as_str()), ("CMD", "map-server"));
    assert!(map_server::command().try_get_matches_from(&asked[1..]).is_ok(), "{asked:?}");
    let folder = tempfile::tempdir().unwrap();
    let endpoint = fht_demo::free_endpoint().unwrap();
    let health = || map_server(&["health", "--wait", "4", "--connect", &endpoint]).status.success();
    assert!(!health(), "nobody is there");
    let patience = std::time::Duration::from_secs(30);
    let _server = fht_demo::Process::map_server(executable(), folder.path(), &endpoint, patience).unwrap();
    assert!(health());
}

#[test]
fn the_units_are_sound_and_start_what_there_is() {
    let dir = tempfile::tempdir().unwrap();
    for unit in ["fht-map-server.service", "fht-map-router.service"] {
        let text = read(unit);
        let values = |key: &str| -> Vec<String> {
            let prefix = format!("{key}=");
            text.lines().filter_map(|line| line.strip_prefix(&prefix)).map(str::to_owned).collect()
        };
        for (key, value) in [
            ("ProtectSystem", "strict"),
            ("NoNewPrivileges", "yes"),
            ("Restart", "always"),
            ("LimitNOFILE", "65536"),
            ("User", "fht-map"),
            ("CapabilityBoundingSet", ""),
            ("TasksMax", "512"),
        ] {
            assert_eq!(values(key), [value], "{unit}: {key}");
        }
        let memory =
            [values("MemoryHigh"), values("MemoryMax")].map(|it| it[0].trim_end_matches('%').parse::<u8>().unwrap());
        assert!(memory[0] < memory[1] && memory[1] <= 80, "{unit}: {memory:?}");
        let start = values("ExecStart").remove(0);
        let words: Vec<&str> = start.split(' ').collect();
        if unit == "fht-map-server.service" {
            assert!(map_server(&[&words[1..], &["--help"]].concat()).status.success(), "{start}");
            assert!(words.windows(2).any(|pair| pair == ["--roles", "/etc/fht-map/roles.json5"]), "{start}");
            let state = format!("/var/lib/{}", values("StateDirectory")[0]);
            assert!(words.contains(&state.as_str()), "it may write there only");
        } else {
            assert!(words[1..].chunks(2).all(|pair| ["-c", "-e", "--rest-http-port"].contains(&pair[0])), "{start}");
        }
        // If systemd is installed, it checks the units; the programs are not installed here.
        let copy = dir.path().join(unit);
        std::fs::write(&copy, text.replace(words[0], executable().to_str().unwrap())).unwrap();
        match Command::new("systemd-analyze").arg("verify").arg(&copy).output() {
            Ok(output) => assert!(said(&output).lines().all(|line| !line.contains(unit)), "{}", said(&output)),
            Err(_) => assert!(text.contains("[Service]") && text.contains("[Install]")),
        }
    }
}

#[test]
fn configurations_without_access_control_say_so_and_lists_that_cannot_be_are_refused() {
    for (file, own) in [("router.json5", "router-a"), ("server-alone.json5", "server-maps")] {
        let text = shipped(file, own, &[&free_endpoint()], &[]);
        assert!(config(&text).get_json("access_control").unwrap().contains("\"enabled\":false"));
        assert!(read(file).contains("map-server access-control"), "{file}");
    }
    let dir = tempfile::tempdir().unwrap();
    let refused = |text: &str| {
        let file = dir.path().join("roles.json5");
        std::fs::write(&file, text).unwrap();
        let output = map_server(&["access-control", file.to_str().unwrap()]);
        assert!(!output.status.success() && output.stdout.is_empty(), "{text}");
        said(&output)
    };
    assert!(refused("{explorers: ['ana'], clients: ['ana']}").contains("roles.json5: the name 'ana' is listed twice"));
    assert!(refused("{").contains("roles.json5: not understood"));
    assert!(said(&map_server(&["access-control", "nowhere.json5"])).contains("nowhere.json5 cannot be read"));
}

#[test]
fn the_readme_knows_every_file() {
    let readme = read("README.md");
    for file in std::fs::read_dir(deploy("")).unwrap() {
        let file = file.unwrap();
        let name = file.file_name().into_string().unwrap();
        assert!(file.file_type().unwrap().is_dir() || name == "README.md" || readme.contains(&name), "{name}");
    }
    assert!(certificates().exists());
}

/// What Docker sends to the image's build: the first pattern leaves out everything, the others let
/// folders in again, and keys and builds stay out of those.
#[test]
fn no_key_and_no_build_is_in_the_context_of_the_image() {
    let root = deploy("..");
    let text = std::fs::read_to_string(root.join(".dockerignore")).unwrap();
    let patterns: Vec<&str> = text.lines().filter(|line| !line.is_empty() && !line.starts_with('#')).collect();
    assert_eq!(patterns[0], "*");
    let (allowed, denied): (Vec<&str>, Vec<&str>) = patterns[1..].iter().partition(|pattern| pattern.starts_with('!'));
    assert_eq!(denied, ["**/target", "**/*.key", "**/*.pem"]);
    assert_eq!(patterns[patterns.len() - denied.len()..], denied, "the last pattern that fits decides");
    assert!(!allowed.contains(&"!deploy"), "make-certificates.sh puts keys there");
    // What Cargo needs to build a member of the workspace is all there.
    let manifest: toml::Table = std::fs::read_to_string(root.join("Cargo.toml")).unwrap().parse().unwrap();
    let members = manifest["workspace"]["members"].as_array().unwrap();
    let folders = members.iter().map(|member| member.as_str().unwrap().trim_end_matches("/*"));
    for needed in folders.chain(["Cargo.toml", "Cargo.lock", ".cargo", "models"]) {
        assert!(allowed.contains(&format!("!{needed}").as_str()), "{needed} is left out");
    }
}
