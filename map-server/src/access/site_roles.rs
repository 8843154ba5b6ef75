//! Whether routers give each certificate what its role has, no more and no less: their access
//! control is compared with what `map-server access-control` writes for the same members, and the
//! routers' members with each other. One router with another list is enough for a stranger: what it
//! lets in, the others take.

use crate::access::roles::{Roles, members};
use crate::access::router_file::RouterFile;
use crate::access::section::section;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};

type Names = BTreeSet<String>;

/// What is to be done about what does not fit.
const ANEW: &str = "write it anew (map-server access-control)";

/// A rule as Zenoh understands it.
#[derive(Debug, PartialEq, Eq)]
struct Rule {
    allows: bool,
    flows: Names,
    messages: Names,
    keys: Names,
}

/// An access control section: what is allowed to whom.
#[derive(Debug, Default)]
struct Grants {
    /// By id.
    rules: BTreeMap<String, Rule>,
    /// Ids of rules, by common name.
    allowed: BTreeMap<String, Names>,
    /// Ids of subjects that anybody is.
    anybody: Names,
}

fn texts(list: &Value) -> Names {
    list.as_array().into_iter().flatten().filter_map(|text| text.as_str().map(str::to_owned)).collect()
}

fn items<'a>(section: &'a Value, name: &str) -> impl Iterator<Item = &'a Value> {
    section[name].as_array().into_iter().flatten()
}

fn id(of: &Value) -> String {
    of["id"].as_str().unwrap_or_default().to_owned()
}

fn listed(names: &Names) -> String {
    names.iter().map(String::as_str).collect::<Vec<_>>().join(", ")
}

impl Grants {
    fn read(section: &Value) -> Self {
        let mut found = Self::default();
        for rule in items(section, "rules") {
            // Without a direction it is about both.
            let flows = match texts(&rule["flows"]) {
                none if none.is_empty() => ["egress", "ingress"].map(str::to_owned).into(),
                flows => flows,
            };
            let (messages, keys) = (texts(&rule["messages"]), texts(&rule["key_exprs"]));
            let rule_of = Rule { allows: rule["permission"] == "allow", flows, messages, keys };
            found.rules.insert(id(rule), rule_of);
        }
        let mut subjects: BTreeMap<String, Names> = BTreeMap::new();
        for subject in items(section, "subjects") {
            let names = texts(&subject["cert_common_names"]);
            if names.is_empty() {
                found.anybody.insert(id(subject));
            }
            for name in &names {
                found.allowed.entry(name.clone()).or_default();
            }
            subjects.insert(id(subject), names);
        }
        for policy in items(section, "policies") {
            let rules = texts(&policy["rules"]);
            let of_policy = texts(&policy["subjects"]);
            for name in of_policy.iter().filter_map(|subject| subjects.get(subject)).flatten() {
                found.allowed.entry(name.clone()).or_default().extend(rules.iter().cloned());
            }
        }
        found
    }

    fn allows(&self, id: &str) -> bool {
        self.rules.get(id).is_some_and(|rule| rule.allows)
    }
}

/// The list of roles that these common names are; and those that are none of a list.
fn roles_of<'a>(names: impl Iterator<Item = &'a String>) -> (Roles, Vec<&'a str>) {
    let (mut roles, mut others) = (Roles::default(), Vec::new());
    for name in names {
        let (role, member) = name.split_once(':').unwrap_or(("", name));
        let list = match role {
            "router" => &mut roles.routers,
            "server" => &mut roles.servers,
            "explorer" => &mut roles.explorers,
            "client" => &mut roles.clients,
            "operator" => &mut roles.operators,
            _ => {
                others.push(name.as_str());
                continue;
            }
        };
        list.push(member.to_owned());
    }
    (roles, others)
}

