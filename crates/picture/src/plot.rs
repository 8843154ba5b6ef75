//! Drawing in metres. What abuts is drawn without anti-aliasing, pixel for pixel, so that no seam
//! shows between two cells or two rectangles.

use crate::file::PictureError;
use fht_perception::pose::Point2;
use tiny_skia::{Color, ColorU8, FillRule, LineCap, LineJoin, Paint, Path, PathBuilder, Pixmap, Stroke, Transform};

/// Red, green, blue.
pub type Rgb = [u8; 3];

/// Around dots.
pub(crate) const OUTLINE: Rgb = [40, 40, 40];

/// How large a picture becomes.
#[derive(Clone, Debug)]
pub struct PictureConfig {
    /// Pixels for a metre, unless the longer side would leave the limits below. Default 25.
    pub px_per_m: f64,
    /// Least pixels of the longer side of what is drawn. Default 1200.
    pub least_px: u32,
    /// Most pixels of it. Default 4000.
    pub most_px: u32,
    /// Room around what is drawn, metres. Default 0.5.
    pub margin_m: f64,
}

impl Default for PictureConfig {
    fn default() -> Self {
        Self { px_per_m: 25.0, least_px: 1200, most_px: 4000, margin_m: 0.5 }
    }
}

/// A box with sides along the axes, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extent {
    /// Its corner of least x and y.
    pub min: Point2,
    /// The corner opposite.
    pub max: Point2,
}

impl Extent {
    /// The least box around points; none of no points.
    #[must_use]
    pub fn around(points: impl IntoIterator<Item = Point2>) -> Option<Self> {
        let point_box = |point: Point2| Self { min: point, max: point };
        points.into_iter().map(point_box).reduce(Self::join)
    }

    /// The least box around both.
    #[must_use]
    pub fn join(self, other: Self) -> Self {
        Self { min: self.min.inf(&other.min), max: self.max.sup(&other.max) }
    }

    /// With a margin, and neither side shorter than `least_m` or a sixth of the other.
    fn framed(self, margin_m: f64, least_m: f64) -> Self {
        let size = (self.max - self.min).add_scalar(2.0 * margin_m);
        let least = (size.max() / 6.0).max(least_m);
        let half = size.sup(&size.map(|_| least)) * 0.5;
        let middle = self.min + (self.max - self.min) * 0.5;
        Self { min: middle - half, max: middle + half }
    }
}

/// A drawing in metres: x to the right, y up.
pub struct Plot {
    pixmap: Pixmap,
    extent: Extent,
    px_per_m: f64,
}

impl Plot {
    /// An empty drawing of what lies in `extent`.
    ///
    /// # Errors
    /// [`PictureError::Large`] if there is no memory for it, [`PictureError::Empty`] for an extent
    /// that is no box.
    pub fn new(extent: Extent, config: &PictureConfig) -> Result<Self, PictureError> {
        /// Least length of a side, metres.
        const LEAST_M: f64 = 0.5;
        let extent = extent.framed(config.margin_m, LEAST_M);
        let size = extent.max - extent.min;
        let longer = size.max();
        if !longer.is_finite() {
            return Err(PictureError::Empty);
        }
        let (least, most) = (f64::from(config.least_px.max(1)), f64::from(config.most_px.max(config.least_px).max(1)));
        let px_per_m = (longer * config.px_per_m).clamp(least, most) / longer;
        let [width, height] = [size.x, size.y].map(|metres| (metres * px_per_m).round().max(1.0) as u32);
        let large = PictureError::Large { width: width.into(), height: height.into() };
        let mut pixmap = Pixmap::new(width, height).ok_or(large)?;
        pixmap.fill(Color::WHITE);
        Ok(Self { pixmap, extent, px_per_m })
    }

    /// What it shows: what was asked for, and a margin.
    #[must_use]
    pub fn extent(&self) -> Extent {
        self.extent
    }

    /// Pixels for a metre.
    #[must_use]
    pub fn px_per_m(&self) -> f64 {
        self.px_per_m
    }

    pub(crate) fn pixmap(&self) -> &Pixmap {
        &self.pixmap
    }

