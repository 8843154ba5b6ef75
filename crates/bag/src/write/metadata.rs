//! The metadata of rosbag2: `metadata.yaml`, and quality of service by topic.
//!
//! Writes version 5 of the format, which every supported ROS 2 distribution reads.

use serde::Serialize;

/// Version of the format.
const VERSION: u32 = 5;

/// Whether late subscribers get the last message (REP-2003: maps and fixed transforms do).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Durability {
    /// They get it.
    TransientLocal,
    /// They do not get it.
    Volatile,
}

#[derive(Serialize)]
struct Span {
    sec: u64,
    nsec: u64,
}

impl Span {
    /// The middleware's infinite duration.
    const INFINITE: Self = Self { sec: 9_223_372_036, nsec: 854_775_807 };
}

/// Numbers as in `rmw/types.h`.
#[derive(Serialize)]
struct Profile {
    history: u8,
    depth: u32,
    reliability: u8,
    durability: u8,
    deadline: Span,
    lifespan: Span,
    liveliness: u8,
    liveliness_lease_duration: Span,
    avoid_ros_namespace_conventions: bool,
}

/// The quality of service offered for a topic: reliable, keeping the last 1 (transient-local) or 10
/// messages.
pub(crate) fn offered_qos_profiles(durability: Durability) -> String {
    let (durability, depth) = match durability {
        Durability::TransientLocal => (1, 1),
        Durability::Volatile => (2, 10),
    };
    yaml(&[Profile {
        history: 1,
        depth,
        reliability: 1,
        durability,
        deadline: Span::INFINITE,
        lifespan: Span::INFINITE,
        liveliness: 1,
        liveliness_lease_duration: Span::INFINITE,
        avoid_ros_namespace_conventions: false,
    }])
}

#[derive(Clone, Serialize)]
struct Nanoseconds {
    nanoseconds: u64,
}

#[derive(Clone, Serialize)]
struct Start {
    nanoseconds_since_epoch: u64,
}

#[derive(Clone, Serialize)]
struct TopicMetadata {
    name: String,
    #[serde(rename = "type")]
    type_name: String,
    serialization_format: &'static str,
    offered_qos_profiles: String,
}

#[derive(Clone, Serialize)]
struct TopicCount {
    topic_metadata: TopicMetadata,
    message_count: u64,
}

#[derive(Clone, Serialize)]
struct FileInformation {
    path: String,
    starting_time: Start,
    duration: Nanoseconds,
    message_count: u64,
}

#[derive(Clone, Serialize)]
struct Information {
    version: u32,
    storage_identifier: &'static str,
    duration: Nanoseconds,
    starting_time: Start,
    message_count: u64,
    topics_with_message_count: Vec<TopicCount>,
    compression_format: &'static str,
    compression_mode: &'static str,
    relative_file_paths: Vec<String>,
    files: Vec<FileInformation>,
}

#[derive(Serialize)]
struct Metadata {
    rosbag2_bagfile_information: Information,
}

/// A topic that was written.
pub(crate) struct Written {
    pub(crate) name: String,
    pub(crate) type_name: &'static str,
    pub(crate) durability: Durability,
    pub(crate) messages: u64,
}

/// The metadata of a bag with one file: for the file itself, and for the `metadata.yaml` next to
/// it.
pub(crate) fn metadata(file_name: &str, span_ns: Option<(u64, u64)>, topics: &[Written]) -> (String, String) {
    let (start_ns, end_ns) = span_ns.unwrap_or_default();
    let starting_time = Start { nanoseconds_since_epoch: start_ns };
    let duration = Nanoseconds { nanoseconds: end_ns.saturating_sub(start_ns) };
    let message_count = topics.iter().map(|topic| topic.messages).sum();
    let topics = topics.iter().map(|topic| TopicCount {
        topic_metadata: TopicMetadata {
            name: topic.name.clone(),
            type_name: topic.type_name.to_owned(),
            serialization_format: "cdr",
            offered_qos_profiles: offered_qos_profiles(topic.durability),
        },
        message_count: topic.messages,
    });
    let information = Information {
        version: VERSION,
        storage_identifier: "mcap",
        duration: duration.clone(),
        starting_time: starting_time.clone(),
        message_count,
        topics_with_message_count: topics.collect(),
        compression_format: "",
        compression_mode: "",
        relative_file_paths: vec![file_name.to_owned()],
        files: vec![FileInformation { path: file_name.to_owned(), starting_time, duration, message_count }],
    };
    (yaml(&information), yaml(&Metadata { rosbag2_bagfile_information: information.clone() }))
}

/// Plain data can always be written as YAML.
fn yaml<T: Serialize>(value: &T) -> String {
    serde_saphyr::to_string(value).unwrap_or_default()
}
