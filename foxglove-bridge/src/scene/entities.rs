//! What is on a map as entities: one for each node with its rectangle, each edge, place and zone,
//! and for what each robot found blocked. So an increment changes few of them.

use crate::scene::shapes::{BLUE, FREE, GREY, ORANGE, RED, YELLOW, arrow, disc, empty, faint, line, plane_pose, text};
use fht_map::plan::blocked::BlockedBy;
use fht_map::{MapState, NodeRef, Rules};
use fht_proto::{EdgeKey, FixedPoint, FixedPose, Label, NodeId, NodeKind, Zone, ZoneRule};
use foxglove::messages::{Color, CubePrimitive, KeyValuePair, LinePrimitive, SceneEntity, Timestamp, Vector3};
use std::fmt;
use std::sync::Arc;

/// A map as it is shown: its state, and what is closed on it.
#[derive(Clone, Debug, Default)]
pub struct MapScene {
    /// Nodes, edges, places, zones.
    pub state: MapState,
    /// What operators and robots have closed.
    pub rules: Arc<Rules>,
}

/// What an entity shows. As text it is the entity's id: `node 1a2b3c4d.17`, `edge 1a2b3c4d.3
/// 1a2b3c4d.17`, `place dock`, `zone lab`, `blocked by amr-7`.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum EntityKey {
    /// A node, with its rectangle of free space.
    Node(NodeId),
    /// An edge.
    Edge(EdgeKey),
    /// A named place.
    Place(Label),
    /// A zone.
    Zone(Label),
    /// All that a robot found blocked.
    Blocked(String),
}

impl fmt::Display for EntityKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Node(id) => write!(f, "node {id}"),
            Self::Edge(edge) => write!(f, "edge {} {}", edge.low(), edge.high()),
            Self::Place(name) => write!(f, "place {name}"),
            Self::Zone(name) => write!(f, "zone {name}"),
            Self::Blocked(robot) => write!(f, "blocked by {robot}"),
        }
    }
}

fn metres(point: FixedPoint) -> (f64, f64) {
    (point.x(), point.y())
}

impl MapScene {
    /// The entity, if what it shows is there.
    pub(crate) fn entity(&self, key: &EntityKey, at: Timestamp) -> Option<SceneEntity> {
        let entity = empty(key.to_string(), at);
        match key {
            EntityKey::Node(id) => Some(self.with_node(entity, &self.state.node(*id)?)),
            EntityKey::Edge(edge) => self.with_edge(entity, *edge),
            EntityKey::Place(name) => Some(with_place(entity, name, self.state.annotations().place(name)?)),
            EntityKey::Zone(name) => Some(with_zone(entity, name, self.zone(name)?)),
            EntityKey::Blocked(robot) => self.with_blocked(entity, robot),
        }
    }

    fn zone(&self, name: &Label) -> Option<&Zone> {
        self.state.annotations().zones().find(|(known, _)| *known == name).map(|(_, zone)| zone)
    }

    /// What a robot found blocked.
    pub(crate) fn blocked_by<'a>(&'a self, robot: &'a str) -> impl Iterator<Item = &'a BlockedBy> {
        self.rules.blocked.iter().filter(move |by| by.robot == robot)
    }

    fn with_node(&self, mut entity: SceneEntity, node: &NodeRef<'_>) -> SceneEntity {
        let (x, y) = metres(node.pose.position);
        if let Some(rect) = node.free_space {
            let ((min_x, min_y), (max_x, max_y)) = (rect.min(node.pose.position), rect.max(node.pose.position));
            let middle = [0.5 * (min_x + max_x), 0.5 * (min_y + max_y), 0.0];
            entity.cubes.push(CubePrimitive {
                pose: Some(plane_pose(middle, 0.0)),
                size: Some(Vector3 { x: max_x - min_x, y: max_y - min_y, z: 0.01 }),
                color: Some(FREE),
            });
        }
        let (kind, colour, size) = match node.kind {
            NodeKind::Main => ("main", RED, 0.24),
            NodeKind::Support => ("support", YELLOW, 0.14),
        };
        entity.cylinders.push(disc(x, y, size, 0.04, colour));
        let pair = |key: &str, value: String| KeyValuePair { key: key.to_owned(), value };
        entity.metadata = vec![pair("kind", kind.to_owned()), pair("trust", node.trust.to_string())];
        entity
    }

    fn with_edge(&self, mut entity: SceneEntity, edge: EdgeKey) -> Option<SceneEntity> {
        if !self.state.has_edge(edge) {
            return None;
        }
        let is_closed = self.rules.closed.contains(&edge);
        entity.lines.push(self.edge_line(edge, if is_closed { RED } else { faint(GREY, 0.8) })?);
        Some(entity)
    }

    fn edge_line(&self, edge: EdgeKey, colour: Color) -> Option<LinePrimitive> {
        let ends = [self.state.node(edge.low())?, self.state.node(edge.high())?];
        Some(line(ends.iter().map(|node| metres(node.pose.position)), 0.02, false, colour))
    }

    fn with_blocked(&self, mut entity: SceneEntity, robot: &str) -> Option<SceneEntity> {
        for by in self.blocked_by(robot) {
            let edges = by.edges.iter().filter_map(|edge| self.edge_line(*edge, ORANGE));
            entity.lines.extend(edges.map(|line| LinePrimitive { thickness: 0.1, ..line }));
            entity.cylinders.extend(by.places.iter().map(|place| disc(place.x(), place.y(), 0.3, 0.1, ORANGE)));
        }
        (!entity.lines.is_empty() || !entity.cylinders.is_empty()).then_some(entity)
    }
}

fn with_place(mut entity: SceneEntity, name: &Label, pose: FixedPose) -> SceneEntity {
    let (x, y) = metres(pose.position);
    entity.arrows.push(arrow([x, y, pose.yaw()], 0.5, BLUE));
    entity.texts.push(text(name.to_string(), x, y, BLUE));
    entity
}

fn with_zone(mut entity: SceneEntity, name: &Label, zone: &Zone) -> SceneEntity {
    let (colour, words) = match zone.rule {
        ZoneRule::KeepOut => (RED, format!("{name}: keep out")),
        ZoneRule::SpeedLimit(mm_per_s) => (ORANGE, format!("{name}: {} m/s", f64::from(mm_per_s) / 1000.0)),
    };
    let border = line(zone.corners.iter().copied().map(metres), 0.05, true, colour);
    entity.lines.push(LinePrimitive { thickness: 0.06, ..border });
    if let Some(corner) = zone.corners.first() {
        entity.texts.push(text(words, corner.x(), corner.y(), colour));
    }
    entity
}
