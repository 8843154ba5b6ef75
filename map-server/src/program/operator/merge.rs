//! Two maps of one building become one.

use crate::program::operator::asking::{ask_json, head};
use crate::program::operator::error::OperatorError;
use crate::program::operator::transfer::{fetch_state, pieces, put_series};
use crate::program::operator::write::write;
use fht_merge::{AlignmentFigures, MergeConfig, MergeFigures, MergeOptions, MergeRefusal, join, lay};
use fht_proto::api::keys::Key;
use fht_proto::api::reply::{MapsReply, Series};
use fht_proto::{AuthorId, MapName, Op, VersionVector};
use serde::{Deserialize, Serialize};
use zenoh::Session;

/// What is to be merged.
pub(super) struct MergeOrder<'a> {
    pub(super) first: MapName,
    pub(super) second: MapName,
    pub(super) into: Option<MapName>,
    pub(super) dry_run: bool,
    pub(super) only_map: bool,
    pub(super) operator: &'a str,
    pub(super) quiet: bool,
    pub(super) config: MergeConfig,
}

/// The result of a merge.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct MergeReply {
    /// The map whose frame stayed.
    pub first: MapName,
    /// The map that was brought over.
    pub second: MapName,
    /// Whether they fit.
    pub fits: bool,
    /// Why they do not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// How the second lies in the first.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub alignment: Option<AlignmentFigures>,
    /// What was taken over, or would be.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub joined: Option<MergeFigures>,
    /// The map that was written and its version then; none if nothing was written.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub written: Option<(MapName, u64)>,
    /// So many changes that is: `undo --last` takes as many back.
    #[serde(default)]
    pub changes: usize,
    /// Whether it was only asked for.
    #[serde(skip)]
    is_dry_run: bool,
}

/// The answer to maps that do not fit.
pub(super) fn refused(order: &MergeOrder<'_>, refusal: &MergeRefusal) -> MergeReply {
    MergeReply {
        first: order.first.clone(),
        second: order.second.clone(),
        fits: false,
        reason: Some(refusal.to_string()),
        alignment: None,
        joined: None,
        written: None,
        changes: 0,
        is_dry_run: order.dry_run,
    }
}

/// Longest part of the second map's name that is appended to names that are taken.
const SUFFIX: usize = 32;

/// Merges, or reports how the maps would be merged.
pub(super) async fn merge(session: &Session, order: &MergeOrder<'_>) -> Result<MergeReply, OperatorError> {
    let MergeOrder { first, second, into, .. } = order;
    if first == second {
        return Err(OperatorError::Usage(format!("{first} is one map: there is nothing to merge")));
    }
    let is_there = |reply: &MapsReply, name: &MapName| reply.maps.iter().any(|head| head.map == *name);
    if let Some(new) = into
        && is_there(&ask_json(session, &Key::Maps.to_string()).await?, new)
    {
        return Err(OperatorError::Usage(format!("there is a map {new} already: --into makes a new one")));
    }
    let (series, whole, a) = fetch_state(session, first, order.quiet).await?;
    let (_, _, b) = fetch_state(session, second, order.quiet).await?;
    let (author, only_map) = (AuthorId::of_robot(order.operator), order.only_map);
    let config = order.config.clone();
    let suffix: String = second.as_str().chars().take(SUFFIX).collect();
    let compute = move || {
        let laid = lay(&a, &b, &config)?;
        let joined = join(&a, &b, &laid, &MergeOptions { author, suffix: &suffix, only_map }, &config)?;
        Ok::<_, MergeRefusal>((laid.figures, joined))
    };
    let (alignment, joined) = tokio::task::spawn_blocking(compute).await??;
    let mut written = None;
    let changes = joined.batches.len();
    if (into.is_some() || changes > 0) && !order.dry_run {
        let target = into.as_ref().unwrap_or(first);
        let version = match into {
            Some(_) => write_new(session, target, (series, whole), (order.operator, joined.batches)).await?,
            None => write_batches(session, target, order.operator, joined.batches).await?,
        };
        written = Some((target.clone(), version));
    }
    Ok(MergeReply {
        first: first.clone(),
        second: second.clone(),
        fits: true,
        reason: None,
        alignment: Some(alignment),
        joined: Some(joined.figures),
        changes: if written.is_some() { changes } else { 0 },
        written,
        is_dry_run: order.dry_run,
    })
}

