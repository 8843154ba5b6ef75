//! Walls drawn as lines, and how far a scanner sees among them.

use fht_perception::pose::Pose2;
use nalgebra::Vector2;

/// From one end to the other, metres.
pub type Wall = [(f64, f64); 2];

/// How far a beam from `at` goes, metres; its direction is in the frame of `at`.
pub fn range_m(walls: &[Wall], at: &Pose2, (cos, sin): (f64, f64)) -> f64 {
    let ahead = at.rotation * Vector2::new(cos, sin);
    let hits = walls.iter().filter_map(|&[(x1, y1), (x2, y2)]| {
        let (ex, ey, ox, oy) = (x2 - x1, y2 - y1, x1 - at.translation.x, y1 - at.translation.y);
        let cross = ahead.x * ey - ahead.y * ex;
        let (along, on_wall) = ((ox * ey - oy * ex) / cross, (ox * ahead.y - oy * ahead.x) / cross);
        (along > 0.0 && (0.0..=1.0).contains(&on_wall)).then_some(along)
    });
    hits.fold(f64::INFINITY, f64::min)
}
