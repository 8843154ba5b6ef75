//! What all main nodes of a map saw, as one: walls to match to, cells to weigh a pose by, and
//! pictures to search in.

use crate::evidence_grid::{EvidenceGrid, Sighting};
use crate::matching::{BranchAndBoundConfig, ReferenceCloud, SeenPoint, WallPyramid};
use crate::pose::Point2;
use fht_proto::{FixedPoint, Rect};

/// Points of a wall nearer together than this become their mean, metres: two nodes see one wall.
const SPACING_M: f64 = 0.04;

/// The union of all main nodes' scans, map frame.
pub struct ReferenceMap {
    /// To match scans to.
    pub cloud: ReferenceCloud,
    /// To weigh poses by.
    pub known: EvidenceGrid,
    /// To search in; `None` while nothing was seen.
    pub pyramid: Option<WallPyramid>,
}

impl ReferenceMap {
    /// Of what was seen from these places, and the rectangles of free space around all nodes.
    #[must_use]
    pub fn new(sightings: &[Sighting], free: &[(FixedPoint, Rect)], config: &BranchAndBoundConfig) -> Self {
        let mut cloud = ReferenceCloud::default();
        for Sighting { from, ends } in sightings {
            cloud.absorb(ends.iter().map(|end| SeenPoint::new(*end, *from)), SPACING_M);
        }
        let known = EvidenceGrid::new(sightings, free);
        let walls: Vec<Point2> = cloud.positions().collect();
        let places: Vec<Point2> = known.free_places().collect();
        let pyramid = WallPyramid::new(&walls, &places, config);
        Self { cloud, known, pyramid }
    }
}
