//! `since`, `snapshot`, `releases` and `diff`: past states of a map.

use crate::catalog::{MapView, state_at};
use crate::query::answer::release_name::find_release;
use crate::query::answer::reply::{Answer, error, internal, json, postcard};
use crate::store::{IncrementLog, Lacking, StoreError};
use fht_map::MapState;
use fht_proto::api::reply::{
    DiffReply, ErrorCode, ErrorReply, MovedNode, ReleaseView, ReleasesReply, Series, SeriesReply, StateView,
};
use fht_proto::api::request::{Format, Moment};
use fht_proto::{AuthorId, EdgeKey, VersionVector, decode};
use std::sync::Arc;

/// The vector of a moment that the log can still reproduce.
fn vector_of(view: &MapView, log: &dyn IncrementLog, moment: &Moment) -> Result<VersionVector, ErrorReply> {
    let (head, map) = (&view.head, &view.head.map);
    let unknown = |what: String| {
        let text = format!("map {map} has no {what}; it is at version {}, vector {}", head.version, head.vector);
        error(ErrorCode::UnknownVersion, text)
    };
    let compacted = |floor: u64| {
        let text = format!("map {map} is folded up to version {floor}: of older ones there are only releases");
        error(ErrorCode::UnknownVersion, text)
    };
    match moment {
        Moment::Now => Ok(head.vector.clone()),
        Moment::Vector(vector) if !head.vector.covers(vector) => Err(unknown(format!("vector {vector}"))),
        Moment::Vector(vector) => {
            let floor = log.reader().floor(map).map_err(internal)?;
            let is_kept = || view.state.annotations().releases().any(|release| release.release.vector == *vector);
            if vector.covers(&floor.vector) || is_kept() { Ok(vector.clone()) } else { Err(compacted(floor.version)) }
        }
        Moment::Version(version) if *version > head.version => Err(unknown(format!("version {version}"))),
        Moment::Version(version) if log.is_shared() && *version != head.version => {
            let text = format!(
                "map {map} has several servers, and each counts in its own order: name a release or a vector instead of \
                 version {version}"
            );
            Err(error(ErrorCode::UnknownVersion, text))
        }
        Moment::Version(version) => match log.reader().vector_at(map, *version).map_err(internal)? {
            Some(vector) => Ok(vector),
            None => Err(compacted(log.reader().floor(map).map_err(internal)?.version)),
        },
        Moment::Release(name) => {
            let id = find_release(&view.state, name).map_err(|text| error(ErrorCode::UnknownVersion, text))?;
            let release = view.state.annotations().release(&id);
            let release = release.filter(|release| head.vector.covers(&release.release.vector)).ok_or_else(|| {
                error(ErrorCode::UnknownVersion, format!("this server does not have all of release {id} yet"))
            })?;
            if log.reader().has_lost(map).map_err(internal)? && !is_intact(view, log, release.release) {
                return Err(error(ErrorCode::UnknownVersion, format!("a part of release {id} is lost")));
            }
            Ok(release.release.vector.clone())
        }
    }
}

/// How long a reply of increments may be, and in which form.
#[derive(Clone, Copy, Debug)]
pub(super) struct SeriesForm {
    /// All of it, about, bytes.
    pub(super) max_bytes: usize,
    /// Each of several replies, about, bytes; none: one reply.
    pub(super) piece_bytes: Option<usize>,
    /// Binary or JSON.
    pub(super) format: Format,
}

pub(super) fn increments(
    view: &MapView,
    log: &dyn IncrementLog,
    moment: &Moment,
    have: &VersionVector,
    form: SeriesForm,
) -> Result<Vec<Answer>, ErrorReply> {
    let upto = vector_of(view, log, moment)?;
    let Lacking { compacted, increments } = lacking(view, log, have, &upto, form.max_bytes).map_err(internal)?;
    let as_json = |series: &Series| json(&SeriesReply::new(view.head.map.clone(), upto.clone(), series));
    let messages = compacted.iter().map(|bytes| (true, bytes)).chain(increments.iter().map(|bytes| (false, bytes)));
    let piece_bytes = form.piece_bytes.unwrap_or(usize::MAX);
    let (mut pieces, mut piece_length, mut total) = (vec![Series::default()], 0_usize, 0_usize);
    for (is_compacted, bytes) in messages {
        let mut one = Series::default();
        if is_compacted {
            one.folds.push(decode(bytes).map_err(internal)?);
        } else {
            one.increments.push(decode(bytes).map_err(internal)?);
        }
        let length = match form.format {
            Format::Postcard => bytes.len(),
            Format::Json => as_json(&one)?.bytes.len(),
        };
        // The log has kept to the limit in binary; as JSON the same is several times as long.
        if form.format == Format::Json && total > 0 && total + length > form.max_bytes {
            break;
        }
        total += length;
        piece_length += length;
        if piece_length > piece_bytes && piece_length > length {
            pieces.push(Series::default());
            piece_length = length;
        }
        let Some(piece) = pieces.last_mut() else { continue };
        piece.folds.append(&mut one.folds);
        piece.increments.append(&mut one.increments);
    }
    match form.format {
        Format::Postcard => pieces.iter().map(postcard).collect(),
        Format::Json => pieces.iter().map(as_json).collect(),
    }
}