/// Writes the joined maps to `target`, a new map that begins with a whole one; returns its version.
async fn write_new(
    session: &Session,
    target: &MapName,
    (begin, whole): (Series, VersionVector),
    (operator, batches): (&str, Vec<Vec<Op>>),
) -> Result<u64, OperatorError> {
    let part = |is_sure, reason| OperatorError::PartlyMerged { map: target.clone(), is_sure, reason: Box::new(reason) };
    let mut is_there = false;
    for piece in pieces(begin) {
        match put_series(session, target, (&piece, &whole)).await {
            Ok(_) => is_there = true,
            Err(reason) if is_there => return Err(part(true, reason)),
            Err(reason @ OperatorError::OrderUnanswered { .. }) => return Err(part(false, reason)),
            // Of the first piece something may have been taken before the rest was refused.
            Err(reason) => {
                let head = head(session, target).await;
                let is_begun = head.is_ok_and(|head| head.version > 0 && whole.covers(&head.vector));
                return Err(if is_begun { part(true, reason) } else { reason });
            }
        }
    }
    write_batches(session, target, operator, batches).await.map_err(|reason| part(true, reason))
}

/// Writes to a map that is there: what is written is a change that undo takes back. Returns the
/// map's version.
async fn write_batches(
    session: &Session,
    target: &MapName,
    operator: &str,
    batches: Vec<Vec<Op>>,
) -> Result<u64, OperatorError> {
    let mut version = head(session, target).await?.version;
    for ops in batches {
        version = write(session, target, operator, ops).await?.version;
    }
    Ok(version)
}

pub(super) fn in_words(reply: &MergeReply) -> String {
    let mut lines = Vec::new();
    if let Some(AlignmentFigures {
        matched,
        places,
        transform: [x, y, yaw],
        residual_median_m,
        residual_max_m,
        overlap_m2,
        overlap_share,
        contradicted,
        ..
    }) = &reply.alignment
    {
        lines.push(format!("matched     {matched} of {places} places of {}", reply.second));
        let yaw_deg = yaw.to_degrees();
        lines.push(format!("lies at     {x:.3},{y:.3} in {}, turned by {yaw_deg:.2}°", reply.first));
        lines.push(format!("off by      {residual_median_m:.3} m in the median, {residual_max_m:.3} m at most"));
        let (share, against) = (100.0 * overlap_share, 100.0 * contradicted);
        lines.push(format!(
            "in both     {overlap_m2:.0} m², {share:.0} % of {}; {against:.1} % of the beams contradict",
            reply.second
        ));
    }
    if let Some(joined) = &reply.joined {
        let MergeFigures {
            nodes,
            main_nodes,
            support_nodes,
            edges,
            joining_edges,
            left_out,
            annotations,
            closed_edges,
            renamed,
        } = joined;
        lines.push(format!("new         {main_nodes} main and {support_nodes} support nodes of {nodes}, {edges} edges between them, {joining_edges} edges to {}", reply.first));
        if *left_out > 0 {
            lines.push(format!("left out    {left_out} nodes that no way leads to"));
        }
        if annotations + closed_edges > 0 {
            lines.push(format!("rules       {annotations} places and zones, {closed_edges} closed edges"));
        }
        lines.extend(renamed.iter().map(|[old, new]| format!("renamed     {old} of {} is {new} now", reply.second)));
    }
    lines.push(match &reply.written {
        Some((map, version)) => {
            let back = match reply.changes {
                0 => format!("; nothing of {} was added to it", reply.second),
                1 => format!("; `map-server undo {map}` takes it back"),
                changes => format!("; `map-server undo {map} --last {changes}` takes it back"),
            };
            format!("written     map {map} is at version {version}{back}")
        }
        None if reply.is_dry_run => "written     nothing (--dry-run)".to_owned(),
        None => "written     nothing: there is nothing to change".to_owned(),
    });
    lines.join("\n")
}
