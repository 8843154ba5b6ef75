//! Whether what operators name and draw makes sense on the map: a place where a robot can be, a
//! zone that touches the map. Whoever means it writes it all the same.

use crate::crdt::state::MapState;
use crate::navmesh::free_space::{FreeSpace, SpaceConfig};
use crate::navmesh::outside::Ground;
use fht_proto::{FixedPoint, Zone};

/// A zone may reach this far beyond the map, metres.
const BEYOND_M: f64 = 100.0;

/// What is odd about a place or a zone.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DoubtfulWords {
    /// A place where no robot can be.
    #[error(
        "no robot can be at ({:.2}, {:.2}): it is in or behind a wall, or outside of the map; the nearest free space is at \
         ({:.2}, {:.2}), {:.2} m away",
        at.x(), at.y(), nearest.x(), nearest.y(), at.distance(*nearest)
    )]
    Unreachable {
        /// The place.
        at: FixedPoint,
        /// The nearest free space.
        nearest: FixedPoint,
    },
    /// A place that nobody has seen.
    #[error(
        "the map knows nothing of the ground at ({:.2}, {:.2}); the nearest free space is at ({:.2}, {:.2}), {:.2} m away",
        at.x(), at.y(), nearest.x(), nearest.y(), at.distance(*nearest)
    )]
    Unseen {
        /// The place.
        at: FixedPoint,
        /// The nearest free space.
        nearest: FixedPoint,
    },
    /// A zone where the map is not.
    #[error("the zone does not touch the map: it lies {away_m:.1} m outside")]
    ZoneApart {
        /// How far the box around it is from the one around the map, metres.
        away_m: f64,
    },
    /// A zone far larger than the map.
    #[error("the zone reaches {beyond_m:.1} m beyond the map, and more than {BEYOND_M} m make no sense")]
    ZoneHuge {
        /// How far its farthest corner is from the box around the map, metres.
        beyond_m: f64,
    },
}

/// Whether robots can go to a place, as far as the map knows, whatever is closed.
///
/// # Errors
/// [`DoubtfulWords`].
pub fn check_place(map: &MapState, at: FixedPoint) -> Result<(), DoubtfulWords> {
    match FreeSpace::of(map, &SpaceConfig::default()).ground_at(at) {
        Ground::Free => Ok(()),
        Ground::Unseen { nearest } => Err(DoubtfulWords::Unseen { at, nearest }),
        Ground::Unreachable { nearest } => Err(DoubtfulWords::Unreachable { at, nearest }),
    }
}

/// Whether a zone touches the map, and does not reach far beyond it. Of a map without nodes nothing
/// is known.
///
/// # Errors
/// [`DoubtfulWords`].
pub fn check_zone(map: &MapState, zone: &Zone) -> Result<(), DoubtfulWords> {
    let of_node = map.nodes().map(|node| {
        let (at, rect) = (node.pose.position, node.free_space.unwrap_or_default());
        (rect.min(at), rect.max(at))
    });
    let join = |a: ((f64, f64), (f64, f64)), b: ((f64, f64), (f64, f64))| {
        ((a.0.0.min(b.0.0), a.0.1.min(b.0.1)), (a.1.0.max(b.1.0), a.1.1.max(b.1.1)))
    };
    let Some(mapped) = of_node.reduce(join) else { return Ok(()) };
    let corners = zone.corners.iter().map(|corner| ((corner.x(), corner.y()), (corner.x(), corner.y())));
    let Some(drawn) = corners.reduce(join) else { return Ok(()) };
    let apart = |drawn: (f64, f64), mapped: (f64, f64)| (drawn.0 - mapped.1).max(mapped.0 - drawn.1).max(0.0);
    let beyond = |drawn: (f64, f64), mapped: (f64, f64)| (mapped.0 - drawn.0).max(drawn.1 - mapped.1);
    let x = |((low, _), (high, _)): ((f64, f64), (f64, f64))| (low, high);
    let y = |((_, low), (_, high)): ((f64, f64), (f64, f64))| (low, high);
    let away_m = apart(x(drawn), x(mapped)).hypot(apart(y(drawn), y(mapped)));
    if away_m > 0.0 {
        return Err(DoubtfulWords::ZoneApart { away_m });
    }
    let beyond_m = beyond(x(drawn), x(mapped)).max(beyond(y(drawn), y(mapped)));
    if beyond_m > BEYOND_M { Err(DoubtfulWords::ZoneHuge { beyond_m }) } else { Ok(()) }
}
