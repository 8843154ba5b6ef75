//! What each map's scans say in the other: walls that are explained, walls in what the other knows
//! to be free, and beams through what the other knows as walls.

use crate::alignment::pose_alignment::Aligned;
use crate::alignment::prepared_map::{PreparedMap, PreparedNode};
use fht_perception::evidence_grid::{Evidence, EvidenceConfig, EvidenceGrid, Sighting};
use fht_perception::pose::{Point2, Pose2};

/// What speaks for an alignment, and against it.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Verdict {
    /// Both maps' scans in the other map.
    pub(crate) beams: Evidence,
    /// Free space that both maps know, square metres.
    pub(crate) overlap_m2: f64,
    /// Its share of `b`'s free space, 0 to 1.
    pub(crate) overlap_share: f64,
    /// Its share of the free space of the map that has less of it, 0 to 1.
    pub(crate) overlap_of_smaller: f64,
    /// Greatest distance between matched places, metres.
    pub(crate) spread_m: f64,
    /// How surely looks say that matched places are where they are, 0 to 1: the mean share of the
    /// first map's places elsewhere that look less like one than what is there. Half of them by
    /// chance.
    pub(crate) look: Option<f64>,
}

impl Verdict {
    /// Greater is better: what is explained, less what is contradicted many times over.
    pub(crate) fn gain(&self, contradiction_cost: f64) -> f64 {
        self.beams.explained as f64 - contradiction_cost * self.beams.contradicted as f64
    }
}

/// Weighs an alignment.
pub(crate) fn weigh(a: &PreparedMap<'_>, b: &PreparedMap<'_>, aligned: &Aligned, config: &EvidenceConfig) -> Verdict {
    let mut beams = Evidence::default();
    for (place, a_from_node) in b.places.iter().zip(&aligned.a_from_nodes) {
        beams.add(a.walls.known.weigh(&place.beams, a_from_node, config));
    }
    let sightings: Vec<Sighting> =
        b.places.iter().zip(&aligned.a_from_nodes).map(|(place, pose)| place.sighting(pose)).collect();
    let b_known = EvidenceGrid::new(&sightings, &[]);
    for place in &a.places {
        beams.add(b_known.weigh(&place.beams, &place.map_from_node, config));
    }
    let (mut b_cells, mut both) = (0_usize, 0_usize);
    for place in b_known.free_places() {
        b_cells += 1;
        both += usize::from(a.walls.known.is_free(place));
    }
    let a_cells = a.walls.known.free_places().count();
    let cell_m2 = b_known.resolution_m().powi(2);
    let place = |index: usize| Point2::from(aligned.a_from_nodes[index].translation.vector);
    let matched = || aligned.matched.iter().map(|&(index, _)| place(index));
    let spread_m = matched().flat_map(|one| matched().map(move |other| (one - other).norm())).fold(0.0, f64::max);
    let looks: Vec<f64> = aligned
        .matched
        .iter()
        .filter_map(|&(index, _)| look(a, &b.places[index], &aligned.a_from_nodes[index]))
        .collect();
    Verdict {
        beams,
        overlap_m2: both as f64 * cell_m2,
        overlap_share: both as f64 / b_cells.max(1) as f64,
        overlap_of_smaller: both as f64 / b_cells.min(a_cells).max(1) as f64,
        spread_m,
        look: (looks.len() >= LEAST_LOOKS).then(|| looks.iter().sum::<f64>() / looks.len() as f64),
    }
}

/// Fewer say nothing, be they matched places or places elsewhere.
const LEAST_LOOKS: usize = 4;
/// What is seen from places this far apart is alike, metres.
const HERE_M: f64 = 2.5;
/// Places this far off are elsewhere, metres.
const ELSEWHERE_M: f64 = 5.0;

/// The share of `a`'s places elsewhere that look less like a place of `b` than the nearest one
/// does.
fn look(a: &PreparedMap<'_>, place: &PreparedNode<'_>, a_from_node: &Pose2) -> Option<f64> {
    let here = Point2::from(a_from_node.translation.vector);
    let descriptor = place.descriptor?;
    let alike = a
        .places
        .iter()
        .filter_map(|other| Some(((other.position() - here).norm(), other.descriptor?.similarity(descriptor)?)));
    let alike: Vec<(f64, f32)> = alike.collect();
    let nearest =
        alike.iter().filter(|(metres, _)| *metres <= HERE_M).min_by(|one, other| one.0.total_cmp(&other.0))?;
    let elsewhere: Vec<f32> =
        alike.iter().filter(|(metres, _)| *metres >= ELSEWHERE_M).map(|(_, cosine)| *cosine).collect();
    let less = elsewhere.iter().filter(|cosine| **cosine < nearest.1).count();
    (elsewhere.len() >= LEAST_LOOKS).then(|| less as f64 / elsewhere.len() as f64)
}
