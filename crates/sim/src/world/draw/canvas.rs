//! A sheet to draw on in metres; x to the right, y down from the top left corner.

use crate::scene::texture::{Repeat, Texture};
use crate::world::draw::Panel;
use font8x8::UnicodeFonts;
use image::RgbImage;
use rand::{Rng, RngExt};
use tiny_skia::{
    Color, FillRule, FilterQuality, GradientStop, IntSize, LineCap, LineJoin, LinearGradient, Paint, Path, PathBuilder,
    Pixmap, PixmapPaint, Point, Rect, SpreadMode, Stroke, Transform,
};

/// Red, green, blue.
pub(crate) type Rgb = [u8; 3];

/// The colour `part` of the way from `a` to `b`.
pub(crate) fn mix(a: Rgb, b: Rgb, part: f32) -> Rgb {
    let channel = |i: usize| (f32::from(a[i]) + (f32::from(b[i]) - f32::from(a[i])) * part) as u8;
    [channel(0), channel(1), channel(2)]
}

/// The colour scaled: darker below 1, lighter above.
pub(crate) fn shade(colour: Rgb, factor: f32) -> Rgb {
    colour.map(|value| (f32::from(value) * factor) as u8)
}

/// From hue, saturation and value, each 0 to 1.
pub(crate) fn hsv(hue: f32, saturation: f32, value: f32) -> Rgb {
    let channel = |offset: f32| {
        let k = (offset + hue.rem_euclid(1.0) * 6.0) % 6.0;
        let dip = k.min(4.0 - k).clamp(0.0, 1.0);
        (255.0 * value * (1.0 - saturation * dip)) as u8
    };
    [channel(5.0), channel(3.0), channel(1.0)]
}

/// A random colour of this saturation and value range.
pub(crate) fn any_colour(rng: &mut impl Rng, saturation: (f32, f32), value: (f32, f32)) -> Rgb {
    hsv(rng.random(), rng.random_range(saturation.0..saturation.1), rng.random_range(value.0..value.1))
}

/// A sheet.
pub(crate) struct Canvas {
    pixmap: Option<Pixmap>,
    width_m: f32,
    height_m: f32,
    /// Pixels per metre, across and down. Pixels are whole, so this differs slightly from what was
    /// requested.
    scale: [f32; 2],
}

impl Canvas {
    /// A sheet of one colour with `pixels_per_m` pixels per metre.
    pub(crate) fn new(width_m: f64, height_m: f64, pixels_per_m: f64, colour: Rgb) -> Self {
        let pixels = |metres: f64| (metres * pixels_per_m).round().clamp(1.0, 4096.0) as u32;
        let (across, down) = (pixels(width_m), pixels(height_m));
        let mut canvas = Self {
            pixmap: Pixmap::new(across, down),
            width_m: width_m as f32,
            height_m: height_m as f32,
            scale: [across as f32 / width_m as f32, down as f32 / height_m as f32],
        };
        canvas.rect(0.0, 0.0, canvas.width_m + 1.0, canvas.height_m + 1.0, colour);
        canvas
    }

    /// Width, metres.
    pub(crate) fn width(&self) -> f32 {
        self.width_m
    }

    /// Height, metres.
    pub(crate) fn height(&self) -> f32 {
        self.height_m
    }

    /// A filled rectangle.
    pub(crate) fn rect(&mut self, x: f32, y: f32, width: f32, height: f32, colour: Rgb) {
        self.rect_alpha(x, y, width, height, colour, 1.0);
    }

    /// A filled, translucent rectangle.
    pub(crate) fn rect_alpha(&mut self, x: f32, y: f32, width: f32, height: f32, colour: Rgb, alpha: f32) {
        let transform = self.transform();
        if let (Some(pixmap), Some(rect)) = (&mut self.pixmap, Rect::from_xywh(x, y, width.max(1e-4), height.max(1e-4)))
        {
            pixmap.fill_rect(rect, &paint(colour, alpha), transform, None);
        }
    }

