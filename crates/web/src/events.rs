//! Server-sent events. Each event is written once for all who watch; who does not keep up is
//! dropped, comes again, and reads everything anew.

use axum::body::{Body, Bytes};
use fht_proto::MapName;
use futures_util::stream::unfold;
use serde::Serialize;
use std::collections::BTreeMap;
use std::convert::Infallible;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::sync::OwnedSemaphorePermit;
use tokio::sync::broadcast::{Receiver, Sender, channel};
use tokio::time::timeout;

/// So many events may wait for one who watches.
const MAX_WAITING: usize = 64;
/// A browser whose stream has ended comes again after so long, milliseconds.
const COME_AGAIN_MS: u32 = 1000;

/// An event, as it is sent.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WebEvent(Bytes);

impl WebEvent {
    /// An event called `name` with `data` as JSON; none if that has no form in JSON.
    #[must_use]
    pub fn new<T: Serialize>(name: &'static str, data: &T) -> Option<Self> {
        // JSON has no line breaks of its own.
        let data = serde_json::to_string(data).ok()?;
        Some(Self(Bytes::from(format!("event: {name}\ndata: {data}\n\n"))))
    }
}

/// Where events go. Clones are the same hub.
#[derive(Clone, Debug, Default)]
pub struct EventHub(Arc<Mutex<BTreeMap<Option<MapName>, Sender<WebEvent>>>>);

impl EventHub {
    fn lock(&self) -> MutexGuard<'_, BTreeMap<Option<MapName>, Sender<WebEvent>>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether anybody watches a map; none: the list of maps.
    #[must_use]
    pub fn is_watched(&self, map: Option<&MapName>) -> bool {
        self.lock().get(&map.cloned()).is_some_and(|sender| sender.receiver_count() > 0)
    }

    /// The maps that somebody watches.
    #[must_use]
    pub fn watched(&self) -> Vec<MapName> {
        let mut channels = self.lock();
        channels.retain(|_, sender| sender.receiver_count() > 0);
        channels.keys().flatten().cloned().collect()
    }

    /// Sends an event to all who watch a map; none: the list of maps.
    pub fn publish(&self, map: Option<&MapName>, event: WebEvent) {
        if let Some(sender) = self.lock().get(&map.cloned()) {
            // Nobody watches any more.
            let _ = sender.send(event);
        }
    }

    /// The events of a map from now on; none: of the list of maps.
    /// They end once `may_look` says no, which is asked before each.
    pub(crate) fn watch(
        &self,
        map: Option<MapName>,
        heartbeat: Duration,
        may_look: impl Fn() -> bool + Send + 'static,
    ) -> EventStream {
        let mut channels = self.lock();
        channels.retain(|_, sender| sender.receiver_count() > 0);
        let events = channels.entry(map).or_insert_with(|| channel(MAX_WAITING).0).subscribe();
        EventStream {
            events,
            heartbeat,
            may_look: Box::new(may_look),
            greeting: Some(Bytes::from(format!("retry: {COME_AGAIN_MS}\n\n"))),
        }
    }
}

/// What one who watches is sent.
pub(crate) struct EventStream {
    events: Receiver<WebEvent>,
    heartbeat: Duration,
    may_look: Box<dyn Fn() -> bool + Send>,
    greeting: Option<Bytes>,
}

impl EventStream {
    /// What is sent next; none: it has not kept up, or may not look any more, and is dropped.
    async fn next(&mut self) -> Option<Bytes> {
        if let Some(greeting) = self.greeting.take() {
            return Some(greeting);
        }
        let next = match timeout(self.heartbeat, self.events.recv()).await {
            Ok(Ok(event)) => event.0,
            Ok(Err(_)) => return None,
            Err(_) => Bytes::from_static(b"event: beat\ndata: {}\n\n"),
        };
        (self.may_look)().then_some(next)
    }

    /// The body of a reply, which keeps its place while it is read. `gone` is called at its end.
    pub(crate) fn into_body(self, place: OwnedSemaphorePermit, gone: impl FnOnce() + Send + 'static) -> Body {
        let end = AtEnd(Some(Box::new(gone)), place);
        Body::from_stream(unfold((self, end), |(mut stream, end)| async move {
            let bytes = stream.next().await?;
            Some((Ok::<_, Infallible>(bytes), (stream, end)))
        }))
    }
}

/// Gives the place back, however the stream ends.
struct AtEnd(Option<Box<dyn FnOnce() + Send>>, #[allow(dead_code)] OwnedSemaphorePermit);

impl Drop for AtEnd {
    fn drop(&mut self) {
        if let Some(gone) = self.0.take() {
            gone();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn museum() -> MapName {
        "museum".parse().unwrap_or_else(|error| panic!("{error}"))
    }

    fn event(number: usize) -> WebEvent {
        WebEvent::new("head", &number).unwrap_or_else(|| panic!("a number has a form"))
    }

    #[tokio::test]
    async fn who_watches_gets_what_comes_and_who_does_not_read_is_dropped() {
        let hub = EventHub::default();
        hub.publish(Some(&museum()), event(0));
        let mut stream = hub.watch(Some(museum()), Duration::from_secs(60), || true);
        let mut slow = hub.watch(Some(museum()), Duration::from_secs(60), || true);
        assert!(hub.is_watched(Some(&museum())) && !hub.is_watched(None));
        assert_eq!(hub.watched(), [museum()]);
        assert!(stream.next().await.is_some_and(|bytes| bytes.starts_with(b"retry: ")));
        for number in 1..=2 * MAX_WAITING {
            hub.publish(Some(&museum()), event(number));
            let got = stream.next().await;
            assert_eq!(got, Some(Bytes::from(format!("event: head\ndata: {number}\n\n"))));
        }
        assert!(slow.next().await.is_some());
        assert_eq!(slow.next().await, None);
        drop((stream, slow));
        assert!(hub.watched().is_empty());
    }

    #[tokio::test]
    async fn who_may_not_look_any_more_gets_nothing_more() {
        let (hub, may) = (EventHub::default(), Arc::new(std::sync::atomic::AtomicBool::new(true)));
        let asked = Arc::clone(&may);
        let may_look = move || asked.load(std::sync::atomic::Ordering::Relaxed);
        let mut stream = hub.watch(Some(museum()), Duration::from_millis(10), may_look);
        let _ = stream.next().await;
        hub.publish(Some(&museum()), event(1));
        assert!(stream.next().await.is_some());
        hub.publish(Some(&museum()), event(2));
        may.store(false, std::sync::atomic::Ordering::Relaxed);
        assert_eq!(stream.next().await, None, "neither an event that waits, nor a beat");
    }

    #[tokio::test]
    async fn a_silent_stream_says_that_it_is_there_and_names_break_no_line() {
        let hub = EventHub::default();
        let mut stream = hub.watch(None, Duration::from_millis(10), || true);
        let _ = stream.next().await;
        assert!(stream.next().await.is_some_and(|bytes| bytes.starts_with(b"event: beat")));
        let hostile = WebEvent::new("head", &"a\n\nevent: evil\ndata: x\r</script>");
        let text = hostile.map(|event| event.0).unwrap_or_default();
        assert_eq!(text.iter().filter(|byte| **byte == b'\n').count(), 3, "{text:?}");
        assert!(!text.contains(&b'\r'), "{text:?}");
    }
}
