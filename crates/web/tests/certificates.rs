//! Mutual TLS: without a certificate there is nothing to see, a client looks, an operator changes,
//! and who was taken off the list does neither.
#![allow(clippy::unwrap_used)] // tests may panic

mod support;

use fht_web::{DoorCertificates, WebConfig, WebError, WebListener};
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, PrivateKeyDer, ServerName};
use rustls::{ClientConfig, RootCertStore};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;
use support::{Reply, Served, exchange, posted};
use tokio_rustls::TlsConnector;

fn make(folder: &Path, arguments: &[&str]) {
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/../../deploy/make-certificates.sh");
    let out = folder.to_str().unwrap();
    let made = Command::new("sh").arg(script).args(["--out", out, "--no-passphrase"]).args(arguments).output().unwrap();
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
}

fn tls(folder: &Path) -> DoorCertificates {
    let file = |name: &str| folder.join(name);
    DoorCertificates { certificate: file("server-maps.pem"), key: file("server-maps.key"), authority: file("ca.pem") }
}

/// A request over TLS; `who` shows a certificate if there is one.
async fn send(site: &Served, folder: &Path, who: Option<(&Path, &str)>, request: &str) -> Option<Reply> {
    let certificates = |file: PathBuf| CertificateDer::pem_file_iter(file).unwrap().map(Result::unwrap);
    let mut roots = RootCertStore::empty();
    certificates(folder.join("ca.pem")).for_each(|authority| roots.add(authority).unwrap());
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let builder = ClientConfig::builder_with_provider(provider).with_safe_default_protocol_versions().unwrap();
    let builder = builder.with_root_certificates(roots);
    let config = match who {
        None => builder.with_no_client_auth(),
        Some((folder, name)) => {
            let chain = certificates(folder.join(format!("{name}.pem"))).collect();
            let key = PrivateKeyDer::from_pem_file(folder.join(format!("{name}.key"))).unwrap();
            builder.with_client_auth_cert(chain, key).unwrap()
        }
    };
    let name = ServerName::try_from("localhost").unwrap();
    let stream = TlsConnector::from(Arc::new(config)).connect(name, site.connect().await).await.ok()?;
    Some(exchange(stream, request.as_bytes()).await)
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn certificates_say_who_somebody_is_and_what_that_one_may_do() {
    let (dir, strangers) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let (site_dir, other_dir) = (dir.path(), strangers.path());
    make(site_dir, &["authority"]);
    make(site_dir, &["server", "maps", "localhost"]);
    for (role, name) in [("operator", "ada"), ("operator", "gone"), ("client", "tug"), ("explorer", "ana")] {
        make(site_dir, &[role, name]);
    }
    make(other_dir, &["authority"]);
    make(other_dir, &["operator", "ada"]);
    let site = Served::start(|config| config.tls = Some(tls(site_dir)));
    let ask = async |who: Option<(&Path, &str)>, request: &str| send(&site, site_dir, who, request).await;
    let get = |path: &str| format!("GET {path} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
    let change = posted("/api/change/museum", "Content-Type: application/json\r\n", r#"{"op":"undo"}"#);

    for path in ["/", "/page/main.js", "/fht/maps", "/metrics", "/api/events", "/nowhere"] {
        let reply = ask(None, &get(path)).await.unwrap();
        assert!(reply.status == 401 && reply.body.contains("show a certificate"), "{path}: {reply:?}");
    }
    assert_eq!(ask(None, &change).await.unwrap().status, 401);
    // TLS 1.3 tells who shows a stranger's certificate only after the handshake.
    let stranger = ask(Some((other_dir, "operator-ada")), &get("/fht/maps")).await;
    assert!(stranger.as_ref().is_none_or(|reply| reply.status == 0), "{stranger:?}");
    let gone = Some((site_dir, "operator-gone"));
    assert_eq!(ask(gone, &get("/fht/maps")).await.unwrap().status, 403);
    for who in ["client-tug", "explorer-ana"] {
        let who = Some((site_dir, who));
        assert_eq!(ask(who, &get("/fht/maps")).await.unwrap().status, 200, "{who:?}");
        assert_eq!(ask(who, &change).await.unwrap().status, 403, "{who:?}");
    }
    assert!(site.echo.changes.lock().unwrap().is_empty());
    let ada = Some((site_dir, "operator-ada"));
    assert_eq!(ask(ada, &get("/api/me")).await.unwrap().body, r#"{"name":"ada","role":"operator","rights":"change"}"#);
    assert_eq!(ask(ada, &change).await.unwrap().status, 200);
    // A browser says where it comes from: by https.
    let page = change.replace("\r\n\r\n", "\r\nOrigin: https://localhost\r\nSec-Fetch-Site: same-origin\r\n\r\n");
    assert_eq!(ask(ada, &page).await.unwrap().status, 200);
    assert_eq!(ask(ada, &page.replace("https://localhost", "http://localhost")).await.unwrap().status, 403);
    let changes = site.echo.changes.lock().unwrap();
    assert!(changes.len() == 2 && changes.iter().all(|(by, _)| by == "ada"));
}

#[test]
fn files_that_are_of_no_use_are_named() {
    let dir = tempfile::tempdir().unwrap();
    make(dir.path(), &["authority"]);
    make(dir.path(), &["server", "maps", "localhost"]);
    make(dir.path(), &["server", "spare", "localhost"]);
    let bind = |change: &dyn Fn(&mut DoorCertificates)| {
        let mut files = tls(dir.path());
        change(&mut files);
        let config = WebConfig { tls: Some(files), ..WebConfig::at("0.0.0.0:0".parse().unwrap()) };
        WebListener::bind(&config).map(|listener| listener.url())
    };
    assert!(bind(&|_| {}).is_ok_and(|url| url.starts_with("https://0.0.0.0:")));
    let missing = bind(&|files| files.key = "gone.key".into()).unwrap_err().to_string();
    assert!(missing.contains("--web-key: gone.key"), "{missing}");
    let swapped = bind(&|files| files.authority = files.key.clone()).unwrap_err().to_string();
    assert!(swapped.contains("--web-authority") && swapped.contains("no certificate"), "{swapped}");
    let other = bind(&|files| files.key = dir.path().join("server-spare.key")).unwrap_err();
    assert!(matches!(other, WebError::Tls(_)), "{other}");
    let named = WebConfig {
        tls: Some(tls(dir.path())),
        operator: Some("ada".parse().unwrap()),
        ..WebConfig::at("127.0.0.1:0".parse().unwrap())
    };
    assert!(matches!(WebListener::bind(&named), Err(WebError::NamedTwice { .. })));
}
