//! Two strangers with certificates of the site, and a client that turns on it, each doing what once
//! kept others out. Attacks go on until the run is over; that one of them fails is what is hoped
//! for.

use crate::site::secured::{Credentials, STRANGERS, TRAITOR};
use crate::site::sessions::map;
use fht_demo::{Process, ProcessError};
use fht_proto::api::fleet::BlockedReport;
use fht_proto::api::keys::{Key, RobotTopic, Topic};
use fht_proto::api::reply::Head;
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, PrivateKeyDer, ServerName};
use rustls::{ClientConfig, ClientConnection, RootCertStore};
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;
use zenoh::{Config, Session, Wait};

/// TLS connections that say nothing, to each router: more than Zenoh's own `accept_pending`.
const IDLE: usize = 101;
/// How long a router may take for its part of a handshake.
const HANDSHAKE: Duration = Duration::from_secs(2);
/// How long they are left before they are made again.
const IDLE_FOR: Duration = Duration::from_secs(5);
/// Between two bad handshakes with a router: twelve a second and more.
const BAD_EVERY: Duration = Duration::from_millis(60);
/// Between two looks at the servers' ids.
const TAKE_EVERY: Duration = Duration::from_secs(5);
/// Between two reports, and between two long questions: twenty a second.
const REPORT_EVERY: Duration = Duration::from_millis(50);
/// Between two names that are invented: 40 a second, 12,000 in five minutes.
const INVENT_EVERY: Duration = Duration::from_millis(25);

/// The role of the process that attacks.
pub const NAME: &str = "strangers";

/// Who attacks, and whom.
#[derive(Clone)]
struct Strangers {
    credentials: Credentials,
    endpoints: Vec<String>,
}

type Attack = fn(&Strangers);

/// What they do, by the numbers that `attack --attacks` takes.
const ATTACKS: [(u32, Attack); 7] = [
    (1, Strangers::draw_traffic),
    (2, Strangers::fail_handshakes),
    (3, Strangers::stay_idle),
    (4, Strangers::take_ids),
    (7, Strangers::report_blocked),
    (8, Strangers::ask_much),
    (9, Strangers::invent_names),
];

/// Starts a process that attacks the routers at `endpoints` until it is killed.
pub(super) fn start(
    executable: &Path,
    attacks: &[u32],
    credentials: &Credentials,
    endpoints: &[String],
) -> Result<Process, ProcessError> {
    let attacks = attacks.iter().map(u32::to_string).collect::<Vec<_>>().join(",");
    let folder = credentials.folder().display().to_string();
    Process::start(executable, NAME, [attacks, folder].iter().chain(endpoints))
}

/// What that process does: the attacks of these numbers, separated by commas. It returns when no
/// thread can be started.
pub fn attack(numbers: &str, folder: PathBuf, endpoints: Vec<String>) {
    let numbers: Vec<u32> = numbers.split(',').filter_map(|number| number.parse().ok()).collect();
    let strangers = Strangers { credentials: Credentials::in_folder(folder), endpoints };
    std::thread::scope(|threads| {
        for (_, attack) in ATTACKS.iter().filter(|(number, _)| numbers.contains(number)) {
            let strangers = strangers.clone();
            threads.spawn(move || attack(&strangers));
        }
    });
}

impl Strangers {
    /// A session that tries each endpoint once.
    fn session(&self, role: &str, name: &str, endpoints: &[String], options: &[(&str, String)]) -> Option<Session> {
        let mut config = Config::from_file(self.credentials.session(role, name, endpoints).ok()?).ok()?;
        config.insert_json5("connect/timeout_ms", "0").ok()?;
        config.insert_json5("listen/endpoints", "[]").ok()?;
        for (key, value) in options {
            config.insert_json5(key, value).ok()?;
        }
        zenoh::open(config).wait().ok()
    }

    /// Attack 1: in mode router, with the least weights to all routers.
    fn draw_traffic(&self) {
        let mut weights = Vec::new();
        for endpoint in &self.endpoints {
            let session = self.session("explorer", STRANGERS[0], std::slice::from_ref(endpoint), &[]);
            if let Some(session) = session {
                weights.extend(session.info().routers_zid().wait().map(|id| format!("{{dst_zid: '{id}', weight: 1}}")));
            }
        }
        let options = [
            ("mode", "\"router\"".to_owned()),
            ("routing/router/linkstate/transport_weights", format!("[{}]", weights.join(","))),
        ];
        let session = self.session("explorer", STRANGERS[0], &self.endpoints, &options);
        while session.is_some() {
            std::thread::sleep(BAD_EVERY);
        }
    }