    /// Gives each pixel the colour of its middle, where that has one.
    pub fn fill(&mut self, mut colour_of: impl FnMut(Point2) -> Option<Rgb>) {
        for (x, y) in pixels(&self.pixmap) {
            let middle = Point2::new(
                self.extent.min.x + (f64::from(x) + 0.5) / self.px_per_m,
                self.extent.max.y - (f64::from(y) + 0.5) / self.px_per_m,
            );
            if let Some(colour) = colour_of(middle) {
                put(&mut self.pixmap, (x, y), colour);
            }
        }
    }

    /// Makes the pixel of a point darker by `levels` of 255.
    pub fn darken(&mut self, point: Point2, levels: u8) {
        let (x, y) = self.pixel(point);
        let (x, y) = (x.floor(), y.floor());
        let is_inside = x >= 0.0 && y >= 0.0 && x < self.pixmap.width() as f32 && y < self.pixmap.height() as f32;
        let Some(pixel) = is_inside.then(|| self.pixmap.pixel(x as u32, y as u32)).flatten() else { return };
        let colour = [pixel.red(), pixel.green(), pixel.blue()].map(|value| value.saturating_sub(levels));
        put(&mut self.pixmap, (x as i32, y as i32), colour);
    }

    /// Boxes of one colour that are one area where they abut or overlap, each with a thin line
    /// around it.
    pub fn boxes(&mut self, boxes: &[Extent], area: Rgb, line: Rgb) {
        let spans: Vec<[i32; 4]> = boxes.iter().map(|it| self.span(it)).collect();
        for &[left, top, right, bottom] in &spans {
            block(&mut self.pixmap, [left, top, right, bottom], area);
        }
        for &[left, top, right, bottom] in &spans {
            for side in [
                [left, top, right, top + 1],
                [left, bottom - 1, right, bottom],
                [left, top, left + 1, bottom],
                [right - 1, top, right, bottom],
            ] {
                block(&mut self.pixmap, side, line);
            }
        }
    }

    /// A line through points.
    pub fn line(&mut self, points: &[Point2], colour: Rgb, width_px: f64) {
        let mut builder = PathBuilder::new();
        for (index, point) in points.iter().enumerate() {
            let (x, y) = self.pixel(*point);
            if index == 0 { builder.move_to(x, y) } else { builder.line_to(x, y) }
        }
        stroke(&mut self.pixmap, builder.finish(), colour, width_px as f32);
    }

    /// A dot with a dark line around it.
    pub fn dot(&mut self, middle: Point2, radius_px: f64, colour: Rgb) {
        let middle = self.pixel(middle);
        dot(&mut self.pixmap, middle, radius_px as f32, colour);
    }

    /// Metres to pixels.
    fn pixel(&self, point: Point2) -> (f32, f32) {
        let (x, y) = ((point.x - self.extent.min.x) * self.px_per_m, (self.extent.max.y - point.y) * self.px_per_m);
        (x as f32, y as f32)
    }

    /// The pixels of a box, at least one: left, top, right, bottom, the last two exclusive. Boxes
    /// that share a side share the pixel's border that is nearest to it.
    fn span(&self, area: &Extent) -> [i32; 4] {
        let (left, bottom) = self.pixel(area.min);
        let (right, top) = self.pixel(area.max);
        let [left, top, right, bottom] = [left, top, right, bottom].map(|edge| edge.round() as i32);
        [left, top, right.max(left + 1), bottom.max(top + 1)]
    }
}

/// All pixels, row by row.
fn pixels(pixmap: &Pixmap) -> impl Iterator<Item = (i32, i32)> + use<> {
    let (width, height) = (pixmap.width() as i32, pixmap.height() as i32);
    (0..height).flat_map(move |y| (0..width).map(move |x| (x, y)))
}

/// Gives one pixel a colour, if it is inside.
pub(crate) fn put(pixmap: &mut Pixmap, (x, y): (i32, i32), [r, g, b]: Rgb) {
    let (width, height) = (pixmap.width() as i32, pixmap.height() as i32);
    if (0..width).contains(&x) && (0..height).contains(&y) {
        let colour = ColorU8::from_rgba(r, g, b, 255).premultiply();
        pixmap.pixels_mut()[y as usize * width as usize + x as usize] = colour;
    }
}

