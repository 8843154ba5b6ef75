//! Putting a map on a server, as writers do.

use client_robot::replica::ask_head;
use fht_proto::keys::Key;
use fht_proto::{CodecError, Increment, MapName, VersionVector, encode};
use std::time::{Duration, Instant};
use zenoh::qos::CongestionControl;
use zenoh::{Session, Wait};

/// How long the server may take to take a part in.
const PATIENCE: Duration = Duration::from_secs(60);
/// Increments put ahead of the acknowledgement.
const PART: usize = 500;

/// Why a map is not on the server.
#[derive(Debug, thiserror::Error)]
pub enum FeedError {
    /// Zenoh refuses.
    #[error("Zenoh refuses: {0}")]
    Zenoh(#[from] zenoh::Error),
    /// An increment cannot be written.
    #[error(transparent)]
    Codec(#[from] CodecError),
    /// The server did not take it in.
    #[error("the server has {has} of {wanted} after {} s", PATIENCE.as_secs())]
    NotStored {
        /// What it has.
        has: VersionVector,
        /// What it was sent.
        wanted: VersionVector,
    },
}

/// Puts a map's increments, no more at a time than the server acknowledges, and again what it has not got. Returns what it then has.
///
/// # Errors
/// [`FeedError`].
pub fn write(session: &Session, map: &MapName, increments: &[Increment]) -> Result<VersionVector, FeedError> {
    let mut wanted = VersionVector::default();
    for part in increments.chunks(PART) {
        let deadline = Instant::now() + PATIENCE;
        part.iter().for_each(|increment| wanted.set(increment.author, increment.number));
        let mut has = VersionVector::default();
        while !has.covers(&wanted) {
            if Instant::now() > deadline {
                return Err(FeedError::NotStored { has, wanted });
            }
            let is_lacking = |increment: &&Increment| increment.number > has.get(increment.author);
            part.iter().filter(is_lacking).try_for_each(|increment| put(session, map, increment))?;
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
/// [`FeedError`].
pub fn put(session: &Session, map: &MapName, increment: &Increment) -> Result<(), FeedError> {
    let key = Key::increment(map, increment.author, increment.number).to_string();
    session.put(key, encode(increment)?).congestion_control(CongestionControl::Block).wait()?;
    Ok(())
}
