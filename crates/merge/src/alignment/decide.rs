//! Is it one building, and is this how the maps lie? Everything that could be said against it is
//! asked.

use crate::alignment::candidates::contradiction;
use crate::alignment::evidence::Verdict;
use crate::alignment::pose_alignment::Aligned;
use crate::refusal::MergeRefusal;
use fht_perception::drift::difference;
use fht_perception::pose::Pose2;
use serde::{Deserialize, Serialize};

/// When two maps are believed to be of one building.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct DecideConfig {
    /// Fewest places that were matched one by one and agree. Default 4.
    pub least_matches: usize,
    /// They are at least this far apart, metres. Default 4.
    pub least_spread_m: f64,
    /// Least free space that both maps know, square metres. Default 20.
    pub least_overlap_m2: f64,
    /// And its least share of the map that has less. Default 0.1.
    pub least_overlap_share: f64,
    /// Greatest share of beams that contradict the other map, among those that say something,
    /// before any place is matched. Default 0.05.
    pub max_contradicted: f64,
    /// So much more for each matched place: furniture may have moved, if all the rest fits in many
    /// places. Default 0.003.
    pub max_contradicted_per_place: f64,
    /// But never more than this. Default 0.12: with a third of the furniture moved it is 0.06, in
    /// the same rooms with other furniture 0.24, in another building 0.4 and more.
    pub most_contradicted: f64,
    /// A contradicted beam counts against as many explained ones. Default 5.
    pub contradiction_cost: f64,
    /// Greatest share of the best way's gain that a second one may have. Default 0.7.
    pub max_rival: f64,
    /// Ways differ when matched places are at least this far apart in the mean, metres. Default
    /// 0.5.
    pub apart_m: f64,
    /// Or headings differ by this, radians. Default 0.2.
    pub apart_rad: f64,
    /// Least mean share of places elsewhere that look less like a matched place than what is there.
    /// Default 0.65; by chance it is 0.5.
    pub least_look: f64,
}

impl Default for DecideConfig {
    fn default() -> Self {
        Self {
            least_matches: 4,
            least_spread_m: 4.0,
            least_overlap_m2: 20.0,
            least_overlap_share: 0.1,
            max_contradicted: 0.05,
            max_contradicted_per_place: 0.003,
            most_contradicted: 0.12,
            contradiction_cost: 5.0,
            max_rival: 0.7,
            apart_m: 0.5,
            apart_rad: 0.2,
            least_look: 0.65,
        }
    }
}

/// A way to lay `b` on `a`, weighed.
pub(crate) struct Weighed {
    pub(crate) aligned: Aligned,
    pub(crate) verdict: Verdict,
}

/// The way that is believed, of some that were weighed.
pub(crate) fn decide(mut ways: Vec<Weighed>, config: &DecideConfig) -> Result<Weighed, MergeRefusal> {
    let gain = |way: &Weighed| way.verdict.gain(config.contradiction_cost);
    ways.sort_by(|one, other| gain(other).total_cmp(&gain(one)));
    let needed = config.least_matches;
    if ways.is_empty() {
        return Err(MergeRefusal::TooFewMatches { agreeing: 0, needed });
    }
    let best = ways.remove(0);
    let agreeing = best.aligned.matched.len();
    if agreeing < needed {
        return Err(MergeRefusal::TooFewMatches { agreeing, needed });
    }
    let Verdict { spread_m, overlap_m2, overlap_of_smaller: share, .. } = best.verdict;
    let is_wide = spread_m >= config.least_spread_m
        && overlap_m2 >= config.least_overlap_m2
        && share >= config.least_overlap_share;
    if !is_wide {
        return Err(MergeRefusal::TooLittleOverlap { agreeing, spread_m, overlap_m2, share });
    }
    let contradicted = contradiction(&best.verdict.beams);
    let most = config.max_contradicted + config.max_contradicted_per_place * agreeing as f64;
    let most = most.min(config.most_contradicted);
    if contradicted > most {
        return Err(MergeRefusal::Contradiction { share: contradicted, most });
    }
    for other in &ways {
        let share = gain(other) / gain(&best).max(1.0);
        let (apart_m, apart_rad) = apart(&best.aligned, &other.aligned);
        let is_other = apart_m >= config.apart_m || apart_rad >= config.apart_rad;
        if is_other && share > config.max_rival {
            return Err(MergeRefusal::Ambiguous { apart_m, apart_deg: apart_rad.to_degrees(), share });
        }
    }
    match best.verdict.look {
        Some(look) if look < config.least_look => Err(MergeRefusal::LooksDifferent { share: look }),
        _ => Ok(best),
    }
}

/// How far two ways to lay `b` on `a` are apart: mean over the places that the first one matched,
/// metres, and mean turn, radians.
fn apart(one: &Aligned, other: &Aligned) -> (f64, f64) {
    let gaps = one.matched.iter().filter_map(|&(place, _)| {
        let at = |aligned: &Aligned| -> Option<Pose2> { aligned.a_from_nodes.get(place).copied() };
        Some(difference(&at(one)?, &at(other)?))
    });
    let (mut metres, mut radians, mut count) = (0.0, 0.0, 0.0_f64);
    for gap in gaps {
        (metres, radians, count) = (metres + gap.xy().norm(), radians + gap.z.abs(), count + 1.0);
    }
    (metres / count.max(1.0), radians / count.max(1.0))
}
