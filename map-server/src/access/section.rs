//! The access control section of a router's configuration.

use crate::access::backbone;
use crate::access::roles::{AccessError, Roles, check, members};
use crate::access::rules::{OPERATOR_RULES, ROBOT_RULES, ROUTER_RULES, SERVER_RULES, own_rules, shared_rules};
use serde_json::{Map, Value, json};

/// The `access_control` section for `roles`: rules, subjects (certificates) and policies. Default
/// deny.
///
/// # Errors
/// [`AccessError`]: invalid names, or names that could be taken for one another.
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

/// The sections of a configuration (JSON5). Comments are lost.
///
/// # Errors
/// [`AccessError`].
pub fn object(config: &str) -> Result<Map<String, Value>, AccessError> {
    match json5::from_str(config)? {
        Value::Object(fields) => Ok(fields),
        _ => Err(AccessError::NotAnObject),
    }
}

/// `config` with the section for `roles` in place of any that it had. An empty `config` gives the
/// section alone. With `router`, a name of the list, it becomes that router's own: with its id, and
/// what keeps others from between the routers.
///
/// # Errors
/// [`AccessError`].
pub fn configuration(
    mut config: Map<String, Value>,
    roles: &Roles,
    router: Option<&str>,
) -> Result<String, AccessError> {
    if let Some(name) = router {
        backbone::bind(&mut config, roles, name)?;
    }
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

/// The section as text, one line per rule, subject or policy.
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
    use crate::access::roles::parse;
    use fht_proto::AuthorId;
    use fht_proto::api::keys::ALL_KEPT;

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
        let text = configuration(text, &roles(FLEET), Some("hall")).unwrap();
        let config = zenoh::Config::from_json5(&text).unwrap();
        let section: Value = serde_json::from_str(&config.get_json("access_control").unwrap()).unwrap();
        assert_eq!((&section["enabled"], &section["default_permission"]), (&json!(true), &json!("deny")));
        assert_eq!(section["subjects"].as_array().unwrap().len(), 6);
        assert!(section["rules"].as_array().unwrap().iter().all(|rule| rule["permission"] == "allow"));
        assert!(config.get_json("listen/endpoints").unwrap().contains("tls/[::]:7447"), "the rest is as it was");
        assert!(config.get_json("id").unwrap().contains(&backbone::router_id("hall")));
        let refused = configuration(Map::new(), &roles(FLEET), Some("maps")).unwrap_err().to_string();
        assert!(refused.contains("no router called 'maps'"), "{refused}");
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
        let sends = |subject: &str| granted(&section, subject).contains("\"fht/*/robots/*/goal\"");
        assert!(sends("operator:desk") && !sends("explorer:ana") && !sends("client:tug"));
        let takes =
            |subject: &str, robot: &str| granted(&section, subject).contains(&format!("robots/{robot}/goal/**"));
        assert!(takes("client:tug", "tug") && !takes("client:tug", "ana") && !takes("operator:desk", "desk"));
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
