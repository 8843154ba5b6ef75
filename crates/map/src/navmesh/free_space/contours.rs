//! Outlines in whole millimetres: what nodes and edges declare free, and what is cut out of it.

use crate::crdt::state::NodeRef;
use crate::navmesh::plane::corner_of;
use fht_proto::FixedPoint;
use i_overlay::core::fill_rule::FillRule;
use i_overlay::core::overlay::Overlay;
use i_overlay::core::overlay_rule::OverlayRule;
use i_overlay::core::simplify::Simplify;
use i_overlay::i_float::int::point::IntPoint;
use i_overlay::i_shape::int::shape::{IntContour, IntShapes};

/// The union of contours: of either half of them first. Of hundreds that overlap, each would meet
/// each; of two halves only borders meet.
pub(crate) fn union(mut contours: Vec<IntContour<i32>>) -> IntShapes<i32> {
    if contours.len() <= UNION_AT_ONCE {
        return contours.simplify(FillRule::NonZero, Default::default());
    }
    let extent = |axis: fn(&IntPoint<i32>) -> i32| {
        let all = contours.iter().flatten().map(axis);
        let (least, greatest) =
            all.fold((i32::MAX, i32::MIN), |(least, greatest), at| (least.min(at), greatest.max(at)));
        i64::from(greatest) - i64::from(least)
    };
    let axis: fn(&IntPoint<i32>) -> i32 = if extent(|p| p.x) > extent(|p| p.y) { |p| p.x } else { |p| p.y };
    contours.sort_by_cached_key(|contour| contour.iter().map(axis).min());
    let others = contours.split_off(contours.len() / 2);
    Overlay::from_subj_and_clip(&union(contours), &union(others)).overlay(OverlayRule::Union, FillRule::NonZero)
}

/// What of some shapes lies outside of others.
pub(crate) fn difference(shapes: &IntShapes<i32>, less: &IntShapes<i32>) -> IntShapes<i32> {
    Overlay::from_subj_and_clip(shapes, less).overlay(OverlayRule::Difference, FillRule::NonZero)
}

/// So many contours are put together at once.
const UNION_AT_ONCE: usize = 8;

pub(crate) fn rectangle(node: &NodeRef<'_>) -> Option<IntContour<i32>> {
    let (rect, at) = (node.free_space?, node.pose.position);
    let x = [at.x_mm.saturating_sub(rect.west_mm.into()), at.x_mm.saturating_add(rect.east_mm.into())];
    let y = [at.y_mm.saturating_sub(rect.south_mm.into()), at.y_mm.saturating_add(rect.north_mm.into())];
    let is_flat = x[0] == x[1] || y[0] == y[1];
    (!is_flat).then(|| vec![point(x[0], y[0]), point(x[1], y[0]), point(x[1], y[1]), point(x[0], y[1])])
}

fn point(x: i32, y: i32) -> IntPoint<i32> {
    IntPoint::new(x, y)
}

/// The corridor around an edge, with half an octagon at either end: a robot may stand at a node and
/// turn.
pub(crate) fn corridor(from: FixedPoint, to: FixedPoint, half_width_mm: u16) -> Option<IntContour<i32>> {
    let ([x0, y0], [x1, y1]) = (corner_of(from), corner_of(to));
    let (dx, dy) = (x1 - x0, y1 - y0);
    let length = dx.hypot(dy);
    if length < 1.0 {
        return None;
    }
    let radius = f64::from(half_width_mm) / std::f64::consts::FRAC_PI_8.cos();
    let heading = dy.atan2(dx);
    let eighth = std::f64::consts::FRAC_PI_4;
    let half = |at: FixedPoint, first: f64| {
        (0..4).map(move |k| corner_at(at, radius, heading + first + (f64::from(k) + 0.5) * eighth))
    };
    Some(half(to, -2.0 * eighth).chain(half(from, 2.0 * eighth)).collect())
}

/// The corner of an octagon around a place.
fn corner_at(centre: FixedPoint, radius_mm: f64, angle: f64) -> IntPoint<i32> {
    let offset = |value: f64| (radius_mm * value).round() as i32;
    point(centre.x_mm.saturating_add(offset(angle.cos())), centre.y_mm.saturating_add(offset(angle.sin())))
}

/// An octagon around a place, counter-clockwise.
pub(crate) fn octagon(centre: FixedPoint, radius_mm: f64) -> impl Iterator<Item = IntPoint<i32>> {
    (0..8).map(move |k| corner_at(centre, radius_mm, (f64::from(k) + 0.5) * std::f64::consts::FRAC_PI_4))
}
