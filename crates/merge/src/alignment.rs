//! Where one map lies in the other, and how good that is.
//!
//! | module | idea |
//! | --- | --- |
//! | `prepared_map` | a map as it is compared |
//! | `candidates` | place recognition: where in the other map could this have been seen? |
//! | `match_consensus` | which matches say the same |
//! | `pose_alignment` | the pose graph: one map bent so that its places lie on their matches |
//! | `evidence` | what each map's scans say in the other |
//! | `decide` | is it one building, and is this how the maps lie? |

mod candidates;
mod decide;
mod evidence;
mod match_consensus;
mod pose_alignment;
mod prepared_map;

pub use candidates::CandidateConfig;
pub use decide::DecideConfig;
pub use match_consensus::MatchConsensusConfig;
pub use pose_alignment::PoseAlignmentConfig;

use crate::config::MergeConfig;
use crate::refusal::MergeRefusal;
use candidates::{Candidate, candidates, contradiction};
use decide::{Weighed, decide};
use evidence::weigh;
use fht_map::MapState;
use fht_perception::pose::{Point2, Pose2, from_fixed};
use fht_proto::NodeId;
use match_consensus::hypotheses;
use nalgebra::Vector2;
use pose_alignment::{Aligned, align};
use prepared_map::PreparedMap;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Where the second map lies in the first.
#[derive(Clone, Debug)]
pub struct Alignment {
    /// All nodes of the second map, in the first one's frame.
    pub a_from_nodes: BTreeMap<NodeId, Pose2>,
    /// The rigid motion that comes nearest to it.
    pub a_from_b: Pose2,
    /// How good it is.
    pub figures: AlignmentFigures,
}

/// How good an alignment is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AlignmentFigures {
    /// Main nodes of the second map.
    pub places: usize,
    /// Of these, matched to the first map one by one and in agreement.
    pub matched: usize,
    /// Of these, matched in contradiction to the others, and left out.
    pub outliers: usize,
    /// Where the second map's frame lies in the first: x and y in metres, yaw in radians.
    pub transform: [f64; 3],
    /// How far matched places are from their own match: median, metres.
    pub residual_median_m: f64,
    /// The greatest of them, metres.
    pub residual_max_m: f64,
    /// Free space that both maps know, square metres.
    pub overlap_m2: f64,
    /// Its share of the second map.
    pub overlap_share: f64,
    /// Share of beams that contradict the other map, among those that say something.
    pub contradicted: f64,
    /// Ways to lay one on the other that were weighed.
    pub ways: usize,
    /// How surely looks say that places are where they are, 0 to 1, by chance 0.5: the mean share
    /// of the first map's places elsewhere that look less like one than what is there. None without
    /// pictures of one model.
    pub look: Option<f64>,
}

/// Lays `b` on `a`.
///
/// # Errors
/// [`MergeRefusal`]: not one building, or not surely.
pub fn lay(a: &MapState, b: &MapState, config: &MergeConfig) -> Result<Alignment, MergeRefusal> {
    check_sizes(a, b, config)?;
    check_same(a, b)?;
    let side = |map| PreparedMap::of(map, &config.search, &config.evidence);
    let (a_side, b_side) = (side(a), side(b));
    for (name, side) in [("the first map", &a_side), ("the second map", &b_side)] {
        if side.places.is_empty() || side.walls.pyramid.is_none() {
            return Err(MergeRefusal::NothingSeen { map: name });
        }
    }
    let found = candidates(&a_side, &b_side, a, &config.candidates, &config.evidence);
    let sets = hypotheses(&b_side, &found, &config.agreement);
    tracing::debug!(candidates = found.len(), hypotheses = sets.len(), "places of the second map in the first");
    let mut ways = Vec::new();
    for set in &sets {
        let matches: Vec<&Candidate> = set.iter().map(|&index| &found[index]).collect();
        let MergeConfig { candidates, agreement, evidence, align: graph, .. } = config;
        let aligned = align(&a_side, &b_side, &matches, candidates, agreement, evidence, graph)?;
        let verdict = weigh(&a_side, &b_side, &aligned, &config.evidence);
        tracing::debug!(
            agreeing = set.len(),
            matched = aligned.matched.len(),
            outliers = aligned.outliers,
            contradicted = contradiction(&verdict.beams),
            gain = verdict.gain(config.decide.contradiction_cost),
            ?verdict,
            "a way to lay the second map on the first"
        );
        ways.push(Weighed { aligned, verdict });
    }
    let count = ways.len();
    let Weighed { aligned, verdict } = decide(ways, &config.decide)?;
    let a_from_b = rigid(&b_side, &aligned);
    let mut residuals: Vec<f64> = aligned.matched.iter().map(|(_, metres)| *metres).collect();
    residuals.sort_by(f64::total_cmp);
    let figures = AlignmentFigures {
        places: b_side.places.len(),
        matched: aligned.matched.len(),
        outliers: aligned.outliers,
        transform: [a_from_b.translation.x, a_from_b.translation.y, a_from_b.rotation.angle()],
        residual_median_m: residuals.get(residuals.len() / 2).copied().unwrap_or(0.0),
        residual_max_m: residuals.last().copied().unwrap_or(0.0),
        overlap_m2: verdict.overlap_m2,
        overlap_share: verdict.overlap_share,
        contradicted: contradiction(&verdict.beams),
        ways: count,
        look: verdict.look,
    };
    Ok(Alignment { a_from_nodes: carry_all(b, &b_side, &aligned), a_from_b, figures })
}

