//! How well maps that were made apart are merged, against the truth.

use crate::survey::Survey;
use crate::team::parts;
use fht_map::plan::rules::Rules;
use fht_map::{FreeSpace, MapState, NodeRouteConfig};
use fht_merge::{AlignmentFigures, MergeConfig, MergeFigures, MergeOptions, MergeRefusal, join, lay};
use fht_perception::pose::{Point2, Pose2, from_fixed};
use fht_proto::{AuthorId, FixedPoint, Increment, NodeId, Op, Rect};
use fht_sim::{SimConfig, World};
use serde::{Deserialize, Serialize};
use std::time::Instant;

/// A map, and where its frame lies in the world.
#[derive(Clone)]
pub struct MadeMap {
    /// The map.
    pub map: MapState,
    /// Its frame in the world.
    pub world_from_map: Pose2,
}

impl MadeMap {
    /// Of an exploration.
    #[must_use]
    pub fn of(survey: &Survey) -> Self {
        Self { map: survey.map.clone(), world_from_map: survey.world_from_map }
    }

    /// The part of it whose nodes lie, in the world, where `is_kept` holds.
    #[must_use]
    pub fn part(&self, is_kept: impl Fn(Point2) -> bool) -> Self {
        let here = |id: NodeId| {
            let node = self.map.node(id)?;
            Some(self.world_from_map * Point2::from(from_fixed(node.pose).translation.vector))
        };
        let stays = |id: NodeId| here(id).is_some_and(&is_kept);
        Self { map: rebuilt(&self.map, stays, |op| op), world_from_map: self.world_from_map }
    }

    /// The mirrored building: y is negated. Its place in the world then has no meaning.
    #[must_use]
    pub fn mirrored(&self) -> Self {
        let mirror = |op: Op| match op {
            Op::PutNode { id, kind, pose } => {
                let at = pose.position;
                Op::PutNode { id, kind, pose: fht_proto::FixedPose::from_metres(at.x(), -at.y(), -pose.yaw()) }
            }
            Op::SetSignature { id, mut signature } => {
                let at = signature.scan.base_from_sensor;
                signature.scan.base_from_sensor =
                    fht_proto::FixedPose::from_metres(at.position.x(), -at.position.y(), -at.yaw());
                signature.scan.angle_min = -signature.scan.angle_min;
                signature.scan.angle_increment = -signature.scan.angle_increment;
                Op::SetSignature { id, signature }
            }
            Op::SetFreeSpace { id, rect } => {
                let turned = |rect: Rect| Rect { south_mm: rect.north_mm, north_mm: rect.south_mm, ..rect };
                Op::SetFreeSpace { id, rect: rect.map(turned) }
            }
            other => other,
        };
        Self { map: rebuilt(&self.map, |_| true, mirror), world_from_map: self.world_from_map }
    }
}

/// A map of the same nodes and edges, each changed.
fn rebuilt(map: &MapState, stays: impl Fn(NodeId) -> bool, change: impl Fn(Op) -> Op) -> MapState {
    let mut ops: Vec<Op> = map.models().map(|model| Op::PutModel { model: model.clone() }).collect();
    for node in map.nodes().filter(|node| stays(node.id)) {
        let id = node.id;
        ops.push(Op::PutNode { id, kind: node.kind, pose: node.pose });
        ops.extend(node.free_space.map(|rect| Op::SetFreeSpace { id, rect: Some(rect) }));
        ops.extend(node.signature.map(|signature| Op::SetSignature { id, signature: signature.clone() }));
    }
    let edges = map.edges().filter(|edge| stays(edge.low()) && stays(edge.high()));
    ops.extend(edges.map(|edge| Op::PutEdge { edge }));
    let mut made = MapState::new();
    apply(&mut made, AuthorId::of_robot("surgeon"), ops.into_iter().map(|op| vec![change(op)]));
    made
}

fn apply(map: &mut MapState, author: AuthorId, batches: impl IntoIterator<Item = Vec<Op>>) {
    for (number, ops) in (1..).zip(batches) {
        map.apply(&Increment { author, number, hlc_us: map.max_hlc_us() + 1, ops });
    }
}

/// The result of a merge.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Merged {
    /// How the maps were laid.
    pub alignment: AlignmentFigures,
    /// What was taken over.
    pub joined: MergeFigures,
    /// Mean error of the second map's nodes in the first map's frame, metres.
    pub error_mean_m: f64,
    /// The greatest of them, metres.
    pub error_max_m: f64,
    /// Connected parts of the first map and of the merged one. Parts of the second map that are not
    /// connected to the first are left out.
    pub parts: [usize; 2],
    /// Paths asked for between ground that only the first map's rectangles cover and ground that
    /// only the second's cover, in both directions.
    pub paths: usize,
    /// Of these, planned.
    pub planned: usize,
    /// Of these, touching something in the building.
    pub touching: usize,
    /// Seconds that laying and joining took.
    pub seconds: [f64; 2],
}

