//! Subscribes to increments and queues them for the writer.

use crate::ingest::{Arrival, Refusal, WriterQueue};
use fht_proto::api::keys::{ALL_INCREMENTS, ALL_KEPT};
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
/// servers put into the storages. Payloads over `max_bytes` are refused unread.
///
/// # Errors
/// When Zenoh refuses the subscriptions.
pub(crate) async fn subscribe_increments(
    session: &Session,
    queue: &Arc<WriterQueue>,
    max_bytes: usize,
    from_servers: bool,
) -> Result<IncrementSubscriptions, zenoh::Error> {
    let push = || {
        let queue = Arc::clone(queue);
        move |sample: Sample| queue.push(arrival(&sample, max_bytes))
    };
    let from_writers = session.declare_subscriber(ALL_INCREMENTS).callback(push()).await?;
    let from_servers = if from_servers {
        let remote = session.declare_subscriber(ALL_KEPT).allowed_origin(Locality::Remote);
        Some(remote.callback(push()).await?)
    } else {
        None
    };
    Ok(IncrementSubscriptions { from_writers, _from_servers: from_servers })
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
