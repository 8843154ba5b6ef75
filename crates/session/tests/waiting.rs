//! Clients that wait for their routers and go back to them, on loopback.

use fht_session::{
    ConnectError, SessionConfig, check_owner, check_server, check_serving, homecoming, open_configured, read_config,
    set_endpoints, without_source_paths,
};
use std::time::{Duration, Instant};
use zenoh::Config;

fn free_endpoint() -> String {
    format!("tcp/{}", fht_reserved_port::reserve().expect("a port"))
}

fn config(mode: &str, listen: &[&str], connect: &[&str]) -> Config {
    let mut config = Config::default();
    for (key, value) in [
        ("mode", format!("{mode:?}")),
        ("listen/endpoints", format!("{listen:?}")),
        ("connect/endpoints", format!("{connect:?}")),
        ("connect/timeout_ms", "-1".to_owned()),
        ("connect/exit_on_failure", "false".to_owned()),
        ("scouting/multicast/enabled", "false".to_owned()),
    ] {
        config.insert_json5(key, &value).expect("accepted");
    }
    config
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_client_tries_all_its_endpoints() {
    let (dead, late) = (free_endpoint(), free_endpoint());
    let client = tokio::spawn(open_configured(config("client", &[], &[&dead, &late]), None));
    tokio::time::sleep(Duration::from_millis(300)).await;
    assert!(!client.is_finished(), "nobody is there yet");
    let router = open_configured(config("router", &[&late], &[]), None).await.expect("a router");
    let client = tokio::time::timeout(Duration::from_secs(30), client).await.expect("no end");
    let client = client.expect("no panic").expect("a session");
    client.close().await.expect("closed");
    router.close().await.expect("closed");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_session_goes_back_to_its_first_router() {
    let (first, second) = (free_endpoint(), free_endpoint());
    let router =
        async |endpoint: &str| open_configured(config("router", &[endpoint], &[]), None).await.expect("a router");
    let other = router(&second).await;
    let config = config("client", &[], &[&first, &second]);
    let session = open_configured(config.clone(), None).await.expect("a session");
    let is_at = async |session: &zenoh::Session, router: &zenoh::Session| {
        session.info().routers_zid().await.collect::<Vec<_>>() == [router.zid()]
    };
    assert!(is_at(&session, &other).await);

    let home = router(&first).await;
    let returned = tokio::time::timeout(Duration::from_secs(60), homecoming(&session, &config)).await.expect("no end");
    assert!(is_at(&returned, &home).await);
    // There it stays.
    assert!(tokio::time::timeout(Duration::from_secs(12), homecoming(&returned, &config)).await.is_err());
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn patience_ends_with_the_reason() {
    let endpoints = [free_endpoint(), free_endpoint()];
    let texts: Vec<&str> = endpoints.iter().map(String::as_str).collect();
    let begin = Instant::now();
    let error =
        open_configured(config("client", &[], &texts), Some(Duration::from_millis(400))).await.expect_err("nobody");
    assert!(begin.elapsed() < Duration::from_secs(30));
    let ConnectError::Refused { reason, .. } = error else { panic!("{error}") };
    assert!(endpoints.iter().all(|endpoint| reason.contains(endpoint)), "{reason}");
    assert!(reason.contains("nobody listens there") && reason == without_source_paths(&reason), "{reason}");
}

/// A certificate for this machine that vouches for itself, and its key.
fn certificate(folder: &std::path::Path, common_name: &str) -> [String; 2] {
    let at = |name: &str| folder.join(name).to_str().expect("UTF-8").to_owned();
    let (certificate, key) = (at("robot.pem"), at("robot.key"));
    let (subject, host) = (format!("/CN={common_name}"), "subjectAltName=DNS:localhost");
    let made = std::process::Command::new("openssl")
        .args(["req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-days", "2"])
        .args(["-subj", &subject, "-addext", host, "-keyout", &key, "-out", &certificate])
        .output()
        .expect("openssl");
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    [certificate, key]
}

/// Why nobody answers at an endpoint within two seconds; the reason is not long after them.
async fn refusal(mut config: Config, certificate: &str) -> String {
    let begin = Instant::now();
    config.insert_json5("transport/link/tls/root_ca_certificate", &format!("{certificate:?}")).expect("accepted");
    let error = open_configured(config, Some(Duration::from_secs(2))).await.expect_err("another protocol");
    assert!(begin.elapsed() < Duration::from_secs(4), "{:?}", begin.elapsed());
    let ConnectError::Refused { reason, .. } = error else { panic!("{error}") };
    reason
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn who_speaks_another_protocol_is_told_which() {
    let folder = tempfile::tempdir().expect("a folder");
    let [certificate, key] = certificate(folder.path(), "router");
    let (plain, secure) = (free_endpoint(), free_endpoint().replace("tcp/127.0.0.1", "tls/localhost"));
    let mut router = config("router", &[&plain, &secure], &[]);
    for (option, file) in [("listen_certificate", &certificate), ("listen_private_key", &key)] {
        router.insert_json5(&format!("transport/link/tls/{option}"), &format!("{file:?}")).expect("accepted");
    }
    let router = open_configured(router, None).await.expect("a router");
    let (swapped, told) = (secure.replace("tls/", "tcp/"), plain.replace("tcp/127.0.0.1", "tls/localhost"));
    let reason = refusal(config("client", &[], &[&swapped]), &certificate).await;
    assert!(reason.contains(&format!("perhaps it wants {secure}")), "{reason}");
    let reason = refusal(config("client", &[], &[&told]), &certificate).await;
    assert!(reason.contains(&format!("perhaps it wants tcp/{}", &told["tls/".len()..])), "{reason}");
    router.close().await.expect("closed");
}

#[test]
fn a_certificate_of_another_robot_is_refused_before_anybody_connects() {
    let folder = tempfile::tempdir().expect("a folder");
    let [certificate, key] = certificate(folder.path(), "client:amr-7");
    let file = folder.path().join("zenoh.json5");
    let tls = format!(
        "{{root_ca_certificate: {certificate:?}, connect_certificate: {certificate:?}, connect_private_key: {key:?}}}"
    );
    std::fs::write(&file, format!("{{transport: {{link: {{tls: {tls}}}}}}}")).expect("written");
    let said = |endpoint: &str, role: &'static str, name: &str| {
        let link = SessionConfig::from_options(vec![endpoint.to_owned()], Some(file.clone()));
        check_owner(&link, role, name).err().map(|error| error.to_string()).unwrap_or_default()
    };
    let told = said("tls/localhost:7447", "client", "amr-8");
    for part in ["robot.pem is of client:amr-7", "this client is called amr-8", "--robot amr-7"] {
        assert!(told.contains(part), "{told}");
    }
    assert_eq!(said("tls/localhost:7447", "client", "amr-7"), "");
    let told = said("tls/localhost:7447", "explorer", "amr-7");
    assert!(told.contains("robot.pem is of client:amr-7, which may not write maps"), "{told}");
    let told = said("tls/localhost:7447", "operator", "amr-7");
    assert!(told.contains("is of client:amr-7, which may not give orders or change maps: that takes"), "{told}");
    assert_eq!(said("tcp/localhost:7447", "client", "amr-8"), "", "nobody sees the certificate");
    let serving = || {
        let link = SessionConfig::from_options(vec!["tls/localhost:7447".to_owned()], Some(file.clone()));
        check_serving(&link).err().map(|error| error.to_string()).unwrap_or_default()
    };
    assert_eq!(serving(), "");
    self::certificate(folder.path(), "operator:desk");
    assert!(serving().contains("is of operator:desk, which may not take goals"), "{}", serving());
    // The same files, of an explorer now.
    self::certificate(folder.path(), "explorer:ana");
    let told = said("tls/localhost:7447", "client", "amr-7");
    assert!(told.contains("is of explorer:ana, but this client is called amr-7"), "{told}");
    assert_eq!(said("tls/localhost:7447", "client", "ana"), "", "an explorer may ask under its name");
    // Nor is it a map-server's.
    let of_server = || {
        let mut config = read_config(Some(&file)).expect("read");
        set_endpoints(&mut config, "connect/endpoints", &["tls/localhost:7447".to_owned()]).expect("accepted");
        check_server(&config)
    };
    let told = of_server().err().map(|error| error.to_string()).unwrap_or_default();
    assert!(
        told.contains("is of explorer:ana, which may not serve maps: that takes a certificate of a server"),
        "{told}"
    );
    for name in ["server:maps", "router:hall"] {
        self::certificate(folder.path(), name);
        assert!(of_server().is_ok(), "{name}");
    }
}

#[tokio::test]
async fn a_key_of_another_certificate_is_refused_before_anybody_connects() {
    let folders = [tempfile::tempdir().expect("a folder"), tempfile::tempdir().expect("a folder")];
    let [[certificate, own], [_, of_another]] =
        folders.each_ref().map(|folder| certificate(folder.path(), "client:amr-7"));
    let open = async |key: &str| {
        let mut config = config("client", &[], &[&free_endpoint().replace("tcp/127.0.0.1", "tls/localhost")]);
        let tls = format!(
            "{{root_ca_certificate: {certificate:?}, connect_certificate: {certificate:?}, connect_private_key: {key:?}}}"
        );
        config.insert_json5("transport/link/tls", &tls).expect("accepted");
        let patience = Some(Duration::from_millis(100));
        open_configured(config, patience).await.expect_err("nobody").to_string()
    };
    let told = open(&of_another).await;
    assert!(told.contains("is not the key of the certificate"), "{told}");
    let told = open(&own).await;
    assert!(told.starts_with("no server or router at tls/localhost:"), "{told}");
}
