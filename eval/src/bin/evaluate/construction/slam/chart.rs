//! Scans as a picture: where walls are double, the map is wrong.

use fht_perception::pose::{Point2, Pose2};
use fht_picture::{Extent, LegendEntry, PictureConfig, PictureError, Plot, Rgb, Sheet, Swatch};
use std::path::Path;

/// Share of the points that may fall off the picture on each side: stray returns far away.
const STRAY: f64 = 0.001;
/// A point makes its pixel so much darker, of 255.
const POINT_LEVELS: u8 = 70;
const WALL: Rgb = [0, 0, 0];
const PATH: Rgb = [214, 39, 40];

/// A scan's points in the robot's frame, and where it was taken.
pub struct Posed<'a> {
    pub map_from_base: Pose2,
    pub points: &'a [Point2],
}

/// Draws scans in black, darker where more points lie, and the trajectory in red, into a PNG file.
pub fn draw(scans: &[Posed<'_>], trajectory: &[(u64, Pose2)], title: &str, path: &Path) -> Result<(), PictureError> {
    let placed = |scan: &Posed<'_>| {
        let map_from_base = scan.map_from_base;
        scan.points.iter().map(move |point| map_from_base * point).collect::<Vec<_>>()
    };
    let points: Vec<Point2> = scans.iter().flat_map(placed).collect();
    let (x, y) = (extent(points.iter().map(|point| point.x)), extent(points.iter().map(|point| point.y)));
    let of_points = x
        .zip(y)
        .map(|((left, right), (bottom, top))| Extent { min: Point2::new(left, bottom), max: Point2::new(right, top) });
    let driven: Vec<Point2> = trajectory.iter().map(|(_, pose)| Point2::from(pose.translation.vector)).collect();
    let both = of_points.into_iter().chain(Extent::around(driven.iter().copied())).reduce(Extent::join);
    let mut plot = Plot::new(both.ok_or(PictureError::Empty)?, &PictureConfig::default())?;
    points.iter().for_each(|point| plot.darken(*point, POINT_LEVELS));
    plot.line(&driven, PATH, 1.2);
    let entry = |swatch, colour, label| LegendEntry { swatch, colour, label };
    let legend = [entry(Swatch::Area, WALL, "scan points"), entry(Swatch::Line, PATH, "path driven")];
    Sheet { plot: &plot, title, legend: &legend }.save(path)
}

/// Least and greatest value, without a few stray ones.
fn extent(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    let stray = (STRAY * values.len() as f64) as usize;
    Some((*values.get(stray)?, *values.get(values.len().checked_sub(1 + stray)?)?))
}