/// What is wrong with who may do what at these routers, a sentence each. Nothing: fine. A router
/// without access control is left out.
pub(super) fn misfits(routers: &[RouterFile]) -> Vec<String> {
    let mut found = Vec::new();
    let mut lists: Vec<(&str, Names)> = Vec::new();
    for router in routers {
        let section = router.get("access_control");
        if section["enabled"] != true {
            continue;
        }
        let grants = Grants::read(&section);
        found.extend(of_router(&grants).into_iter().map(|text| format!("{}: {text}", router.name)));
        lists.push((&router.name, grants.allowed.into_keys().collect()));
    }
    found.extend(between(&lists));
    found
}

fn of_router(grants: &Grants) -> Vec<String> {
    let mut found: Vec<String> = (grants.anybody.iter())
        .map(|subject| format!("the subject '{subject}' has no cert_common_names: everybody who connects is that"))
        .collect();
    let (roles, others) = roles_of(grants.allowed.keys());
    for name in others {
        found.push(format!("the common name '{name}' is no ROLE:NAME of a list of roles; {ANEW}"));
    }
    if members(&roles).next().is_none() {
        found.push(format!("access control names nobody of a list of roles; {ANEW}"));
        return found;
    }
    match section(&roles) {
        Err(error) => found.push(format!("its subjects are no list of roles: {error}")),
        Ok(written) => {
            let expected = Grants::read(&written);
            found.extend(rules(grants, &expected));
            found.extend(policies(grants, &expected));
        }
    }
    found
}

/// How rules differ from those that are written.
fn rules(grants: &Grants, expected: &Grants) -> Vec<String> {
    let mut found = Vec::new();
    for (id, rule) in grants.rules.iter().filter(|(_, rule)| rule.allows) {
        let Some(written) = expected.rules.get(id) else {
            found.push(format!("the rule '{id}' is none that access-control writes: what it allows, no role has"));
            continue;
        };
        let lists = [(&rule.flows, &written.flows), (&rule.messages, &written.messages), (&rule.keys, &written.keys)];
        let more: Names = lists.iter().flat_map(|(is, should)| is.difference(should)).cloned().collect();
        if !more.is_empty() {
            found.push(format!("the rule '{id}' allows more than access-control writes: {}", listed(&more)));
        }
        let less: Names = lists.iter().flat_map(|(is, should)| should.difference(is)).cloned().collect();
        if !less.is_empty() {
            found.push(format!("the rule '{id}' lacks what access-control writes: {}; {ANEW}", listed(&less)));
        }
    }
    let missing = expected.rules.keys().filter(|id| !grants.allows(id));
    found.extend(missing.map(|id| format!("the rule '{id}' is missing: who needs it is denied that; {ANEW}")));
    found
}

/// How what each member is given differs from what is written.
fn policies(grants: &Grants, expected: &Grants) -> Vec<String> {
    let nothing = Names::new();
    let mut found = Vec::new();
    for (name, written) in &expected.allowed {
        let given = grants.allowed.get(name).unwrap_or(&nothing);
        let more: Names = given.difference(written).filter(|id| grants.allows(id)).cloned().collect();
        if !more.is_empty() {
            found.push(format!("{name} is given what its role does not have: {}", listed(&more)));
        }
        // A rule that is nowhere is told once.
        let less: Names = written.difference(given).filter(|id| grants.allows(id)).cloned().collect();
        if !less.is_empty() {
            found.push(format!("{name} is not given what its role has: {}; {ANEW}", listed(&less)));
        }
    }
    found
}

/// Who is a member at one router and not at another.
fn between(lists: &[(&str, Names)]) -> Vec<String> {
    let mut found = Vec::new();
    for (router, list) in lists {
        for (other, of_other) in lists {
            let lacks: Names = of_other.difference(list).cloned().collect();
            if !lacks.is_empty() {
                found.push(format!(
                    "{router} and {other} have different lists of roles: only {other} has {}; write both of one list",
                    listed(&lacks)
                ));
            }
        }
    }
    found
}
