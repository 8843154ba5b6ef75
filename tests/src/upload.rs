//! Uploads a map to a server, as writers do.

use fht_client::ask_head;
use fht_proto::api::keys::Key;
use fht_proto::{CodecError, Increment, MapName, VersionVector, encode};
use std::time::{Duration, Instant};
use zenoh::qos::CongestionControl;
use zenoh::{Session, Wait};

/// How long the server may take to store a part.
const PATIENCE: Duration = Duration::from_secs(60);
/// Increments put ahead of the acknowledgement.
const PART: usize = 500;

/// Why a map is not on the server.
#[derive(Debug, thiserror::Error)]
pub enum UploadError {
    /// Zenoh refuses.
    #[error("Zenoh refuses: {}", fht_session::in_words(.0))]
    Zenoh(#[from] zenoh::Error),
    /// An increment cannot be written.
    #[error(transparent)]
    Codec(#[from] CodecError),
    /// The server did not store it.
    #[error("the server has {has} of {wanted} after {} s", PATIENCE.as_secs())]
    NotStored {
        /// What it has.
        has: VersionVector,
        /// What it was sent.
        wanted: VersionVector,
    },
}

/// Puts a map's increments, no more at a time than the server acknowledges, and repeats those that
/// it lacks. Returns what it then has.
///
/// # Errors
/// [`UploadError`].
pub fn upload_map(session: &Session, map: &MapName, increments: &[Increment]) -> Result<VersionVector, UploadError> {
    let mut wanted = VersionVector::default();
    for part in increments.chunks(PART) {
        let deadline = Instant::now() + PATIENCE;
        part.iter().for_each(|increment| wanted.set(increment.author, increment.number));
        let mut has = VersionVector::default();
        while !has.covers(&wanted) {
            if Instant::now() > deadline {
                return Err(UploadError::NotStored { has, wanted });
            }
            let is_lacking = |increment: &&Increment| increment.number > has.get(increment.author);
            part.iter().filter(is_lacking).try_for_each(|increment| put_increment(session, map, increment))?;
            // A server that has just started may not listen to increments yet, nor know the map.
            std::thread::sleep(Duration::from_millis(200));
            has = ask_head(session, map, PATIENCE).map_or(has, |head| head.vector);
        }
    }
    Ok(wanted)
}

/// Puts one increment, as an explorer does.
///
/// # Errors
/// [`UploadError`].
pub fn put_increment(session: &Session, map: &MapName, increment: &Increment) -> Result<(), UploadError> {
    let key = Key::increment(map, increment.author, increment.number).to_string();
    session.put(key, encode(increment)?).congestion_control(CongestionControl::Block).wait()?;
    Ok(())
}
