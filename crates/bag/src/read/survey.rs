//! What is in a bag, and whether all of it can be read.

use super::files::{BagOpenError, files_of};
use super::stream::{Broken, Messages, RECORD_LIMIT};
use mcap::sans_io::{SummaryReadEvent, SummaryReader, SummaryReaderOptions};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Read, Seek};
use std::path::{Path, PathBuf};

/// A topic of a bag.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct BagTopic {
    /// Its name.
    pub name: String,
    /// The type of its messages, such as `sensor_msgs/msg/LaserScan`.
    pub type_name: String,
    /// How its messages are serialized; `cdr` in ROS 2.
    pub encoding: String,
    /// Number of messages.
    pub messages: u64,
}

/// What is in a bag.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct BagInfo {
    /// Its files, in order.
    pub files: Vec<PathBuf>,
    /// Bytes of all files.
    pub bytes: u64,
    /// Messages of all topics.
    pub messages: u64,
    /// When the first message was logged, nanoseconds since the epoch.
    pub start_ns: Option<u64>,
    /// When the last message was logged, nanoseconds since the epoch.
    pub end_ns: Option<u64>,
    /// Topics by name.
    pub topics: Vec<BagTopic>,
    /// Files that cannot be read to the end. [`survey`] does not check those with a summary.
    pub broken: Vec<Broken>,
}

/// Surveys the bag at `path`. Files that were closed properly have a summary, which is used; others
/// are read in full.
///
/// # Errors
/// [`BagOpenError`] when there is no bag.
pub fn survey(path: &Path) -> Result<BagInfo, BagOpenError> {
    look_at(path, |tally, file, summary| match summary {
        Some(summary) => tally.add_summary(&summary),
        None => tally.read_through(file),
    })
}

/// Surveys the bag at `path`, and reads all of its files to their ends: chunks are unpacked, and
/// their checksums compared. Messages are counted that can be read.
///
/// # Errors
/// [`BagOpenError`] when there is no bag.
pub fn examine(path: &Path) -> Result<BagInfo, BagOpenError> {
    look_at(path, |tally, file, summary| {
        // A topic may have no messages.
        summary.iter().flat_map(|summary| summary.channels.values()).for_each(|channel| tally.add(channel, 0));
        tally.read_through(file);
    })
}

/// What is in the bag at `path`, where `take` takes in a file and its summary, if that has one.
fn look_at(path: &Path, take: impl Fn(&mut Tally, &Path, Option<mcap::Summary>)) -> Result<BagInfo, BagOpenError> {
    let files = files_of(path)?;
    let mut tally = Tally::default();
    let mut bytes = 0;
    let mut mcap_files = 0;
    for path in &files {
        let mut file = File::open(path).map_err(BagOpenError::read(path))?;
        bytes += file.metadata().map_err(BagOpenError::read(path))?.len();
        let mut magic = [0; mcap::MAGIC.len()];
        mcap_files += u32::from(file.read_exact(&mut magic).is_ok() && magic == *mcap::MAGIC);
        take(&mut tally, path, summary(&mut file));
    }
    if mcap_files == 0 {
        return Err(BagOpenError::NotMcap { path: files.into_iter().next().unwrap_or_else(|| path.to_owned()) });
    }
    Ok(BagInfo {
        bytes,
        messages: tally.topics.values().sum(),
        start_ns: tally.start_ns,
        end_ns: tally.end_ns,
        topics: tally.topics.into_iter().map(|(topic, messages)| BagTopic { messages, ..topic }).collect(),
        broken: tally.broken,
        files,
    })
}

#[derive(Default)]
struct Tally {
    /// Messages of each topic; the keys' own counts are 0.
    topics: BTreeMap<BagTopic, u64>,
    start_ns: Option<u64>,
    end_ns: Option<u64>,
    broken: Vec<Broken>,
}

impl Tally {
    fn add(&mut self, channel: &mcap::Channel<'_>, messages: u64) {
        let type_name = channel.schema.as_ref().map(|schema| schema.name.clone()).unwrap_or_default();
        let encoding = channel.message_encoding.clone();
        let topic = BagTopic { name: channel.topic.clone(), type_name, encoding, messages: 0 };
        *self.topics.entry(topic).or_default() += messages;
    }

    fn span(&mut self, start_ns: u64, end_ns: u64) {
        self.start_ns = Some(self.start_ns.map_or(start_ns, |start| start.min(start_ns)));
        self.end_ns = Some(self.end_ns.map_or(end_ns, |end| end.max(end_ns)));
    }

    fn add_summary(&mut self, summary: &mcap::Summary) {
        let Some(statistics) = &summary.stats else { return };
        for (id, channel) in &summary.channels {
            self.add(channel, statistics.channel_message_counts.get(id).copied().unwrap_or(0));
        }
        if statistics.message_count > 0 {
            self.span(statistics.message_start_time, statistics.message_end_time);
        }
    }

    fn read_through(&mut self, path: &Path) {
        let mut messages = Messages::of_files(vec![path.to_owned()]);
        for message in &mut messages {
            self.add(&message.channel, 1);
            self.span(message.log_time, message.log_time);
        }
        self.broken.extend_from_slice(messages.broken());
    }
}

/// The summary at the end of a file; `None` if there is none that can be used.
fn summary(file: &mut File) -> Option<mcap::Summary> {
    let options = SummaryReaderOptions::default()
        .with_file_size(file.metadata().ok()?.len())
        .with_record_length_limit(RECORD_LIMIT);
    let mut reader = SummaryReader::new_with_options(options);
    while let Some(event) = reader.next_event() {
        match event.ok()? {
            SummaryReadEvent::ReadRequest(bytes) => {
                let read = file.read(reader.insert(bytes)).ok()?;
                reader.notify_read(read);
            }
            SummaryReadEvent::SeekRequest(to) => {
                let place = file.seek(to).ok()?;
                reader.notify_seeked(place);
            }
        }
    }
    // A summary may omit statistics or channels; such a summary is of no use here.
    reader
        .finish()
        .filter(|summary| summary.stats.as_ref().is_some_and(|s| s.message_count == 0 || !summary.channels.is_empty()))
}
