//! Maps to files and back.

use crate::ingest::Refusal;
use crate::program::operator::asking::{ask_binary, head, order, state_of};
use crate::program::operator::error::OperatorError;
use crate::rescue::check_archive;
use fht_map::MapState;
use fht_proto::api::keys::{AdminAction, Key, Topic};
use fht_proto::api::reply::{Head, Series, StateView};
use fht_proto::codec::archive::{Archive, ArchiveError, ArchiveHeader, header_line, is_archive_begin};
use fht_proto::{Increment, MapName, VersionVector, decode, encode};
use indicatif::{ProgressBar, ProgressStyle};
use serde::{Deserialize, Serialize};
use std::io::{Read, Write};
use std::path::Path;
use zenoh::Session;

/// Approximate length of the messages in a file, bytes.
const SERIES_BYTES: usize = 64 << 10;
/// About how much is asked for at one time, bytes: what a link takes in one piece. Routers drop
/// what it cannot take at that moment.
const PART_BYTES: usize = 48 << 10;
/// So much of a file tells whether it is a map, bytes.
const ARCHIVE_BEGIN: u64 = 64;
/// The file that is standard output.
pub(super) const STANDARD_OUTPUT: &str = "-";

/// What was exported or imported.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Transferred {
    /// The map.
    pub map: MapName,
    /// Its version.
    pub version: u64,
    /// Hash of the canonical map.
    pub digest: fht_proto::Digest,
    /// Length of the file, bytes.
    pub bytes: u64,
}

