//! Paintings, posters and reliefs, each different.

use super::Panel;
use super::canvas::{Canvas, Rgb, any_colour, hsv, mix, shade};
use image::{RgbImage, imageops};
use rand::{Rng, RngExt};

/// Pixels per metre of pictures.
const FINENESS: f64 = 140.0;
/// Height of a painting's centre above the floor, metres.
const EYE_M: f64 = 1.45;

/// What a painting shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Genre {
    /// Hills, water, sky.
    Landscape,
    /// A head and shoulders.
    Portrait,
    /// Things on a table.
    StillLife,
    /// Fields of colour with black lines.
    Geometric,
    /// Thrown paint.
    Gestural,
    /// A town.
    City,
    /// Circles and arcs.
    Orphic,
}

/// All genres.
pub(crate) const GENRES: [Genre; 7] = [
    Genre::Landscape,
    Genre::Portrait,
    Genre::StillLife,
    Genre::Geometric,
    Genre::Gestural,
    Genre::City,
    Genre::Orphic,
];

/// A framed painting with its label.
pub(crate) fn painting(genre: Genre, rng: &mut impl Rng) -> Panel {
    let (width, height): (f64, f64) = match genre {
        Genre::Landscape | Genre::City => (rng.random_range(1.2..2.1), rng.random_range(0.8..1.3)),
        Genre::Portrait => (rng.random_range(0.8..1.1), rng.random_range(1.1..1.5)),
        Genre::StillLife => (rng.random_range(0.9..1.3), rng.random_range(0.8..1.1)),
        _ => (rng.random_range(1.0..1.7), rng.random_range(1.0..1.6)),
    };
    let modern = matches!(genre, Genre::Geometric | Genre::Gestural | Genre::Orphic);
    let border = if modern { 0.035 } else { rng.random_range(0.08..0.13) };
    let mut picture = Canvas::new(width - 2.0 * border, height - 2.0 * border, FINENESS, [200, 190, 170]);
    match genre {
        Genre::Landscape => landscape(&mut picture, rng),
        Genre::Portrait => portrait(&mut picture, rng),
        Genre::StillLife => still_life(&mut picture, rng),
        Genre::Geometric => geometric(&mut picture, rng),
        Genre::Gestural => gestural(&mut picture, rng),
        Genre::City => city(&mut picture, rng),
        Genre::Orphic => orphic(&mut picture, rng),
    }
    picture.grain(5.0, rng);
    let frame = if modern {
        [[32, 30, 30], [228, 226, 220], [96, 70, 44]][rng.random_range(0..3)]
    } else {
        [[176, 134, 58], [150, 104, 40], [84, 54, 32], [196, 160, 92]][rng.random_range(0..4)]
    };
    framed(&picture, width, height, border as f32, frame).into_panel(EYE_M - height / 2.0)
}

/// A sheet with a moulded frame around it.
fn framed(picture: &Canvas, width: f64, height: f64, border: f32, frame: Rgb) -> Canvas {
    let mut canvas = Canvas::new(width, height, FINENESS, frame);
    let (w, h) = (canvas.width(), canvas.height());
    canvas.frame(0.0, 0.0, w, h, border * 0.3, shade(frame, 1.25));
    canvas.frame(border * 0.55, border * 0.55, w - 1.1 * border, h - 1.1 * border, border * 0.2, shade(frame, 0.6));
    canvas.paste(border, border, picture);
    canvas
}

/// Height of a photograph on a wall, metres.
const PHOTOGRAPH_M: (f64, f64) = (0.9, 1.5);

/// A framed crop of a photograph: at least two thirds of it, so that two crops of the same
/// photograph differ a little.
pub(crate) fn photograph(photograph: &RgbImage, rng: &mut impl Rng) -> Panel {
    let part = rng.random_range(0.67..=1.0);
    let size = |full: u32| ((f64::from(full) * part) as u32).max(1);
    let (width, height) = (size(photograph.width()), size(photograph.height()));
    let left = rng.random_range(0..=photograph.width() - width);
    let top = rng.random_range(0..=photograph.height() - height);
    let cut = imageops::crop_imm(photograph, left, top, width, height).to_image();
    let height_m = rng.random_range(PHOTOGRAPH_M.0..PHOTOGRAPH_M.1);
    let width_m = (height_m * f64::from(width) / f64::from(height)).clamp(0.5, 2.6);
    let frame = [[40, 36, 34], [222, 220, 214], [120, 86, 54]][rng.random_range(0..3)];
    let mut canvas = Canvas::new(width_m, height_m, FINENESS, frame);
    let (w, h) = (canvas.width(), canvas.height());
    canvas.photograph(0.04, 0.04, w - 0.08, h - 0.08, &cut);
    canvas.into_panel(EYE_M - height_m / 2.0)
}

