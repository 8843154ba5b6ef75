//! What a map's replica and its robots say, as one outlook that is renewed some times a second.

use crate::channel::encoded;
use crate::outlook::Outlook;
use crate::scene::{FloorDrawing, KnownRobots, MapScene, floor_grid};
use fht_client::{LiveReplica, RobotEvents};
use fht_localization::landmarks::Landmarks;
use fht_map::Rules;
use foxglove::messages::Timestamp;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};
use tokio::sync::watch;
use tokio::task::spawn_blocking;
use tokio::time::{MissedTickBehavior, interval, sleep};

/// What changes is shown so often.
const EVERY: Duration = Duration::from_millis(200);
/// The floor is drawn so often at most: it is told as a whole.
const FLOOR_EVERY: Duration = Duration::from_secs(2);

/// Whether anybody wants the floor to be drawn. Copies are one.
#[derive(Clone, Debug, Default)]
pub(crate) struct FloorWishes(Arc<AtomicUsize>);

/// Somebody wants it, until this is dropped.
#[derive(Debug)]
pub(crate) struct FloorWish(Arc<AtomicUsize>);

impl FloorWishes {
    pub(crate) fn wish(&self) -> FloorWish {
        self.0.fetch_add(1, Ordering::Relaxed);
        FloorWish(Arc::clone(&self.0))
    }

    fn has_any(&self) -> bool {
        self.0.load(Ordering::Relaxed) > 0
    }
}

impl Drop for FloorWish {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

/// A map and its robots, live.
pub(crate) struct LiveSite {
    replica: LiveReplica,
    outlook: watch::Sender<Arc<Outlook>>,
    wishes: FloorWishes,
}

impl LiveSite {
    pub(crate) fn new(replica: LiveReplica) -> Self {
        Self { replica, outlook: watch::Sender::default(), wishes: FloorWishes::default() }
    }

    /// What there is to tell. The sender is for those who add to it.
    pub(crate) fn outlook(&self) -> &watch::Sender<Arc<Outlook>> {
        &self.outlook
    }

    /// Whether anybody wants the floor to be drawn.
    pub(crate) fn wishes(&self) -> &FloorWishes {
        &self.wishes
    }

    /// Keeps the outlook up to date until nothing can be heard of the robots any more.
    pub(crate) async fn follow(&self, mut events: RobotEvents) {
        let (mut robots, mut shown) = (KnownRobots::default(), Shown::default());
        let mut tick = interval(EVERY);
        tick.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            tokio::select! {
                event = events.next() => match event {
                    Some(event) => robots.take(event, Instant::now()),
                    None => return,
                },
                _ = tick.tick() => {
                    robots.expire(Instant::now());
                    self.show(&robots, &mut shown);
                }
            }
        }
    }

    /// Renews what has changed.
    fn show(&self, robots: &KnownRobots, shown: &mut Shown) {
        let (changes, rules, robots) = (self.replica.changes(), self.replica.rules(), robots.now());
        let is_other = shown.changes != Some(changes) || !Arc::ptr_eq(&shown.rules, &rules);
        let map = is_other.then(|| {
            let state = self.replica.read().state().clone();
            // Not older than the state: what it closes that the state does not have yet comes with
            // the next one, which differs.
            let rules = self.replica.rules();
            *shown = Shown { changes: Some(changes), rules: Arc::clone(&rules) };
            Arc::new(MapScene { state, rules })
        });
        if map.is_none() && Arc::ptr_eq(&self.outlook.borrow().robots, &robots) {
            return;
        }
        self.outlook.send_modify(|now| {
            let map = map.unwrap_or_else(|| Arc::clone(&now.map));
            *now = Arc::new(Outlook { map, robots, ..Outlook::clone(now) });
        });
    }

    /// Draws the floor for ever, while anybody wants it and whenever the map has changed.
    pub(crate) async fn draw_floor(&self) {
        let (mut landmarks, mut drawn) = (Landmarks::default(), None::<Arc<MapScene>>);
        loop {
            sleep(FLOOR_EVERY).await;
            let map = Arc::clone(&self.outlook.borrow().map);
            let is_drawn = drawn.as_ref().is_some_and(|drawn| Arc::ptr_eq(drawn, &map));
            if is_drawn || !self.wishes.has_any() {
                continue;
            }
            drawn = Some(Arc::clone(&map));
            let drawing = spawn_blocking(move || {
                let floor = FloorDrawing::of(&map.state, &mut landmarks);
                (encoded(&floor_grid(floor, Timestamp::now())), landmarks)
            });
            match drawing.await {
                Ok((floor, kept)) => {
                    landmarks = kept;
                    let floor = Some(Arc::new(floor));
                    self.outlook.send_modify(|now| *now = Arc::new(Outlook { floor, ..Outlook::clone(now) }));
                }
                Err(error) => {
                    landmarks = Landmarks::default();
                    tracing::error!("the floor is not drawn: {error}");
                }
            }
        }
    }
}

/// What is shown of the map.
#[derive(Debug, Default)]
struct Shown {
    changes: Option<u64>,
    rules: Arc<Rules>,
}
