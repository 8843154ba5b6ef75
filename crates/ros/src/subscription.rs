//! Subscribing to a topic: messages wait in a queue of bounded length, the oldest goes first.

use crate::attachment::{Attachment, Gid};
use crate::error::RosError;
use crate::inbox::Inbox;
use crate::keys::EndpointKind;
use crate::missed::Missed;
use crate::node::{Declared, RosNode};
use crate::qos::{Qos, QosDurability};
use fht_ros_messages::{RosMessage, cdr};
use serde::Deserialize;
use std::collections::VecDeque;
use std::marker::PhantomData;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use zenoh::pubsub::Subscriber;
use zenoh::query::{ConsolidationMode, QueryTarget, ReplyKeyExpr};
use zenoh::sample::{Sample, SampleKind};
use zenoh::{Session, Wait};

/// How long publishers may take to tell their last messages.
const HISTORY_PATIENCE: Duration = Duration::from_secs(10);
/// How many messages are remembered, so that none is taken twice.
const REMEMBERED: usize = 256;

/// A message as it came.
#[derive(Clone, Debug)]
pub struct Received {
    /// The message in CDR, with its header of four bytes.
    pub bytes: Vec<u8>,
    /// Which one it is, if its sender says so.
    pub attachment: Option<Attachment>,
    /// When it arrived here.
    pub arrived: Instant,
}

impl Received {
    /// The message.
    ///
    /// # Errors
    /// [`cdr::CdrError`] when it is not of this type.
    pub fn decode<'a, M: Deserialize<'a>>(&'a self) -> Result<M, cdr::CdrError> {
        cdr::decode(&self.bytes)
    }
}

/// Hears messages of one type.
pub struct Subscription<M> {
    raw: RawSubscription,
    message: PhantomData<fn() -> M>,
}

impl RosNode {
    /// Subscribes to `topic`. Of publishers of other distributions, whose hashes differ, messages
    /// are taken as well.
    ///
    /// # Errors
    /// [`RosError`].
    pub async fn subscribe<M: RosMessage>(&self, topic: &str, qos: Qos) -> Result<Subscription<M>, RosError> {
        let raw = RawSubscription::new(self, topic, M::TYPE, qos).await?;
        Ok(Subscription { raw, message: PhantomData })
    }
}

impl<M> Subscription<M> {
    /// The full name of the topic.
    #[must_use]
    pub fn topic(&self) -> &str {
        &self.raw.declared.name
    }

    /// Waits for the next message. Cancel safe.
    pub async fn next_raw(&self) -> Received {
        self.raw.inbox.next().await
    }

    /// The oldest message that waits, if there is one.
    #[must_use]
    pub fn take_raw(&self) -> Option<Received> {
        self.raw.inbox.take()
    }

    /// How many messages were dropped, since newer ones came before they were taken.
    #[must_use]
    pub fn dropped(&self) -> u64 {
        self.raw.inbox.dropped()
    }

    /// How many messages have not come here, by the numbers that their publishers give them: lost
    /// on the way, or published while the link was away. One that comes late after all counts no
    /// more.
    #[must_use]
    pub fn missed(&self) -> u64 {
        self.raw.door.missed.lock().unwrap_or_else(PoisonError::into_inner).count()
    }
}

impl<M: for<'a> Deserialize<'a>> Subscription<M> {
    /// Waits for the next message. Cancel safe.
    ///
    /// # Errors
    /// [`RosError::Message`] when it is not of this type; the next may be.
    pub async fn next(&self) -> Result<M, RosError> {
        self.next_raw().await.decode().map_err(RosError::message(self.topic()))
    }
}

/// A subscription to a type that is known only when the program runs.
pub(crate) struct RawSubscription {
    pub(crate) declared: Declared,
    pub(crate) inbox: Arc<Inbox<Received>>,
    door: Arc<Door>,
    _subscriber: Subscriber<()>,
    _publishers: Option<Subscriber<()>>,
    _node: RosNode,
}

impl RawSubscription {
    pub(crate) async fn new(node: &RosNode, topic: &str, ros_type: &str, qos: Qos) -> Result<Self, RosError> {
        let declared = node.declare(EndpointKind::Subscription, topic, ros_type, qos).await?;
        let door = Arc::new(Door {
            inbox: Arc::new(Inbox::new(qos.kept())),
            seen: Mutex::default(),
            missed: Mutex::default(),
        });
        let (own, session) = (Arc::clone(&door), node.session());
        let (inbox, live) = (Arc::clone(&door.inbox), Arc::clone(&door));
        let failed = RosError::zenoh(format!("subscribe to {}", declared.name));
        let subscriber = session
            .declare_subscriber(declared.any_key.clone())
            .callback(move |sample| live.take(&sample))
            .await
            .map_err(failed)?;
        let publishers = match qos.durability {
            QosDurability::TransientLocal => Some(history(session, &declared, qos.kept(), door).await?),
            QosDurability::Volatile => None,
        };
        let (_subscriber, _publishers, _node) = (subscriber, publishers, node.clone());
        Ok(Self { declared, inbox, door: own, _subscriber, _publishers, _node })
    }
}

/// Asks every publisher that keeps its last messages for them, now or when it comes.
async fn history(
    session: &Session,
    declared: &Declared,
    depth: usize,
    door: Arc<Door>,
) -> Result<Subscriber<()>, RosError> {
    let asking = session.clone();
    let ask = move |token: Sample| {
        if token.kind() != SampleKind::Put {
            return;
        }
        let (place, door) = (token.key_expr().clone(), Arc::clone(&door));
        let asked = asking
            .get(format!("{place}?_max={depth}"))
            .target(QueryTarget::All)
            .consolidation(ConsolidationMode::None)
            .accept_replies(ReplyKeyExpr::Any)
            .timeout(HISTORY_PATIENCE)
            .callback(move |reply| {
                if let Ok(sample) = reply.result() {
                    door.take(sample);
                }
            })
            .wait();
        if let Err(error) = asked {
            tracing::debug!("the last messages at {place} cannot be asked for: {error}");
        }
    };
    let failed = RosError::zenoh(format!("ask for the last messages of {}", declared.name));
    let places = format!("{}/@adv/pub/**", declared.any_key);
    session.liveliness().declare_subscriber(places).history(true).callback(ask).await.map_err(failed)
}

/// Where messages come in; those that came before are left outside.
struct Door {
    inbox: Arc<Inbox<Received>>,
    seen: Mutex<VecDeque<(Gid, i64)>>,
    missed: Mutex<Missed>,
}

impl Door {
    fn take(&self, sample: &Sample) {
        if sample.kind() != SampleKind::Put {
            return;
        }
        let attachment = sample.attachment().and_then(|bytes| match Attachment::from_bytes(&bytes.to_bytes()) {
            Ok(attachment) => Some(attachment),
            Err(error) => {
                tracing::debug!("{}: {error}", sample.key_expr());
                None
            }
        });
        if let Some(Attachment { gid, sequence, .. }) = attachment {
            let mut seen = self.seen.lock().unwrap_or_else(PoisonError::into_inner);
            if seen.contains(&(gid, sequence)) {
                return;
            }
            seen.push_back((gid, sequence));
            if seen.len() > REMEMBERED {
                seen.pop_front();
            }
            drop(seen);
            self.missed.lock().unwrap_or_else(PoisonError::into_inner).take(gid, sequence);
        }
        let bytes = sample.payload().to_bytes().into_owned();
        self.inbox.push(Received { bytes, attachment, arrived: Instant::now() });
    }
}
