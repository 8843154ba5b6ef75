//! Which topics of a bag to read.

use super::survey::BagTopic;
use fht_ros_frames::CAMERAS;
use fht_ros_messages::RosMessage;
use fht_ros_messages::msg::{CompressedImage, Image, LaserScanMsg, OdometryMsg, TfMessage};
use serde::{Deserialize, Serialize};

/// The topics to read. A topic that is `None` is found: by its default name, or as the only topic
/// of its type.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct TopicConfig {
    /// Scans. `/scan`.
    pub scan: Option<String>,
    /// Odometry, or a topic of transforms. `/odom`, or the transforms of `tf`.
    pub odometry: Option<String>,
    /// Moving transforms. `/tf`.
    pub tf: String,
    /// Fixed transforms. `/tf_static`.
    pub tf_static: String,
    /// Cameras ahead, left, behind, right; `NAME/compressed` is accepted too. `None` reads no
    /// pictures. `/camera_front/image`, `/camera_left/image`, `/camera_back/image`,
    /// `/camera_right/image`.
    pub cameras: Option<[String; 4]>,
}

impl Default for TopicConfig {
    fn default() -> Self {
        Self {
            scan: None,
            odometry: None,
            tf: "/tf".to_owned(),
            tf_static: "/tf_static".to_owned(),
            cameras: Some(CAMERAS.map(|name| format!("/camera_{name}/image"))),
        }
    }
}

/// Why a bag's topics cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum TopicError {
    /// There is no topic of that type.
    #[error("the bag has no {wanted} (topics: {there})")]
    None {
        /// The type that is needed.
        wanted: &'static str,
        /// The topics in the bag.
        there: String,
    },
    /// There are several topics of that type, and none has the default name.
    #[error("the bag has several topics of type {wanted}: {there}; choose one with --{flag}")]
    Several {
        /// The type that is needed.
        wanted: &'static str,
        /// The topics of that type.
        there: String,
        /// The flag that chooses one.
        flag: &'static str,
    },
    /// The requested topic does not exist.
    #[error("the bag has no topic {name} (topics: {there})")]
    Missing {
        /// The requested topic.
        name: String,
        /// The topics in the bag.
        there: String,
    },
    /// The requested topic has another type.
    #[error("topic {name} holds {holds}, not {wanted}")]
    Type {
        /// The topic.
        name: String,
        /// Its type.
        holds: String,
        /// The type that is needed.
        wanted: &'static str,
    },
    /// The topic is not serialized as in ROS 2.
    #[error("topic {name} is serialized as '{encoding}'; only cdr (ROS 2) is read")]
    Encoding {
        /// The topic.
        name: String,
        /// Its encoding.
        encoding: String,
    },
}

/// Where odometry comes from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum OdometrySource {
    Messages(String),
    Transforms,
}

/// The topics chosen for reading.
#[derive(Clone, Debug)]
pub(crate) struct Chosen {
    pub(crate) scan: String,
    pub(crate) odometry: OdometrySource,
    pub(crate) cameras: Option<[String; 4]>,
    /// Choices that were not requested, as sentences.
    pub(crate) notes: Vec<String>,
}

pub(crate) fn choose(topics: &[BagTopic], config: &TopicConfig) -> Result<Chosen, TopicError> {
    let mut notes = Vec::new();
    let scan = one::<LaserScanMsg>(topics, config.scan.as_deref(), "/scan", "scan-topic", &mut notes)?;
    let has_tf = topics.iter().any(|topic| topic.name == config.tf && topic.type_name == TfMessage::TYPE);
    let odometry = match one::<OdometryMsg>(topics, config.odometry.as_deref(), "/odom", "odom-topic", &mut notes) {
        Ok(name) => OdometrySource::Messages(name),
        Err(TopicError::None { .. }) if has_tf => {
            notes.push(format!("there is no odometry topic: the transforms of {} are used", config.tf));
            OdometrySource::Transforms
        }
        Err(TopicError::Type { name, holds, .. }) if name == config.tf && holds == TfMessage::TYPE => {
            OdometrySource::Transforms
        }
        Err(error) => return Err(error),
    };
    let cameras = config.cameras.as_ref().and_then(|names| cameras(topics, names, &mut notes));
    Ok(Chosen { scan, odometry, cameras, notes })
}

fn names<'a>(topics: impl Iterator<Item = &'a BagTopic>) -> String {
    let names: Vec<&str> = topics.map(|topic| topic.name.as_str()).collect();
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}

fn one<M: RosMessage>(
    topics: &[BagTopic],
    asked: Option<&str>,
    usual: &'static str,
    flag: &'static str,
    notes: &mut Vec<String>,
) -> Result<String, TopicError> {
    let fitting: Vec<&BagTopic> = topics.iter().filter(|topic| topic.type_name == M::TYPE).collect();
    let chosen = match asked {
        Some(name) => match fitting.iter().find(|topic| topic.name == name) {
            Some(topic) => topic,
            None => {
                return Err(match topics.iter().find(|topic| topic.name == name) {
                    Some(other) => {
                        TopicError::Type { name: name.to_owned(), holds: other.type_name.clone(), wanted: M::TYPE }
                    }
                    None => TopicError::Missing { name: name.to_owned(), there: names(topics.iter()) },
                });
            }
        },
        None => match (fitting.iter().find(|topic| topic.name == usual), fitting.as_slice()) {
            (Some(topic), _) => topic,
            (None, []) => return Err(TopicError::None { wanted: M::TYPE, there: names(topics.iter()) }),
            (None, [topic]) => {
                notes.push(format!("there is no {usual}: {} is used, the only {}", topic.name, M::TYPE));
                topic
            }
            (None, several) => {
                return Err(TopicError::Several { wanted: M::TYPE, there: names(several.iter().copied()), flag });
            }
        },
    };
    if chosen.encoding != "cdr" {
        return Err(TopicError::Encoding { name: chosen.name.clone(), encoding: chosen.encoding.clone() });
    }
    Ok(chosen.name.clone())
}

/// All four cameras, or none.
fn cameras(topics: &[BagTopic], wanted: &[String; 4], notes: &mut Vec<String>) -> Option<[String; 4]> {
    let is_picture = |topic: &BagTopic| topic.type_name == Image::TYPE || topic.type_name == CompressedImage::TYPE;
    let found = wanted.each_ref().map(|name| {
        let compressed = format!("{name}/compressed");
        let mut there =
            topics.iter().filter(|topic| is_picture(topic) && topic.encoding == "cdr" && topic.messages > 0);
        there.find(|topic| topic.name == *name || topic.name == compressed).map(|topic| topic.name.clone())
    });
    let missing: Vec<&str> =
        wanted.iter().zip(&found).filter(|(_, found)| found.is_none()).map(|(name, _)| name.as_str()).collect();
    if !missing.is_empty() {
        if topics.iter().any(is_picture) {
            notes.push(format!("pictures are not used, since these topics are missing: {}", missing.join(", ")));
        }
        return None;
    }
    let [Some(front), Some(left), Some(back), Some(right)] = found else { return None };
    Some([front, left, back, right])
}