/// What is missing, beginning with the authors of whom the least is missing: a client that missed a
/// few live increments while the whole map is under way over a thin link gets those at once.
fn lacking(
    view: &MapView,
    log: &dyn IncrementLog,
    have: &VersionVector,
    upto: &VersionVector,
    max_bytes: usize,
) -> Result<Lacking, StoreError> {
    let mut authors: Vec<(AuthorId, u64)> = upto.iter().filter(|(author, last)| *last > have.get(*author)).collect();
    authors.sort_unstable_by_key(|(author, last)| (last - have.get(*author), *author));
    let (mut found, mut total) = (Lacking::default(), 0);
    for (author, last) in authors {
        let mut of_author = VersionVector::default();
        of_author.set(author, last);
        let Lacking { compacted, increments } =
            log.reader().lacking(&view.head.map, have, &of_author, max_bytes - total)?;
        total += compacted.iter().chain(&increments).map(Vec::len).sum::<usize>();
        found.compacted.extend(compacted);
        found.increments.extend(increments);
        if total >= max_bytes {
            break;
        }
    }
    Ok(found)
}

pub(super) fn releases(view: &MapView, log: &dyn IncrementLog) -> Result<Answer, ErrorReply> {
    let annotations = view.state.annotations();
    let enabled = annotations.enabled().map(|release| release.id.clone());
    let floor = log.reader().floor(&view.head.map).map_err(internal)?;
    let has_lost = log.reader().has_lost(&view.head.map).map_err(internal)?;
    let is_whole = |release: &fht_proto::Release| !has_lost && release.vector.covers(&floor.vector);
    let mut releases: Vec<ReleaseView> = annotations
        .releases()
        .map(|release| ReleaseView {
            name: release.id.name.to_string(),
            author: release.id.author.to_string(),
            version: release.release.vector.version(),
            vector: release.release.vector.clone(),
            digest: release.release.digest,
            made_us: release.made_us,
            enabled: enabled.as_ref() == Some(release.id),
            available: view.head.vector.covers(&release.release.vector)
                && match enabled.as_ref() {
                    // It was read when it was enabled.
                    Some(id) if id == release.id => view.running.release() == Some(id),
                    _ => is_whole(release.release) || is_intact(view, log, release.release),
                },
        })
        .collect();
    releases.sort_by(|a, b| (a.made_us, &a.name, &a.author).cmp(&(b.made_us, &b.name, &b.author)));
    let deleted = annotations.deleted_releases().map(ToString::to_string).collect();
    json(&ReleasesReply { map: view.head.map.clone(), version: view.head.version, releases, deleted })
}

/// Whether what is left of a release below the floor adds up to it.
fn is_intact(view: &MapView, log: &dyn IncrementLog, release: &fht_proto::Release) -> bool {
    let state = state_at(&view.head.map, &release.vector, log).unwrap_or_else(|cause| {
        tracing::error!("a release could not be read: {cause}");
        None
    });
    state.is_some_and(|state| state.digest() == release.digest)
}

/// The state of a map at a moment, and its vector.
///
/// # Errors
/// `UNKNOWN_VERSION` if it is not kept.
pub(crate) fn state_of(
    view: &MapView,
    log: &dyn IncrementLog,
    moment: &Moment,
) -> Result<(Arc<MapState>, VersionVector), ErrorReply> {
    let vector = vector_of(view, log, moment)?;
    if vector == view.head.vector {
        return Ok((Arc::clone(&view.state), vector));
    }
    let state = state_at(&view.head.map, &vector, log).map_err(internal)?;
    let state = state.ok_or_else(|| internal(format!("the log lacks a part of {vector}")))?;
    Ok((Arc::new(state), vector))
}

pub(super) fn diff(view: &MapView, log: &dyn IncrementLog, from: &Moment, to: &Moment) -> Result<Answer, ErrorReply> {
    let state_of = |moment: &Moment| -> Result<(Arc<MapState>, StateView), ErrorReply> {
        let (state, vector) = state_of(view, log, moment)?;
        let shown = StateView { version: vector.version(), vector, digest: state.digest() };
        Ok((state, shown))
    };
    let ((from_state, from), (to_state, to)) = (state_of(from)?, state_of(to)?);
    let diff = fht_map::crdt::diff::diff(&from_state, &to_state);
    let ends = |edges: &[EdgeKey]| edges.iter().map(EdgeKey::to_texts).collect();
    let ids = |ids: &[fht_proto::NodeId]| ids.iter().map(ToString::to_string).collect();
    json(&DiffReply {
        map: view.head.map.clone(),
        from,
        to,
        added_nodes: ids(&diff.added),
        removed_nodes: ids(&diff.removed),
        moved_nodes: diff
            .moved
            .iter()
            .map(|(id, by_m)| MovedNode { id: id.to_string(), by_m: (by_m * 1000.0).round() / 1000.0 })
            .collect(),
        changed_nodes: ids(&diff.changed),
        added_edges: ends(&diff.added_edges),
        removed_edges: ends(&diff.removed_edges),
        closed_edges: ends(&diff.closed_edges),
        opened_edges: ends(&diff.opened_edges),
        words: diff.in_words(),
        annotations: diff.annotations.into_iter().map(|change| change.what).collect(),
    })
}
