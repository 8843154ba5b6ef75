//! The keys that robots ask for all the time, declared one by one.
//!
//! A router has the routes of a key at hand that somebody has declared. For any other, such as
//! `fht/museum/path` where all that is declared is `fht/**`, it goes through all names below `fht/`
//! at each question. A bad neighbour that invents thousands of names makes that most of what the
//! router does (`docs/upstream.md`).

use crate::catalog::Catalog;
use fht_proto::MapName;
use fht_proto::api::keys::{Key, Topic};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;
use zenoh::Session;
use zenoh::query::Queryable;

/// What a robot that has joined asks for again and again.
const ASKED_OFTEN: [Topic; 5] = [Topic::Head, Topic::Since, Topic::Snapshot, Topic::Path, Topic::Nodes];
/// How late a new map's keys may be declared: they are answered all the time.
const EVERY: Duration = Duration::from_millis(500);

/// Declares the keys of each map that there is, for as long as it is there. Whoever answers is
/// declared with wildcards: these here answer nothing.
///
/// `is_complete`: whether this server knows all about them, so that it is asked alone.
pub(crate) async fn declare_exact_keys(session: Session, catalog: Arc<Catalog>, is_complete: bool) {
    let mut declared: BTreeMap<MapName, Vec<Queryable<()>>> = BTreeMap::new();
    loop {
        let maps: Vec<MapName> = catalog.heads().iter().map(|head| head.map.clone()).collect();
        declared.retain(|map, _| maps.contains(map));
        for map in maps {
            if declared.contains_key(&map) {
                continue;
            }
            match declare(&session, &map, is_complete).await {
                Ok(keys) => _ = declared.insert(map, keys),
                // It is asked for under the wildcards, as before.
                Err(error) => tracing::debug!(%map, %error, "its keys are not declared one by one"),
            }
        }
        tokio::time::sleep(EVERY).await;
    }
}

async fn declare(session: &Session, map: &MapName, is_complete: bool) -> Result<Vec<Queryable<()>>, zenoh::Error> {
    let mut keys = Vec::new();
    for topic in ASKED_OFTEN {
        let key = Key::topic(map, topic).to_string();
        keys.push(session.declare_queryable(key).complete(is_complete).callback(drop).await?);
    }
    Ok(keys)
}
