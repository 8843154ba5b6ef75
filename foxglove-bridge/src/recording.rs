//! All channels as an MCAP file, as a viewer that wants everything is told them.

use crate::channel::{BridgeChannel, ENCODING};
use crate::outlook::ChannelMessage;
use mcap::records::MessageHeader;
use mcap::{Compression, McapError, WriteOptions};
use std::collections::BTreeMap;
use std::error::Error;
use std::fs::{File, OpenOptions};
use std::io::BufWriter;
use std::path::{Path, PathBuf};

/// Longest time between two chunks, nanoseconds: so much is lost if the program is killed.
const CHUNK_NS: u64 = 10_000_000_000;

/// Why nothing is recorded.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// The file cannot be made.
    #[error("--record {}: {source}", file.display())]
    Create {
        /// The file.
        file: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The disk is full, or gone.
    #[error("--record {}: {}", file.display(), first_cause(source))]
    Write {
        /// The file.
        file: PathBuf,
        /// Why.
        source: McapError,
    },
}

/// What the system says: of a full disk the MCAP writer only says that writing failed.
fn first_cause(error: &McapError) -> &(dyn Error + 'static) {
    let mut cause: &(dyn Error + 'static) = error;
    while let Some(deeper) = cause.source() {
        cause = deeper;
    }
    cause
}

/// A file that is being written. Chunks are written whole, so that one whose writer was killed can
/// be read up to its last chunk.
pub(crate) struct Recording {
    file: PathBuf,
    writer: mcap::Writer<BufWriter<File>>,
    /// The file's channels, and how many messages of each there are.
    channels: BTreeMap<BridgeChannel, (u16, u32)>,
    chunk_begin_ns: Option<u64>,
}

impl Recording {
    /// Begins a new file.
    ///
    /// # Errors
    /// [`RecordError`], also if it is there already.
    pub(crate) fn create(file: &Path) -> Result<Self, RecordError> {
        let created = OpenOptions::new().write(true).create_new(true).open(file);
        let stream = created.map_err(|source| RecordError::Create { file: file.to_owned(), source })?;
        let failed = |source| RecordError::Write { file: file.to_owned(), source };
        let mut writer = WriteOptions::new()
            .library(concat!("fht-map/", env!("CARGO_PKG_VERSION")))
            .compression(Some(Compression::Zstd))
            .compression_threads(0)
            .disable_seeking(true)
            .create(BufWriter::new(stream))
            .map_err(failed)?;
        let mut channels = BTreeMap::new();
        for channel in BridgeChannel::ALL {
            let schema = channel.schema();
            let schema = schema.map(|it| writer.add_schema(&it.name, &it.encoding, &it.data)).transpose();
            let id = schema.and_then(|schema| {
                writer.add_channel(schema.unwrap_or_default(), channel.topic(), ENCODING, &BTreeMap::new())
            });
            channels.insert(channel, (id.map_err(failed)?, 0));
        }
        Ok(Self { file: file.to_owned(), writer, channels, chunk_begin_ns: None })
    }

    fn failed(&self) -> impl FnOnce(McapError) -> RecordError + use<> {
        let file = self.file.clone();
        move |source| RecordError::Write { file, source }
    }

    /// Adds a message.
    ///
    /// # Errors
    /// [`RecordError::Write`].
    pub(crate) fn write(&mut self, message: &ChannelMessage) -> Result<(), RecordError> {
        let failed = self.failed();
        let Some((channel_id, count)) = self.channels.get_mut(&message.channel) else { return Ok(()) };
        let (log_time, sequence) = (message.at_ns, *count);
        *count = count.wrapping_add(1);
        let header = MessageHeader { channel_id: *channel_id, sequence, log_time, publish_time: log_time };
        let begin_ns = *self.chunk_begin_ns.get_or_insert(log_time);
        let written = self.writer.write_to_known_channel(&header, &message.bytes);
        let written = written.and_then(|()| {
            if log_time.saturating_sub(begin_ns) < CHUNK_NS {
                return Ok(());
            }
            self.chunk_begin_ns = None;
            self.writer.flush()
        });
        written.map_err(failed)
    }

    /// Ends the file.
    ///
    /// # Errors
    /// [`RecordError::Write`].
    pub(crate) fn finish(mut self) -> Result<(), RecordError> {
        let failed = self.failed();
        self.writer.finish().map_err(failed)?;
        Ok(())
    }
}
