//! Writing bags that `ros2 bag`, Foxglove and every MCAP tool can read.

use super::metadata::{Durability, Written, metadata, offered_qos_profiles};
use fht_ros_messages::RosMessage;
use fht_ros_messages::cdr::{self, CdrError};
use fht_ros_messages::definition;
use mcap::records::{MessageHeader, Metadata};
use mcap::{Compression, WriteOptions};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::error::Error;
use std::fs::{File, OpenOptions};
use std::io::BufWriter;
use std::path::{Path, PathBuf};

/// Longest time between two chunks, microseconds of the log: at most this much is lost if the
/// program is killed.
const CHUNK_US: u64 = 10_000_000;

/// Why a bag cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// The file or folder exists already.
    #[error("{path} is there already; choose another name, or remove it")]
    Exists {
        /// The file or folder.
        path: PathBuf,
    },
    /// The file or folder cannot be created.
    #[error("cannot write {path}: {source}")]
    Create {
        /// The file or folder.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// Writing failed: the disk is full, or gone.
    #[error("cannot write {path}: {}", first_cause(source))]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: mcap::McapError,
    },
    /// A message cannot be serialized: a defect.
    #[error("a {type_name} cannot be written: {reason}")]
    Message {
        /// Its type.
        type_name: &'static str,
        /// Why.
        reason: String,
    },
}

/// What the system says: of a full disk the MCAP writer only says that writing failed.
fn first_cause(error: &mcap::McapError) -> &(dyn Error + 'static) {
    let mut cause: &(dyn Error + 'static) = error;
    while let Some(deeper) = cause.source() {
        cause = deeper;
    }
    cause
}

/// What was written.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct WriteReport {
    /// The file.
    pub file: PathBuf,
    /// Messages by topic.
    pub messages: BTreeMap<String, u64>,
    /// Bytes of the file.
    pub bytes: u64,
}

struct Channel {
    id: u16,
    type_name: &'static str,
    durability: Durability,
    messages: u32,
}

/// Writes one bag: a file whose name ends in `.mcap`, or else a folder like those of rosbag2.
/// Chunks are compressed with zstd and written whole, so a bag whose writer was killed can be read
/// up to its last chunk.
pub struct BagWriter {
    writer: mcap::Writer<BufWriter<File>>,
    file: PathBuf,
    /// The folder to put a `metadata.yaml` in.
    folder: Option<PathBuf>,
    channels: BTreeMap<String, Channel>,
    span_ns: Option<(u64, u64)>,
    chunk_begin_us: Option<u64>,
}

impl BagWriter {
    /// Starts a bag at `path`.
    ///
    /// # Errors
    /// [`WriteError`] when the file or folder exists already or cannot be created.
    pub fn create(path: &Path) -> Result<Self, WriteError> {
        let failed = |path: &Path| {
            let path = path.to_owned();
            move |source: std::io::Error| match source.kind() {
                std::io::ErrorKind::AlreadyExists => WriteError::Exists { path },
                _ => WriteError::Create { path, source },
            }
        };
        let is_file = path.extension().is_some_and(|ending| ending == "mcap");
        let (file, folder) = if is_file {
            (path.to_owned(), None)
        } else {
            std::fs::create_dir(path).map_err(failed(path))?;
            let name = path.file_name().map_or_else(|| "bag".into(), |name| name.to_string_lossy());
            (path.join(format!("{name}_0.mcap")), Some(path.to_owned()))
        };
        let stream = OpenOptions::new().write(true).create_new(true).open(&file).map_err(failed(&file))?;
        let writer = WriteOptions::new()
            .profile("ros2")
            .library(concat!("fht-map/", env!("CARGO_PKG_VERSION")))
            .compression(Some(Compression::Zstd))
            // Chunks are compressed while the robot computes: more threads would only compete with
            // it.
            .compression_threads(0)
            // The header of a chunk is not patched afterwards, so that what is on the disk is
            // complete.
            .disable_seeking(true)
            .create(BufWriter::new(stream))
            .map_err(|source| WriteError::Write { path: file.clone(), source })?;
        Ok(Self { writer, file, folder, channels: BTreeMap::new(), span_ns: None, chunk_begin_us: None })
    }

