//! What is closed to an explorer: ground that operators keep robots out of, and places that other
//! robots found blocked. For planning it is drawn into a copy of the grid, as if something stood
//! there, so that no way leads over it and nothing beyond it is reached.
//!
//! Closed edges are left alone: they are a matter of ways over the map, which the explorer's grid
//! knows nothing of.

use fht_map::{Rules, SpaceConfig};
use fht_navigation::motion::{distance_to_segment, speed_limit_ahead};
use fht_perception::frame::Twist;
use fht_perception::grid::OccupancyGrid;
use fht_perception::pose::{Point2, Pose2, fixed_point};
use fht_proto::{FixedPoint, Zone};
use std::borrow::Cow;

/// A piece of ground that is closed, map frame.
enum Ground<'a> {
    Zone(&'a Zone),
    /// What stands somewhere reaches so far around it, metres.
    Blocked(FixedPoint, f64),
}

impl Ground<'_> {
    fn contains(&self, place: Point2) -> bool {
        match self {
            Self::Zone(zone) => zone.contains(fixed_point(place)),
            Self::Blocked(at, radius_m) => at.distance(fixed_point(place)) <= *radius_m,
        }
    }

    /// Whether it is to be drawn at a cell. Of a zone thinner than a cell, no cell's centre may lie
    /// inside: its border counts, too.
    fn is_drawn_at(&self, centre: Point2, cell_m: f64) -> bool {
        self.contains(centre)
            || match self {
                Self::Zone(zone) => {
                    zone.sides().any(|(a, b)| distance_to_segment(centre, metres(a), metres(b)) <= 0.5 * cell_m)
                }
                Self::Blocked(..) => false,
            }
    }

    /// The least and greatest coordinates of what is drawn.
    fn extent(&self, cell_m: f64) -> (Point2, Point2) {
        let (corners, margin_m) = match self {
            Self::Zone(zone) => (zone.corners.as_slice(), cell_m),
            Self::Blocked(at, radius_m) => (std::slice::from_ref(at), *radius_m),
        };
        let (mut min, mut max) = (Point2::from([f64::INFINITY; 2]), Point2::from([f64::NEG_INFINITY; 2]));
        for corner in corners {
            (min, max) = (min.inf(&metres(*corner)), max.sup(&metres(*corner)));
        }
        let margin = nalgebra::Vector2::repeat(margin_m);
        (min - margin, max + margin)
    }
}

fn metres(place: FixedPoint) -> Point2 {
    Point2::new(place.x(), place.y())
}

fn grounds(rules: &Rules) -> impl Iterator<Item = Ground<'_>> {
    let radius_m = f64::from(SpaceConfig::default().blocked_radius_mm) * 1e-3;
    let zones = rules.keep_out.iter().map(|(_, zone)| Ground::Zone(zone));
    let places = rules.blocked.iter().flat_map(|by| &by.places);
    zones.chain(places.map(move |at| Ground::Blocked(*at, radius_m)))
}

/// Whether a robot's centre may not be there.
pub(super) fn is_closed(rules: &Rules, place: Point2) -> bool {
    grounds(rules).any(|ground| ground.contains(place))
}

/// The grid with what is closed as occupied. Ground that a robot at `leaving` stands on stays as it
/// is, so that it finds the way off. The grid itself if nothing is closed.
pub(super) fn drawn<'a>(grid: &'a OccupancyGrid, rules: &Rules, leaving: Option<Point2>) -> Cow<'a, OccupancyGrid> {
    let mut drawn = Cow::Borrowed(grid);
    let cell_m = grid.resolution_m();
    for ground in grounds(rules).filter(|ground| !leaving.is_some_and(|place| ground.contains(place))) {
        let (min, max) = ground.extent(cell_m);
        drawn.to_mut().suppose_occupied(min, max, |centre| ground.is_drawn_at(centre, cell_m));
    }
    drawn
}

/// A command that does not lead onto closed ground within `period_s` seconds: ways lead around it,
/// but before a way is known, and when the robot backs out of where it is stuck, nothing else
/// looks. The robot may turn, and leave.
pub(super) fn held_back(command: Twist, rules: &Rules, map_from_base: &Pose2, period_s: f64) -> Twist {
    let here = Point2::from(map_from_base.translation.vector);
    let there = map_from_base * Point2::new(command.linear_mps * period_s, 0.0);
    let is_barred = grounds(rules).any(|ground| ground.contains(there) && !ground.contains(here));
    if is_barred { Twist { linear_mps: 0.0, ..command } } else { command }
}

/// How fast a robot may drive, metres per second; none if nothing limits it.
pub(super) fn speed_limit_mps(rules: &Rules, map_from_base: &Pose2) -> Option<f64> {
    speed_limit_ahead(map_from_base, |place| rules.speed_limit_mps(fixed_point(place)))
}

#[cfg(test)]
mod tests;