fn landscape(canvas: &mut Canvas, rng: &mut impl Rng) {
    let (w, h) = (canvas.width(), canvas.height());
    let hue: f32 = [0.58, 0.55, 0.07, 0.95, 0.62][rng.random_range(0..5)];
    let (sky, haze) =
        (hsv(hue, rng.random_range(0.25..0.65), rng.random_range(0.55..0.95)), hsv(hue + 0.5, 0.15, 0.95));
    let horizon = h * rng.random_range(0.4..0.65);
    canvas.gradient(0.0, 0.0, w, horizon, sky, haze);
    for _ in 0..rng.random_range(3..9) {
        let (x, y) = (rng.random_range(0.0..w), rng.random_range(0.0..horizon * 0.8));
        for puff in 0..4 {
            let dx = puff as f32 * 0.06;
            canvas.ellipse(x + dx, y, 0.1, 0.03, [250, 246, 240], 0.35);
        }
    }
    if rng.random_bool(0.5) {
        let x = rng.random_range(w * 0.1..w * 0.9);
        canvas.ellipse(x, horizon * 0.5, 0.06, 0.06, [255, 236, 180], 0.95);
    }
    let land = hsv(rng.random_range(0.08..0.42), rng.random_range(0.3..0.7), rng.random_range(0.3..0.6));
    for layer in 0..4 {
        let base = horizon + (h - horizon) * layer as f32 * 0.12 - 0.03;
        let colour = mix(mix(land, haze, 0.55), shade(land, 0.7), layer as f32 / 3.0);
        let (f1, f2) = (rng.random_range(2.0..6.0), rng.random_range(5.0..13.0));
        let (p1, p2): (f32, f32) = (rng.random_range(0.0..6.0), rng.random_range(0.0..6.0));
        let rise = if layer == 0 { 0.16 } else { 0.05 } * h;
        let mut corners = vec![(0.0, h), (0.0, base)];
        corners.extend((0..=40).map(|step| {
            let x = step as f32 / 40.0 * w;
            (x, base - rise * ((f1 * x + p1).sin() * 0.6 + (f2 * x + p2).sin() * 0.4))
        }));
        corners.push((w, h));
        canvas.polygon(&corners, colour, 1.0);
    }
    if rng.random_bool(0.6) {
        let water = mix(sky, [40, 70, 90], 0.35);
        canvas.rect(0.0, h * 0.74, w, h * 0.14, water);
        for _ in 0..14 {
            let (x, y) = (rng.random_range(0.0..w), rng.random_range(h * 0.75..h * 0.87));
            canvas.line(&[(x, y), (x + 0.12, y)], 0.008, mix(water, [255, 255, 255], 0.6), 0.7);
        }
    }
    for _ in 0..rng.random_range(2..9) {
        let (x, foot, size) =
            (rng.random_range(0.0..w), rng.random_range(h * 0.6..h * 0.95), rng.random_range(0.08..0.22));
        canvas.line(&[(x, foot), (x, foot - size)], 0.02, [60, 42, 28], 1.0);
        for _ in 0..6 {
            let (dx, dy) = (rng.random_range(-0.07..0.07), rng.random_range(-0.07..0.05));
            canvas.ellipse(x + dx, foot - size + dy, 0.06, 0.05, shade(land, rng.random_range(0.5..1.0)), 0.9);
        }
    }
}

