//! Queries from the moment on that the server can be reached: those that come while it still makes
//! or reads its store wait at the door, and are answered when it is open.

use crate::network::queryable::{QueryService, busy, reply_error};
use fht_proto::api::keys::ALL_QUERIES;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use zenoh::Session;
use zenoh::query::{Query, Queryable};

/// So many queries may wait; the others are told that the server is busy.
const MAX_WAITING: usize = 1024;

#[derive(Debug, Default)]
struct Door {
    service: OnceLock<QueryService>,
    waiting: Mutex<Vec<Query>>,
}

impl Door {
    fn take(&self, query: Query) {
        if let Some(service) = self.service.get() {
            service.take_query(query);
            return;
        }
        let mut waiting = self.waiting.lock().unwrap_or_else(PoisonError::into_inner);
        // It may have been opened in between.
        if let Some(service) = self.service.get() {
            service.take_query(query);
        } else if waiting.len() < MAX_WAITING {
            waiting.push(query);
        } else {
            reply_error(&query, &busy());
        }
    }
}

/// The queryable of a server. Closed at first.
#[derive(Debug)]
pub(crate) struct QueryDoor {
    queryable: Queryable<()>,
    door: Arc<Door>,
}

impl QueryDoor {
    /// Takes queries from now on.
    ///
    /// # Errors
    /// When Zenoh refuses the queryable.
    pub(crate) async fn declare(session: &Session) -> Result<Self, zenoh::Error> {
        let door = Arc::new(Door::default());
        let taking = Arc::clone(&door);
        let queryable = session.declare_queryable(ALL_QUERIES).callback(move |query| taking.take(query)).await?;
        Ok(Self { queryable, door })
    }

    /// Has `service` answer, also those who have waited.
    pub(crate) fn open(&self, service: QueryService) {
        let mut waiting = self.door.waiting.lock().unwrap_or_else(PoisonError::into_inner);
        let service = self.door.service.get_or_init(|| service);
        waiting.drain(..).for_each(|query| service.take_query(query));
    }

    /// Takes no more.
    ///
    /// # Errors
    /// When Zenoh fails.
    pub(crate) async fn close(self) -> Result<(), zenoh::Error> {
        self.queryable.undeclare().await
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::ServerEndpoints;
    use crate::ingest::WriterQueue;
    use crate::network::open;
    use crate::query::AnswerSources;
    use crate::store::MemoryLog;
    use fht_proto::api::reply::MapsReply;
    use std::time::Duration;
    use tokio::runtime::Handle;

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn who_asks_before_everything_is_read_is_answered_after_it() {
        let free = fht_reserved_port::reserve().unwrap_or_else(|error| panic!("{error}"));
        let endpoint = format!("tcp/{free}");
        let listening = ServerEndpoints { listen: vec![endpoint.clone()], ..ServerEndpoints::default() };
        let server = open(&listening).await.unwrap_or_else(|error| panic!("{error}"));
        let door = QueryDoor::declare(&server).await.unwrap_or_else(|error| panic!("{error}"));
        let connecting = ServerEndpoints { connect: vec![endpoint], ..ServerEndpoints::default() };
        let client = open(&connecting).await.unwrap_or_else(|error| panic!("{error}"));
        let asked = client.get("fht/maps").timeout(Duration::from_secs(20)).await;
        let replies = asked.unwrap_or_else(|error| panic!("{error}"));
        tokio::time::sleep(Duration::from_millis(300)).await;

        let sources = AnswerSources {
            writers: None,
            catalog: Arc::default(),
            log: Arc::new(MemoryLog::new()),
            active_rules: Arc::default(),
            fleet: Arc::default(),
            operators: Arc::default(),
            config: Arc::default(),
        };
        door.open(QueryService::new(sources, Arc::new(WriterQueue::new(1 << 20)), server.clone(), Handle::current()));
        let reply = replies.recv_async().await.unwrap_or_else(|error| panic!("nobody answers: {error}"));
        let bytes = reply.result().map(|sample| sample.payload().to_bytes().into_owned());
        let maps: MapsReply =
            serde_json::from_slice(&bytes.unwrap_or_default()).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(maps, MapsReply::default());
        assert!(door.close().await.is_ok());
    }
}