    /// Attack 2: garbage in place of a TLS handshake.
    fn fail_handshakes(&self) {
        loop {
            for endpoint in &self.endpoints {
                let address = endpoint.trim_start_matches("tls/");
                if let Ok(mut stream) = TcpStream::connect(address) {
                    let _ = stream.set_read_timeout(Some(Duration::from_millis(5)));
                    let _ = stream.write_all(b"\x16\x03\x01 no handshake at all, no handshake at all");
                    let _ = stream.read(&mut [0; 16]);
                }
            }
            std::thread::sleep(BAD_EVERY);
        }
    }

    /// Attack 3: TLS connections with a certificate that then say nothing.
    fn stay_idle(&self) {
        let Some(config) = self.tls() else { return };
        loop {
            let at = self.endpoints.iter().flat_map(|endpoint| std::iter::repeat_n(endpoint, IDLE));
            let idle: Vec<_> = at.filter_map(|endpoint| shake_hands(&config, endpoint)).collect();
            std::thread::sleep(IDLE_FOR);
            drop(idle);
        }
    }

    fn tls(&self) -> Option<Arc<ClientConfig>> {
        let [own, key, authority] = self.credentials.stranger_tls(STRANGERS[1]);
        let mut roots = RootCertStore::empty();
        roots.add(CertificateDer::from_pem_file(authority).ok()?).ok()?;
        let chain = vec![CertificateDer::from_pem_file(own).ok()?];
        let key = PrivateKeyDer::from_pem_file(key).ok()?;
        Some(Arc::new(ClientConfig::builder().with_root_certificates(roots).with_client_auth_cert(chain, key).ok()?))
    }

    /// Attack 4: a session with each server's id at all routers.
    fn take_ids(&self) {
        let mut taken = Vec::new();
        loop {
            let asker = self.session("client", TRAITOR, &self.endpoints, &[]);
            let replies = asker.as_ref().and_then(|asker| asker.get(format!("fht/{}/head", map())).wait().ok());
            let ids = replies.into_iter().flatten().filter_map(|reply| Some(reply.replier_id()?.zid().to_string()));
            for id in ids {
                for endpoint in &self.endpoints {
                    let options = [("id", format!("\"{id}\""))];
                    taken.extend(self.session("explorer", STRANGERS[1], std::slice::from_ref(endpoint), &options));
                }
            }
            std::thread::sleep(TAKE_EVERY);
        }
    }

    /// Attack 7: reports of blocked places, all over the map, for a day each.
    fn report_blocked(&self) {
        let Some(session) = self.session("client", TRAITOR, &self.endpoints, &[]) else { return };
        let key = Key::robot(&map(), TRAITOR, RobotTopic::Blocked).to_string();
        for number in 0_u32.. {
            let places = (0..64).map(|place| [f64::from(number % 50), f64::from(place) * 0.3]).collect();
            let report = BlockedReport { for_s: BlockedReport::MAX_S, edges: Vec::new(), places };
            let _ = serde_json::to_vec(&report).map(|report| session.put(&key, report).wait());
            std::thread::sleep(REPORT_EVERY);
        }
    }

    /// Attack 8: questions for which old states are made anew; nobody waits for the answers.
    fn ask_much(&self) {
        let Some(session) = self.session("client", TRAITOR, &self.endpoints, &[]) else { return };
        let key = Key::topic(&map(), Topic::Diff);
        loop {
            let head = session.get(Key::topic(&map(), Topic::Head).to_string()).timeout(Duration::from_secs(2)).wait();
            let head = head.ok().and_then(|replies| replies.recv().ok()).and_then(|reply| reply.into_result().ok());
            let head = head.and_then(|head| serde_json::from_slice::<Head>(&head.payload().to_bytes()).ok());
            let Some(head) = head else { continue };
            for _ in 0..100 {
                let selector = format!("{key}?from={};to=head", head.vector);
                drop(session.get(selector).callback(|_| {}).wait());
                std::thread::sleep(REPORT_EVERY);
            }
        }
    }

    /// Attack 9: liveliness subscribers and queriers on names that nobody else uses.
    fn invent_names(&self) {
        let Some(session) = self.session("client", TRAITOR, &self.endpoints, &[]) else { return };
        for number in 0_u64.. {
            drop(session.liveliness().declare_subscriber(format!("fht/x{number}/robots/r")).wait());
            drop(session.declare_querier(format!("fht/x{number}/head")).wait());
            std::thread::sleep(INVENT_EVERY);
        }
    }
}

/// A TLS connection after its handshake.
fn shake_hands(config: &Arc<ClientConfig>, endpoint: &str) -> Option<(ClientConnection, TcpStream)> {
    let address = endpoint.trim_start_matches("tls/");
    let (host, _) = address.rsplit_once(':')?;
    let mut stream = TcpStream::connect(address).ok()?;
    stream.set_read_timeout(Some(HANDSHAKE)).ok()?;
    let mut connection = ClientConnection::new(Arc::clone(config), ServerName::try_from(host.to_owned()).ok()?).ok()?;
    while connection.is_handshaking() {
        connection.complete_io(&mut stream).ok()?;
    }
    Some((connection, stream))
}
