//! Makes the keys that robots ask for known to all routers.
//!
//! A router that is asked under a key that nobody has declared compares all declared keys with it,
//! for each question anew; of a declared key it remembers who answers. Subscriptions declare keys
//! at every router and change nobody's answer, unlike queryables (docs/adr/0054).

use fht_proto::MapName;
use fht_proto::api::keys::{Key, Topic};
use std::collections::{BTreeMap, BTreeSet};
use zenoh::Session;
use zenoh::pubsub::Subscriber;

/// What robots ask for again and again.
const TOPICS: [Topic; 5] = [Topic::Head, Topic::Path, Topic::Since, Topic::Rules, Topic::Snapshot];

/// The keys of the maps that there are.
#[derive(Debug)]
pub(crate) struct KnownKeys {
    session: Session,
    declared: BTreeMap<MapName, Vec<Subscriber<()>>>,
}

impl KnownKeys {
    /// None yet.
    #[must_use]
    pub(crate) fn new(session: Session) -> Self {
        Self { session, declared: BTreeMap::new() }
    }

    /// Declares the keys of maps that are new, and drops those of maps that are gone.
    ///
    /// # Errors
    /// The session is closed.
    pub(crate) async fn follow(&mut self, maps: &BTreeSet<MapName>) -> Result<(), zenoh::Error> {
        self.declared.retain(|map, _| maps.contains(map));
        for map in maps {
            if !self.declared.contains_key(map) {
                let mut keys = Vec::with_capacity(TOPICS.len());
                for topic in TOPICS {
                    let key = Key::topic(map, topic).to_string();
                    // Heads come here, too; nothing is done with them.
                    keys.push(self.session.declare_subscriber(key).callback(drop).await?);
                }
                self.declared.insert(map.clone(), keys);
            }
        }
        Ok(())
    }
}
