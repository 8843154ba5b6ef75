//! The rules that roles are given.

use fht_proto::AuthorId;
use fht_proto::api::keys::{ALL_KEPT, ALL_QUERIES};
use serde_json::{Value, json};

/// The kinds of messages, in Zenoh's words.
const ALL_MESSAGES: [&str; 9] = [
    "put",
    "delete",
    "declare_subscriber",
    "query",
    "reply",
    "declare_queryable",
    "liveliness_token",
    "liveliness_query",
    "declare_liveliness_subscriber",
];

/// What a robot may receive.
const SHARED: [&str; 3] = ["fht/*/inc/**", "fht/*/head", "fht/*/robots/**"];
/// What a robot may ask: every topic, even misspelt ones, since the server answers those with an
/// explanation. One chunk after the map's name, so that no wildcard reaches the admin keys; and of
/// other robots not where they are sent.
const QUESTIONS: [&str; 9] = [
    "fht/*",
    "fht/*/*",
    "fht/*/inc/**",
    "fht/*/robots/*",
    "fht/*/robots/*/pose",
    "fht/*/robots/*/status",
    "fht/*/robots/*/blocked",
    "fht/*/robots/*/seen",
    "fht/*/robots/*/goal/status",
];
/// Where the robots are.
const ROBOTS: [&str; 1] = ["fht/*/robots/**"];
/// Where robots are sent.
const GOALS: [&str; 2] = ["fht/*/robots/*/goal", "fht/*/robots/*/goal/cancel"];
/// Orders to the server.
const ADMIN: [&str; 1] = ["fht/*/admin/**"];
/// Everything of this service. `**` does not cover chunks that begin with `@`.
const EVERYTHING: [&str; 1] = [ALL_QUERIES];
/// Zenoh's own keys: the routers' admin space.
const ZENOH_ADMIN: [&str; 1] = ["@/**"];
/// What routers send each other: the service, the admin space, and how replicated storages compare
/// their contents.
const BETWEEN_ROUTERS: [&str; 4] = [ALL_QUERIES, "@/**", "@-digest/**", "@zid/**"];

fn rule(id: String, flow: &str, messages: &[&str], key_exprs: &[impl AsRef<str>]) -> Value {
    let keys: Vec<&str> = key_exprs.iter().map(AsRef::as_ref).collect();
    json!({ "id": id, "permission": "allow", "flows": [flow], "messages": messages, "key_exprs": keys })
}

/// The rules that the members of a role share. Their ids contain no colon; those of [`own_rules`]
/// do.
pub(super) fn shared_rules() -> Vec<Value> {
    let rule = |id: &str, flow: &str, messages: &[&str], keys: &[&str]| rule(id.to_owned(), flow, messages, keys);
    let declared = ["declare_subscriber", "declare_queryable"];
    let liveliness = ["liveliness_query", "declare_liveliness_subscriber"];
    vec![
        rule("robots subscribe", "ingress", &["declare_subscriber"], &SHARED),
        rule("robots ask", "ingress", &["query"], &QUESTIONS),
        rule("robots see each other", "ingress", &liveliness, &ROBOTS),
        rule("robots hear", "egress", &["put", "delete"], &SHARED),
        rule("robots are answered", "egress", &["reply"], &QUESTIONS),
        // Publishers learn whether anybody listens, and send nothing otherwise.
        rule("robots are told who listens", "egress", &declared, &EVERYTHING),
        // Who may ask was checked where it was asked; wildcards go to several robots.
        rule("robots are sent", "egress", &["query"], &["fht/*/robots/*/goal/**"]),
        rule("robots are told who is there", "egress", &["liveliness_token"], &ROBOTS),
        rule("operators order", "ingress", &["put", "delete", "query"], &ADMIN),
        rule("operators send robots", "ingress", &["put"], &GOALS),
        rule("operators ask", "ingress", &["query", "declare_subscriber"], &EVERYTHING),
        rule("operators ask routers", "ingress", &["query"], &ZENOH_ADMIN),
        rule("operators hear", "egress", &["put", "delete", "reply"], &EVERYTHING),
        rule("operators are answered by routers", "egress", &["reply"], &ZENOH_ADMIN),
        rule("servers say", "ingress", &["put"], &["fht/*/head", "fht/*/refused/*", "fht/*/admin/**", ALL_KEPT]),
        rule("servers serve", "ingress", &["declare_queryable", "reply", "declare_subscriber", "query"], &EVERYTHING),
        rule("servers see robots", "ingress", &liveliness, &ROBOTS),
        rule("servers are sent", "egress", &ALL_MESSAGES, &EVERYTHING),
        rule("routers send", "ingress", &ALL_MESSAGES, &BETWEEN_ROUTERS),
        rule("routers are sent", "egress", &ALL_MESSAGES, &BETWEEN_ROUTERS),
    ]
}

pub(super) const ROBOT_RULES: [&str; 8] = [
    "robots subscribe",
    "robots ask",
    "robots see each other",
    "robots hear",
    "robots are answered",
    "robots are told who listens",
    "robots are sent",
    "robots are told who is there",
];
pub(super) const OPERATOR_RULES: [&str; 6] = [
    "operators order",
    "operators send robots",
    "operators ask",
    "operators ask routers",
    "operators hear",
    "operators are answered by routers",
];
pub(super) const SERVER_RULES: [&str; 4] = ["servers say", "servers serve", "servers see robots", "servers are sent"];
pub(super) const ROUTER_RULES: [&str; 2] = ["routers send", "routers are sent"];

/// The rules for the robot called `name` alone. Clients have no increments of their own.
pub(super) fn own_rules(role: &str, name: &str) -> Vec<Value> {
    // This includes the name itself: `**` also matches no chunk at all.
    let own = [format!("fht/*/robots/{name}/**")];
    // By tokens, explorers say that they explore and who begins a map: a robot that may not write
    // must not keep others from it.
    let tokens = if role == "client" { [format!("fht/*/robots/{name}")] } else { own.clone() };
    let id = |what: &str| format!("{role}:{name} {what}");
    let mut rules = vec![
        rule(id("reports"), "ingress", &["put", "delete"], &own),
        rule(id("is there"), "ingress", &["liveliness_token"], &tokens),
    ];
    if role != "operator" {
        // Where it is sent; this includes the key of the goal itself.
        let goals = [format!("fht/*/robots/{name}/goal/**")];
        rules.push(rule(id("takes goals"), "ingress", &["declare_queryable", "reply"], &goals));
    }
    if role != "client" {
        let author = AuthorId::of_robot(name);
        let refused = [format!("fht/*/refused/{author}")];
        rules.push(rule(id("writes"), "ingress", &["put"], &[format!("fht/*/inc/{author}/*")]));
        rules.push(rule(id("asks what is refused"), "ingress", &["declare_subscriber"], &refused));
        rules.push(rule(id("is refused"), "egress", &["put"], &refused));
    }
    rules
}
