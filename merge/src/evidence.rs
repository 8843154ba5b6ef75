//! What each map's scans say in the other: walls that are explained, walls in what the other knows to be free, and beams through what the
//! other knows as walls.

use crate::align::Aligned;
use crate::side::Side;
use fht_robot::known_space::{Evidence, EvidenceConfig, KnownSpace, Sighting};
use fht_robot::pose::{Point2, Pose2};

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
    /// Median of how much matched places look like the nearest ones of the other map, above what the model calls near; where both look like
    /// anything.
    pub(crate) look: Option<f64>,
}

impl Verdict {
    /// Greater is better: what is explained, less what is contradicted many times over.
    pub(crate) fn gain(&self, contradiction_cost: f64) -> f64 {
        self.beams.explained as f64 - contradiction_cost * self.beams.contradicted as f64
    }
}

/// Weighs an alignment.
pub(crate) fn weigh(
    a: &Side<'_>,
    b: &Side<'_>,
    aligned: &Aligned,
    near: impl Fn(usize, usize) -> Option<f64>,
    config: &EvidenceConfig,
) -> Verdict {
    let mut beams = Evidence::default();
    for (place, a_from_node) in b.places.iter().zip(&aligned.a_from_nodes) {
        beams.add(a.walls.known.weigh(&place.beams, a_from_node, config));
    }
    let sightings: Vec<Sighting> =
        b.places.iter().zip(&aligned.a_from_nodes).map(|(place, pose)| place.sighting(pose)).collect();
    let b_known = KnownSpace::new(&sightings, &[]);
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
    let mut looks: Vec<f64> =
        aligned.matched.iter().filter_map(|&(index, _)| look(a, index, &aligned.a_from_nodes[index], &near)).collect();
    looks.sort_by(f64::total_cmp);
    Verdict {
        beams,
        overlap_m2: both as f64 * cell_m2,
        overlap_share: both as f64 / b_cells.max(1) as f64,
        overlap_of_smaller: both as f64 / b_cells.min(a_cells).max(1) as f64,
        spread_m,
        look: (looks.len() >= LEAST_LOOKS).then(|| looks[looks.len() / 2]),
    }
}

/// Fewer say nothing.
const LEAST_LOOKS: usize = 3;
/// Places this far apart look alike in one building, metres.
const LOOK_M: f64 = 2.5;

/// How much a place looks like the ones of `a` around it: the best of them.
fn look(a: &Side<'_>, place: usize, a_from_node: &Pose2, near: impl Fn(usize, usize) -> Option<f64>) -> Option<f64> {
    let here = Point2::from(a_from_node.translation.vector);
    let around = a.places.iter().enumerate().filter(|(_, other)| (other.position() - here).norm() <= LOOK_M);
    around.filter_map(|(other, _)| near(other, place)).max_by(f64::total_cmp)
}
