//! What leaves a site open: the Zenoh configurations of its routers, read as an attacker would.

use crate::access::backbone::WEIGHT;
use crate::access::router_file::RouterFile;
use crate::access::site_roles::misfits;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Display;

/// So many connections may be on their way in. Zenoh's own default is 100: as many silent ones of
/// one robot keep everybody out.
const LEAST_PENDING: u64 = 1000;
/// So long each of them may take, milliseconds.
const LONGEST_ACCEPT: u64 = 15_000;
/// Robots, tools and routers at one time. Zenoh's own default is 1000.
const LEAST_SESSIONS: u64 = 2000;
/// A router that is silent for so long is given up, milliseconds.
const LONGEST_LEASE: u64 = 6000;
/// The longest message that Zenoh may put together, bytes.
const LONGEST_MESSAGE: u64 = 64 << 20;

/// What leaves the site of these routers open, a sentence each. Nothing: fine.
///
/// With several routers, or one that has an id, what holds them together is judged, too.
#[must_use]
pub fn openings(routers: &[RouterFile]) -> Vec<String> {
    let mut found = Vec::new();
    for router in routers {
        let of_router = match router.get("mode") == "router" {
            true => [doors(router), limits(router), service(router)].concat(),
            // Nothing else that a router must have is asked of it.
            false => vec!["this is no router's configuration: its mode is another".to_owned()],
        };
        found.extend(of_router.into_iter().map(|text| format!("{}: {text}", router.name)));
    }
    found.extend(misfits(routers));
    let is_alone =
        matches!(routers, [router] if router.id().is_none() && router.endpoints("connect/endpoints").is_empty());
    if !is_alone {
        found.extend(between(routers));
    }
    found
}

/// That a single router is one of several: a sentence. What holds them together is seen only if the
/// configurations of all are given.
#[must_use]
pub fn others_not_given(routers: &[RouterFile]) -> Option<String> {
    let [router] = routers else { return None };
    let own = router.id();
    let mut others = listed_routers(router)?;
    others.retain(|id| Some(id) != own.as_ref());
    let ids = others.iter().map(String::as_str).collect::<Vec<_>>().join(", ");
    (!others.is_empty()).then(|| {
        format!(
            "{}: it counts others as routers ({ids}): give the configurations of all, or nobody sees whether a stranger gets \
             between them",
            router.name
        )
    })
}

/// Who gets in.
fn doors(router: &RouterFile) -> Vec<String> {
    let mut found = Vec::new();
    let mut note = |is_open: bool, text: &str| {
        if is_open {
            found.push(text.to_owned());
        }
    };
    let is_tls = |endpoint: &String| endpoint.starts_with("tls/") || endpoint.starts_with("quic/");
    note(
        !router.endpoints("listen/endpoints").iter().all(is_tls),
        "it listens without TLS: whoever reaches it reads and writes everything",
    );
    let tls = router.get("transport/link/tls");
    note(
        tls["enable_mtls"] != true,
        "enable_mtls is not set: nobody has to show a certificate, and access control knows nobody",
    );
    note(tls["verify_name_on_connect"] == false, "verify_name_on_connect is off: any certificate may play a router");
    note(
        tls["close_link_on_expiration"] != true,
        "close_link_on_expiration is not set: who is connected stays when the certificate has expired",
    );
    let protocols = router.get("transport/link/protocols");
    let is_fixed = protocols.as_array().is_some_and(|all| all.iter().all(|one| one == "tls" || one == "quic"));
    note(!is_fixed, "transport/link/protocols is not [\"tls\"]: one more endpoint opens a door without a lock");
    let access = router.get("access_control");
    note(access["enabled"] != true, "there is no access control (map-server access-control writes it)");
    note(
        access["enabled"] == true && access["default_permission"] != "deny",
        "access control allows what no rule says: default_permission must be deny",
    );
    found
}

