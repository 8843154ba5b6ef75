//! Publishing a topic, and keeping the last messages for who comes later.

use crate::attachment::{Attachment, Gid};
use crate::error::RosError;
use crate::keys::{EndpointKind, KeyForm};
use crate::node::{Declared, RosNode, now_ns};
use crate::qos::{Qos, QosDurability, QosReliability};
use fht_ros_messages::{RosMessage, cdr};
use serde::Serialize;
use std::collections::VecDeque;
use std::marker::PhantomData;
use std::sync::atomic::{AtomicI64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use zenoh::Wait;
use zenoh::bytes::{Encoding, ZBytes};
use zenoh::liveliness::LivelinessToken;
use zenoh::qos::CongestionControl;
use zenoh::query::{Query, Queryable};
use zenoh::time::Timestamp;

/// Publishes messages of one type.
pub struct Publisher<M> {
    raw: RawPublisher,
    message: PhantomData<fn(&M)>,
}

impl RosNode {
    /// Publishes `topic`.
    ///
    /// # Errors
    /// [`RosError`].
    pub async fn publisher<M: RosMessage>(&self, topic: &str, qos: Qos) -> Result<Publisher<M>, RosError> {
        let raw = RawPublisher::new(self, topic, M::TYPE, qos).await?;
        Ok(Publisher { raw, message: PhantomData })
    }
}

impl<M: Serialize> Publisher<M> {
    /// Publishes a message. Reliable ones block the caller while the link takes no more.
    ///
    /// # Errors
    /// [`RosError`] when the message cannot be written, or the session is closed.
    pub fn publish(&self, message: &M) -> Result<(), RosError> {
        self.raw.publish(message)
    }

    /// The full name of the topic.
    #[must_use]
    pub fn topic(&self) -> &str {
        &self.raw.declared.name
    }

    /// Whether somebody listens.
    ///
    /// # Errors
    /// [`RosError::Zenoh`].
    pub async fn is_heard(&self) -> Result<bool, RosError> {
        let failed = RosError::zenoh("say who listens");
        Ok(self.raw.publisher.matching_status().await.map_err(failed)?.matching())
    }
}

/// A message as it was sent.
struct Sent {
    payload: ZBytes,
    attachment: Option<ZBytes>,
    stamp: Timestamp,
}

type Kept = Arc<Mutex<VecDeque<Sent>>>;

/// The last messages, for who comes later: as zenoh-ext's `AdvancedPublisher` keeps them, at
/// `KEY/@adv/pub/ZID/uhlc/_`, where a token says that they are there.
struct History {
    kept: Kept,
    depth: usize,
    _queryable: Queryable<()>,
    _token: LivelinessToken,
}

/// A publisher of a type that is known only when the program runs.
pub(crate) struct RawPublisher {
    declared: Declared,
    gid: Option<Gid>,
    sequence: AtomicI64,
    publisher: zenoh::pubsub::Publisher<'static>,
    history: Option<History>,
    node: RosNode,
}

impl RawPublisher {
    pub(crate) async fn new(node: &RosNode, topic: &str, ros_type: &str, qos: Qos) -> Result<Self, RosError> {
        let declared = node.declare(EndpointKind::Publisher, topic, ros_type, qos).await?;
        let congestion = match qos.reliability {
            QosReliability::Reliable => CongestionControl::Block,
            QosReliability::BestEffort => CongestionControl::Drop,
        };
        let failed = RosError::zenoh(format!("publish {}", declared.name));
        let publisher = node
            .session()
            .declare_publisher(declared.key.clone())
            .encoding(Encoding::APPLICATION_CDR)
            .congestion_control(congestion)
            .await
            .map_err(failed)?;
        let history = match qos.durability {
            QosDurability::TransientLocal => Some(History::new(node, &declared, qos.kept()).await?),
            QosDurability::Volatile => None,
        };
        let gid = (node.config().form == KeyForm::Rmw).then(|| Gid::of_token(&declared.token));
        Ok(Self { declared, gid, sequence: AtomicI64::new(0), publisher, history, node: node.clone() })
    }

    pub(crate) fn publish<T: Serialize>(&self, message: &T) -> Result<(), RosError> {
        let payload = ZBytes::from(cdr::encode(message).map_err(RosError::message(&self.declared.name))?);
        let sequence = self.sequence.fetch_add(1, Ordering::Relaxed);
        let attachment = self.gid.map(|gid| {
            let attachment = Attachment { sequence, stamp_ns: now_ns(), gid };
            ZBytes::from(attachment.to_bytes().to_vec())
        });
        let stamp = self.node.session().new_timestamp();
        if let Some(history) = &self.history {
            history.keep(Sent { payload: payload.clone(), attachment: attachment.clone(), stamp });
        }
        let put = self.publisher.put(payload).timestamp(stamp);
        let put = match attachment {
            Some(attachment) => put.attachment(attachment),
            None => put,
        };
        put.wait().map_err(RosError::zenoh(format!("send a message of {}", self.declared.name)))
    }
}

impl History {
    async fn new(node: &RosNode, declared: &Declared, depth: usize) -> Result<Self, RosError> {
        let session = node.session();
        let place = format!("{}/@adv/pub/{}/uhlc/_", declared.key, session.zid());
        let kept = Kept::default();
        let (told, key) = (Arc::clone(&kept), declared.key.clone());
        let answer = move |query: Query| tell(&query, &key, &told);
        let failed = RosError::zenoh(format!("keep the last messages of {}", declared.name));
        let queryable = session.declare_queryable(place.clone()).callback(answer).await.map_err(failed)?;
        let failed = RosError::zenoh(format!("declare the token {place}"));
        let token = session.liveliness().declare_token(place).await.map_err(failed)?;
        Ok(Self { kept, depth, _queryable: queryable, _token: token })
    }

    fn keep(&self, sent: Sent) {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        if kept.len() >= self.depth {
            kept.pop_front();
        }
        kept.push_back(sent);
    }
}

/// Replies with the last messages, as many as are asked for (`_max`).
fn tell(query: &Query, key: &str, kept: &Kept) {
    let kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
    let wanted = query.parameters().get("_max").and_then(|max| max.parse().ok()).unwrap_or(kept.len());
    for sent in kept.iter().skip(kept.len().saturating_sub(wanted)) {
        let reply = query.reply(key, sent.payload.clone()).encoding(Encoding::APPLICATION_CDR).timestamp(sent.stamp);
        let reply = match &sent.attachment {
            Some(attachment) => reply.attachment(attachment.clone()),
            None => reply,
        };
        if let Err(error) = reply.wait() {
            tracing::debug!("the last messages of {key} could not be told: {error}");
        }
    }
}
