//! Typed requests to replies, over a shared view of the maps.

use crate::catalog::{Catalog, MapView};
use crate::config::AnswerConfig;
use crate::request::{Format, Moment, Question, Request};
use crate::store::Store;
use fht_map::route::{Route, RouteError};
use fht_map::{MapState, NodeRef, lookup, taut};
use fht_proto::compact::{CompactNode, CompactNodes, CompactPath, CompactWaypoint};
use fht_proto::envelope::Message;
use fht_proto::query::{ErrorCode, ErrorReply, MapsReply, NodeView, NodesReply, PathReply, Place, Snapshot, Waypoint};
use fht_proto::{Descriptor, FixedPoint, MapName, VersionVector, decode, encode};
use serde::Serialize;

/// What is replied.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Answer {
    /// How it is written.
    pub format: Format,
    /// The payload.
    pub bytes: Vec<u8>,
}

fn error(code: ErrorCode, message: impl Into<String>) -> ErrorReply {
    ErrorReply { code, message: message.into() }
}

fn internal(cause: impl std::fmt::Display) -> ErrorReply {
    tracing::error!("a query failed: {cause}");
    error(ErrorCode::Internal, "the server failed; its log says why")
}

fn json<T: Serialize>(value: &T) -> Result<Answer, ErrorReply> {
    let bytes = serde_json::to_vec(value).map_err(internal)?;
    Ok(Answer { format: Format::Json, bytes })
}

fn postcard<M: Message>(message: &M) -> Result<Answer, ErrorReply> {
    let bytes = encode(message).map_err(internal)?;
    Ok(Answer { format: Format::Postcard, bytes })
}

/// Answers a request.
///
/// # Errors
/// What the asker is told instead.
pub fn answer(request: Request, catalog: &Catalog, store: &Store, config: &AnswerConfig) -> Result<Answer, ErrorReply> {
    let (map, question) = match request {
        Request::Maps => {
            let maps = catalog.heads().iter().map(|head| head.as_ref().clone()).collect();
            return json(&MapsReply { maps });
        }
        Request::Map(map, question) => (map, question),
    };
    let view = catalog.view(&map).ok_or_else(|| unknown_map(&map, catalog))?;
    match question {
        Question::Head => json(view.head.as_ref()),
        Question::Increments { moment, have, max_bytes } => increments(&map, &view, store, &moment, &have, max_bytes),
        Question::Path { from, to, format } => {
            let (from, to) = (locate(&view.state, from)?, locate(&view.state, to)?);
            let planned = taut::plan(&view.state, view.free_space(), from, to, &config.route);
            let route = planned.map_err(|cause| no_route(&cause))?;
            path(map, &view, &route, format)
        }
        Question::Nodes { near, radius_m, limit, format } => {
            let near = lookup::nearest(&view.state, near, radius_m);
            let nodes = near.into_iter().take(limit).map(|(node, _)| (node, None)).collect();
            nodes_reply(map, &view, nodes, format, false)
        }
        Question::Match { descriptor, limit, format } => {
            let nodes = matching(&view.state, &descriptor, limit)?;
            nodes_reply(map, &view, nodes, format, true)
        }
    }
}

fn unknown_map(map: &MapName, catalog: &Catalog) -> ErrorReply {
    /// Names that are worth reading.
    const SHOWN: usize = 10;
    let names: Vec<String> = catalog.heads().iter().take(SHOWN).map(|head| head.map.to_string()).collect();
    let known = if names.is_empty() { "no maps yet".to_owned() } else { names.join(", ") };
    error(ErrorCode::UnknownMap, format!("there is no map {map} here (there is: {known})"))
}

fn increments(
    map: &MapName,
    view: &MapView,
    store: &Store,
    moment: &Moment,
    have: &VersionVector,
    max_bytes: usize,
) -> Result<Answer, ErrorReply> {
    let now = &view.head.vector;
    let unknown = |what: String| {
        let text = format!("map {map} has no {what}; it is at version {}, vector {now}", view.head.version);
        error(ErrorCode::UnknownVersion, text)
    };
    let upto = match moment {
        Moment::Now => now.clone(),
        Moment::Vector(vector) if now.covers(vector) => vector.clone(),
        Moment::Vector(vector) => return Err(unknown(format!("vector {vector}"))),
        Moment::Version(version) if *version <= view.head.version => {
            store.vector_at(map, *version).map_err(internal)?
        }
        Moment::Version(version) => return Err(unknown(format!("version {version}"))),
    };
    let stored = store.lacking(map, have, &upto, max_bytes).map_err(internal)?;
    let increments = stored.iter().map(|bytes| decode(bytes)).collect::<Result<_, _>>().map_err(internal)?;
    postcard(&Snapshot { increments })
}