/// How much one who gets in can take.
fn limits(router: &RouterFile) -> Vec<String> {
    let number = |key: &str| router.get(key).as_u64().unwrap_or_default();
    let mut found = Vec::new();
    let mut within = |key: &str, least: u64, most: u64, harm: &str| {
        let is = number(key);
        if is < least || is > most {
            let bound = if is < least { format!("at least {least}") } else { format!("at most {most}") };
            found.push(format!("{key} is {is} and should be {bound}: {harm}"));
        }
    };
    let any = u64::MAX;
    within("transport/unicast/max_sessions", LEAST_SESSIONS, any, "one certificate's sessions fill it");
    within("transport/unicast/accept_pending", LEAST_PENDING, any, "so many silent connections keep everybody out");
    within("transport/unicast/accept_timeout", 1, LONGEST_ACCEPT, "each silent connection keeps a slot for so long");
    within("transport/unicast/max_links", 1, 1, "a session needs one link");
    within("transport/link/tx/lease", 1, LONGEST_LEASE, "robots notice after so long that this router is frozen");
    within("transport/link/rx/max_message_size", 1, LONGEST_MESSAGE, "it puts together so much for anybody");
    if router.get("transport/shared_memory/enabled") == true {
        found.push("shared memory is on: sessions of its own machine take what is meant for all".to_owned());
    }
    found
}

/// What it does besides.
fn service(router: &RouterFile) -> Vec<String> {
    let mut found = Vec::new();
    if router.get("adminspace/enabled") == true && router.get("adminspace/permissions/write") == true {
        found.push("adminspace/permissions/write is on: its configuration can be changed over the network".to_owned());
    }
    if !router.get("plugins/rest").is_null() {
        found.push("the REST plugin asks nobody for a certificate, and passes by access control".to_owned());
    }
    // Zenoh's default is on.
    if router.get("scouting/multicast/enabled") != false {
        found.push("multicast scouting is on: it tells everybody in the network where it is".to_owned());
    }
    found
}

/// Who gets between the routers.
fn between(routers: &[RouterFile]) -> Vec<String> {
    let mut found = Vec::new();
    let mut owners: BTreeMap<String, &RouterFile> = BTreeMap::new();
    for router in routers {
        let Some(id) = router.id() else {
            found.push(format!("{}: it has no fixed id: others cannot tell it from a stranger", router.name));
            continue;
        };
        if let Some(first) = owners.insert(id.clone(), router) {
            found.push(format!("{} and {} have the same id {id}: one keeps the other out", first.name, router.name));
        }
    }
    for router in routers {
        let others = owners.iter().filter(|(_, owner)| owner.name != router.name);
        let listed = listed_routers(router);
        let weights = router.get("routing/router/linkstate/transport_weights");
        for (id, other) in others {
            let is_link = |weight: &Value| weight["dst_zid"] == **id && weight["weight"] == WEIGHT;
            if !weights.as_array().is_some_and(|weights| weights.iter().any(is_link)) {
                found.push(format!(
                    "{}: transport_weights gives the link to {} ({id}) no weight of {WEIGHT}: any certificate of the \
                     site can draw to itself what goes between them",
                    router.name, other.name
                ));
            }
            if listed.as_ref().is_some_and(|listed| !listed.contains(id)) {
                found.push(format!("{}: its gateway does not count {} ({id}) as a router", router.name, other.name));
            }
        }
        match listed {
            None => found.push(format!(
                "{}: gateway/south does not keep apart who is no router of the list: any certificate of the site, in mode \
                 router, tells it where others are",
                router.name
            )),
            Some(listed) if routers.len() > 1 => {
                found.extend(unowned(&router.name, listed.iter().filter(|id| !owners.contains_key(*id))));
            }
            Some(_) => {}
        }
    }
    found
}

fn unowned(name: &str, ids: impl Iterator<Item = impl Display>) -> Vec<String> {
    ids.map(|id| format!("{name}: its gateway counts {id} as a router, which is none of these: who takes it is one"))
        .collect()
}

/// The ids that count as routers, if everybody else is kept apart.
fn listed_routers(router: &RouterFile) -> Option<BTreeSet<String>> {
    let gateway = router.get("gateway");
    let filters =
        gateway["south"].as_array()?.iter().flat_map(|region| region["filters"].as_array().into_iter().flatten());
    let keeps_apart = |filter: &&Value| {
        let is_bare = ["modes", "interfaces", "region_names"].iter().all(|field| filter[*field].is_null());
        is_bare && filter["negated"] == true && filter["zids"].is_array()
    };
    let filter = filters.into_iter().find(keeps_apart)?;
    Some(filter["zids"].as_array()?.iter().filter_map(|id| id.as_str().map(str::to_owned)).collect())
}
