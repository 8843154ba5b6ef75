//! Which nodes of the second map are of use beside those of the first: main nodes that saw what no
//! other has seen, and rectangles over ground that no other covers.

use crate::operations::coverage::Covered;
use fht_map::MapState;
use fht_perception::frame::LaserScan;
use fht_perception::free_rectangle::{FreeRectangleConfig, grow};
use fht_perception::grid::OccupancyGrid;
use fht_perception::matching::{ReferenceCloud, SeenPoint};
use fht_perception::pose::{Point2, Pose2, from_fixed, to_fixed};
use fht_perception::square::{SquareIndex, square_of};
use fht_proto::{FixedPoint, NodeId, NodeKind, Rect};
use serde::{Deserialize, Serialize};
use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet, BinaryHeap};

/// What is of use.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct NodeSelectionConfig {
    /// A wall is known within this of where another node saw it, metres. Default 0.1.
    pub known_m: f64,
    /// A main node is kept that shows at least so much wall that no other shows, metres. Default 2.
    pub least_news_m: f64,
    /// And one with a picture when no other with one of the same model is within this, metres.
    /// Default 3.
    pub look_m: f64,
    /// A rectangle is kept that covers at least so much ground that no other covers, square metres.
    /// Default 0.1.
    pub least_ground_m2: f64,
    /// How rectangles are grown.
    pub free_space: FreeRectangleConfig,
}

impl Default for NodeSelectionConfig {
    fn default() -> Self {
        Self {
            known_m: 0.1,
            least_news_m: 2.0,
            look_m: 3.0,
            least_ground_m2: 0.1,
            free_space: FreeRectangleConfig::default(),
        }
    }
}

/// A node of the second map that is taken over.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Kept {
    /// What it is taken over as: a main node that shows nothing new becomes a support node.
    pub(crate) kind: NodeKind,
    pub(crate) a_from_node: Pose2,
    pub(crate) free_space: Option<Rect>,
}

impl Kept {
    pub(crate) fn position(&self) -> FixedPoint {
        to_fixed(&self.a_from_node).position
    }

    /// A node at its place, with the rectangle that both maps together leave it.
    pub(crate) fn at(a_from_node: &Pose2, kind: NodeKind, grid: &OccupancyGrid, config: &NodeSelectionConfig) -> Self {
        let free_space = grow(grid, to_fixed(a_from_node).position, &config.free_space);
        Self { kind, a_from_node: *a_from_node, free_space }
    }
}

/// Squares of this side in which a scan ends count once, metres.
const SQUARE_M: f64 = 0.1;

/// The nodes of `b`, at `a_from_nodes`, that are of use beside those of `a`. Those for which `must`
/// holds are kept anyway.
pub(crate) fn keep(
    a: &MapState,
    b: &MapState,
    a_from_nodes: &BTreeMap<NodeId, Pose2>,
    grid: &OccupancyGrid,
    must: impl Fn(NodeId) -> bool,
    config: &NodeSelectionConfig,
) -> BTreeMap<NodeId, Kept> {
    let mut covered = Covered::on(grid);
    for node in a.nodes() {
        if let Some(rect) = &node.free_space {
            covered.add(grid, node.pose.position, rect);
        }
    }
    let mut kept: BTreeMap<NodeId, Kept> = BTreeMap::new();
    for id in telling(a, b, a_from_nodes, config) {
        kept.insert(id, Kept::at(&a_from_nodes[&id], NodeKind::Main, grid, config));
    }
    for node in b.nodes().filter(|node| must(node.id)) {
        if let Some(a_from_node) = a_from_nodes.get(&node.id) {
            kept.entry(node.id).or_insert_with(|| Kept::at(a_from_node, NodeKind::Support, grid, config));
        }
    }
    for one in kept.values() {
        if let Some(rect) = &one.free_space {
            covered.add(grid, one.position(), rect);
        }
    }
    // What a rectangle adds only ever falls: it is counted again when it comes first, and stays
    // first if it still adds most.
    let others = a_from_nodes.iter().filter(|(id, _)| !kept.contains_key(id));
    let rest: BTreeMap<NodeId, Kept> =
        others.map(|(id, at)| (*id, Kept::at(at, NodeKind::Support, grid, config))).collect();
    let news = |covered: &Covered, id: &NodeId| -> u64 {
        let one = &rest[id];
        one.free_space.map_or(0, |rect| (covered.news_m2(grid, one.position(), &rect) * 1e6) as u64)
    };
    let mut waiting: BinaryHeap<(u64, Reverse<NodeId>)> =
        rest.keys().map(|id| (news(&covered, id), Reverse(*id))).collect();
    let least = (config.least_ground_m2 * 1e6) as u64;
    while let Some((bound, Reverse(id))) = waiting.pop().filter(|(bound, _)| *bound >= least) {
        let now = news(&covered, &id);
        if now < bound {
            waiting.push((now, Reverse(id)));
            continue;
        }
        let one = rest[&id].clone();
        if let Some(rect) = &one.free_space {
            covered.add(grid, one.position(), rect);
        }
        kept.insert(id, one);
    }
    kept
}

/// The main nodes of `b` that show what the first map's nodes and those chosen before do not.
fn telling(
    a: &MapState,
    b: &MapState,
    a_from_nodes: &BTreeMap<NodeId, Pose2>,
    config: &NodeSelectionConfig,
) -> Vec<NodeId> {
    let seen_from = |map_from_node: &Pose2, node: &fht_map::NodeRef<'_>| -> Vec<SeenPoint> {
        let Some(signature) = node.signature else { return Vec::new() };
        let scanner = Point2::from(from_fixed(signature.scan.base_from_sensor).translation.vector);
        let points = LaserScan::record_points_in_base(&signature.scan);
        points.iter().map(|end| SeenPoint::new(map_from_node * end, map_from_node * scanner)).collect()
    };
    let mut cloud = ReferenceCloud::default();
    let mut pictures = Vec::new();
    for node in a.main_nodes() {
        cloud.absorb(seen_from(&from_fixed(node.pose), &node), 0.5 * config.known_m);
        pictures.extend(node.descriptor().map(|picture| (picture.model, node.pose.position)));
    }
    let news_m = |cloud: &ReferenceCloud, seen: &[SeenPoint]| {
        let new = seen.iter().filter(|point| !cloud.has_point_within(point, config.known_m));
        let squares: BTreeSet<SquareIndex> = new.map(|point| square_of(point.position, SQUARE_M)).collect();
        squares.len() as f64 * SQUARE_M
    };
    let mut open: Vec<(f64, fht_map::NodeRef<'_>, Vec<SeenPoint>)> = b
        .main_nodes()
        .filter_map(|node| {
            let seen = seen_from(a_from_nodes.get(&node.id)?, &node);
            Some((news_m(&cloud, &seen), node, seen))
        })
        .collect();
    open.sort_by(|one, other| other.0.total_cmp(&one.0).then(one.1.id.cmp(&other.1.id)));
    let mut chosen = Vec::new();
    for (_, node, seen) in open {
        let here = to_fixed(&a_from_nodes[&node.id]).position;
        let is_unlike_any = |model| {
            !pictures.iter().any(|(other, at)| *other == model && FixedPoint::distance(*at, here) <= config.look_m)
        };
        let has_new_look = node.descriptor().is_some_and(|picture| is_unlike_any(picture.model));
        if has_new_look || news_m(&cloud, &seen) >= config.least_news_m {
            cloud.absorb(seen, 0.5 * config.known_m);
            pictures.extend(node.descriptor().map(|picture| (picture.model, here)));
            chosen.push(node.id);
        }
    }
    chosen
}
