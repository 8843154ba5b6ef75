//! One viewer, from its greeting to its end. What it is told is made when it can take it, so one
//! that is slow keeps nothing waiting; one that takes nothing is given up by the door.

use crate::channel::BridgeChannel;
use crate::link::handshake::{Origins, ViewerSocket, shake_hands};
use crate::link::protocol::{
    ServiceCall, Severity, Subscription, ViewerWord, advertise, advertise_services, message_data, server_info,
    service_failure, service_reply, status,
};
use crate::link::services::Services;
use crate::outlook::{Outlook, Progress};
use crate::site::{FloorWish, FloorWishes};
use fht_door::{Caller, DoorStream};
use futures_util::stream::{SplitSink, SplitStream};
use futures_util::{SinkExt, StreamExt};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;
use tokio::sync::{mpsc, watch};
use tokio::task::JoinSet;
use tokio::time::{MissedTickBehavior, interval};
use tokio_tungstenite::tungstenite::{Error, Message};

/// Calls of one viewer that may wait for their answers.
const MAX_CALLS: usize = 4;
/// Orders of one viewer that may wait to be carried out; then it is not heard for a while.
const ORDERS: usize = 16;
/// A viewer is asked so often whether it is there.
const PING_EVERY: Duration = Duration::from_secs(10);
/// Who leaves so many unanswered is not there.
const MAX_PINGS: u32 = 3;

/// What all viewers share.
#[derive(Clone)]
pub(crate) struct Viewers {
    origins: Arc<Origins>,
    services: Services,
    outlook: watch::Receiver<Arc<Outlook>>,
    wishes: FloorWishes,
    greeting: Arc<[String; 3]>,
}

/// What is to be done for a viewer.
enum ViewerOrder {
    Subscribe(Vec<Subscription>),
    Unsubscribe(Vec<u32>),
    Say(Message),
}

impl Viewers {
    /// Viewers of what is called `name`; `run` is another text after each start.
    pub(crate) fn new(
        name: &str,
        run: &str,
        origins: Origins,
        services: Services,
        outlook: watch::Receiver<Arc<Outlook>>,
        wishes: FloorWishes,
    ) -> Self {
        let greeting = Arc::new([server_info(name, run), advertise(), advertise_services()]);
        Self { origins: Arc::new(origins), services, outlook, wishes, greeting }
    }

    /// Serves whoever is on a connection until it ends.
    pub(crate) async fn serve(self, stream: DoorStream, caller: Caller) {
        let Some(socket) = shake_hands(stream, &caller, &self.origins).await else { return };
        tracing::info!(?caller, "a viewer has come");
        let outcome = self.talk(socket).await;
        tracing::info!(
            ?caller,
            "a viewer has gone{}",
            outcome.map_or_else(|error| format!(": {error}"), |()| String::new())
        );
    }

    async fn talk(&self, socket: ViewerSocket) -> Result<(), Error> {
        let (mut sink, stream) = socket.split();
        for words in self.greeting.iter() {
            sink.send(Message::text(words.as_str())).await?;
        }
        let (orders, taken) = mpsc::channel(ORDERS);
        let unanswered = AtomicU32::new(0);
        let teller = Teller { sink, progress: Progress::default(), subscriptions: BTreeMap::new(), wish: None };
        tokio::select! {
            told = teller.tell(taken, self.outlook.clone(), &self.wishes, &unanswered) => told,
            heard = self.hear(stream, orders, &unanswered) => heard,
        }
    }

    /// Hears a viewer until it goes.
    async fn hear(
        &self,
        mut stream: SplitStream<ViewerSocket>,
        orders: mpsc::Sender<ViewerOrder>,
        unanswered: &AtomicU32,
    ) -> Result<(), Error> {
        let mut calls = JoinSet::new();
        while let Some(message) = stream.next().await {
            unanswered.store(0, Ordering::Relaxed);
            let word = match message? {
                Message::Text(text) => ViewerWord::of_text(&text),
                Message::Binary(bytes) => ViewerWord::of_bytes(&bytes),
                Message::Close(_) => break,
                _ => continue,
            };
            while calls.try_join_next().is_some() {}
            let order = match word {
                ViewerWord::Subscribe(wanted) => ViewerOrder::Subscribe(wanted),
                ViewerWord::Unsubscribe(unwanted) => ViewerOrder::Unsubscribe(unwanted),
                ViewerWord::Other(reason) => ViewerOrder::Say(Message::text(status(Severity::Warning, &reason))),
                ViewerWord::Call(call) if calls.len() >= MAX_CALLS => {
                    let text = "too many questions at a time: wait for an answer";
                    ViewerOrder::Say(Message::text(service_failure(call.service, call.call, text)))
                }
                ViewerWord::Call(call) => {
                    let (services, orders) = (self.services.clone(), orders.clone());
                    calls.spawn(async move {
                        let answer = answered(&services, call).await;
                        let _ = orders.send(ViewerOrder::Say(answer)).await; // it may have gone
                    });
                    continue;
                }
            };
            if orders.send(order).await.is_err() {
                break;
            }
        }
        Ok(())
    }
}

