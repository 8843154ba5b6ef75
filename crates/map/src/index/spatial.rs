//! Nodes by place: which rectangles of free space contain a point or come near it.
//!
//! This is an R*-tree (`rstar`) over the rectangles; a node without one is a rectangle without
//! area. A grid of buckets would be simpler for points, but rectangles reach from centimetres to 65
//! m: a bucket would hold too many, or a rectangle would lie in thousands, and a grid does not tell
//! how far away the nearest one is. The tree does all of this and changes in place. Its shape
//! depends on the order of changes, so its findings are sorted here.

use fht_proto::{FixedPoint, Rect};
use rstar::{AABB, PointDistance, RTree, RTreeObject};

/// A node's rectangle.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Spot {
    number: u32,
    position: FixedPoint,
    rect: Rect,
}

/// Millimetres as the tree has them: no difference or square of these overflows.
fn corner(point: FixedPoint) -> [f64; 2] {
    [point.x_mm.into(), point.y_mm.into()]
}

/// The point of a rectangle around `position` that is nearest to `point`.
pub(crate) fn nearest_in(position: FixedPoint, rect: Rect, point: FixedPoint) -> FixedPoint {
    let clamp = |value: i32, centre: i32, below: u16, above: u16| {
        value.clamp(centre.saturating_sub(below.into()), centre.saturating_add(above.into()))
    };
    FixedPoint {
        x_mm: clamp(point.x_mm, position.x_mm, rect.west_mm, rect.east_mm),
        y_mm: clamp(point.y_mm, position.y_mm, rect.south_mm, rect.north_mm),
    }
}

impl RTreeObject for Spot {
    type Envelope = AABB<[f64; 2]>;

    fn envelope(&self) -> Self::Envelope {
        let [x, y] = corner(self.position);
        let Rect { west_mm, south_mm, east_mm, north_mm } = self.rect;
        let reach = [west_mm, south_mm, east_mm, north_mm].map(f64::from);
        AABB::from_corners([x - reach[0], y - reach[1]], [x + reach[2], y + reach[3]])
    }
}

impl PointDistance for Spot {
    fn distance_2(&self, point: &[f64; 2]) -> f64 {
        self.envelope().distance_2(point)
    }
}

/// Rectangles of nodes, by the nodes' numbers in
/// [`RoadGraph`](crate::graph::road_graph::RoadGraph).
#[derive(Clone, Debug, Default)]
pub struct Places {
    tree: RTree<Spot>,
    /// What the tree holds, by number.
    spots: Vec<Option<Spot>>,
}

impl Places {
    /// Nodes with their positions and rectangles. Of one number the last counts.
    #[must_use]
    pub fn new(nodes: impl IntoIterator<Item = (u32, FixedPoint, Option<Rect>)>) -> Self {
        let mut spots: Vec<Option<Spot>> = Vec::new();
        for (number, position, rect) in nodes {
            spots.resize(spots.len().max(number as usize + 1), None);
            spots[number as usize] = Some(Spot { number, position, rect: rect.unwrap_or_default() });
        }
        Self { tree: RTree::bulk_load(spots.iter().copied().flatten().collect()), spots }
    }

    /// Adds a node, or gives it another place or rectangle.
    pub fn put(&mut self, number: u32, position: FixedPoint, rect: Option<Rect>) {
        let spot = Spot { number, position, rect: rect.unwrap_or_default() };
        let place = number as usize;
        if self.spots.get(place) == Some(&Some(spot)) {
            return;
        }
        self.remove(number);
        self.spots.resize(self.spots.len().max(place + 1), None);
        self.spots[place] = Some(spot);
        self.tree.insert(spot);
    }

    /// Takes a node away.
    pub fn remove(&mut self, number: u32) {
        if let Some(spot) = self.spots.get_mut(number as usize).and_then(Option::take) {
            self.tree.remove(&spot);
        }
    }

    /// Where a node is, and its rectangle: one without area if it has none.
    #[must_use]
    pub fn get(&self, number: u32) -> Option<(FixedPoint, Rect)> {
        self.spots.get(number as usize).copied().flatten().map(|spot| (spot.position, spot.rect))
    }

    /// The nodes whose rectangles come within `reach_m` metres of a place (0: contain it), in the
    /// order of their numbers.
    #[must_use]
    pub fn within(&self, point: FixedPoint, reach_m: f64) -> Vec<u32> {
        // What is exactly so far away is decided below, with the distance that everything else is
        // decided with.
        let reach_mm = reach_m * 1000.0 + 1.0;
        if reach_mm.is_nan() || reach_mm < 1.0 {
            return Vec::new();
        }
        let found = self.tree.locate_within_distance(corner(point), reach_mm * reach_mm);
        let is_near = |spot: &&Spot| nearest_in(spot.position, spot.rect, point).distance(point) <= reach_m;
        let mut numbers: Vec<u32> = found.filter(is_near).map(|spot| spot.number).collect();
        numbers.sort_unstable();
        numbers
    }

    /// How far the nearest rectangle is from a place, metres; `None` without nodes.
    #[must_use]
    pub fn nearest_m(&self, point: FixedPoint) -> Option<f64> {
        let spot = self.tree.nearest_neighbor(corner(point))?;
        Some(nearest_in(spot.position, spot.rect, point).distance(point))
    }

    /// Nodes.
    #[must_use]
    pub fn len(&self) -> usize {
        self.tree.size()
    }

    /// Whether there are no nodes.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}
