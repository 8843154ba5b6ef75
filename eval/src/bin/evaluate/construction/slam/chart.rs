//! Scans as a picture: where walls are double, the map is wrong.

use fht_perception::pose::{Point2, Pose2};
use image::{Rgb, RgbImage};

/// Longest side, pixels.
const MAX_PIXELS: f64 = 4000.0;
/// Share of the points that may fall off the picture on each side: stray returns far away.
const STRAY: f64 = 0.001;

/// A scan's points in the robot's frame, and where it was taken.
pub struct Posed<'a> {
    pub map_from_base: Pose2,
    pub points: &'a [Point2],
}

/// Draws scans in black, darker where more points lie, and the trajectory in red. `None` without
/// points.
pub fn draw(scans: &[Posed<'_>], trajectory: &[(u64, Pose2)]) -> Option<RgbImage> {
    let placed = |scan: &Posed<'_>| {
        let map_from_base = scan.map_from_base;
        scan.points.iter().map(move |point| map_from_base * point).collect::<Vec<_>>()
    };
    let points: Vec<Point2> = scans.iter().flat_map(placed).collect();
    let (left, right) = extent(points.iter().map(|point| point.x))?;
    let (bottom, top) = extent(points.iter().map(|point| point.y))?;
    let margin = 1.0;
    let (width_m, height_m) = (right - left + 2.0 * margin, top - bottom + 2.0 * margin);
    let metres_per_pixel = (width_m.max(height_m) / MAX_PIXELS).max(0.04);
    let size = |metres: f64| ((metres / metres_per_pixel).ceil() as u32).max(1);
    let mut picture = RgbImage::from_pixel(size(width_m), size(height_m), Rgb([255; 3]));
    let pixel = |place: &Point2, picture: &RgbImage| {
        let (x, y) = ((place.x - left + margin) / metres_per_pixel, (top + margin - place.y) / metres_per_pixel);
        let is_inside = x >= 0.0 && y >= 0.0 && x < f64::from(picture.width()) && y < f64::from(picture.height());
        is_inside.then_some((x as u32, y as u32))
    };
    for point in &points {
        if let Some((x, y)) = pixel(point, &picture) {
            let shade = &mut picture.get_pixel_mut(x, y).0;
            *shade = shade.map(|value| value.saturating_sub(50));
        }
    }
    for (_, pose) in trajectory {
        if let Some((x, y)) = pixel(&Point2::from(pose.translation.vector), &picture) {
            picture.put_pixel(x, y, Rgb([214, 39, 40]));
        }
    }
    Some(picture)
}

/// Least and greatest value, without a few stray ones.
fn extent(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    let stray = (STRAY * values.len() as f64) as usize;
    Some((*values.get(stray)?, *values.get(values.len().checked_sub(1 + stray)?)?))
}