fn check_sizes(a: &MapState, b: &MapState, config: &MergeConfig) -> Result<(), MergeRefusal> {
    for (name, map) in [("the first map", a), ("the second map", b)] {
        let counts = map.counts();
        let too_large = |what: &str, has: usize, most: usize| {
            let too_large = MergeRefusal::TooLarge { what: format!("{name} has {has} {what}"), most: most.to_string() };
            if has > most { Err(too_large) } else { Ok(()) }
        };
        too_large("main nodes", counts.main_nodes, config.most_main_nodes)?;
        too_large("nodes", counts.main_nodes + counts.support_nodes, config.most_nodes)?;
    }
    Ok(())
}

/// Scans are never alike to the bit, unless they are one.
fn check_same(a: &MapState, b: &MapState) -> Result<(), MergeRefusal> {
    let is_shared = |node: &fht_map::NodeRef<'_>| {
        let other = a.node(node.id).and_then(|other| other.signature);
        node.signature.is_some()
            && node.signature.map(|signature| &signature.scan) == other.map(|signature| &signature.scan)
    };
    match b.main_nodes().filter(is_shared).count() {
        0 => Ok(()),
        shared => Err(MergeRefusal::SameMap { shared }),
    }
}

/// The rigid motion nearest to what became of the matched places (least squares over their
/// positions).
fn rigid(b: &PreparedMap<'_>, aligned: &Aligned) -> Pose2 {
    let pairs: Vec<(Point2, Point2)> = aligned
        .matched
        .iter()
        .map(|&(index, _)| (b.places[index].position(), Point2::from(aligned.a_from_nodes[index].translation.vector)))
        .collect();
    let count = pairs.len().max(1) as f64;
    let mean = |of: fn(&(Point2, Point2)) -> Vector2<f64>| pairs.iter().map(of).sum::<Vector2<f64>>() / count;
    let (from, to) = (mean(|pair| pair.0.coords), mean(|pair| pair.1.coords));
    let (mut sin, mut cos) = (0.0, 0.0);
    for (one, other) in &pairs {
        let (p, q) = (one.coords - from, other.coords - to);
        sin += p.x * q.y - p.y * q.x;
        cos += p.dot(&q);
    }
    let rotation = nalgebra::UnitComplex::new(sin.atan2(cos));
    Pose2::from_parts((to - rotation * from).into(), rotation)
}

/// Main nodes that carry a node along.
const CARRIERS: usize = 4;
/// Nearer than this all count alike, metres.
const NEAREST_M: f64 = 0.5;

/// All nodes: main nodes where they are aligned, the others as the main nodes around them have
/// moved, the nearer the more.
fn carry_all(b: &MapState, side: &PreparedMap<'_>, aligned: &Aligned) -> BTreeMap<NodeId, Pose2> {
    let placed: BTreeMap<NodeId, Pose2> =
        side.places.iter().zip(&aligned.a_from_nodes).map(|(place, pose)| (place.id, *pose)).collect();
    let moved: Vec<(Point2, Pose2)> = side
        .places
        .iter()
        .zip(&aligned.a_from_nodes)
        .map(|(place, a_from_node)| (place.position(), a_from_node * place.map_from_node.inverse()))
        .collect();
    let carry = |node: fht_map::NodeRef<'_>| {
        if let Some(pose) = placed.get(&node.id) {
            return (node.id, *pose);
        }
        let b_from_node = from_fixed(node.pose);
        let here = Point2::from(b_from_node.translation.vector);
        let mut near: Vec<(f64, &Pose2)> = moved.iter().map(|(at, motion)| ((at - here).norm(), motion)).collect();
        near.sort_by(|one, other| one.0.total_cmp(&other.0));
        near.truncate(CARRIERS);
        let (mut at, mut sin, mut cos, mut sum) = (Vector2::zeros(), 0.0, 0.0, 0.0);
        for (distance, motion) in near {
            let weight = distance.max(NEAREST_M).powi(-2);
            let moved = motion * b_from_node;
            at += weight * moved.translation.vector;
            (sin, cos) = (sin + weight * moved.rotation.angle().sin(), cos + weight * moved.rotation.angle().cos());
            sum += weight;
        }
        (node.id, Pose2::new(at / sum, f64::atan2(sin, cos)))
    };
    b.nodes().map(carry).collect()
}