fn portrait(canvas: &mut Canvas, rng: &mut impl Rng) {
    let (w, h) = (canvas.width(), canvas.height());
    let ground = any_colour(rng, (0.2, 0.6), (0.12, 0.4));
    canvas.gradient(0.0, 0.0, w, h, shade(ground, 1.5), shade(ground, 0.6));
    let skin = mix([236, 196, 164], [110, 70, 48], rng.random_range(0.0..1.0));
    let hair = [[40, 28, 20], [96, 60, 30], [180, 150, 96], [150, 146, 140], [20, 18, 18]][rng.random_range(0..5)];
    let clothes = any_colour(rng, (0.3, 0.9), (0.2, 0.7));
    let (x, y) = (w * rng.random_range(0.42..0.58), h * rng.random_range(0.33..0.4));
    let r = w * rng.random_range(0.15..0.2);
    canvas.ellipse(x, y - r * 0.15, r * 1.25, r * 1.5, hair, 1.0);
    canvas.polygon(
        &[(x - r * 2.4, h), (x - r * 1.8, y + r * 2.0), (x, y + r * 1.4), (x + r * 1.8, y + r * 2.0), (x + r * 2.4, h)],
        clothes,
        1.0,
    );
    canvas.rect(x - r * 0.4, y + r * 0.8, r * 0.8, r * 0.9, shade(skin, 0.85));
    canvas.polygon(&[(x - r * 0.9, y + r * 1.55), (x, y + r * 2.6), (x + r * 0.9, y + r * 1.55)], [236, 232, 222], 0.9);
    canvas.ellipse(x, y, r, r * 1.3, skin, 1.0);
    canvas.ellipse(x + r * 0.4, y + r * 0.1, r * 0.55, r * 1.1, shade(skin, 0.8), 0.5);
    for side in [-1.0, 1.0] {
        canvas.ellipse(x + side * r * 0.38, y - r * 0.1, r * 0.15, r * 0.08, [240, 238, 230], 1.0);
        canvas.ellipse(x + side * r * 0.38, y - r * 0.1, r * 0.08, r * 0.08, [30, 26, 24], 1.0);
        canvas.line(&[(x + side * r * 0.2, y - r * 0.3), (x + side * r * 0.6, y - r * 0.32)], r * 0.07, hair, 1.0);
    }
    canvas.line(&[(x, y), (x + r * 0.12, y + r * 0.35), (x, y + r * 0.4)], r * 0.05, shade(skin, 0.6), 0.9);
    canvas.line(&[(x - r * 0.3, y + r * 0.7), (x + r * 0.3, y + r * 0.7)], r * 0.1, [150, 60, 56], 0.9);
    canvas.ellipse(x, y - r * 1.15, r * 1.05, r * 0.5, hair, 1.0);
    if rng.random_bool(0.4) {
        canvas.rect(x - r * 1.1, y - r * 1.9, r * 2.2, r * 0.7, shade(clothes, 0.6));
        canvas.rect(x - r * 1.7, y - r * 1.25, r * 3.4, r * 0.16, shade(clothes, 0.5));
    }
}

fn still_life(canvas: &mut Canvas, rng: &mut impl Rng) {
    let (w, h) = (canvas.width(), canvas.height());
    let ground = any_colour(rng, (0.1, 0.5), (0.25, 0.7));
    canvas.gradient(0.0, 0.0, w, h, ground, shade(ground, 0.6));
    let cloth = any_colour(rng, (0.1, 0.6), (0.5, 0.95));
    canvas.rect(0.0, h * 0.68, w, h * 0.32, cloth);
    for fold in 0..6 {
        let x = w * fold as f32 / 6.0;
        canvas.polygon(&[(x, h * 0.7), (x + 0.05, h), (x + 0.12, h)], shade(cloth, 0.75), 0.7);
    }
    let x = rng.random_range(w * 0.25..w * 0.75);
    let vase = any_colour(rng, (0.3, 0.8), (0.3, 0.8));
    canvas.ellipse(x, h * 0.62, w * 0.11, h * 0.15, vase, 1.0);
    canvas.rect(x - w * 0.04, h * 0.4, w * 0.08, h * 0.15, vase);
    canvas.ellipse(x - w * 0.04, h * 0.58, w * 0.025, h * 0.07, [255, 255, 250], 0.5);
    for _ in 0..14 {
        let (dx, dy) = (rng.random_range(-0.25..0.25) * w, rng.random_range(-0.32..0.0) * h);
        let petal = any_colour(rng, (0.5, 0.95), (0.7, 1.0));
        canvas.line(&[(x, h * 0.42), (x + dx, h * 0.4 + dy)], 0.01, [50, 92, 44], 0.9);
        for leaf in 0..5 {
            let angle = leaf as f32 * 1.257;
            canvas.ellipse(x + dx + angle.cos() * 0.03, h * 0.4 + dy + angle.sin() * 0.03, 0.025, 0.025, petal, 0.9);
        }
        canvas.ellipse(x + dx, h * 0.4 + dy, 0.015, 0.015, [250, 220, 90], 1.0);
    }
    for _ in 0..rng.random_range(3..8) {
        let (x, r) = (rng.random_range(w * 0.08..w * 0.92), rng.random_range(0.035..0.075));
        let fruit = hsv(rng.random_range(-0.03..0.28), 0.8, rng.random_range(0.6..0.95));
        canvas.ellipse(x, h * 0.78, r, r, fruit, 1.0);
        canvas.ellipse(x - r * 0.3, h * 0.78 - r * 0.3, r * 0.25, r * 0.25, [255, 255, 240], 0.6);
    }
}