/// Gives a block of pixels a colour: left, top, right, bottom, the last two exclusive.
pub(crate) fn block(pixmap: &mut Pixmap, [left, top, right, bottom]: [i32; 4], colour: Rgb) {
    let (width, height) = (pixmap.width() as i32, pixmap.height() as i32);
    for y in top.max(0)..bottom.min(height) {
        for x in left.max(0)..right.min(width) {
            put(pixmap, (x, y), colour);
        }
    }
}

pub(crate) fn dot(pixmap: &mut Pixmap, (x, y): (f32, f32), radius_px: f32, colour: Rgb) {
    if let Some(circle) = PathBuilder::from_circle(x, y, radius_px) {
        pixmap.fill_path(&circle, &paint(colour), FillRule::Winding, Transform::identity(), None);
        stroke(pixmap, Some(circle), OUTLINE, 1.2);
    }
}

fn stroke(pixmap: &mut Pixmap, path: Option<Path>, colour: Rgb, width: f32) {
    let stroke = Stroke { width, line_cap: LineCap::Round, line_join: LineJoin::Round, ..Stroke::default() };
    if let Some(path) = path {
        pixmap.stroke_path(&path, &paint(colour), &stroke, Transform::identity(), None);
    }
}

fn paint([r, g, b]: Rgb) -> Paint<'static> {
    let mut paint = Paint { anti_alias: true, ..Paint::default() };
    paint.set_color_rgba8(r, g, b, 255);
    paint
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const AREA: Rgb = [1, 2, 3];

    fn colours(plot: &Plot) -> Vec<Rgb> {
        plot.pixmap.pixels().iter().map(|pixel| [pixel.red(), pixel.green(), pixel.blue()]).collect()
    }

    fn extent(min: (f64, f64), max: (f64, f64)) -> Extent {
        Extent { min: Point2::new(min.0, min.1), max: Point2::new(max.0, max.1) }
    }

    proptest! {
        #[test]
        fn no_background_shows_between_what_abuts(
            cuts in proptest::collection::vec(0.01_f64..9.99, 1..30),
            px_per_m in 3.0_f64..90.0,
        ) {
            let mut cuts = cuts;
            cuts.extend([0.0, 10.0]);
            cuts.sort_by(f64::total_cmp);
            let config = PictureConfig { px_per_m, least_px: 1, most_px: 1000, margin_m: 0.0 };
            let mut plot = Plot::new(extent((0.0, 0.0), (10.0, 10.0)), &config).unwrap();
            let strips: Vec<_> = cuts.windows(2).map(|cut| extent((cut[0], 0.0), (cut[1], 10.0))).collect();
            plot.boxes(&strips, AREA, AREA);
            prop_assert!(colours(&plot).iter().all(|colour| *colour == AREA), "cuts {cuts:?}");
        }
    }

    #[test]
    fn cells_are_one_area() {
        let mut plot = Plot::new(extent((0.0, 0.0), (7.0, 3.0)), &PictureConfig::default()).unwrap();
        let is_inside = |point: Point2| (0.0..7.0).contains(&point.x) && (0.0..3.0).contains(&point.y);
        plot.fill(|point| is_inside(point).then_some(AREA));
        let mut rows = colours(&plot);
        rows.retain(|colour| *colour == AREA);
        let px = plot.px_per_m();
        assert_eq!(rows.len(), (7.0 * px).round() as usize * (3.0 * px).round() as usize);
    }

    #[test]
    fn a_corridor_and_a_point_have_room() {
        for (min, max) in [((0.0, 0.0), (100.0, 1.0)), ((2.0, 2.0), (2.0, 2.0))] {
            let plot = Plot::new(extent(min, max), &PictureConfig::default()).unwrap();
            let (width, height) = (plot.pixmap.width(), plot.pixmap.height());
            assert!((1200..=4000).contains(&width.max(height)) && width.min(height) >= 200, "{width} × {height}");
        }
        let endless = extent((0.0, 0.0), (f64::INFINITY, 1.0));
        assert!(matches!(Plot::new(endless, &PictureConfig::default()), Err(PictureError::Empty)));
    }
}