/// A bar that counts `what`: increments, bytes.
pub(super) fn progress(length: u64, what: &'static str, quiet: bool) -> ProgressBar {
    if quiet {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(length);
    if let Ok(style) = ProgressStyle::with_template("{prefix} [{bar:40}] {pos} of {len} {msg}") {
        bar.set_style(style);
    }
    bar.with_message(what)
}

/// Writes a map, or a release of it, to a file. The file appears when it is complete.
pub(super) async fn export(
    session: &Session,
    map: &MapName,
    path: &Path,
    release: Option<&str>,
    quiet: bool,
) -> Result<Transferred, OperatorError> {
    check_replaceable(path)?;
    let StateView { vector, digest, .. } = state_of(session, map, release).await?;
    let bar = progress(vector.version(), "increments", quiet);
    bar.set_prefix("export");
    let whole = fetch_whole(session, map, &vector, &bar).await?;
    let header = ArchiveHeader::new(map.clone(), vector, digest);
    let mut bytes = header_line(&header).map_err(|error| OperatorError::json(&error))?;
    for series in pieces(whole) {
        bytes.extend(encode(&series).map_err(|error| OperatorError::Answer(error.to_string()))?);
    }
    bar.finish_and_clear();
    let failed = |source| OperatorError::File { path: path.to_owned(), source };
    write_whole(path, &bytes).map_err(failed)?;
    Ok(Transferred { map: map.clone(), version: header.version, digest, bytes: bytes.len() as u64 })
}

/// Whether a map may be written to `path`: what is there and is no map in a file stays, such as a
/// server's store.
fn check_replaceable(path: &Path) -> Result<(), OperatorError> {
    if path == Path::new(STANDARD_OUTPUT) || !path.is_file() {
        return Ok(());
    }
    let failed = |source| OperatorError::File { path: path.to_owned(), source };
    let mut begin = Vec::new();
    std::fs::File::open(path).map_err(failed)?.take(ARCHIVE_BEGIN).read_to_end(&mut begin).map_err(failed)?;
    let is_archive = begin.is_empty() || is_archive_begin(&begin);
    if is_archive { Ok(()) } else { Err(OperatorError::NoArchive(path.to_owned())) }
}

/// The increments that a state consists of.
pub(super) async fn fetch_whole(
    session: &Session,
    map: &MapName,
    vector: &VersionVector,
    bar: &ProgressBar,
) -> Result<Series, OperatorError> {
    let (mut have, mut whole) = (VersionVector::default(), Series::default());
    while have != *vector {
        let series = fetch(session, map, vector, &have).await?;
        let before = have.clone();
        series.folds.iter().for_each(|fold| have.set(fold.author, fold.last));
        series.increments.iter().for_each(|increment| have.set(increment.author, increment.number));
        if have == before {
            return Err(OperatorError::Answer(format!("the server has no more than {have} of {vector}")));
        }
        bar.set_position(have.version());
        whole.folds.extend(series.folds);
        whole.increments.extend(series.increments);
    }
    Ok(whole)
}

/// A map as it is now: its increments, their vector, and what they add up to.
pub(super) async fn fetch_state(
    session: &Session,
    map: &MapName,
    quiet: bool,
) -> Result<(Series, VersionVector, MapState), OperatorError> {
    let head = head(session, map).await?;
    let bar = progress(head.vector.version(), "increments", quiet);
    bar.set_prefix(map.to_string());
    let series = fetch_whole(session, map, &head.vector, &bar).await?;
    bar.finish_and_clear();
    let mut state = MapState::new();
    series.folds.iter().for_each(|fold| state.apply_fold(fold));
    series.increments.iter().for_each(|increment| state.apply(increment));
    if state.digest() != head.digest {
        let text = format!("the increments of {map} do not add up to what the server says: digest {}", state.digest());
        return Err(OperatorError::Answer(text));
    }
    Ok((series, head.vector, state))
}

async fn fetch(
    session: &Session,
    map: &MapName,
    vector: &VersionVector,
    have: &VersionVector,
) -> Result<Series, OperatorError> {
    let part = format!("vector={vector};have={have};max_bytes={PART_BYTES}");
    let bytes = ask_binary(session, &format!("{}?{part}", Key::topic(map, Topic::Snapshot))).await?;
    decode(&bytes).map_err(|error| OperatorError::Answer(error.to_string()))
}

/// Has the server take in a part of a map whose vector is `whole`; returns the map's head after
/// that. The server takes nothing into a map of others.
pub(super) async fn put_series(
    session: &Session,
    map: &MapName,
    (series, whole): (&Series, &VersionVector),
) -> Result<Head, OperatorError> {
    let key = Key::Admin { map: map.clone(), action: AdminAction::Import };
    let payload = encode(series).map_err(|error| OperatorError::Answer(error.to_string()))?;
    let answer = order(session, &format!("{key}?vector={whole}"), Some(payload)).await?;
    serde_json::from_slice(&answer).map_err(|error| OperatorError::json(&error))
}

/// Splits a map into messages of sensible length, compacted series first.
pub(super) fn pieces(whole: Series) -> Vec<Series> {
    let mut pieces = Vec::new();
    let (mut piece, mut length) = (Series::default(), 0);
    let mut close = |piece: &mut Series, length: &mut usize, more: usize| {
        *length += more;
        if *length > SERIES_BYTES && *length > more {
            pieces.push(std::mem::take(piece));
            *length = more;
        }
    };
    for fold in whole.folds {
        close(&mut piece, &mut length, fold.memory_bytes());
        piece.folds.push(fold);
    }
    for increment in whole.increments {
        close(&mut piece, &mut length, increment.memory_bytes());
        piece.increments.push(increment);
    }
    pieces.push(piece);
    pieces
}

/// Writes a file whole or not at all, also behind a link. What is no file, such as a pipe, gets the
/// bytes as they are; `-` is standard output.
fn write_whole(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    if path == Path::new(STANDARD_OUTPUT) {
        let mut output = std::io::stdout().lock();
        return output.write_all(bytes).and_then(|()| output.flush());
    }
    let path = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    if path.exists() && !path.is_file() {
        return std::fs::OpenOptions::new().write(true).open(&path)?.write_all(bytes);
    }
    let mut unfinished = path.as_os_str().to_owned();
    unfinished.push(".unfinished");
    let write = || {
        let mut file = std::fs::File::create(&unfinished)?;
        file.write_all(bytes)?;
        file.sync_all()?;
        std::fs::rename(&unfinished, &path)
    };
    write().inspect_err(|_| {
        let _ = std::fs::remove_file(&unfinished); // what failed is said
    })
}

/// Why an import has ended, with what of the map is there if it has brought a part of it to what
/// was there before.
async fn of_a_part(
    session: &Session,
    map: &MapName,
    (before, whole): (u64, &VersionVector),
    reason: OperatorError,
) -> OperatorError {
    let OperatorError::Refused(refusal) = &reason else { return reason }; // nobody answers
    if refusal.message == Refusal::CompactedBeside.to_string() {
        return reason; // it does not go on from there
    }
    match head(session, map).await {
        Ok(Head { version, vector, .. }) if version > before && vector != *whole && whole.covers(&vector) => {
            OperatorError::PartlyImported { map: map.clone(), version, of: whole.version(), reason: Box::new(reason) }
        }
        _ => reason,
    }
}

/// Of each author whom a file and a map have in common the newest increment that both must have.
/// The server has all of these already: where one is another, as of two operators of one name, it
/// says so before anything is written.
fn in_both(archive: Archive<'_>, known: &VersionVector) -> Result<Series, ArchiveError> {
    let both = known.meet(&archive.header.vector);
    let mut shared = Series::default();
    if both.version() == 0 {
        return Ok(shared);
    }
    let is_last = |increment: &Increment| increment.number == both.get(increment.author);
    for series in archive {
        shared.increments.extend(series?.increments.into_iter().filter(is_last));
    }
    Ok(shared)
}

/// Has the server take in a map from a file, under its own name or another.
pub(super) async fn import(
    session: &Session,
    path: &Path,
    name: Option<MapName>,
    quiet: bool,
) -> Result<Transferred, OperatorError> {
    let bytes = std::fs::read(path).map_err(|source| OperatorError::File { path: path.to_owned(), source })?;
    let damaged = |source| OperatorError::Archive { path: path.to_owned(), source };
    let archive = Archive::open(&bytes).map_err(damaged)?;
    // The whole file is checked first, down to what it adds up to: a damaged one changes nothing.
    check_archive(path, archive.clone())?;
    let header = archive.header.clone();
    let map = name.unwrap_or_else(|| header.map.clone());
    let known = match head(session, &map).await {
        Ok(head) => head.vector,
        Err(OperatorError::Refused(_)) => VersionVector::default(),
        Err(error) => return Err(error),
    };
    let shared = in_both(archive.clone(), &known).map_err(damaged)?;
    for piece in pieces(shared).into_iter().filter(|piece| !piece.increments.is_empty()) {
        put_series(session, &map, (&piece, &header.vector)).await?;
    }
    let before = known.version();
    let bar = progress(bytes.len() as u64, "bytes", quiet);
    bar.set_prefix("import");
    let mut archive = archive;
    let mut head: Option<Head> = None;
    while let Some(series) = archive.next() {
        match put_series(session, &map, (&series.map_err(damaged)?, &header.vector)).await {
            Ok(after) => head = Some(after),
            Err(reason) => {
                bar.finish_and_clear();
                return Err(of_a_part(session, &map, (before, &header.vector), reason).await);
            }
        }
        bar.set_position(archive.position() as u64);
    }
    bar.finish_and_clear();
    let head = head.ok_or_else(|| OperatorError::Usage(format!("{} has no increments", path.display())))?;
    if head.vector == header.vector && head.digest != header.digest {
        let text =
            format!("the map is not what the file says it is: digest {} instead of {}", head.digest, header.digest);
        return Err(OperatorError::Answer(text));
    }
    Ok(Transferred { map, version: head.version, digest: head.digest, bytes: bytes.len() as u64 })
}
