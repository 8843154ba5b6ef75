//! The panorama unrolled: a cylinder around the robot, on which a turn of the robot is just a
//! shift.
//!
//! Pinhole views stretch what is near their corners, so the same picture looks different in the
//! middle of a view and at its edge. On the cylinder it looks the same everywhere, which tells
//! places that are seen with another heading apart far better (figures in `models/README.md`).

use fht_perception::frame::Panorama;
use image::{Rgb, RgbImage};
use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2, FRAC_PI_4, TAU};

/// Width of the part repeated at either end of the strip, so that the network sees no seam, pixels.
pub(crate) const MARGIN_PX: u32 = 64;
/// Heights are multiples of this, pixels, which suits the strides of networks.
const HEIGHT_STEP_PX: f64 = 16.0;

/// Unrolls a panorama to a strip `width_px` wide: from the left edge of the view ahead, to the
/// right, all the way around. It covers the elevations that the views have everywhere (tangent
/// ±1/√2). `None` if a view or the strip has no pixels.
#[must_use]
pub(crate) fn unroll(panorama: &Panorama, width_px: u32) -> Option<RgbImage> {
    if width_px == 0 || panorama.views.iter().any(|view| view.width() == 0 || view.height() == 0) {
        return None;
    }
    let radius = f64::from(width_px) / TAU;
    let steps = (radius * 2.0 * FRAC_1_SQRT_2 / HEIGHT_STEP_PX).floor().max(1.0);
    let height_px = (steps * HEIGHT_STEP_PX) as u32;
    let mut strip = RgbImage::new(width_px, height_px);
    for column in 0..width_px {
        let azimuth = FRAC_PI_4 - (f64::from(column) + 0.5) / radius;
        let quarter = (azimuth / FRAC_PI_2).round();
        let view = &panorama.views[(quarter as i64).rem_euclid(4) as usize];
        let (sin, cos) = (azimuth - quarter * FRAC_PI_2).sin_cos();
        let x = (1.0 - sin / cos) / 2.0 * f64::from(view.width()) - 0.5;
        for row in 0..height_px {
            let up = (f64::from(height_px) / 2.0 - f64::from(row) - 0.5) / radius;
            let y = (1.0 - up / cos) / 2.0 * f64::from(view.height()) - 0.5;
            strip.put_pixel(column, row, sample(view, x, y));
        }
    }
    Some(strip)
}

/// The strip with [`MARGIN_PX`] of its opposite end added at either end (less if the strip is
/// shorter), and the width of that margin.
#[must_use]
pub(crate) fn close(strip: &RgbImage) -> (RgbImage, u32) {
    let width = strip.width();
    let margin = MARGIN_PX.min(width);
    let closed =
        RgbImage::from_fn(width + 2 * margin, strip.height(), |x, y| *strip.get_pixel((x + width - margin) % width, y));
    (closed, margin)
}

/// The colour at a point between pixel centres, interpolated; beyond the border the border's
/// colour.
fn sample(view: &RgbImage, x: f64, y: f64) -> Rgb<u8> {
    let split = |at: f64, size: u32| {
        let at = at.clamp(0.0, f64::from(size - 1));
        let low = at.floor();
        (low as u32, (low as u32 + 1).min(size - 1), at - low)
    };
    let (left, right, to_right) = split(x, view.width());
    let (top, bottom, to_bottom) = split(y, view.height());
    let corners = [(left, top), (right, top), (left, bottom), (right, bottom)].map(|(x, y)| view.get_pixel(x, y).0);
    let mix = |channel: usize| {
        let [a, b, c, d] = corners.map(|colour| f64::from(colour[channel]));
        let (upper, lower) = (a + (b - a) * to_right, c + (d - c) * to_right);
        (upper + (lower - upper) * to_bottom).round() as u8
    };
    Rgb([mix(0), mix(1), mix(2)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_strip_goes_around_to_the_right() {
        let colours = [[200, 0, 0], [0, 200, 0], [0, 0, 200], [90, 90, 90]];
        let panorama = Panorama { views: colours.map(|colour| RgbImage::from_pixel(20, 20, Rgb(colour))) };
        let strip = unroll(&panorama, 128).unwrap();
        assert_eq!((strip.width(), strip.height()), (128, 16));
        // Ahead, right, behind, left.
        let seen: Vec<[u8; 3]> = [16, 48, 80, 112].map(|x| strip.get_pixel(x, 8).0).to_vec();
        assert_eq!(seen, [colours[0], colours[3], colours[2], colours[1]]);
        let (closed, margin) = close(&strip);
        assert_eq!((closed.width(), margin), (256, 64));
        assert_eq!(closed.get_pixel(63, 8), strip.get_pixel(127, 8));
        assert_eq!(closed.get_pixel(64, 8), strip.get_pixel(0, 8));
        assert_eq!(closed.get_pixel(192, 8), strip.get_pixel(0, 8));
    }

    #[test]
    fn views_of_any_size_are_unrolled() {
        let mut panorama = Panorama { views: [1, 2, 3, 50].map(|size| RgbImage::new(size, 60 / size)) };
        assert_eq!(unroll(&panorama, 7).map(|strip| strip.width()), Some(7));
        assert!(unroll(&panorama, 0).is_none());
        panorama.views[2] = RgbImage::new(0, 4);
        assert!(unroll(&panorama, 64).is_none());
    }
}
