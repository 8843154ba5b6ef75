//! Who may do what: from a list of roles to the access control section of a router's configuration.
//!
//! Zenoh's rules know certificates by their common names and have no variables, and the keys of increments hold hashes of
//! names. So what is one sentence for people ("an explorer writes under its own name") is a rule for each robot in the
//! configuration, and a program writes it.
//!
//! Everything that is not allowed is denied, in both directions, as the router sees them: *ingress* is what a session sends,
//! *egress* what it is sent. Zenoh compares by inclusion: a rule for `fht/*/inc/**` covers a subscription to
//! `fht/museum/inc/**`, and none to `fht/**`.
//!
//! | role | sends | is sent |
//! | --- | --- | --- |
//! | client | its own `robots/{name}`, questions | increments, heads, robots, replies |
//! | explorer | the same, and its own increments | the same, and its own refusals |
//! | operator | the same as an explorer, and admin orders | everything |
//! | server | heads, refusals, replies, admin notices, questions, what storages keep | everything |
//! | router | everything | everything |
//!
//! A router trusts the others: they have checked what they pass on, by the same list.

pub mod command;

use fht_proto::AuthorId;
use fht_proto::keys::{ALL_KEPT, ALL_QUERIES};
use serde::Deserialize;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;

/// Who is in a fleet: names as in certificates, which are called `ROLE:NAME`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Roles {
    /// Zenoh routers.
    pub routers: Vec<String>,
    /// Map-servers.
    pub servers: Vec<String>,
    /// Robots that write maps.
    pub explorers: Vec<String>,
    /// Robots that only use maps.
    pub clients: Vec<String>,
    /// People's tools: they edit maps and give admin orders.
    pub operators: Vec<String>,
}