async fn answered(services: &Services, call: ServiceCall) -> Message {
    let ServiceCall { service, call, encoding, payload } = call;
    match services.answer(service, &encoding, &payload).await {
        Ok(answer) => Message::binary(service_reply(service, call, &answer)),
        Err(reason) => Message::text(service_failure(service, call, &reason)),
    }
}

/// Tells one viewer what it wants to see.
struct Teller {
    sink: SplitSink<ViewerSocket, Message>,
    progress: Progress,
    /// By which numbers the viewer calls the channels.
    subscriptions: BTreeMap<BridgeChannel, u32>,
    /// Held while the viewer wants the floor.
    wish: Option<FloorWish>,
}

impl Teller {
    async fn tell(
        mut self,
        mut orders: mpsc::Receiver<ViewerOrder>,
        mut outlook: watch::Receiver<Arc<Outlook>>,
        wishes: &FloorWishes,
        unanswered: &AtomicU32,
    ) -> Result<(), Error> {
        let mut ping = interval(PING_EVERY);
        ping.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            while let Ok(order) = orders.try_recv() {
                self.carry_out(order, wishes).await?;
            }
            let now = Arc::clone(&outlook.borrow_and_update());
            if let Some(message) = self.progress.next(&now) {
                if let Some(subscription) = self.subscriptions.get(&message.channel) {
                    let bytes = message_data(*subscription, message.at_ns, &message.bytes);
                    self.sink.send(Message::binary(bytes)).await?;
                }
                continue;
            }
            drop(now);
            tokio::select! {
                order = orders.recv() => match order {
                    Some(order) => self.carry_out(order, wishes).await?,
                    None => return Ok(()),
                },
                changed = outlook.changed() => if changed.is_err() { return Ok(()) },
                _ = ping.tick() => {
                    if unanswered.fetch_add(1, Ordering::Relaxed) >= MAX_PINGS {
                        return Ok(());
                    }
                    self.sink.send(Message::Ping(Vec::new().into())).await?;
                }
            }
        }
    }

    async fn carry_out(&mut self, order: ViewerOrder, wishes: &FloorWishes) -> Result<(), Error> {
        match order {
            ViewerOrder::Say(message) => self.sink.send(message).await?,
            ViewerOrder::Unsubscribe(unwanted) => {
                let gone: Vec<BridgeChannel> =
                    self.subscriptions.iter().filter(|(_, id)| unwanted.contains(id)).map(|(it, _)| *it).collect();
                for channel in gone {
                    self.subscriptions.remove(&channel);
                    self.progress.want(channel, false);
                }
            }
            ViewerOrder::Subscribe(wanted) => {
                let mut refused = 0;
                for Subscription { id, channel_id } in wanted {
                    match BridgeChannel::of(channel_id).filter(|channel| !self.subscriptions.contains_key(channel)) {
                        Some(channel) if !self.subscriptions.values().any(|known| *known == id) => {
                            self.subscriptions.insert(channel, id);
                            self.progress.want(channel, true);
                        }
                        _ => refused += 1,
                    }
                }
                if refused > 0 {
                    let text = format!("{refused} subscriptions are of no use: no such channel, or a second one");
                    self.sink.send(Message::text(status(Severity::Error, &text))).await?;
                }
            }
        }
        let wants_floor = self.subscriptions.contains_key(&BridgeChannel::Floor);
        self.wish = wants_floor.then(|| self.wish.take().unwrap_or_else(|| wishes.wish()));
        Ok(())
    }
}
