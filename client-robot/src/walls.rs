//! What all main nodes of a map saw, as one: walls to match to, cells to weigh a pose by, and pictures to search in.

use crate::known_space::{KnownSpace, Sighting};
use crate::landmarks::Landmark;
use fht_proto::{FixedPoint, Rect};
use fht_robot::matching::{EverywhereConfig, ReferenceCloud, SeenPoint, WallPyramid};
use fht_robot::pose::Point2;

/// Points of a wall nearer together than this become their mean, metres: two nodes see one wall.
const SPACING_M: f64 = 0.04;

/// The union of all main nodes' scans, map frame.
pub struct Walls {
    /// To match scans to.
    pub cloud: ReferenceCloud,
    /// To weigh poses by.
    pub known: KnownSpace,
    /// To search in; `None` while nothing was seen.
    pub pyramid: Option<WallPyramid>,
}

impl Walls {
    /// Of these nodes and the rectangles of free space around all nodes.
    #[must_use]
    pub fn new<'a>(
        landmarks: impl Iterator<Item = &'a Landmark>,
        free: &[(FixedPoint, Rect)],
        config: &EverywhereConfig,
    ) -> Self {
        let mut cloud = ReferenceCloud::default();
        let mut sightings = Vec::new();
        for landmark in landmarks {
            let from = landmark.map_from_node * landmark.scanner;
            let ends: Vec<Point2> = landmark.points.iter().map(|point| landmark.map_from_node * point).collect();
            cloud.absorb(ends.iter().map(|end| SeenPoint::new(*end, from)), SPACING_M);
            sightings.push(Sighting { from, ends });
        }
        let known = KnownSpace::new(&sightings, free);
        let walls: Vec<Point2> = cloud.positions().collect();
        let places: Vec<Point2> = known.free_places().collect();
        let pyramid = WallPyramid::new(&walls, &places, config);
        Self { cloud, known, pyramid }
    }
}
