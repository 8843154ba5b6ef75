//! What holds the routers of a site together: fixed ids, and no way for anybody else between them.
//!
//! Routers tell each other who is linked to whom and send everything along the shortest ways.
//! Access control does not look at that: a session in mode `router`, whatever its certificate,
//! would take part, draw traffic between routers to itself and drop it. So every router
//!
//! * has a fixed id, made of its name,
//! * counts as routers only those of the list; whoever else comes in mode `router` is a region of
//!   its own (`gateway`), whose links stay there,
//! * gives the links to the others the least weight there is: no detour is ever shorter.

use crate::access::roles::{AccessError, Roles};
use fht_proto::AuthorId;
use serde_json::{Map, Value, json};

/// The least weight of a link. Two links over somebody else are 2 at least.
pub(super) const WEIGHT: u64 = 1;

/// The Zenoh id of the router called `name`, hexadecimal.
#[must_use]
pub fn router_id(name: &str) -> String {
    // Zenoh wants no zero at the beginning.
    format!("f47a{}", AuthorId::of_robot(&format!("router:{name}")))
}

/// Makes `config` that of the router called `name`.
///
/// # Errors
/// [`AccessError::NotARouter`].
pub(super) fn bind(config: &mut Map<String, Value>, roles: &Roles, name: &str) -> Result<(), AccessError> {
    if !roles.routers.iter().any(|router| router == name) {
        return Err(AccessError::NotARouter { name: name.to_owned(), routers: roles.routers.clone() });
    }
    let ids: Vec<String> = roles.routers.iter().map(|router| router_id(router)).collect();
    let own = router_id(name);
    let others = ids.iter().filter(|id| **id != own);
    let weights: Vec<Value> = others.map(|id| json!({ "dst_zid": id, "weight": WEIGHT })).collect();
    config.insert("id".to_owned(), own.into());
    config.insert("gateway".to_owned(), json!({ "south": [{ "filters": [{ "zids": ids, "negated": true }] }] }));
    put(config, &["routing", "router", "linkstate", "transport_weights"], weights.into());
    Ok(())
}

/// Puts `value` at `path`, beside what else is there.
fn put(map: &mut Map<String, Value>, path: &[&str], value: Value) {
    match path {
        [] => {}
        [last] => _ = map.insert((*last).to_owned(), value),
        [first, rest @ ..] => {
            let mut inner = match map.remove(*first) {
                Some(Value::Object(inner)) => inner,
                _ => Map::new(),
            };
            put(&mut inner, rest, value);
            map.insert((*first).to_owned(), inner.into());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_routers_id_is_one_for_zenoh_and_others_have_others() {
        let id = router_id("hall");
        assert_eq!(id.parse::<zenoh::session::ZenohId>().unwrap().to_string(), id);
        assert_ne!(id, router_id("stairs"));
    }
}