    /// The outline of a rectangle, `line` metres wide, inside its border.
    pub(crate) fn frame(&mut self, x: f32, y: f32, width: f32, height: f32, line: f32, colour: Rgb) {
        self.rect(x, y, width, line, colour);
        self.rect(x, y + height - line, width, line, colour);
        self.rect(x, y, line, height, colour);
        self.rect(x + width - line, y, line, height, colour);
    }

    /// A rectangle that fades from one colour at its top to another at its bottom.
    pub(crate) fn gradient(&mut self, x: f32, y: f32, width: f32, height: f32, top: Rgb, bottom: Rgb) {
        let stops = vec![GradientStop::new(0.0, solid(top, 1.0)), GradientStop::new(1.0, solid(bottom, 1.0))];
        let (from, to) = (Point::from_xy(x, y), Point::from_xy(x, y + height));
        let transform = self.transform();
        let shader = LinearGradient::new(from, to, stops, SpreadMode::Pad, Transform::identity());
        if let (Some(pixmap), Some(shader), Some(rect)) =
            (&mut self.pixmap, shader, Rect::from_xywh(x, y, width.max(1e-4), height.max(1e-4)))
        {
            let paint = Paint { shader, ..Paint::default() };
            pixmap.fill_rect(rect, &paint, transform, None);
        }
    }

    /// A filled ellipse around a centre.
    pub(crate) fn ellipse(&mut self, x: f32, y: f32, rx: f32, ry: f32, colour: Rgb, alpha: f32) {
        if let Some(rect) = Rect::from_ltrb(x - rx, y - ry, x + rx, y + ry) {
            self.fill(PathBuilder::from_oval(rect), colour, alpha);
        }
    }

    /// A filled polygon.
    pub(crate) fn polygon(&mut self, corners: &[(f32, f32)], colour: Rgb, alpha: f32) {
        self.fill(open_path(corners, true), colour, alpha);
    }

    /// A polyline with round ends.
    pub(crate) fn line(&mut self, points: &[(f32, f32)], width: f32, colour: Rgb, alpha: f32) {
        let stroke = Stroke { width, line_cap: LineCap::Round, line_join: LineJoin::Round, ..Stroke::default() };
        let transform = self.transform();
        if let (Some(pixmap), Some(path)) = (&mut self.pixmap, open_path(points, false)) {
            pixmap.stroke_path(&path, &paint(colour, alpha), &stroke, transform, None);
        }
    }

    /// A cubic Bézier curve between two points with two control points.
    pub(crate) fn curve(&mut self, points: [(f32, f32); 4], width: f32, colour: Rgb, alpha: f32) {
        let mut builder = PathBuilder::new();
        let [(x0, y0), (x1, y1), (x2, y2), (x3, y3)] = points;
        builder.move_to(x0, y0);
        builder.cubic_to(x1, y1, x2, y2, x3, y3);
        let stroke = Stroke { width, line_cap: LineCap::Round, ..Stroke::default() };
        let transform = self.transform();
        if let (Some(pixmap), Some(path)) = (&mut self.pixmap, builder.finish()) {
            pixmap.stroke_path(&path, &paint(colour, alpha), &stroke, transform, None);
        }
    }

    /// A line of text, each letter `size` metres wide and high.
    pub(crate) fn text(&mut self, x: f32, y: f32, size: f32, text: &str, colour: Rgb) {
        let dot = size / 8.0;
        for (index, letter) in text.chars().enumerate() {
            let Some(glyph) = font8x8::BASIC_FONTS.get(letter) else { continue };
            for (row, bits) in glyph.iter().enumerate() {
                for column in (0..8).filter(|column| bits >> column & 1 == 1) {
                    let left = x + index as f32 * size + column as f32 * dot;
                    self.rect(left, y + row as f32 * dot, dot * 1.05, dot * 1.05, colour);
                }
            }
        }
    }

