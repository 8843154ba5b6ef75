//! What there is to tell now, and what one receiver has been told of it.

use crate::channel::{BridgeChannel, encoded};
use crate::scene::{MapProgress, MapScene, RobotProgress, RobotsNow, poses, transforms};
use foxglove::messages::Timestamp;
use std::sync::Arc;

/// What there is to tell now. Parts that have not changed are the same ones.
#[derive(Clone, Debug, Default)]
pub(crate) struct Outlook {
    pub(crate) map: Arc<MapScene>,
    pub(crate) robots: Arc<RobotsNow>,
    /// The floor as a message.
    pub(crate) floor: Option<Arc<Vec<u8>>>,
    /// The path that was asked for last, as a message.
    pub(crate) path: Option<Arc<Vec<u8>>>,
}

/// A message of a channel.
#[derive(Debug, PartialEq)]
pub(crate) struct ChannelMessage {
    pub(crate) channel: BridgeChannel,
    /// Nanoseconds since 1970.
    pub(crate) at_ns: u64,
    pub(crate) bytes: Vec<u8>,
}

/// What one receiver has been told on the channels that it wants. Nothing waits for one that is
/// slow: what comes next is made when it can be taken.
#[derive(Debug, Default)]
pub(crate) struct Progress {
    map: Option<MapProgress>,
    robots: Option<RobotProgress>,
    poses: Option<Option<u64>>,
    transforms: Option<u64>,
    floor: Option<Option<Arc<Vec<u8>>>>,
    path: Option<Option<Arc<Vec<u8>>>>,
}

impl Progress {
    /// Of a receiver that wants everything.
    pub(crate) fn of_everything() -> Self {
        let mut progress = Self::default();
        BridgeChannel::ALL.into_iter().for_each(|channel| progress.want(channel, true));
        progress
    }

    /// Whether a channel is wanted, from its beginning.
    pub(crate) fn want(&mut self, channel: BridgeChannel, is_wanted: bool) {
        match channel {
            BridgeChannel::MapScene => self.map = is_wanted.then(MapProgress::default),
            BridgeChannel::RobotScene => self.robots = is_wanted.then(RobotProgress::default),
            BridgeChannel::Poses => self.poses = is_wanted.then_some(None),
            BridgeChannel::Transforms => self.transforms = is_wanted.then_some(0),
            BridgeChannel::Floor => self.floor = is_wanted.then_some(None),
            BridgeChannel::Path => self.path = is_wanted.then_some(None),
        }
    }

    /// What is to be told next; `None` when all has been told.
    pub(crate) fn next(&mut self, now: &Outlook) -> Option<ChannelMessage> {
        let at = Timestamp::now();
        let message = |channel, bytes| Some(ChannelMessage { channel, at_ns: at.total_nanos(), bytes });
        let change = now.robots.change;
        // What moves comes before what is large.
        if let Some(told) = self.transforms.as_mut().filter(|told| **told != change) {
            let since = std::mem::replace(told, change);
            if let Some(moved) = transforms(&now.robots, since, at) {
                return message(BridgeChannel::Transforms, encoded(&moved));
            }
        }
        if let Some(told) = self.poses.as_mut().filter(|told| **told != Some(change)) {
            *told = Some(change);
            return message(BridgeChannel::Poses, encoded(&poses(&now.robots, at)));
        }
        if let Some(update) = self.robots.as_mut().and_then(|robots| robots.next(&now.robots, at)) {
            return message(BridgeChannel::RobotScene, encoded(&update));
        }
        for (told, newest, channel) in
            [(&mut self.path, &now.path, BridgeChannel::Path), (&mut self.floor, &now.floor, BridgeChannel::Floor)]
        {
            if let (Some(told), Some(bytes)) = (told, newest)
                && !told.as_ref().is_some_and(|told| Arc::ptr_eq(told, bytes))
            {
                *told = Some(Arc::clone(bytes));
                return message(channel, bytes.to_vec());
            }
        }
        let update = self.map.as_mut()?.next(&now.map, at)?;
        message(BridgeChannel::MapScene, encoded(&update))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_receiver_is_told_each_thing_once_and_only_what_it_wants() {
        let path = Some(Arc::new(vec![7]));
        let now = Outlook { path, ..Outlook::default() };
        let told = |progress: &mut Progress| -> Vec<BridgeChannel> {
            std::iter::from_fn(|| progress.next(&now)).map(|message| message.channel).collect()
        };
        let mut all = Progress::of_everything();
        let (poses, robots) = (BridgeChannel::Poses, BridgeChannel::RobotScene);
        assert_eq!(told(&mut all), [poses, robots, BridgeChannel::Path, BridgeChannel::MapScene]);
        assert_eq!(told(&mut all), []);
        all.want(BridgeChannel::Path, true);
        assert_eq!(told(&mut all), [BridgeChannel::Path], "from its beginning");
        let mut nothing = Progress::default();
        assert_eq!(told(&mut nothing), []);
        nothing.want(poses, true);
        nothing.want(poses, false);
        assert_eq!(told(&mut nothing), []);
    }
}
