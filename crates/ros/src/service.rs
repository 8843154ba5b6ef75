//! Services: asking and answering.

use crate::attachment::{Attachment, Gid};
use crate::error::RosError;
use crate::inbox::Inbox;
use crate::keys::{EndpointKind, KeyForm};
use crate::node::{Declared, RosNode, now_ns};
use crate::qos::Qos;
use fht_ros_messages::{RosService, cdr};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::marker::PhantomData;
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};
use std::time::Duration;
use zenoh::Wait;
use zenoh::bytes::{Encoding, ZBytes};
use zenoh::query::{ConsolidationMode, Query, QueryTarget, Queryable};

/// Asks a service.
pub struct ServiceClient<S> {
    raw: RawClient,
    service: PhantomData<fn() -> S>,
}

/// Answers a service.
pub struct ServiceServer<S> {
    raw: RawServer,
    service: PhantomData<fn() -> S>,
}

/// A request that waits for its answer. Dropped without one, the client hears that nobody answers.
pub struct Call<S: RosService> {
    /// What is asked.
    pub request: S::Request,
    reply: RawCall,
}

impl RosNode {
    /// A client of the service `name`.
    ///
    /// # Errors
    /// [`RosError`].
    pub async fn client<S: RosService>(&self, name: &str) -> Result<ServiceClient<S>, RosError> {
        Ok(ServiceClient { raw: RawClient::new(self, name, S::TYPE).await?, service: PhantomData })
    }

    /// A server of the service `name`: take its requests with [`ServiceServer::next`].
    ///
    /// # Errors
    /// [`RosError`].
    pub async fn server<S: RosService>(&self, name: &str) -> Result<ServiceServer<S>, RosError> {
        Ok(ServiceServer { raw: RawServer::new(self, name, S::TYPE).await?, service: PhantomData })
    }
}

impl<S: RosService> ServiceClient<S> {
    /// Asks, and waits at most `patience` for the answer.
    ///
    /// # Errors
    /// [`RosError::NoServer`] when nobody answers, [`RosError::Refused`] with the server's words.
    pub async fn call(&self, request: &S::Request, patience: Duration) -> Result<S::Response, RosError> {
        self.raw.call(request, patience).await
    }
}

impl<S: RosService> ServiceServer<S> {
    /// Waits for the next request. Cancel safe. Who asks what is no request hears so.
    pub async fn next(&self) -> Call<S> {
        loop {
            let call = self.raw.inbox.next().await;
            match call.request() {
                Ok(request) => return Call { request, reply: call },
                Err(error) => call.refuse(&error.to_string()),
            }
        }
    }
}

impl<S: RosService> Call<S> {
    /// Answers.
    ///
    /// # Errors
    /// [`RosError`] when the answer cannot be written or sent.
    pub fn respond(self, response: &S::Response) -> Result<(), RosError> {
        self.reply.respond(response)
    }
}

/// Requests that wait for a server.
const REQUESTS: usize = 64;

pub(crate) struct RawClient {
    declared: Declared,
    gid: Gid,
    sequence: AtomicI64,
    node: RosNode,
}

impl RawClient {
    pub(crate) async fn new(node: &RosNode, name: &str, ros_type: &str) -> Result<Self, RosError> {
        let declared = node.declare(EndpointKind::Client, name, ros_type, Qos::default()).await?;
        let gid = Gid::of_token(&declared.token);
        Ok(Self { declared, gid, sequence: AtomicI64::new(1), node: node.clone() })
    }

