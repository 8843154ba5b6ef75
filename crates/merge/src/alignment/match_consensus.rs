//! Which matches say the same: each is one place of `b` in `a`, and two agree when the way between
//! both places is the same in both maps. The heaviest set that agrees pairwise is a hypothesis;
//! what is left then may make others.

use crate::alignment::candidates::Candidate;
use crate::alignment::prepared_map::PreparedMap;
use fht_perception::consensus::{ConsensusConfig, MOST_VERTICES, heaviest_clique, members};
use fht_perception::drift::{OdometryDrift, propagate};
use fht_perception::pose::wrap_angle;
use serde::{Deserialize, Serialize};

/// When matches agree.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct MatchConsensusConfig {
    /// How wrong the way between two places of a map is, along the straight line.
    pub noise: OdometryDrift,
    /// When two matches agree.
    pub consensus: ConsensusConfig,
    /// Hypotheses made, at most. Default 6.
    pub hypotheses: usize,
    /// Matches of a hypothesis, at least. Default 2.
    pub least: usize,
}

impl Default for MatchConsensusConfig {
    fn default() -> Self {
        Self {
            noise: OdometryDrift {
                position_per_m: 0.01,
                yaw_per_sqrt_m: 0.1_f64.to_radians(),
                yaw_per_rad: 0.0,
                ..OdometryDrift::default()
            },
            consensus: ConsensusConfig::default(),
            hypotheses: 6,
            least: 2,
        }
    }
}

/// Matches that agree: indices of candidates, at most one for each place of `b`. The weightiest
/// first.
pub(crate) fn hypotheses(
    b: &PreparedMap<'_>,
    candidates: &[Candidate],
    config: &MatchConsensusConfig,
) -> Vec<Vec<usize>> {
    let count = candidates.len();
    let mut agree = vec![false; count * count];
    for i in 0..count {
        for j in 0..i {
            let says = do_agree(b, &candidates[i], &candidates[j], config);
            (agree[i * count + j], agree[j * count + i]) = (says, says);
        }
    }
    let mut open: Vec<usize> = (0..count).collect();
    let mut found: Vec<Vec<usize>> = Vec::new();
    while found.len() < config.hypotheses {
        let friends = |&one: &usize| {
            let mut friends: Vec<usize> = open.iter().copied().filter(|other| agree[one * count + other]).collect();
            friends.push(one);
            friends
        };
        // Places count once, however many matches of one agree with this one.
        let support = |one: &usize| {
            let mut best = vec![0.0_f64; b.places.len()];
            for friend in friends(one).iter().map(|&friend| &candidates[friend]) {
                best[friend.place] = best[friend.place].max(friend.weight);
            }
            best.iter().sum::<f64>()
        };
        let supported = open.iter().map(|one| (support(one), *one));
        let Some((_, seed)) = supported.max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1))) else { break };
        let mut set = friends(&seed);
        set.sort_by(|a, b| {
            let weight = |index: &usize| candidates[*index].weight;
            (*b == seed).cmp(&(*a == seed)).then(weight(b).total_cmp(&weight(a))).then(a.cmp(b))
        });
        set.truncate(MOST_VERTICES);
        let graph: Vec<u64> = set
            .iter()
            .map(|i| {
                set.iter().enumerate().filter(|(_, j)| agree[i * count + **j]).fold(0, |bits, (bit, _)| bits | 1 << bit)
            })
            .collect();
        let weights: Vec<f64> = set.iter().map(|&index| candidates[index].weight).collect();
        let clique: Vec<usize> = members(heaviest_clique(&graph, &weights, u64::MAX)).map(|bit| set[bit]).collect();
        if clique.len() < config.least {
            break;
        }
        // What agrees with most of it says the same.
        let says_same = |one: &usize| {
            let with = clique.iter().filter(|&member| member == one || agree[one * count + member]).count();
            2 * with > clique.len()
        };
        open.retain(|one| !says_same(one) && *one != seed && !clique.contains(one));
        found.push(clique);
    }
    found
}

fn do_agree(b: &PreparedMap<'_>, one: &Candidate, other: &Candidate, config: &MatchConsensusConfig) -> bool {
    if one.place == other.place {
        return false;
    }
    let way = b.places[one.place].map_from_node.inverse() * b.places[other.place].map_from_node;
    let predicted = one.a_from_node * way;
    if !config.consensus.is_near(&predicted, &other.a_from_node) {
        return false;
    }
    let (metres, radians) = (way.translation.vector.norm(), wrap_angle(way.rotation.angle()).abs());
    let carried = propagate(&one.covariance, &one.a_from_node, &predicted, &config.noise, metres, radians);
    config.consensus.explains(&predicted, &other.a_from_node, &(carried + other.covariance))
}