fn geometric(canvas: &mut Canvas, rng: &mut impl Rng) {
    let (w, h) = (canvas.width(), canvas.height());
    canvas.rect(0.0, 0.0, w, h, [236, 232, 220]);
    let mut cuts = |length: f32| {
        let mut cuts = vec![0.0];
        while let Some(&last) = cuts.last()
            && last < length
        {
            cuts.push(last + rng.random_range(0.12..0.45_f32));
        }
        cuts
    };
    let (columns, rows) = (cuts(w), cuts(h));
    let palette =
        [[200, 40, 36], [32, 62, 142], [238, 200, 48], [236, 232, 220], [236, 232, 220], [30, 30, 30], [226, 120, 40]];
    for x in columns.windows(2) {
        for y in rows.windows(2) {
            let colour = palette[rng.random_range(0..palette.len())];
            canvas.rect(x[0], y[0], x[1] - x[0], y[1] - y[0], colour);
        }
    }
    for &x in &columns {
        canvas.rect(x - 0.012, 0.0, 0.025, h, [20, 20, 20]);
    }
    for &y in &rows {
        canvas.rect(0.0, y - 0.012, w, 0.025, [20, 20, 20]);
    }
}

fn gestural(canvas: &mut Canvas, rng: &mut impl Rng) {
    let (w, h) = (canvas.width(), canvas.height());
    let ground = any_colour(rng, (0.0, 0.5), (0.15, 0.95));
    canvas.rect(0.0, 0.0, w, h, ground);
    let palette: Vec<Rgb> = (0..4).map(|_| any_colour(rng, (0.4, 1.0), (0.3, 1.0))).collect();
    for stroke in 0..60 {
        let mut point = || (rng.random_range(-0.1..w + 0.1), rng.random_range(-0.1..h + 0.1));
        let points = [point(), point(), point(), point()];
        let width = if stroke < 12 { rng.random_range(0.04..0.16) } else { rng.random_range(0.005..0.03) };
        let colour = palette[rng.random_range(0..palette.len())];
        canvas.curve(points, width, shade(colour, rng.random_range(0.7..1.1)), 0.85);
    }
    for _ in 0..80 {
        let (x, y, r) = (rng.random_range(0.0..w), rng.random_range(0.0..h), rng.random_range(0.004..0.02));
        canvas.ellipse(x, y, r, r, palette[rng.random_range(0..palette.len())], 0.9);
    }
}

fn city(canvas: &mut Canvas, rng: &mut impl Rng) {
    let (w, h) = (canvas.width(), canvas.height());
    let night = rng.random_bool(0.4);
    let hue = rng.random_range(0.0..1.0);
    let sky = if night { hsv(0.64, 0.6, 0.25) } else { hsv(hue, 0.3, 0.9) };
    canvas.gradient(0.0, 0.0, w, h, sky, mix(sky, [250, 200, 150], 0.5));
    for layer in 0..3 {
        let mut x = -0.05;
        while x < w {
            let (width, top) =
                (rng.random_range(0.08..0.24), h * rng.random_range(0.12..0.4) + h * 0.15 * layer as f32);
            let wall = hsv(
                hue + rng.random_range(-0.1..0.15),
                rng.random_range(0.1..0.5),
                if night { 0.25 } else { rng.random_range(0.4..0.85) },
            );
            let wall = mix(wall, sky, 0.5 - 0.25 * layer as f32);
            canvas.rect(x, top, width, h - top, wall);
            if rng.random_bool(0.4) {
                canvas.polygon(&[(x, top), (x + width / 2.0, top - 0.09), (x + width, top)], [150, 70, 50], 1.0);
            }
            let lit: Rgb = if night { [250, 216, 120] } else { shade(wall, 0.55) };
            let mut wy = top + 0.03;
            while wy < h * 0.92 {
                let mut wx = x + 0.02;
                while wx + 0.025 < x + width {
                    if rng.random_bool(0.75) {
                        canvas.rect(wx, wy, 0.018, 0.03, lit);
                    }
                    wx += 0.04;
                }
                wy += 0.06;
            }
            x += width;
        }
    }
    canvas.rect(0.0, h * 0.93, w, h * 0.07, [70, 66, 64]);
}

