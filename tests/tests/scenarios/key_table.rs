//! Who may do what under which key: the table in `docs/security.md` is what the written access
//! control says, and what a router as deployed does, cell by cell.

use crate::site::{MOMENT, config, deploy, free_endpoint, guarded, in_file, shipped};
use fht_proto::AuthorId;
use serde_json::Value;
use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::sync::{Arc, Mutex};
use std::time::Duration;
use zenoh::key_expr::keyexpr;
use zenoh::query::QueryTarget;
use zenoh::{Session, Wait};

/// What a session may do with a key, and the messages that this takes: those that it sends, those
/// that it is sent.
const DEEDS: [(&str, &[&str], &[&str]); 7] = [
    ("put", &["put"], &[]),
    ("delete", &["delete"], &[]),
    ("hear", &["declare_subscriber"], &["put"]),
    ("ask", &["query"], &["reply"]),
    ("answer", &["declare_queryable", "reply"], &["query"]),
    ("be there", &["liveliness_token"], &[]),
    ("see who is there", &["declare_liveliness_subscriber"], &["liveliness_token"]),
];
/// Members of the fleet, each with the file of `deploy/` that it uses; a stranger has a certificate
/// of the site and is in no list.
const MEMBERS: [(&str, &str, &str); 5] = [
    ("explorer", "ana", "explorer.json5"),
    ("client", "tug", "client.json5"),
    ("operator", "desk", "operator.json5"),
    ("server", "maps", "server.json5"),
    ("not in the list", "stranger", "explorer.json5"),
];
/// How often all is tried at most.
const ROUNDS: usize = 4;
/// Keys with what stands for them in the test. `{own}` is the member's name, `{own id}` its author.
const KEYS: [(&str, &str); 17] = [
    ("inc/{own id}/{number}", "fht/museum/inc/{own id}/7"),
    ("inc/{others' id}/{number}", "fht/museum/inc/{others' id}/7"),
    ("refused/{own id}", "fht/museum/refused/{own id}"),
    ("refused/{others' id}", "fht/museum/refused/{others' id}"),
    ("kept/{id}/{number}", "fht/museum/kept/{others' id}/7"),
    ("head", "fht/museum/head"),
    ("path, nodes, since … (questions)", "fht/museum/path"),
    ("admin/retain, import … (orders)", "fht/museum/admin/retain"),
    ("robots/{own}", "fht/museum/robots/{own}"),
    ("robots/{others}", "fht/museum/robots/ben"),
    ("robots/{own}/exploring", "fht/museum/robots/{own}/exploring"),
    ("robots/{own}/pose, status, blocked", "fht/museum/robots/{own}/pose"),
    ("robots/{others}/pose, status, blocked", "fht/museum/robots/ben/pose"),
    ("robots/{own}/goal", "fht/museum/robots/{own}/goal"),
    ("robots/{others}/goal", "fht/museum/robots/ben/goal"),
    ("another service's", "elsewhere/museum/head"),
    ("another service's robots", "elsewhere/museum/robots/{own}"),
];

/// `row` of [`KEYS`] for a member.
fn key(row: usize, name: &str) -> String {
    let id = |name: &str| AuthorId::of_robot(name).to_string();
    KEYS[row].1.replace("{own}", name).replace("{own id}", &id(name)).replace("{others' id}", &id("ben"))
}

/// The written section: whether a member may send (`ingress`) or be sent (`egress`) a message.
fn allows(section: &Value, subject: &str, flow: &str, message: &str, key: &str) -> bool {
    let list = |name: &str| section[name].as_array().unwrap();
    let Some(policy) = list("policies").iter().find(|policy| policy["id"] == subject) else { return false };
    list("rules").iter().filter(|rule| policy["rules"].as_array().unwrap().contains(&rule["id"])).any(|rule| {
        let has = |field: &str, what: &str| rule[field].as_array().unwrap().iter().any(|one| one == what);
        let mut keys = rule["key_exprs"].as_array().unwrap().iter().map(|one| keyexpr::new(one.as_str().unwrap()));
        let key = keyexpr::new(key).unwrap();
        has("flows", flow) && has("messages", message) && keys.any(|one| one.unwrap().includes(key))
    })
}

