//! Who is connected to the server's session, by what they are in Zenoh's words. Behind a router
//! there may be any number of others, of whom a server does not know.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};
use zenoh::Session;
use zenoh::config::WhatAmI;
use zenoh::sample::SampleKind;
use zenoh::session::{TransportEvent, TransportEventsListener, ZenohId};

/// What others are.
const KINDS: [(WhatAmI, &str); 3] = [(WhatAmI::Router, "router"), (WhatAmI::Peer, "peer"), (WhatAmI::Client, "client")];

/// Those that are connected. Zenoh bounds their number.
type Connected = Arc<Mutex<HashMap<ZenohId, WhatAmI>>>;

/// Follows who is connected, until it is dropped.
pub(crate) struct ConnectedSessions {
    connected: Connected,
    _following: TransportEventsListener<()>,
}

impl ConnectedSessions {
    /// Follows who is connected to `session`.
    ///
    /// # Errors
    /// When the session is closed.
    pub(crate) async fn follow(session: &Session) -> Result<Self, zenoh::Error> {
        let connected = Connected::default();
        let following = Arc::clone(&connected);
        let note = move |event: TransportEvent| {
            let mut connected = following.lock().unwrap_or_else(PoisonError::into_inner);
            let other = event.transport();
            match event.kind() {
                SampleKind::Put => _ = connected.insert(*other.zid(), other.whatami()),
                SampleKind::Delete => _ = connected.remove(other.zid()),
            }
        };
        let listener = session.info().transport_events_listener().history(true).callback(note).await?;
        Ok(Self { connected, _following: listener })
    }

    /// How many there are of each kind.
    pub(crate) fn counts(&self) -> Vec<(&'static str, usize)> {
        let connected = self.connected.lock().unwrap_or_else(PoisonError::into_inner);
        let count = |of: WhatAmI| connected.values().filter(|kind| **kind == of).count();
        KINDS.iter().map(|(kind, name)| (*name, count(*kind))).collect()
    }
}
