//! The files of a bag, in the order in which they are read.

use serde::Deserialize;
use std::path::{Path, PathBuf};

/// Largest `metadata.yaml` that is read, bytes.
const METADATA_LIMIT: u64 = 16 << 20;

/// Why a bag cannot be opened.
#[derive(Debug, thiserror::Error)]
pub enum BagOpenError {
    /// A file or folder cannot be read.
    #[error("cannot read {path}: {source}")]
    Read {
        /// The file or folder.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The folder's `metadata.yaml` makes no sense.
    #[error("{path} does not describe a bag: {reason}")]
    Metadata {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// The bag is not stored as MCAP.
    #[error("{path} is stored as {storage}; only MCAP is read ('ros2 bag convert' makes MCAP of it)")]
    Storage {
        /// The bag.
        path: PathBuf,
        /// Its storage format.
        storage: String,
    },
    /// Whole files or single messages are compressed; only MCAP's own compressed chunks are
    /// supported.
    #[error(
        "{path} was recorded with compression mode {mode}; only MCAP's own compressed chunks are read ('ros2 bag convert' \
         rewrites it)"
    )]
    Compressed {
        /// The bag.
        path: PathBuf,
        /// `FILE` or `MESSAGE`.
        mode: String,
    },
    /// The folder has no MCAP files.
    #[error("{path} has neither a metadata.yaml nor a file that ends in .mcap")]
    Empty {
        /// The folder.
        path: PathBuf,
    },
    /// The file does not start like an MCAP file.
    #[error("{path} is not an MCAP file")]
    NotMcap {
        /// The file.
        path: PathBuf,
    },
}

impl BagOpenError {
    pub(crate) fn read(path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Read { path, source }
    }
}

#[derive(Deserialize)]
struct Metadata {
    rosbag2_bagfile_information: Information,
}

/// The keys of a `metadata.yaml` that are used; the others are ignored, so that every version can
/// be read.
#[derive(Deserialize)]
struct Information {
    storage_identifier: String,
    #[serde(default)]
    compression_mode: String,
    relative_file_paths: Vec<PathBuf>,
}

/// The MCAP files of the bag at `path`: a file, a folder with the `metadata.yaml` of rosbag2, or a
/// folder of MCAP files, which are taken in the order of their names (`run_2` before `run_10`).
///
/// # Errors
/// [`BagOpenError`].
pub fn files_of(path: &Path) -> Result<Vec<PathBuf>, BagOpenError> {
    let about = std::fs::metadata(path).map_err(BagOpenError::read(path))?;
    if !about.is_dir() {
        return match path.extension().and_then(|ending| ending.to_str()) {
            Some("db3") => Err(BagOpenError::Storage { path: path.to_owned(), storage: "sqlite3".to_owned() }),
            Some("bag") => Err(BagOpenError::Storage { path: path.to_owned(), storage: "a ROS 1 bag".to_owned() }),
            _ => Ok(vec![path.to_owned()]),
        };
    }
    let metadata = path.join("metadata.yaml");
    if metadata.exists() { listed(path, &metadata) } else { found(path) }
}

fn listed(folder: &Path, metadata: &Path) -> Result<Vec<PathBuf>, BagOpenError> {
    let refuse = |reason: String| BagOpenError::Metadata { path: metadata.to_owned(), reason };
    if std::fs::metadata(metadata).map_err(BagOpenError::read(metadata))?.len() > METADATA_LIMIT {
        return Err(refuse(format!("it is larger than {METADATA_LIMIT} bytes")));
    }
    let text = std::fs::read_to_string(metadata).map_err(BagOpenError::read(metadata))?;
    let information = serde_saphyr::from_str::<Metadata>(&text)
        .map_err(|error| refuse(error.to_string()))?
        .rosbag2_bagfile_information;
    if information.storage_identifier != "mcap" {
        return Err(BagOpenError::Storage { path: folder.to_owned(), storage: information.storage_identifier });
    }
    if !matches!(information.compression_mode.to_ascii_uppercase().as_str(), "" | "NONE") {
        return Err(BagOpenError::Compressed { path: folder.to_owned(), mode: information.compression_mode });
    }
    // Early versions wrote the folder's name too; and nothing outside the folder belongs to the
    // bag.
    let names = information.relative_file_paths.iter().filter_map(|path| path.file_name());
    let files: Vec<PathBuf> = names.map(|name| folder.join(name)).collect();
    if files.is_empty() { Err(refuse("it lists no files".to_owned())) } else { Ok(files) }
}

fn found(folder: &Path) -> Result<Vec<PathBuf>, BagOpenError> {
    let entries = std::fs::read_dir(folder).map_err(BagOpenError::read(folder))?;
    let mut files: Vec<PathBuf> = entries
        .filter_map(|entry| entry.ok().map(|entry| entry.path()))
        .filter(|path| path.extension().is_some_and(|ending| ending == "mcap"))
        .collect();
    files.sort_by_cached_key(|path| order(path));
    if files.is_empty() { Err(BagOpenError::Empty { path: folder.to_owned() }) } else { Ok(files) }
}

/// Natural sort order: by the name without its trailing digits, then by their number.
fn order(path: &Path) -> (String, u64, PathBuf) {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let name = stem.trim_end_matches(|c: char| c.is_ascii_digit());
    (name.to_owned(), stem[name.len()..].parse().unwrap_or(0), path.to_owned())
}
