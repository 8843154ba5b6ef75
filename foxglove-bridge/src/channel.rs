//! What is told on which channel, and with which schema.

use foxglove::messages::{FrameTransforms, Grid, PosesInFrame, SceneUpdate};
use foxglove::{Encode, Schema};

/// How messages are encoded.
pub(crate) const ENCODING: &str = "protobuf";

/// A channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum BridgeChannel {
    /// What is on the map.
    MapScene,
    /// The map's floor.
    Floor,
    /// The robots.
    RobotScene,
    /// Where the robots are that know it.
    Poses,
    /// Their frames.
    Transforms,
    /// The path that was asked for last.
    Path,
}

impl BridgeChannel {
    pub(crate) const ALL: [Self; 6] =
        [Self::MapScene, Self::Floor, Self::RobotScene, Self::Poses, Self::Transforms, Self::Path];

    /// Its number, from 1.
    pub(crate) fn id(self) -> u32 {
        self as u32 + 1
    }

    /// The channel of a number.
    pub(crate) fn of(id: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|channel| channel.id() == id)
    }

    pub(crate) fn topic(self) -> &'static str {
        match self {
            Self::MapScene => "/map/scene",
            Self::Floor => "/map/grid",
            Self::RobotScene => "/robots/scene",
            Self::Poses => "/robots/poses",
            Self::Transforms => "/tf",
            Self::Path => "/path",
        }
    }

    /// Its messages' schema; all of Foxglove's own have one.
    pub(crate) fn schema(self) -> Option<Schema> {
        match self {
            Self::MapScene | Self::RobotScene => SceneUpdate::get_schema(),
            Self::Floor => Grid::get_schema(),
            Self::Poses | Self::Path => PosesInFrame::get_schema(),
            Self::Transforms => FrameTransforms::get_schema(),
        }
    }
}

/// A message as it travels. It cannot fail: a vector grows.
pub(crate) fn encoded<T: Encode>(message: &T) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(message.encoded_len().unwrap_or_default());
    if let Err(error) = message.encode(&mut bytes) {
        tracing::error!("a message is not encoded: {error}");
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::link::ServiceKind;
    use serde_json::Value;

    #[test]
    fn the_layout_shows_what_there_is() {
        let layout: Value =
            serde_json::from_str(include_str!("../layout.json")).unwrap_or_else(|error| panic!("{error}"));
        let panels = layout["configById"].as_object().unwrap_or_else(|| panic!("panels"));
        let topics = panels["3D!map"]["topics"].as_object().unwrap_or_else(|| panic!("topics"));
        for topic in topics.keys() {
            assert!(BridgeChannel::ALL.iter().any(|channel| channel.topic() == topic), "{topic}");
        }
        for service in ["/path", "/places"] {
            assert!(panels.values().any(|panel| panel["serviceName"] == service), "{service}");
            assert!(ServiceKind::ALL.iter().any(|kind| kind.name() == service), "{service}");
        }
    }

    #[test]
    fn channels_have_numbers_names_and_schemas() {
        for channel in BridgeChannel::ALL {
            assert_eq!(BridgeChannel::of(channel.id()), Some(channel));
            let schema = channel.schema();
            assert!(schema.is_some_and(|schema| schema.name.starts_with("foxglove.") && schema.encoding == ENCODING));
        }
        assert_eq!((BridgeChannel::of(0), BridgeChannel::of(7)), (None, None));
    }
}