fn locate(map: &MapState, place: Place) -> Result<FixedPoint, ErrorReply> {
    match place {
        Place::Point(point) => Ok(point),
        Place::Node(id) => {
            let node = map.node(id);
            let position = node.map(|node| node.pose.position);
            position.ok_or_else(|| error(ErrorCode::UnknownNode, format!("there is no node {id} on this map")))
        }
    }
}

fn no_route(cause: &RouteError) -> ErrorReply {
    let code = match cause {
        RouteError::NoPath { .. } => ErrorCode::NoPath,
        RouteError::OutOfMap { .. } => ErrorCode::OutOfMap,
    };
    error(code, cause.to_string())
}

fn path(map: MapName, view: &MapView, route: &Route, format: Format) -> Result<Answer, ErrorReply> {
    let version = view.head.version;
    match format {
        Format::Json => {
            let waypoints = route.waypoints.iter().map(|waypoint| Waypoint {
                x: waypoint.point.x(),
                y: waypoint.point.y(),
                node: waypoint.node.map(|id| id.to_string()),
            });
            // To the millimetre, like everything else.
            let length_m = (route.length_m * 1000.0).round() / 1000.0;
            json(&PathReply { map, version, length_m, waypoints: waypoints.collect() })
        }
        Format::Postcard => {
            let waypoints = route.waypoints.iter();
            let waypoints = waypoints.map(|waypoint| CompactWaypoint { point: waypoint.point, node: waypoint.node });
            postcard(&CompactPath { map, version, waypoints: waypoints.collect() })
        }
    }
}

/// The most similar nodes with their cosines.
fn matching<'a>(
    map: &'a MapState,
    descriptor: &Descriptor,
    limit: usize,
) -> Result<Vec<(NodeRef<'a>, Option<f32>)>, ErrorReply> {
    let similar = lookup::most_similar(map, descriptor, limit);
    if similar.is_empty() && map.main_nodes().any(|node| node.descriptor().is_some()) {
        let used: Vec<String> = map.models().map(|model| format!("{} ({:08x})", model.name, model.id.0)).collect();
        let text = format!(
            "the descriptor is of model {:08x} with {} numbers; this map uses: {}",
            descriptor.model.0,
            descriptor.values.len(),
            used.join(", ")
        );
        return Err(error(ErrorCode::IncompatibleModel, text));
    }
    Ok(similar.into_iter().filter_map(|(id, cosine)| Some((map.node(id)?, Some(cosine)))).collect())
}

fn nodes_reply(
    map: MapName,
    view: &MapView,
    nodes: Vec<(NodeRef<'_>, Option<f32>)>,
    format: Format,
    with_signatures: bool,
) -> Result<Answer, ErrorReply> {
    let version = view.head.version;
    match format {
        Format::Json => {
            let nodes = nodes.iter().map(|(node, similarity)| node_view(&view.state, node, *similarity)).collect();
            json(&NodesReply { map, version, nodes })
        }
        Format::Postcard => {
            let compact = |(node, similarity): (NodeRef<'_>, Option<f32>)| CompactNode {
                id: node.id,
                kind: node.kind,
                pose: node.pose,
                free_space: node.free_space,
                signature: node.signature.filter(|_| with_signatures).cloned(),
                similarity,
            };
            postcard(&CompactNodes { map, version, nodes: nodes.into_iter().map(compact).collect() })
        }
    }
}

fn node_view(map: &MapState, node: &NodeRef<'_>, similarity: Option<f32>) -> NodeView {
    let position = node.pose.position;
    NodeView {
        id: node.id.to_string(),
        kind: node.kind,
        x: position.x(),
        y: position.y(),
        yaw: node.pose.yaw(),
        free_space: node.free_space.map(|rect| NodeView::corners(position, &rect)),
        neighbours: map.neighbours(node.id).map(|other| other.id.to_string()).collect(),
        similarity,
    }
}