fn orphic(canvas: &mut Canvas, rng: &mut impl Rng) {
    let (w, h) = (canvas.width(), canvas.height());
    let hue: f32 = rng.random_range(0.0..1.0);
    canvas.rect(0.0, 0.0, w, h, hsv(hue, 0.25, 0.9));
    for _ in 0..rng.random_range(3..7) {
        let (x, y) = (rng.random_range(0.0..w), rng.random_range(0.0..h));
        let mut r: f32 = rng.random_range(0.15..0.45);
        while r > 0.03 {
            let colour =
                hsv(hue + rng.random_range(-0.25..0.35), rng.random_range(0.4..0.95), rng.random_range(0.4..1.0));
            canvas.ellipse(x, y, r, r, colour, 0.95);
            r -= rng.random_range(0.03..0.09);
        }
    }
    for _ in 0..4 {
        let (x, y) = (rng.random_range(0.0..w), rng.random_range(0.0..h));
        canvas.line(&[(x, y), (rng.random_range(0.0..w), rng.random_range(0.0..h))], 0.012, [24, 22, 30], 1.0);
    }
}

/// A poster: a block of colour, a shape, lines of writing.
pub(crate) fn poster(rng: &mut impl Rng) -> Panel {
    let (w, h) = (rng.random_range(0.6..0.95), rng.random_range(0.9..1.3));
    let ground = any_colour(rng, (0.3, 0.9), (0.5, 1.0));
    let mut canvas = Canvas::new(w, h, FINENESS, ground);
    let (w, h) = (canvas.width(), canvas.height());
    let ink = if rng.random_bool(0.5) { [250, 248, 240] } else { [24, 24, 34] };
    let other = any_colour(rng, (0.5, 1.0), (0.3, 1.0));
    for _ in 0..rng.random_range(1..5) {
        let (x, y, r) = (rng.random_range(0.1..w), rng.random_range(h * 0.25..h * 0.7), rng.random_range(0.08..0.3));
        match rng.random_range(0..3) {
            0 => canvas.ellipse(x, y, r, r, other, 0.9),
            1 => canvas.polygon(&[(x, y - r), (x + r, y + r), (x - r, y + r)], other, 0.9),
            _ => canvas.rect(x - r, y - r * 0.5, r * 2.0, r, mix(other, ground, 0.3)),
        }
    }
    let words = ["EXPO", "FORM", "LICHT", "1926", "OPERA", "KUNST", "JAZZ", "ATLAS", "MODERN", "ARTE", "SOLO", "NORD"];
    let word = words[rng.random_range(0..words.len())];
    let size = (w * 0.85 / word.len() as f32).min(0.2);
    canvas.text(w * 0.08, 0.07, size, word, ink);
    for line in 0..3 {
        canvas.rect(w * 0.08, h * 0.82 + line as f32 * 0.05, w * rng.random_range(0.3..0.8), 0.02, ink);
    }
    canvas.frame(0.0, 0.0, w, h, 0.02, [40, 40, 40]);
    canvas.into_panel(0.85)
}

/// A relief in stone: an arch, figures or a frieze.
pub(crate) fn relief(rng: &mut impl Rng) -> Panel {
    let stone = mix([206, 194, 170], [150, 146, 140], rng.random_range(0.0..1.0));
    let mut canvas = Canvas::new(rng.random_range(1.2..2.0), rng.random_range(1.2..1.6), FINENESS, stone);
    let (w, h) = (canvas.width(), canvas.height());
    let (dark, light) = (shade(stone, 0.55), shade(stone, 1.15));
    canvas.frame(0.0, 0.0, w, h, 0.08, light);
    canvas.frame(0.08, 0.08, w - 0.16, h - 0.16, 0.03, dark);
    let figures = rng.random_range(2..5);
    for figure in 0..figures {
        let x = (figure as f32 + 0.5) / figures as f32 * (w - 0.3) + 0.15;
        let lean = rng.random_range(-0.08..0.08);
        for (offset, tone) in [(0.02, dark), (0.0, light)] {
            canvas.ellipse(x + lean + offset, h * 0.3 + offset, 0.07, 0.09, tone, 1.0);
            canvas.polygon(
                &[
                    (x + lean - 0.09 + offset, h * 0.4),
                    (x + lean + 0.09 + offset, h * 0.4),
                    (x + 0.14 + offset, h * 0.88),
                    (x - 0.14 + offset, h * 0.88),
                ],
                tone,
                1.0,
            );
            let hand = rng.random_range(-0.2..0.2);
            canvas.line(&[(x + lean + offset, h * 0.45), (x + hand + offset, h * 0.55 + offset)], 0.05, tone, 1.0);
        }
        for fold in 0..3 {
            let fx = x - 0.08 + fold as f32 * 0.07;
            canvas.line(&[(fx, h * 0.52), (fx + lean * 0.5, h * 0.86)], 0.012, dark, 0.7);
        }
    }
    canvas.grain(8.0, rng);
    canvas.into_panel(0.75)
}