/// Why there is no access control section.
#[derive(Debug, thiserror::Error)]
pub enum AccessError {
    /// The text is not JSON5, or has other fields.
    #[error("not understood: {0}")]
    Syntax(#[from] json5::Error),
    /// A configuration is an object.
    #[error("not understood: a configuration begins with a brace")]
    NotAnObject,
    /// There is nobody in it.
    #[error("the list names nobody, and so nobody could connect")]
    Nobody,
    /// A name that no certificate can have.
    #[error("the name '{0}' is not 1 to 55 letters, digits, '_' or '-'")]
    Name(String),
    /// Two entries for one name. Robots and operators with one name would be one author.
    #[error("the name '{name}' is listed twice, as {first} and as {second}")]
    Twice {
        /// Which name.
        name: String,
        /// Its first role.
        first: &'static str,
        /// Its second role.
        second: &'static str,
    },
    /// Two names with one author id: one could write as the other.
    #[error("the names '{first}' and '{second}' have the same author id {author}; rename one of the robots")]
    SameAuthor {
        /// One name.
        first: String,
        /// The other.
        second: String,
        /// The id of both.
        author: AuthorId,
    },
    /// The section cannot be written.
    #[error(transparent)]
    Json(#[from] serde_json::Error),
}

/// What a rule is about, in Zenoh's words.
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

/// What a robot may hear.
const SHARED: [&str; 3] = ["fht/*/inc/**", "fht/*/head", "fht/*/robots/**"];
/// What a robot may ask: every topic, misspelt ones too, since the server answers those with a sentence. One chunk after the
/// map's name, so that no wildcard reaches the admin keys.
const QUESTIONS: [&str; 4] = ["fht/*", "fht/*/*", "fht/*/inc/**", "fht/*/robots/**"];
/// Where the robots are.
const ROBOTS: [&str; 1] = ["fht/*/robots/**"];
/// Orders to the server.
const ADMIN: [&str; 1] = ["fht/*/admin/**"];
/// Everything of this service. `**` does not cover chunks that begin with `@`.
const EVERYTHING: [&str; 1] = [ALL_QUERIES];
/// Zenoh's own: the routers' admin space.
const ZENOH_ADMIN: [&str; 1] = ["@/**"];
/// What routers say to each other: the service, the admin space, and how replicated storages compare what they have.
const BETWEEN_ROUTERS: [&str; 4] = [ALL_QUERIES, "@/**", "@-digest/**", "@zid/**"];

/// Reads a list of roles (JSON5).
///
/// # Errors
/// [`AccessError::Syntax`].
pub fn parse(text: &str) -> Result<Roles, AccessError> {
    Ok(json5::from_str(text)?)
}

fn rule(id: String, flow: &str, messages: &[&str], key_exprs: &[impl AsRef<str>]) -> Value {
    let keys: Vec<&str> = key_exprs.iter().map(AsRef::as_ref).collect();
    json!({ "id": id, "permission": "allow", "flows": [flow], "messages": messages, "key_exprs": keys })
}

/// The rules that a role's members share. Their ids have no colon; those of [`own_rules`] have one.
fn shared_rules() -> Vec<Value> {
    let rule = |id: &str, flow: &str, messages: &[&str], keys: &[&str]| rule(id.to_owned(), flow, messages, keys);
    let declared = ["declare_subscriber", "declare_queryable"];
    let liveliness = ["liveliness_query", "declare_liveliness_subscriber"];
    vec![
        rule("robots subscribe", "ingress", &["declare_subscriber"], &SHARED),
        rule("robots ask", "ingress", &["query"], &QUESTIONS),
        rule("robots see each other", "ingress", &liveliness, &ROBOTS),
        rule("robots hear", "egress", &["put", "delete"], &SHARED),
        rule("robots are answered", "egress", &["reply"], &QUESTIONS),
        // Publishers are told whether anybody listens, and send nothing otherwise.
        rule("robots are told who listens", "egress", &declared, &EVERYTHING),
        rule("robots are told who is there", "egress", &["liveliness_token"], &ROBOTS),
        rule("operators order", "ingress", &["put", "delete", "query"], &ADMIN),
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

const ROBOT_RULES: [&str; 7] = [
    "robots subscribe",
    "robots ask",
    "robots see each other",
    "robots hear",
    "robots are answered",
    "robots are told who listens",
    "robots are told who is there",
];
const OPERATOR_RULES: [&str; 5] = [
    "operators order",
    "operators ask",
    "operators ask routers",
    "operators hear",
    "operators are answered by routers",
];
const SERVER_RULES: [&str; 4] = ["servers say", "servers serve", "servers see robots", "servers are sent"];
const ROUTER_RULES: [&str; 2] = ["routers send", "routers are sent"];

/// What only the robot called `name` may do. Clients have no increments of their own.
fn own_rules(role: &str, name: &str) -> Vec<Value> {
    // The name itself, too: `**` stands for no chunk as well.
    let own = [format!("fht/*/robots/{name}/**")];
    // Explorers say by tokens that they explore, and who begins a map: who may not write must not keep others from it.
    let tokens = if role == "client" { [format!("fht/*/robots/{name}")] } else { own.clone() };
    let id = |what: &str| format!("{role}:{name} {what}");
    let mut rules = vec![
        rule(id("reports"), "ingress", &["put", "delete"], &own),
        rule(id("is there"), "ingress", &["liveliness_token"], &tokens),
    ];
    if role != "client" {
        let author = AuthorId::of_robot(name);
        let refused = [format!("fht/*/refused/{author}")];
        rules.push(rule(id("writes"), "ingress", &["put"], &[format!("fht/*/inc/{author}/*")]));
        rules.push(rule(id("asks what is refused"), "ingress", &["declare_subscriber"], &refused));
        rules.push(rule(id("is refused"), "egress", &["put"], &refused));
    }
    rules
}

/// Everybody, with the role's name in certificates.
fn members(roles: &Roles) -> impl Iterator<Item = (&'static str, &str)> {
    let lists = [
        ("router", &roles.routers),
        ("server", &roles.servers),
        ("explorer", &roles.explorers),
        ("client", &roles.clients),
        ("operator", &roles.operators),
    ];
    lists.into_iter().flat_map(|(role, names)| names.iter().map(move |name| (role, name.as_str())))
}

fn check(roles: &Roles) -> Result<(), AccessError> {
    if members(roles).next().is_none() {
        return Err(AccessError::Nobody);
    }
    let (mut machines, mut robots, mut authors) = (BTreeMap::new(), BTreeMap::new(), BTreeMap::new());
    for (role, name) in members(roles) {
        let is_plain = |byte: u8| byte.is_ascii_alphanumeric() || byte == b'_' || byte == b'-';
        // A common name has 64 characters at most, the role's included.
        if name.is_empty() || name.len() > 55 || !name.bytes().all(is_plain) {
            return Err(AccessError::Name(name.chars().take(80).collect()));
        }
        let is_robot = !matches!(role, "router" | "server");
        let known = if is_robot { &mut robots } else { &mut machines };
        if let Some(first) = known.insert(name, role).filter(|first| is_robot || *first == role) {
            return Err(AccessError::Twice { name: name.to_owned(), first, second: role });
        }
        let author = AuthorId::of_robot(name);
        if is_robot && let Some(first) = authors.insert(author, name) {
            return Err(AccessError::SameAuthor { first: first.to_owned(), second: name.to_owned(), author });
        }
    }
    Ok(())
}

/// The `access_control` section for `roles`: rules, subjects (certificates) and policies. Default deny.
///
/// # Errors
/// [`AccessError`]: names that cannot be, or that could be taken for one another.
pub fn section(roles: &Roles) -> Result<Value, AccessError> {
    check(roles)?;
    let (mut rules, mut subjects, mut policies) = (shared_rules(), Vec::new(), Vec::new());
    for (role, name) in members(roles) {
        let id = format!("{role}:{name}");
        let own = match role {
            "router" | "server" => Vec::new(),
            _ => own_rules(role, name),
        };
        let mut allowed: Vec<Value> = own.iter().map(|rule| rule["id"].clone()).collect();
        let of_role: [&[&str]; 2] = match role {
            "router" => [&ROUTER_RULES, &[]],
            "server" => [&SERVER_RULES, &[]],
            "operator" => [&ROBOT_RULES, &OPERATOR_RULES],
            _ => [&ROBOT_RULES, &[]],
        };
        allowed.extend(of_role.concat().into_iter().map(Value::from));
        rules.extend(own);
        subjects.push(json!({ "id": id, "cert_common_names": [id] }));
        policies.push(json!({ "id": id, "subjects": [id], "rules": allowed }));
    }
    Ok(json!({
        "enabled": true,
        "default_permission": "deny",
        "rules": rules,
        "subjects": subjects,
        "policies": policies,
    }))
}

/// The sections of a configuration (JSON5). Its comments are lost.
///
/// # Errors
/// [`AccessError`].
pub fn object(config: &str) -> Result<Map<String, Value>, AccessError> {
    match json5::from_str(config)? {
        Value::Object(fields) => Ok(fields),
        _ => Err(AccessError::NotAnObject),
    }
}

/// `config` with the section for `roles` in it, in place of any that it had; without others it is the section alone.
///
/// # Errors
/// [`AccessError`].
pub fn configuration(mut config: Map<String, Value>, roles: &Roles) -> Result<String, AccessError> {
    config.insert("access_control".to_owned(), Value::Null);
    let mut text =
        String::from("// Written by `map-server access-control`: change the list of roles, not this file.\n{\n");
    for (name, value) in &config {
        let value = match name.as_str() {
            "access_control" => lines(&section(roles)?)?,
            _ => serde_json::to_string_pretty(value)?.replace('\n', "\n  "),
        };
        text += &format!("  {}: {value},\n", serde_json::to_string(name)?);
    }
    Ok(text + "}\n")
}

/// The section with one rule, subject or policy a line.
fn lines(section: &Value) -> Result<String, AccessError> {
    let mut text = String::from("{\n");
    for (name, value) in section.as_object().into_iter().flatten() {
        let value = match value.as_array() {
            None => serde_json::to_string(value)?,
            Some(items) => {
                let items: Result<Vec<String>, _> = items.iter().map(serde_json::to_string).collect();
                format!("[\n      {},\n    ]", items?.join(",\n      "))
            }
        };
        text += &format!("    {}: {value},\n", serde_json::to_string(name)?);
    }
    Ok(text + "  }")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn roles(text: &str) -> Roles {
        parse(text).unwrap()
    }

    const FLEET: &str = r#"{
        routers: ["hall"], servers: ["maps"], explorers: ["ana", "ben"], clients: ["tug"], operators: ["desk"], // all
    }"#;

    fn granted(section: &Value, subject: &str) -> String {
        let policy = section["policies"].as_array().unwrap().iter().find(|policy| policy["id"] == subject).unwrap();
        let rules = section["rules"].as_array().unwrap();
        let of = |id: &Value| rules.iter().find(|rule| rule["id"] == *id).unwrap().to_string();
        policy["rules"].as_array().unwrap().iter().map(of).collect()
    }

    #[test]
    fn zenoh_understands_it_and_it_denies_what_it_does_not_say() {
        let text = object("{mode: 'router', listen: {endpoints: ['tls/[::]:7447']}}").unwrap();
        let text = configuration(text, &roles(FLEET)).unwrap();
        let config = zenoh::Config::from_json5(&text).unwrap();
        let section: Value = serde_json::from_str(&config.get_json("access_control").unwrap()).unwrap();
        assert_eq!((&section["enabled"], &section["default_permission"]), (&json!(true), &json!("deny")));
        assert_eq!(section["subjects"].as_array().unwrap().len(), 6);
        assert!(section["rules"].as_array().unwrap().iter().all(|rule| rule["permission"] == "allow"));
        assert!(config.get_json("listen/endpoints").unwrap().contains("tls/[::]:7447"), "the rest is as it was");
    }

    #[test]
    fn each_writes_under_its_own_author_only_and_a_client_under_none() {
        let section = section(&roles(FLEET)).unwrap();
        let writes = |subject: &str, robot: &str| {
            granted(&section, subject).contains(&format!("fht/*/inc/{}/*", AuthorId::of_robot(robot)))
        };
        assert!(writes("explorer:ana", "ana") && !writes("explorer:ana", "ben"));
        assert!(writes("operator:desk", "desk") && !writes("operator:desk", "ana"));
        let keeps = |subject: &str| granted(&section, subject).contains(ALL_KEPT);
        assert!(keeps("server:maps") && !keeps("explorer:ana") && !keeps("operator:desk") && !keeps("client:tug"));
        assert!(!writes("client:tug", "tug") && !granted(&section, "client:tug").contains("/admin/"));
    }

    #[test]
    fn every_rule_is_used_and_every_rule_that_is_used_exists() {
        let section = section(&roles(FLEET)).unwrap();
        let mut known: Vec<&Value> = section["rules"].as_array().unwrap().iter().map(|rule| &rule["id"]).collect();
        let policies = section["policies"].as_array().unwrap();
        let mut used: Vec<&Value> = policies.iter().flat_map(|policy| policy["rules"].as_array().unwrap()).collect();
        for ids in [&mut known, &mut used] {
            ids.sort_by_key(ToString::to_string);
            ids.dedup();
        }
        assert_eq!(known, used);
    }

    #[test]
    fn names_that_could_be_taken_for_one_another_are_refused() {
        let said = |text: &str| section(&roles(text)).unwrap_err().to_string();
        assert!(said("{}").contains("nobody"));
        assert!(said("{explorers: ['ana'], operators: ['ana']}").contains("as explorer and as operator"));
        assert!(said("{clients: ['ana', 'ana']}").contains("listed twice"));
        assert!(said("{routers: ['hall', 'hall']}").contains("listed twice"));
        assert!(said("{explorers: ['ana/**']}").contains("'ana/**'"));
        assert!(said("{explorers: ['*']}").contains("'*'"));
        assert!(said("{explorers: ['']}").contains("''"));
        assert!(section(&roles("{routers: ['maps'], servers: ['maps'], explorers: ['maps']}")).is_ok(), "no authors");
        assert!(parse("{explorer: ['ana']}").unwrap_err().to_string().contains("explorer"));
        assert!(matches!(object("[]"), Err(AccessError::NotAnObject)));
    }
}
