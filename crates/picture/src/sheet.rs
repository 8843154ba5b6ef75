//! What stands around a plot: its title, axes with coordinates, the directions of x and y, a scale
//! bar, and what the colours are.
//!
//! ```text
//!  title
//!  y [m]
//!  20 ┌──────────────────────┐
//!     │        the plot      │
//!   0 └──────────────────────┘
//!     0         10         20
//!               x [m]
//!   y
//!   ↑        ├────────┤ 5 m
//!   └─→ x
//!   ● main node  ● support node  …
//! ```

use crate::file::{PictureError, write};
use crate::letters::{self, LETTER_PX, width_px};
use crate::plot::{OUTLINE, Plot, Rgb, block, dot};
use crate::round;
use std::path::Path;
use tiny_skia::{Color, Pixmap, PixmapPaint, Transform};

const INK: Rgb = [20, 20, 20];
/// Between things, pixels.
const GAP: i32 = 14;
/// Length of a mark on an axis, pixels.
const TICK: i32 = 7;
/// Least distance of two marks on an axis, pixels.
const TICKS_APART: f64 = 110.0;
/// Where the plot begins, from above: below the title and the name of the y axis.
const TOP: i32 = 3 * GAP + 2 * LETTER_PX;
/// The arrows of x and y: length, and height of their row, pixels.
const ARROW: i32 = 44;
const ARROW_ROW: i32 = ARROW + LETTER_PX + 2 * GAP;
/// Greatest length of the scale bar, pixels.
const BAR: f64 = 240.0;
/// Thickness of the scale bar, pixels.
const BAR_THICK: i32 = 6;
/// Width and height of a sample in the legend, pixels.
const SAMPLE: (i32, i32) = (30, 18);
/// Height of a row of the legend, pixels.
const LEGEND_ROW: i32 = SAMPLE.1 + GAP;

/// How the legend shows a colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Swatch {
    /// An area.
    Area,
    /// A line.
    Line,
    /// A dot.
    Dot,
}

/// What a colour means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LegendEntry {
    /// How it is shown.
    pub swatch: Swatch,
    /// The colour.
    pub colour: Rgb,
    /// What it means.
    pub label: &'static str,
}

/// A plot with what stands around it.
pub struct Sheet<'a> {
    /// The plot.
    pub plot: &'a Plot,
    /// Above it.
    pub title: &'a str,
    /// What its colours mean.
    pub legend: &'a [LegendEntry],
}

/// Where things are on a sheet, pixels.
struct Layout {
    /// The plot: left, top, right, bottom.
    plot: [i32; 4],
    /// Metres between two marks on an axis.
    step_m: f64,
    /// Where each entry of the legend begins.
    entries: Vec<(i32, i32)>,
    size: (i32, i32),
}