/// Row and deed: what a member may do.
type Deeds = BTreeSet<(usize, &'static str)>;

fn written(section: &Value, role: &str, name: &str) -> Deeds {
    let subject = format!("{role}:{name}");
    let may = |row: usize, (_, sends, is_sent): &(&str, &[&str], &[&str])| {
        let key = key(row, name);
        sends.iter().all(|message| allows(section, &subject, "ingress", message, &key))
            && is_sent.iter().all(|message| allows(section, &subject, "egress", message, &key))
    };
    let cells = (0..KEYS.len()).flat_map(|row| DEEDS.iter().map(move |deed| (row, deed)));
    cells.filter(|(row, deed)| may(*row, deed)).map(|(row, deed)| (row, deed.0)).collect()
}

/// What came through, from callbacks of several sessions.
#[derive(Clone, Default)]
struct Seen(Arc<Mutex<Deeds>>);

impl Seen {
    fn add(&self, row: usize, deed: &'static str) {
        self.0.lock().unwrap().insert((row, deed));
    }

    fn deeds(&self) -> Deeds {
        self.0.lock().unwrap().clone()
    }
}

/// Tries every deed under every key, against the `router`'s own session, which nothing restricts;
/// again if something that is allowed did not come through, as may be on a busy machine.
async fn tried(router: &Session, member: &Session, name: &str, may: &Deeds) -> Deeds {
    let seen = Seen::default();
    for _ in 0..ROUNDS {
        say_and_be_asked(router, member, name, &seen).await;
        ask_and_hear(router, member, name, &seen).await;
        be_there(router, member, name, ("be there", &seen)).await;
        be_there(member, router, name, ("see who is there", &seen)).await;
        if seen.deeds().is_superset(may) {
            break;
        }
    }
    seen.deeds()
}

/// Puts, deletes, answers.
async fn say_and_be_asked(router: &Session, member: &Session, name: &str, seen: &Seen) {
    let mut declared = Vec::new();
    let mut queryables = Vec::new();
    for row in 0..KEYS.len() {
        let (seen, key) = (seen.clone(), key(row, name));
        let heard = move |sample: zenoh::sample::Sample| {
            seen.add(row, if sample.kind() == zenoh::sample::SampleKind::Put { "put" } else { "delete" });
        };
        declared.push(router.declare_subscriber(key.clone()).callback(heard).await.unwrap());
        let answer = move |query: zenoh::query::Query| {
            let _ = query.reply(query.key_expr().clone(), "the member").wait();
        };
        queryables.push(member.declare_queryable(key).callback(answer).await.unwrap());
    }
    tokio::time::sleep(MOMENT).await;
    for row in 0..KEYS.len() {
        member.put(key(row, name), "put").await.unwrap();
        member.delete(key(row, name)).await.unwrap();
        if replies(router, &key(row, name)).await.contains(&"the member".to_owned()) {
            seen.add(row, "answer");
        }
    }
    tokio::time::sleep(MOMENT).await;
}

/// Asks, and hears what is put.
async fn ask_and_hear(router: &Session, member: &Session, name: &str, seen: &Seen) {
    let mut declared = Vec::new();
    let mut queryables = Vec::new();
    for row in 0..KEYS.len() {
        let (seen, key) = (seen.clone(), key(row, name));
        let heard = move |sample: zenoh::sample::Sample| {
            if *sample.payload().to_bytes() == *b"the router" {
                seen.add(row, "hear");
            }
        };
        declared.push(member.declare_subscriber(key.clone()).callback(heard).await.unwrap());
        let answer = move |query: zenoh::query::Query| {
            let _ = query.reply(query.key_expr().clone(), "the router").wait();
        };
        queryables.push(router.declare_queryable(key).callback(answer).await.unwrap());
    }
    tokio::time::sleep(MOMENT).await;
    for row in 0..KEYS.len() {
        router.put(key(row, name), "the router").await.unwrap();
        if replies(member, &key(row, name)).await.contains(&"the router".to_owned()) {
            seen.add(row, "ask");
        }
    }
    tokio::time::sleep(MOMENT).await;
}

/// Whether `watching` sees that `there` is there, which is one of the member's deeds.
async fn be_there(watching: &Session, there: &Session, name: &str, (deed, seen): (&'static str, &Seen)) {
    let mut declared = Vec::new();
    let mut tokens = Vec::new();
    for row in 0..KEYS.len() {
        let (seen, key) = (seen.clone(), key(row, name));
        let found = move |_: zenoh::sample::Sample| seen.add(row, deed);
        declared.push(watching.liveliness().declare_subscriber(key).callback(found).await.unwrap());
    }
    tokio::time::sleep(MOMENT).await;
    for row in 0..KEYS.len() {
        tokens.push(there.liveliness().declare_token(key(row, name)).await.unwrap());
    }
    tokio::time::sleep(MOMENT).await;
}

async fn replies(session: &Session, key: &str) -> Vec<String> {
    let replies = session.get(key).target(QueryTarget::All).timeout(Duration::from_secs(2)).await.unwrap();
    let mut found = Vec::new();
    while let Ok(reply) = replies.recv_async().await {
        found.extend(reply.result().ok().map(|sample| sample.payload().try_to_string().unwrap().into_owned()));
    }
    found
}

/// The table as Markdown.
fn table(section: &Value) -> String {
    let all = MEMBERS.map(|(role, name, _)| written(section, role, name));
    let mut text = format!("| key, after `fht/{{map}}/` | {} |\n", MEMBERS.map(|member| member.0).join(" | "));
    text += "| --- | --- | --- | --- | --- | --- |\n";
    for (row, (of, _)) in KEYS.into_iter().enumerate() {
        let cells = all.each_ref().map(|may| {
            let deeds: Vec<&str> = DEEDS.iter().map(|deed| deed.0).filter(|deed| may.contains(&(row, *deed))).collect();
            if deeds.is_empty() { "–".to_owned() } else { deeds.join(", ") }
        });
        writeln!(text, "| {of} | {} |", cells.join(" | ")).unwrap();
    }
    text
}

fn section() -> Value {
    let text = guarded("router.json5", "router-a", &[]);
    let config: Value = json5::from_str(&text).unwrap();
    config["access_control"].clone()
}

/// `FHT_WRITE_SECURITY=1 cargo test --test scenarios key_table::` writes it.
#[test]
fn the_table_in_the_document_is_what_access_control_says() {
    const MARKS: [&str; 2] =
        ["<!-- made from the code: tests/tests/scenarios/key_table.rs -->\n\n", "\n<!-- end of keys -->"];
    let file = deploy("../docs/security.md");
    let text = std::fs::read_to_string(&file).unwrap();
    let (before, rest) = text.split_once(MARKS[0]).expect("where the table begins");
    let (stands, after) = rest.split_once(MARKS[1]).expect("where it ends");
    if std::env::var_os("FHT_WRITE_SECURITY").is_some() {
        std::fs::write(&file, [before, MARKS[0], &table(&section()), MARKS[1], after].concat()).unwrap();
    } else {
        assert_eq!(stands, table(&section()), "docs/security.md is not what the code says: see the head of this test");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_router_does_what_each_cell_says() {
    let (section, endpoint) = (section(), free_endpoint());
    let router = zenoh::open(config(&guarded("router.json5", "router-a", &[&endpoint]))).await.unwrap();
    let dir = tempfile::tempdir().unwrap();
    let mut differ = String::new();
    for (role, name, file) in MEMBERS {
        let certificate = if name == "stranger" { "explorer-stranger".to_owned() } else { format!("{role}-{name}") };
        let file = in_file(dir.path(), name, &shipped(file, &certificate, &[], &[&endpoint]));
        let session = fht_session::SessionConfig::from_options(Vec::new(), Some(file));
        let session = fht_session::open(&session).await.unwrap();
        let may = written(&section, role, name);
        let could = tried(&router, &session, name, &may).await;
        for (row, deed) in may.symmetric_difference(&could) {
            let expected = if may.contains(&(*row, *deed)) { "may and could not" } else { "may not and could" };
            writeln!(differ, "{role} {expected} {deed}: {}", KEYS[*row].0).unwrap();
        }
        session.close().await.unwrap();
    }
    router.close().await.unwrap();
    assert!(differ.is_empty(), "\n{differ}");
}
