//! Subscribes to increments and queues them for the writer.

use crate::ingest::{Arrival, Refusal, WriterQueue};
use crate::query::OperatorNames;
use fht_proto::api::keys::{ALL_INCREMENTS, ALL_KEPT, Key, STORAGE_PRESENCE};
use fht_proto::{AuthorId, RobotName};
use std::sync::Arc;
use zenoh::Session;
use zenoh::pubsub::Subscriber;
use zenoh::sample::{Locality, Sample, SampleKind};

/// Queues increments until it is closed or dropped.
#[derive(Debug)]
pub(crate) struct IncrementSubscriptions {
    from_writers: Subscriber<()>,
    _from_servers: Option<Subscriber<()>>,
}

impl IncrementSubscriptions {
    /// Ends the subscriptions.
    ///
    /// # Errors
    /// When Zenoh fails.
    pub(crate) async fn close(self) -> Result<(), zenoh::Error> {
        self.from_writers.undeclare().await
    }
}

/// Puts the increments that writers send into `queue`, and with `from_servers` those that other
/// servers put into the storages. Payloads over `max_bytes` are refused unread. Writers who say
/// what they are called are among `names` then.
///
/// # Errors
/// When Zenoh refuses the subscriptions.
pub(crate) async fn subscribe_increments(
    session: &Session,
    queue: &Arc<WriterQueue>,
    (max_bytes, names): (usize, &Arc<OperatorNames>),
    from_servers: bool,
) -> Result<IncrementSubscriptions, zenoh::Error> {
    let push = || {
        let queue = Arc::clone(queue);
        move |sample: Sample| queue.push(arrival(&sample, max_bytes))
    };
    let (names, take) = (Arc::clone(names), push());
    let from_writers = session.declare_subscriber(ALL_INCREMENTS).callback(move |sample| {
        writer_name(&sample).iter().for_each(|name| names.learn(name.as_str()));
        take(sample);
    });
    let from_writers = from_writers.await?;
    let from_servers = if from_servers {
        let remote = session.declare_subscriber(ALL_KEPT).allowed_origin(Locality::Remote);
        let take = push();
        // Another server asks by it which storages are there.
        let take = move |sample: Sample| {
            if sample.key_expr().as_str() != STORAGE_PRESENCE {
                take(sample);
            }
        };
        Some(remote.callback(take).await?)
    } else {
        None
    };
    Ok(IncrementSubscriptions { from_writers, _from_servers: from_servers })
}

/// What the writer is called, if it says so, as operators' commands do. It is believed where the
/// author's id is made of it.
fn writer_name(sample: &Sample) -> Option<RobotName> {
    /// Longest name, bytes.
    const LONGEST: usize = 64;
    let said = sample.attachment().filter(|said| said.len() <= LONGEST)?;
    let name: RobotName = said.try_to_string().ok()?.parse().ok()?;
    let key = sample.key_expr().as_str().parse();
    let is_own = |author: AuthorId| author == AuthorId::of_robot(name.as_str());
    matches!(key, Ok(Key::Increment { author, .. }) if is_own(author)).then_some(name)
}

fn arrival(sample: &Sample, max_bytes: usize) -> Arrival {
    let bytes = sample.payload().len();
    let payload = match sample.kind() {
        SampleKind::Delete => Err(Refusal::Delete),
        // Not even copied.
        SampleKind::Put if bytes > max_bytes => Err(Refusal::TooLong { bytes }),
        SampleKind::Put => Ok(sample.payload().to_bytes().into_owned()),
    };
    Arrival { key: sample.key_expr().as_str().to_owned(), payload }
}