impl Sheet<'_> {
    /// Writes the sheet to a PNG file.
    ///
    /// # Errors
    /// [`PictureError`].
    pub fn save(&self, path: &Path) -> Result<(), PictureError> {
        write(&self.draw()?, path)
    }

    fn layout(&self) -> Layout {
        let (extent, pixmap) = (self.plot.extent(), self.plot.pixmap());
        let step_m = round::at_least(TICKS_APART / self.plot.px_per_m());
        let of_y = round::multiples(step_m, extent.min.y, extent.max.y);
        let widest = of_y.map(|y| width_px(&round::text(y, step_m))).max().unwrap_or(0);
        let left = 2 * GAP + widest + TICK;
        let (right, bottom) = (left + pixmap.width() as i32, TOP + pixmap.height() as i32);
        // The last number below the x axis may stand out by half of its width.
        let out = round::multiples(step_m, extent.min.x, extent.max.x).map(|x| width_px(&round::text(x, step_m)) / 2);
        let entry_px = |entry: &LegendEntry| SAMPLE.0 + GAP + width_px(entry.label) + 2 * GAP;
        let bar_end = left + ARROW + 6 * GAP + BAR as i32 + width_px("0.05 m");
        let widest_entry = self.legend.iter().map(entry_px).max().unwrap_or(0);
        let width = [right + out.max().unwrap_or(0), bar_end, left + width_px(self.title), left + widest_entry];
        let width = width.into_iter().max().unwrap_or(right) + GAP;
        let mut row = bottom + TICK + 2 * LETTER_PX + 3 * GAP + ARROW_ROW;
        let mut column = left;
        let mut entries = Vec::new();
        for entry in self.legend {
            if column > left && column + entry_px(entry) > width {
                (column, row) = (left, row + LEGEND_ROW);
            }
            entries.push((column, row));
            column += entry_px(entry);
        }
        let end = if entries.is_empty() { row } else { row + LEGEND_ROW };
        Layout { plot: [left, TOP, right, bottom], step_m, entries, size: (width, end + GAP) }
    }

    fn draw(&self) -> Result<Pixmap, PictureError> {
        let layout = self.layout();
        let (width, height) = layout.size;
        let large = PictureError::Large { width: width.into(), height: height.into() };
        let mut sheet = Pixmap::new(width as u32, height as u32).ok_or(large)?;
        sheet.fill(Color::WHITE);
        let [left, top, right, bottom] = layout.plot;
        block(&mut sheet, [left - 1, top - 1, right + 1, bottom + 1], OUTLINE);
        let (plot, paint) = (self.plot.pixmap().as_ref(), PixmapPaint::default());
        sheet.draw_pixmap(left, top, plot, &paint, Transform::identity(), None);
        letters::write(&mut sheet, (left, GAP), self.title, INK);
        self.draw_axes(&mut sheet, &layout);
        let base = bottom + TICK + 2 * LETTER_PX + 3 * GAP + ARROW + LETTER_PX;
        draw_arrows(&mut sheet, (left + GAP, base));
        self.draw_bar(&mut sheet, (left + ARROW + 6 * GAP, base));
        for (entry, at) in self.legend.iter().zip(&layout.entries) {
            draw_entry(&mut sheet, entry, *at);
        }
        Ok(sheet)
    }

    fn draw_axes(&self, sheet: &mut Pixmap, layout: &Layout) {
        let (extent, px_per_m, step_m) = (self.plot.extent(), self.plot.px_per_m(), layout.step_m);
        let [left, top, right, bottom] = layout.plot;
        for x in round::multiples(step_m, extent.min.x, extent.max.x) {
            let at = left + ((x - extent.min.x) * px_per_m).round() as i32;
            block(sheet, [at - 1, bottom, at + 1, bottom + TICK], INK);
            let text = round::text(x, step_m);
            letters::write(sheet, (at - width_px(&text) / 2, bottom + TICK + GAP / 2), &text, INK);
        }
        for y in round::multiples(step_m, extent.min.y, extent.max.y) {
            let at = top + ((extent.max.y - y) * px_per_m).round() as i32;
            block(sheet, [left - TICK, at - 1, left, at + 1], INK);
            let text = round::text(y, step_m);
            letters::write(sheet, (left - TICK - GAP / 2 - width_px(&text), at - LETTER_PX / 2), &text, INK);
        }
        letters::write(sheet, (GAP, top - GAP - LETTER_PX), "y [m]", INK);
        let middle = (left + right - width_px("x [m]")) / 2;
        letters::write(sheet, (middle, bottom + TICK + LETTER_PX + GAP), "x [m]", INK);
    }

    /// A bar of a round length, with its left end on the line `base`.
    fn draw_bar(&self, sheet: &mut Pixmap, (left, base): (i32, i32)) {
        let metres = round::at_most(BAR / self.plot.px_per_m());
        let right = left + (metres * self.plot.px_per_m()).round() as i32;
        block(sheet, [left, base - BAR_THICK, right, base], INK);
        for end in [left, right - 2] {
            block(sheet, [end, base - 3 * BAR_THICK, end + 2, base], INK);
        }
        let text = format!("{} m", round::text(metres, metres));
        letters::write(sheet, (right + GAP, base - LETTER_PX), &text, INK);
    }
}

/// Where x and y of the map frame point, from a corner.
fn draw_arrows(sheet: &mut Pixmap, (x, y): (i32, i32)) {
    const HEAD: i32 = 7;
    block(sheet, [x - 1, y - 1, x + ARROW, y + 1], INK);
    block(sheet, [x - 1, y - ARROW, x + 1, y + 1], INK);
    for back in 0..HEAD {
        let half = back / 2 + 1;
        block(sheet, [x + ARROW - back, y - half, x + ARROW - back + 1, y + half], INK);
        block(sheet, [x - half, y - ARROW + back, x + half, y - ARROW + back + 1], INK);
    }
    letters::write(sheet, (x + ARROW + GAP / 2, y - LETTER_PX / 2), "x", INK);
    letters::write(sheet, (x - LETTER_PX / 2, y - ARROW - GAP / 3 - LETTER_PX), "y", INK);
}