    pub(crate) async fn call<Q, R>(&self, request: &Q, patience: Duration) -> Result<R, RosError>
    where
        Q: Serialize,
        R: DeserializeOwned,
    {
        let name = &self.declared.name;
        let payload = cdr::encode(request).map_err(RosError::message(name))?;
        let sequence = self.sequence.fetch_add(1, Ordering::Relaxed);
        let query = self
            .node
            .session()
            .get(&self.declared.key)
            .payload(payload)
            .encoding(Encoding::APPLICATION_CDR)
            .consolidation(ConsolidationMode::None)
            .timeout(patience);
        let query = match self.node.config().form {
            KeyForm::Rmw => {
                let attachment = Attachment { sequence, stamp_ns: now_ns(), gid: self.gid };
                query.target(QueryTarget::AllComplete).attachment(ZBytes::from(attachment.to_bytes().to_vec()))
            }
            // The bridge numbers requests itself.
            KeyForm::Bridge => query,
        };
        let replies = query.await.map_err(RosError::zenoh(format!("ask {name}")))?;
        let Ok(reply) = replies.recv_async().await else { return Err(RosError::NoServer(name.clone())) };
        match reply.result() {
            Ok(sample) => cdr::decode_owned(&sample.payload().to_bytes()).map_err(RosError::message(name)),
            // Zenoh's own reply when nobody answered in time.
            Err(error) => match error.payload().try_to_string() {
                Ok(text) if text.eq_ignore_ascii_case("timeout") => Err(RosError::NoServer(name.clone())),
                Ok(text) => Err(RosError::Refused { name: name.clone(), reason: text.into_owned() }),
                Err(_) => Err(RosError::Refused { name: name.clone(), reason: "no reason".to_owned() }),
            },
        }
    }
}

pub(crate) struct RawServer {
    pub(crate) inbox: Arc<Inbox<RawCall>>,
    _declared: Declared,
    _queryable: Queryable<()>,
    _node: RosNode,
}

/// A request as it came.
pub(crate) struct RawCall {
    query: Query,
    name: String,
    key: String,
}

impl RawServer {
    pub(crate) async fn new(node: &RosNode, name: &str, ros_type: &str) -> Result<Self, RosError> {
        let declared = node.declare(EndpointKind::Server, name, ros_type, Qos::default()).await?;
        let inbox = Arc::new(Inbox::new(REQUESTS));
        let (taking, key, name) = (Arc::clone(&inbox), declared.key.clone(), declared.name.clone());
        let take = move |query| taking.push(RawCall { query, name: name.clone(), key: key.clone() });
        let failed = RosError::zenoh(format!("serve {}", declared.name));
        let session = node.session();
        let queryable =
            session.declare_queryable(declared.key.clone()).complete(true).callback(take).await.map_err(failed)?;
        Ok(Self { inbox, _declared: declared, _queryable: queryable, _node: node.clone() })
    }
}

impl RawCall {
    pub(crate) fn request<Q: DeserializeOwned>(&self) -> Result<Q, RosError> {
        let bytes = self.query.payload().map(ZBytes::to_bytes).unwrap_or_default();
        cdr::decode_owned(&bytes).map_err(RosError::message(&self.name))
    }

    pub(crate) fn respond<R: Serialize>(&self, response: &R) -> Result<(), RosError> {
        self.respond_bytes(cdr::encode(response).map_err(RosError::message(&self.name))?)
    }

    /// Answers with a message in CDR.
    pub(crate) fn respond_bytes(&self, payload: Vec<u8>) -> Result<(), RosError> {
        let asked = self.query.attachment().and_then(|bytes| Attachment::from_bytes(&bytes.to_bytes()).ok());
        let reply = self.query.reply(&self.key, payload).encoding(Encoding::APPLICATION_CDR);
        let reply = match asked {
            Some(asked) => {
                let attachment = Attachment { stamp_ns: now_ns(), ..asked };
                reply.attachment(ZBytes::from(attachment.to_bytes().to_vec()))
            }
            None => reply,
        };
        reply.wait().map_err(RosError::zenoh(format!("answer for {}", self.name)))
    }

    pub(crate) fn refuse(&self, reason: &str) {
        if let Err(error) = self.query.reply_err(reason).wait() {
            tracing::debug!("{}: a client could not be told why it is refused: {error}", self.name);
        }
    }
}