    /// Grain: each pixel gets lighter or darker by up to `amount` grey levels.
    pub(crate) fn grain(&mut self, amount: f32, rng: &mut impl Rng) {
        let Some(pixmap) = &mut self.pixmap else { return };
        for pixel in pixmap.data_mut().chunks_exact_mut(4) {
            let change: f32 = rng.random_range(-amount..=amount);
            for value in &mut pixel[..3] {
                *value = (f32::from(*value) + change) as u8;
            }
        }
    }

    /// Pastes another sheet with its top left corner at a point; both must have the same
    /// resolution.
    pub(crate) fn paste(&mut self, x: f32, y: f32, other: &Self) {
        let (left, top) = ((x * self.scale[0]).round() as i32, (y * self.scale[1]).round() as i32);
        if let (Some(pixmap), Some(other)) = (&mut self.pixmap, &other.pixmap) {
            pixmap.draw_pixmap(left, top, other.as_ref(), &PixmapPaint::default(), Transform::identity(), None);
        }
    }

    /// Covers a rectangle with a photograph.
    pub(crate) fn photograph(&mut self, x: f32, y: f32, width: f32, height: f32, photograph: &RgbImage) {
        let bytes = photograph.pixels().flat_map(|pixel| [pixel[0], pixel[1], pixel[2], 255]).collect();
        let size = IntSize::from_wh(photograph.width(), photograph.height());
        let source = size.and_then(|size| Pixmap::from_vec(bytes, size));
        let (scale_x, scale_y) = (width / photograph.width() as f32, height / photograph.height() as f32);
        let transform = self.transform().pre_concat(Transform::from_row(scale_x, 0.0, 0.0, scale_y, x, y));
        if let (Some(pixmap), Some(source)) = (&mut self.pixmap, source) {
            let paint = PixmapPaint { quality: FilterQuality::Bilinear, ..PixmapPaint::default() };
            pixmap.draw_pixmap(0, 0, source.as_ref(), &paint, transform, None);
        }
    }

    /// The sheet as a texture.
    pub(crate) fn into_texture(self, repeat: Repeat) -> Texture {
        let drawn = self.pixmap.and_then(|pixmap| {
            let (width, height) = (pixmap.width() as usize, pixmap.height() as usize);
            let texels = pixmap.data().chunks_exact(4).map(|p| [p[0], p[1], p[2], 255]).collect();
            Texture::new(width, height, texels, [self.width_m, self.height_m], repeat)
        });
        drawn.unwrap_or_else(Texture::grey)
    }

    /// The sheet as a panel that hangs on a wall.
    pub(crate) fn into_panel(self, bottom_m: f64) -> Panel {
        let (width_m, height_m) = (f64::from(self.width_m), f64::from(self.height_m));
        Panel { texture: self.into_texture(Repeat::No), width_m, height_m, bottom_m }
    }

    fn fill(&mut self, path: Option<Path>, colour: Rgb, alpha: f32) {
        let transform = self.transform();
        if let (Some(pixmap), Some(path)) = (&mut self.pixmap, path) {
            pixmap.fill_path(&path, &paint(colour, alpha), FillRule::Winding, transform, None);
        }
    }

    fn transform(&self) -> Transform {
        Transform::from_scale(self.scale[0], self.scale[1])
    }
}

fn solid(colour: Rgb, alpha: f32) -> Color {
    Color::from_rgba8(colour[0], colour[1], colour[2], (alpha.clamp(0.0, 1.0) * 255.0) as u8)
}

fn paint(colour: Rgb, alpha: f32) -> Paint<'static> {
    let mut paint = Paint { anti_alias: true, ..Paint::default() };
    paint.set_color(solid(colour, alpha));
    paint
}

fn open_path(points: &[(f32, f32)], closed: bool) -> Option<Path> {
    let mut builder = PathBuilder::new();
    for (index, &(x, y)) in points.iter().enumerate() {
        if index == 0 { builder.move_to(x, y) } else { builder.line_to(x, y) }
    }
    if closed {
        builder.close();
    }
    builder.finish()
}