    /// Writes a message to `topic`, logged at `time_us`, microseconds since the epoch.
    ///
    /// # Errors
    /// [`WriteError`]; the messages written before can still be read.
    pub fn write<M: RosMessage + Serialize>(
        &mut self,
        topic: &str,
        durability: Durability,
        time_us: u64,
        message: &M,
    ) -> Result<(), WriteError> {
        let data = cdr::encode(message)
            .map_err(|error: CdrError| WriteError::Message { type_name: M::TYPE, reason: error.to_string() })?;
        let time_ns = time_us.saturating_mul(1000);
        let path = self.file.clone();
        let failed = |source| WriteError::Write { path, source };
        let channel = match self.channels.get_mut(topic) {
            Some(channel) => channel,
            None => {
                let channel = add_channel(&mut self.writer, topic, M::TYPE, durability).map_err(failed.clone())?;
                self.channels.entry(topic.to_owned()).or_insert(channel)
            }
        };
        let header = MessageHeader {
            channel_id: channel.id,
            sequence: channel.messages,
            log_time: time_ns,
            publish_time: time_ns,
        };
        channel.messages = channel.messages.wrapping_add(1);
        self.writer.write_to_known_channel(&header, &data).map_err(failed.clone())?;
        self.span_ns = Some(self.span_ns.map_or((time_ns, time_ns), |(a, b)| (a.min(time_ns), b.max(time_ns))));
        let begin_us = *self.chunk_begin_us.get_or_insert(time_us);
        if time_us.saturating_sub(begin_us) >= CHUNK_US {
            self.chunk_begin_us = None;
            self.writer.flush().map_err(failed)?;
        }
        Ok(())
    }

    /// Finishes the bag: index, summary, and the `metadata.yaml` of a folder.
    ///
    /// # Errors
    /// [`WriteError`]; the messages written before can still be read.
    pub fn finish(mut self) -> Result<WriteReport, WriteError> {
        let failed = |source| WriteError::Write { path: self.file.clone(), source };
        let topics: Vec<Written> = self
            .channels
            .iter()
            .map(|(name, channel)| Written {
                name: name.clone(),
                type_name: channel.type_name,
                durability: channel.durability,
                messages: u64::from(channel.messages),
            })
            .collect();
        let name = self.file.file_name().unwrap_or_default().to_string_lossy();
        let (inside, beside) = metadata(&name, self.span_ns, &topics);
        let metadata = BTreeMap::from([("serialized_metadata".to_owned(), inside)]);
        self.writer.write_metadata(&Metadata { name: "rosbag2".to_owned(), metadata }).map_err(failed)?;
        self.writer.finish().map_err(failed)?;
        let created = |path: &Path| {
            let path = path.to_owned();
            move |source| WriteError::Create { path, source }
        };
        if let Some(folder) = &self.folder {
            let path = folder.join("metadata.yaml");
            std::fs::write(&path, beside).map_err(created(&path))?;
        }
        let bytes = std::fs::metadata(&self.file).map_err(created(&self.file))?.len();
        let messages = topics.into_iter().map(|topic| (topic.name, topic.messages)).collect();
        Ok(WriteReport { file: self.file, messages, bytes })
    }
}

fn add_channel(
    writer: &mut mcap::Writer<BufWriter<File>>,
    topic: &str,
    type_name: &'static str,
    durability: Durability,
) -> Result<Channel, mcap::McapError> {
    let text = definition(type_name).unwrap_or_default();
    let schema = writer.add_schema(type_name, "ros2msg", text.as_bytes())?;
    let metadata = BTreeMap::from([("offered_qos_profiles".to_owned(), offered_qos_profiles(durability))]);
    let id = writer.add_channel(schema, topic, "cdr", &metadata)?;
    Ok(Channel { id, type_name, durability, messages: 0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_a_full_disk_it_is_said_that_it_is_full() {
        let full = std::io::Error::from(std::io::ErrorKind::StorageFull);
        let reason = full.to_string();
        let error = WriteError::Write { path: "run.mcap".into(), source: mcap::McapError::Io(full) };
        assert_eq!(error.to_string(), format!("cannot write run.mcap: {reason}"));
        let other = WriteError::Write { path: "run.mcap".into(), source: mcap::McapError::BadMagic };
        assert_eq!(other.to_string(), "cannot write run.mcap: Bad magic number");
    }
}