fn draw_entry(sheet: &mut Pixmap, entry: &LegendEntry, (x, y): (i32, i32)) {
    let ((width, height), colour) = (SAMPLE, entry.colour);
    match entry.swatch {
        Swatch::Area => {
            block(sheet, [x, y, x + width, y + height], OUTLINE);
            block(sheet, [x + 1, y + 1, x + width - 1, y + height - 1], colour);
        }
        Swatch::Line => block(sheet, [x, y + height / 2 - 2, x + width, y + height / 2 + 2], colour),
        Swatch::Dot => dot(sheet, ((x + width / 2) as f32, (y + height / 2) as f32), height as f32 * 0.4, colour),
    }
    letters::write(sheet, (x + width + GAP, y + (height - LETTER_PX) / 2), entry.label, INK);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plot::{Extent, PictureConfig};
    use fht_perception::pose::Point2;

    const LEGEND: [LegendEntry; 3] = [
        LegendEntry { swatch: Swatch::Area, colour: [1, 200, 3], label: "area" },
        LegendEntry { swatch: Swatch::Line, colour: [1, 2, 200], label: "line" },
        LegendEntry { swatch: Swatch::Dot, colour: [200, 2, 3], label: "a dot with a rather long name" },
    ];

    fn plot(width_m: f64, height_m: f64) -> Plot {
        let extent = Extent { min: Point2::new(-3.0, -12.0), max: Point2::new(width_m - 3.0, height_m - 12.0) };
        Plot::new(extent, &PictureConfig::default()).unwrap()
    }

    fn colour(sheet: &Pixmap, x: i32, y: i32) -> Rgb {
        let pixel = sheet.pixel(x as u32, y as u32).unwrap();
        [pixel.red(), pixel.green(), pixel.blue()]
    }

    /// From one room to a campus, and a corridor either way.
    const SIZES: [(f64, f64); 6] = [(3.0, 2.0), (20.0, 25.0), (60.0, 40.0), (900.0, 500.0), (80.0, 1.5), (1.5, 80.0)];

    #[test]
    fn the_scale_bar_is_as_long_as_it_says() {
        for (width_m, height_m) in SIZES {
            let plot = plot(width_m, height_m);
            let sheet = Sheet { plot: &plot, title: "a title", legend: &LEGEND };
            let (drawn, layout) = (sheet.draw().unwrap(), sheet.layout());
            let [left, _, _, bottom] = layout.plot;
            let base = bottom + TICK + 2 * LETTER_PX + 3 * GAP + ARROW + LETTER_PX;
            let begin = left + ARROW + 6 * GAP;
            let length = (begin..).take_while(|x| colour(&drawn, *x, base - BAR_THICK / 2) == INK).count();
            let metres = round::at_most(BAR / plot.px_per_m());
            assert_eq!(length, (metres * plot.px_per_m()).round() as usize, "{width_m} × {height_m} m");
            assert!((90..=240).contains(&length), "{length} pixels");
        }
    }

    #[test]
    fn the_legend_shows_each_colour_and_nothing_is_cut() {
        for (width_m, height_m) in SIZES {
            let plot = plot(width_m, height_m);
            let sheet = Sheet { plot: &plot, title: "a title that is rather long: museum, seed 1", legend: &LEGEND };
            let (drawn, layout) = (sheet.draw().unwrap(), sheet.layout());
            for (entry, (x, y)) in LEGEND.iter().zip(&layout.entries) {
                assert_eq!(colour(&drawn, x + SAMPLE.0 / 2, y + SAMPLE.1 / 2), entry.colour, "{}", entry.label);
            }
            // What is cut would reach the border.
            let (width, height) = layout.size;
            let border = (0..width).flat_map(|x| [(x, 0), (x, height - 1)]);
            let border = border.chain((0..height).flat_map(|y| [(0, y), (width - 1, y)]));
            for (x, y) in border {
                assert_eq!(colour(&drawn, x, y), [255; 3], "at {x}, {y} of {width} × {height}");
            }
        }
    }

    #[test]
    fn axes_have_round_coordinates_at_their_places() {
        let plot = plot(20.0, 25.0);
        let sheet = Sheet { plot: &plot, title: "", legend: &[] };
        let (drawn, layout) = (sheet.draw().unwrap(), sheet.layout());
        let [left, top, right, bottom] = layout.plot;
        let marks: Vec<f64> = (left..right)
            .filter(|x| colour(&drawn, *x, bottom + TICK - 1) == INK)
            .map(|x| plot.extent().min.x + f64::from(x - left) / plot.px_per_m())
            .collect();
        let counted = round::multiples(layout.step_m, plot.extent().min.x, plot.extent().max.x).count();
        assert!(counted >= 3 && marks.len() == 2 * counted, "{marks:?}");
        for mark in marks {
            let nearest = (mark / layout.step_m).round() * layout.step_m;
            assert!((mark - nearest).abs() < 1.6 / plot.px_per_m(), "{mark} m is no multiple of {} m", layout.step_m);
        }
        assert!((top..bottom).any(|y| colour(&drawn, left - TICK + 1, y) == INK));
    }
}