/// Merges `b` into `a`, and measures the result. Paths are checked against `world`, if there is
/// one.
///
/// # Errors
/// The refusal.
pub fn merge_and_measure(
    a: &MadeMap,
    b: &MadeMap,
    world: Option<&World>,
    config: &MergeConfig,
) -> Result<Merged, MergeRefusal> {
    let begin = Instant::now();
    let laid = lay(&a.map, &b.map, config)?;
    let laid_s = begin.elapsed().as_secs_f64();
    let author = AuthorId::of_robot("operator");
    let order = MergeOptions { author, suffix: "b", only_map: false };
    let joined = join(&a.map, &b.map, &laid, &order, config)?;
    let joined_s = begin.elapsed().as_secs_f64() - laid_s;
    let a_from_b = a.world_from_map.inverse() * b.world_from_map;
    let errors: Vec<f64> = b
        .map
        .nodes()
        .filter_map(|node| {
            let truth = a_from_b * from_fixed(node.pose);
            Some((laid.a_from_nodes.get(&node.id)?.translation.vector - truth.translation.vector).norm())
        })
        .collect();
    let mut both = a.map.clone();
    apply(&mut both, author, joined.batches);
    let mut merged = Merged {
        alignment: laid.figures,
        joined: joined.figures,
        error_mean_m: errors.iter().sum::<f64>() / errors.len().max(1) as f64,
        error_max_m: errors.iter().copied().fold(0.0, f64::max),
        parts: [parts(&a.map).0, parts(&both).0],
        paths: 0,
        planned: 0,
        touching: 0,
        seconds: [laid_s, joined_s],
    };
    if let Some(world) = world {
        merged.try_paths(a, &both, author, world);
    }
    Ok(merged)
}

/// Paths tried in each direction.
const PATHS: usize = 40;

impl Merged {
    fn try_paths(&mut self, a: &MadeMap, both: &MapState, author: AuthorId, world: &World) {
        let rules = Rules::of(both, Vec::new());
        let space = FreeSpace::of(both, &rules.space_config());
        let rects = |is_new: bool| -> Vec<(FixedPoint, Rect)> {
            let nodes = both.nodes().filter(|node| (node.id.author == author) == is_new);
            nodes.filter_map(|node| Some((node.pose.position, node.free_space?))).collect()
        };
        let (old, new) = (rects(false), rects(true));
        let covered =
            |rects: &[(FixedPoint, Rect)], place: FixedPoint| rects.iter().any(|(at, rect)| rect.contains(*at, place));
        let is_open = |place: &FixedPoint| space.contains(*place);
        let middles = |rects: &[(FixedPoint, Rect)]| -> Vec<FixedPoint> {
            let middle = |(at, rect): &(FixedPoint, Rect)| {
                let (low, high) = (rect.min(*at), rect.max(*at));
                FixedPoint::from_metres(0.5 * (low.0 + high.0), 0.5 * (low.1 + high.1))
            };
            rects.iter().map(middle).filter(is_open).collect()
        };
        let ours: Vec<FixedPoint> = middles(&old).into_iter().filter(|place| !covered(&new, *place)).collect();
        let theirs: Vec<FixedPoint> = middles(&new).into_iter().filter(|place| !covered(&old, *place)).collect();
        if ours.is_empty() || theirs.is_empty() {
            return;
        }
        let radius_m = SimConfig::default().radius_m;
        let at = |place: FixedPoint| a.world_from_map * Point2::new(place.x(), place.y());
        for number in 0..PATHS {
            // Strides that have no common divisor with most counts.
            let (one, other) = (ours[number * 7 % ours.len()], theirs[number * 5 % theirs.len()]);
            for (from, to) in [(one, other), (other, one)] {
                self.paths += 1;
                let Ok(route) = rules.plan(both, &space, from, to, &NodeRouteConfig::default()) else { continue };
                self.planned += 1;
                let points: Vec<Point2> = route.waypoints.iter().map(|waypoint| at(waypoint.point)).collect();
                let touch = points.windows(2).find(|pair| !world.is_clear(pair[0], pair[1], radius_m));
                if let Some(pair) = touch {
                    tracing::debug!(from = ?pair[0], to = ?pair[1], "a path touches something");
                    self.touching += 1;
                }
            }
        }
    }
}

/// Below which x in the world the given share of a map's main nodes lies, metres.
#[must_use]
pub fn quantile_x(made: &MadeMap, share: f64) -> f64 {
    let x = |node: fht_map::NodeRef<'_>| (made.world_from_map * from_fixed(node.pose)).translation.x;
    let mut all: Vec<f64> = made.map.main_nodes().map(x).collect();
    all.sort_by(f64::total_cmp);
    all.get(((all.len() as f64 * share) as usize).min(all.len().saturating_sub(1))).copied().unwrap_or(0.0)
}
