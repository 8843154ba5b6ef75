//! Which topics of a bag hold what.

use super::msg::{CompressedImage, Image, LaserScan, Message, Odometry, TfMessage};
use super::survey::Topic;

/// The topics to read. What is `None` is found: the default name if it is there, or the only topic of the type.
#[derive(Clone, Debug)]
pub struct TopicConfig {
    /// Scans. `/scan`.
    pub scan: Option<String>,
    /// Odometry; a topic of transforms is as good. `/odom`, or the transforms of `tf`.
    pub odometry: Option<String>,
    /// Moving transforms. `/tf`.
    pub tf: String,
    /// Fixed transforms. `/tf_static`.
    pub tf_static: String,
    /// Cameras ahead, left, behind, right; `NAME/compressed` is looked for too. `None` reads no pictures.
    /// `/camera_front/image`, `/camera_left/image`, `/camera_back/image`, `/camera_right/image`.
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

/// The cameras' names: ahead, left, behind, right.
pub(super) const CAMERAS: [&str; 4] = ["front", "left", "back", "right"];

/// A bag's topics are not those that are needed.
#[derive(Debug, thiserror::Error)]
pub enum TopicError {
    /// There is no topic of that type.
    #[error("the bag has no {wanted} (topics: {there})")]
    None {
        /// The type that is needed.
        wanted: &'static str,
        /// The topics that there are.
        there: String,
    },
    /// There are several of that type and none has the usual name.
    #[error("the bag has several topics of type {wanted}: {there}; choose one with --{flag}")]
    Several {
        /// The type that is needed.
        wanted: &'static str,
        /// The topics of that type.
        there: String,
        /// The flag that chooses.
        flag: &'static str,
    },
    /// The topic that was asked for is not there.
    #[error("the bag has no topic {name} (topics: {there})")]
    Missing {
        /// The topic that was asked for.
        name: String,
        /// The topics that there are.
        there: String,
    },
    /// The topic that was asked for holds something else.
    #[error("topic {name} holds {holds}, not {wanted}")]
    Type {
        /// The topic.
        name: String,
        /// Its type.
        holds: String,
        /// The type that is needed.
        wanted: &'static str,
    },
    /// The topic is not serialized as ROS 2 does it.
    #[error("topic {name} is serialized as '{encoding}'; only cdr (ROS 2) is read")]
    Encoding {
        /// The topic.
        name: String,
        /// How it is serialized.
        encoding: String,
    },
}

/// Where odometry comes from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum OdometrySource {
    Messages(String),
    Transforms,
}

/// The topics that are read.
#[derive(Clone, Debug)]
pub(super) struct Chosen {
    pub(super) scan: String,
    pub(super) odometry: OdometrySource,
    pub(super) cameras: Option<[String; 4]>,
    /// What was chosen without having been asked for, as sentences.
    pub(super) notes: Vec<String>,
}

pub(super) fn choose(topics: &[Topic], config: &TopicConfig) -> Result<Chosen, TopicError> {
    let mut notes = Vec::new();
    let scan = one::<LaserScan>(topics, config.scan.as_deref(), "/scan", "scan-topic", &mut notes)?;
    let has_tf = topics.iter().any(|topic| topic.name == config.tf && topic.type_name == TfMessage::TYPE);
    let odometry = match one::<Odometry>(topics, config.odometry.as_deref(), "/odom", "odom-topic", &mut notes) {
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

fn names<'a>(topics: impl Iterator<Item = &'a Topic>) -> String {
    topics.map(|topic| topic.name.as_str()).collect::<Vec<_>>().join(", ")
}

fn one<M: Message>(
    topics: &[Topic],
    asked: Option<&str>,
    usual: &'static str,
    flag: &'static str,
    notes: &mut Vec<String>,
) -> Result<String, TopicError> {
    let fitting: Vec<&Topic> = topics.iter().filter(|topic| topic.type_name == M::TYPE).collect();
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
fn cameras(topics: &[Topic], wanted: &[String; 4], notes: &mut Vec<String>) -> Option<[String; 4]> {
    let is_picture = |topic: &Topic| topic.type_name == Image::TYPE || topic.type_name == CompressedImage::TYPE;
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
