//! The pose graph: `b`'s places where their matches with `a` and the ways between them agree best,
//! with `a` fixed.

use crate::alignment::candidates::{Candidate, CandidateConfig, contradiction};
use crate::alignment::match_consensus::MatchConsensusConfig;
use crate::alignment::prepared_map::PreparedMap;
use fht_perception::evidence_grid::EvidenceConfig;
use fht_perception::pose::Pose2;
use fht_perception::pose_graph::{GraphConfig, GraphError, PoseConstraint, chi2, optimise};
use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

/// How a hypothesis is made exact.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct PoseAlignmentConfig {
    /// Times that all places are held to the other map's walls. Default 3.
    pub rounds: usize,
    /// Each place is tied to so many others of its map, the nearest. Default 4.
    pub ties: usize,
    /// A match that is off by more than this squared Mahalanobis distance in the end counts as
    /// wrong. Default 25.
    pub max_chi2: f64,
    /// The optimisation.
    pub graph: GraphConfig,
}

impl Default for PoseAlignmentConfig {
    fn default() -> Self {
        Self { rounds: 3, ties: 4, max_chi2: 25.0, graph: GraphConfig { doubt_chi2: 25.0, ..GraphConfig::default() } }
    }
}

/// `b`'s places in `a`'s frame.
#[derive(Clone, Debug)]
pub(crate) struct Aligned {
    /// By place.
    pub(crate) a_from_nodes: Vec<Pose2>,
    /// The places that were matched to `a`'s walls and agree with the rest; how far each is from
    /// its own match, metres.
    pub(crate) matched: Vec<(usize, f64)>,
    /// Matches that do not agree with the rest.
    pub(crate) outliers: usize,
}

/// Ties between places of one map: a tree that holds all of them, and each one's nearest.
fn ties(b: &PreparedMap<'_>, config: &PoseAlignmentConfig) -> Vec<(usize, usize)> {
    let count = b.places.len();
    let distance = |i: usize, j: usize| (b.places[i].position() - b.places[j].position()).norm();
    let mut ties = Vec::new();
    // Prim's tree.
    let mut nearest: Vec<(f64, usize)> = (0..count).map(|other| (distance(0, other), 0)).collect();
    let mut is_in = vec![false; count];
    is_in[0] = true;
    for _ in 1..count {
        let outside = (0..count).filter(|&other| !is_in[other]);
        let Some(next) = outside.min_by(|&i, &j| nearest[i].0.total_cmp(&nearest[j].0)) else { break };
        ties.push((nearest[next].1.min(next), nearest[next].1.max(next)));
        is_in[next] = true;
        for (other, least) in nearest.iter_mut().enumerate() {
            let to_next = distance(next, other);
            if to_next < least.0 {
                *least = (to_next, next);
            }
        }
    }
    for here in 0..count {
        ties.extend(
            b.around(here, config.ties + 1, f64::INFINITY)
                .into_iter()
                .skip(1)
                .map(|other| (here.min(other), here.max(other))),
        );
    }
    ties.sort_unstable();
    ties.dedup();
    ties
}

/// Makes a hypothesis exact: what agrees with it is matched anew, as long as that is of use.
///
/// # Errors
/// [`GraphError`]: numbers that are no poses.
pub(crate) fn align(
    a: &PreparedMap<'_>,
    b: &PreparedMap<'_>,
    hypothesis: &[&Candidate],
    matching: &CandidateConfig,
    agreement: &MatchConsensusConfig,
    beams: &EvidenceConfig,
    config: &PoseAlignmentConfig,
) -> Result<Aligned, GraphError> {
    let ties: Vec<PoseConstraint> = ties(b, config)
        .into_iter()
        .map(|(i, j)| {
            let measured = b.places[i].map_from_node.inverse() * b.places[j].map_from_node;
            let (sigma_m, sigma_rad) = agreement.noise.sigmas(measured.translation.vector.norm(), 0.0);
            let diagonal = Vector3::new(sigma_m.powi(-2), sigma_m.powi(-2), sigma_rad.powi(-2));
            PoseConstraint {
                from: i + 1,
                to: j + 1,
                measured,
                information: Matrix3::from_diagonal(&diagonal),
                is_doubtful: false,
            }
        })
        .collect();
    // Pose 0 is the frame of `a`.
    let Some(first) = hypothesis.first() else {
        return Ok(Aligned { a_from_nodes: Vec::new(), matched: Vec::new(), outliers: 0 });
    };
    let a_from_b = first.a_from_node * b.places[first.place].map_from_node.inverse();
    let mut poses = vec![Pose2::identity()];
    poses.extend(b.places.iter().map(|place| a_from_b * place.map_from_node));
    let mut matches: Vec<PoseConstraint> = hypothesis
        .iter()
        .filter_map(|candidate| match_edge(candidate.place, candidate.a_from_node, &candidate.covariance))
        .collect();
    for round in 0..=config.rounds {
        let edges: Vec<PoseConstraint> = ties.iter().chain(&matches).cloned().collect();
        optimise(&mut poses, &edges, &config.graph)?;
        if round == config.rounds {
            break;
        }
        let found = b.places.iter().enumerate().filter_map(|(index, place)| {
            let (a_from_node, covariance) = matching.held(a, place, &poses[index + 1])?;
            let evidence = a.walls.known.weigh(&place.beams, &a_from_node, beams);
            let is_good = contradiction(&evidence) <= matching.max_contradicted;
            is_good.then(|| match_edge(index, a_from_node, &covariance)).flatten()
        });
        matches = found.collect();
    }
    let is_wrong = |edge: &&PoseConstraint| chi2(edge, &poses) > config.max_chi2;
    let outliers = matches.iter().filter(is_wrong).count();
    let off = |edge: &PoseConstraint| (poses[edge.to].translation.vector - edge.measured.translation.vector).norm();
    let matched = matches.iter().filter(|edge| !is_wrong(edge)).map(|edge| (edge.to - 1, off(edge))).collect();
    Ok(Aligned { a_from_nodes: poses.split_off(1), matched, outliers })
}

fn match_edge(place: usize, a_from_node: Pose2, covariance: &Matrix3<f64>) -> Option<PoseConstraint> {
    let information = covariance.try_inverse()?;
    Some(PoseConstraint { from: 0, to: place + 1, measured: a_from_node, information, is_doubtful: true })
}
