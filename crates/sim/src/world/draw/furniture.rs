//! Things that stand on the floor, and what their sides look like.

use super::canvas::{Canvas, Rgb, any_colour, hsv, mix, shade};
use super::fittings::books;
use super::surfaces::grain_lines;
use crate::scene::texture::{Repeat, Texture};
use rand::{Rng, RngExt};

/// Kinds of things that stand on the floor. Everything that reaches down to the LiDAR's plane is
/// solid from the floor up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Kind {
    /// A free-standing wall; its faces look like the zone's walls and carry pictures.
    Partition,
    /// A column.
    Pillar,
    /// Books on shelves.
    Bookshelf,
    /// Steel lockers.
    Lockers,
    /// A wooden cupboard.
    Cupboard,
    /// A desk or table.
    Desk,
    /// A computer screen on a desk.
    Screen,
    /// A cloth screen between desks.
    Divider,
    /// A bench or sofa.
    Bench,
    /// What an exhibit stands on.
    Plinth,
    /// An exhibit.
    Exhibit,
    /// A glass case.
    Showcase,
    /// A vending machine.
    Vending,
    /// A pot with a plant.
    Plant,
    /// The frame of a doorway, a pilaster.
    Frame,
}

/// Pixels per metre.
const FINENESS: f64 = 110.0;
const WOODS: [Rgb; 4] = [[150, 108, 66], [186, 150, 108], [104, 70, 46], [206, 188, 160]];

/// The side of a thing, `width_m` × `height_m`.
pub(crate) fn side(kind: Kind, width_m: f64, height_m: f64, rng: &mut impl Rng) -> Texture {
    let canvas = match kind {
        Kind::Bookshelf if width_m > 0.5 => books(width_m, height_m, rng),
        Kind::Lockers => lockers(width_m, height_m, rng),
        Kind::Cupboard | Kind::Bookshelf => cupboard(width_m, height_m, rng),
        Kind::Desk => desk(width_m, height_m, rng),
        Kind::Screen => screen(width_m, height_m, rng),
        Kind::Bench => bench(width_m, height_m, rng),
        Kind::Plinth => plinth(width_m, height_m, rng),
        Kind::Divider => divider(width_m, height_m, rng),
        Kind::Exhibit => exhibit(width_m, height_m, rng),
        Kind::Showcase => showcase(width_m, height_m, rng),
        Kind::Vending => vending(width_m, height_m, rng),
        Kind::Plant => plant(width_m, height_m, rng),
        Kind::Pillar | Kind::Frame | Kind::Partition => stone(width_m, height_m, rng),
    };
    canvas.into_texture(Repeat::No)
}

/// The top of a thing: one plain colour with some grain.
pub(crate) fn top(kind: Kind, rng: &mut impl Rng) -> Texture {
    let colour = match kind {
        Kind::Desk | Kind::Cupboard | Kind::Bookshelf => WOODS[rng.random_range(0..4)],
        Kind::Bench => upholstery(rng),
        Kind::Plant => [60, 104, 50],
        Kind::Showcase => [200, 214, 216],
        Kind::Vending | Kind::Screen => [44, 46, 52],
        Kind::Lockers => [120, 130, 140],
        Kind::Exhibit => MATERIALS[rng.random_range(0..MATERIALS.len())],
        _ => [214, 210, 202],
    };
    let mut canvas = Canvas::new(1.0, 1.0, 40.0, colour);
    canvas.grain(8.0, rng);
    canvas.into_texture(Repeat::Everywhere)
}

fn lockers(width_m: f64, height_m: f64, rng: &mut impl Rng) -> Canvas {
    let steel = [[86, 110, 140], [140, 146, 150], [120, 60, 56], [92, 120, 96]][rng.random_range(0..4)];
    let mut canvas = Canvas::new(width_m, height_m, FINENESS, steel);
    let (w, h) = (canvas.width(), canvas.height());
    let doors = (w / 0.32).round().max(1.0);
    for door in 0..doors as i32 {
        let x = door as f32 * w / doors;
        canvas.frame(x + 0.01, 0.03, w / doors - 0.02, h - 0.1, 0.012, shade(steel, 0.6));
        for slit in 0..4 {
            canvas.rect(x + 0.08, 0.14 + slit as f32 * 0.04, w / doors - 0.16, 0.012, shade(steel, 0.4));
        }
        canvas.rect(x + 0.05, h * 0.5, 0.03, 0.08, [60, 60, 64]);
        if rng.random_bool(0.2) {
            canvas.rect(x + 0.1, h * 0.35, 0.1, 0.1, any_colour(rng, (0.5, 1.0), (0.7, 1.0)));
        }
    }
    canvas
}

fn cupboard(width_m: f64, height_m: f64, rng: &mut impl Rng) -> Canvas {
    let wood = WOODS[rng.random_range(0..4)];
    let mut canvas = Canvas::new(width_m, height_m, FINENESS, wood);
    let (w, h) = (canvas.width(), canvas.height());
    grain_lines(&mut canvas, (0.0, 0.0), (w, h), wood, rng);
    let doors = (w / 0.5).round().max(1.0);
    for door in 0..doors as i32 {
        let x = door as f32 * w / doors;
        canvas.frame(x + 0.015, 0.03, w / doors - 0.03, h - 0.12, 0.012, shade(wood, 0.55));
        canvas.frame(x + 0.09, 0.11, w / doors - 0.18, h - 0.28, 0.01, shade(wood, 0.7));
        canvas.ellipse(x + w / doors - 0.06, h * 0.5, 0.018, 0.018, [212, 190, 120], 1.0);
    }
    canvas.rect(0.0, h - 0.08, w, 0.08, shade(wood, 0.4));
    canvas
}

fn desk(width_m: f64, height_m: f64, rng: &mut impl Rng) -> Canvas {
    let wood = WOODS[rng.random_range(0..4)];
    let mut canvas = Canvas::new(width_m, height_m, FINENESS, shade(wood, 0.8));
    let (w, h) = (canvas.width(), canvas.height());
    grain_lines(&mut canvas, (0.0, 0.0), (w, h), shade(wood, 0.8), rng);
    for drawer in 0..3 {
        canvas.frame(w * 0.7, 0.07 + drawer as f32 * 0.21, w * 0.26, 0.19, 0.01, shade(wood, 0.5));
        canvas.rect(w * 0.8, 0.15 + drawer as f32 * 0.21, w * 0.06, 0.015, [190, 190, 190]);
    }
    canvas.rect(0.0, 0.0, w, 0.04, shade(wood, 1.15));
    canvas
}

fn screen(width_m: f64, height_m: f64, rng: &mut impl Rng) -> Canvas {
    let mut canvas = Canvas::new(width_m, height_m, FINENESS, [24, 26, 30]);
    let (w, h) = (canvas.width(), canvas.height());
    let ground = hsv(rng.random_range(0.5..0.7), rng.random_range(0.2..0.7), rng.random_range(0.3..0.9));
    canvas.rect(0.02, 0.02, w - 0.04, h - 0.04, ground);
    for _ in 0..4 {
        let (x, y) = (rng.random_range(0.03..w * 0.6), rng.random_range(0.03..h * 0.6));
        canvas.rect(x, y, w * 0.3, h * 0.3, mix(ground, [250, 250, 250], rng.random_range(0.2..0.9)));
    }
    canvas
}

fn bench(width_m: f64, height_m: f64, rng: &mut impl Rng) -> Canvas {
    let cover = upholstery(rng);
    let mut canvas = Canvas::new(width_m, height_m, FINENESS, shade(cover, 0.5));
    let (w, h) = (canvas.width(), canvas.height());
    canvas.rect(0.0, 0.0, w, h * 0.5, cover);
    let cushions = (w / 0.6).round().max(1.0);
    for cushion in 0..cushions as i32 {
        canvas.rect(cushion as f32 * w / cushions, 0.0, 0.012, h * 0.5, shade(cover, 0.6));
    }
    canvas
}

/// A bench's upholstery: the first thing drawn for a bench, so that its top and sides match.
fn upholstery(rng: &mut impl Rng) -> Rgb {
    any_colour(rng, (0.3, 0.7), (0.25, 0.55))
}

fn divider(width_m: f64, height_m: f64, rng: &mut impl Rng) -> Canvas {
    let cloth = any_colour(rng, (0.15, 0.45), (0.4, 0.7));
    let mut canvas = Canvas::new(width_m, height_m, FINENESS, cloth);
    canvas.grain(14.0, rng);
    let (w, h) = (canvas.width(), canvas.height());
    canvas.frame(0.0, 0.0, w, h, 0.02, [120, 122, 126]);
    canvas
}

fn plinth(width_m: f64, height_m: f64, rng: &mut impl Rng) -> Canvas {
    let stone = mix([232, 228, 220], [120, 116, 110], rng.random_range(0.0..0.8));
    let mut canvas = Canvas::new(width_m, height_m, FINENESS, stone);
    let (w, h) = (canvas.width(), canvas.height());
    canvas.rect(0.0, 0.0, w, 0.06, shade(stone, 1.06));
    canvas.rect(0.0, 0.06, w, 0.015, shade(stone, 0.6));
    canvas.rect(0.0, h - 0.1, w, 0.1, shade(stone, 0.75));
    if w > 0.35 && h > 0.5 {
        canvas.rect(w * 0.3, h * 0.3, w * 0.4, 0.12, [180, 150, 80]);
        for line in 0..3 {
            canvas.rect(w * 0.34, h * 0.3 + 0.025 + line as f32 * 0.03, w * 0.3, 0.01, [60, 44, 20]);
        }
    }
    canvas.grain(6.0, rng);
    canvas
}

/// Bronze, verdigris, marble, basalt, clay or glaze.
const MATERIALS: [Rgb; 7] =
    [[142, 96, 52], [96, 128, 112], [226, 220, 208], [66, 62, 62], [182, 92, 60], [52, 84, 132], [200, 160, 70]];

/// A slice of an exhibit; all slices of one are drawn from the same random numbers, so they match.
fn exhibit(width_m: f64, height_m: f64, rng: &mut impl Rng) -> Canvas {
    let material = MATERIALS[rng.random_range(0..MATERIALS.len())];
    let mut canvas = Canvas::new(width_m, height_m, FINENESS, material);
    let (w, h) = (canvas.width(), canvas.height());
    for _ in 0..8 {
        let (x, y) = (rng.random_range(0.0..w), rng.random_range(0.0..h));
        let tone = shade(material, rng.random_range(0.75..1.2));
        canvas.curve([(x, 0.0), (x + 0.05, y), (x - 0.05, y), (x + 0.02, h)], 0.008, tone, 0.5);
    }
    canvas.grain(12.0, rng);
    canvas
}

fn showcase(width_m: f64, height_m: f64, rng: &mut impl Rng) -> Canvas {
    let mut canvas = Canvas::new(width_m, height_m, FINENESS, [88, 62, 44]);
    let (w, h) = (canvas.width(), canvas.height());
    let glass = (h - 0.75).max(0.2);
    canvas.gradient(0.03, 0.03, w - 0.06, glass, [206, 222, 224], [150, 160, 160]);
    let mut x = 0.1;
    while x < w - 0.12 {
        let (ow, oh) = (rng.random_range(0.06..0.16), rng.random_range(0.1..glass * 0.75));
        let colour = any_colour(rng, (0.3, 0.8), (0.3, 0.8));
        canvas.ellipse(x + ow / 2.0, glass - oh * 0.4, ow / 2.0, oh * 0.45, colour, 1.0);
        canvas.rect(x + ow * 0.3, glass - oh, ow * 0.4, oh * 0.5, colour);
        x += ow + rng.random_range(0.04..0.14);
    }
    canvas.line(&[(w * 0.15, glass * 0.8), (w * 0.4, 0.08)], 0.02, [255, 255, 255], 0.45);
    canvas.frame(0.0, 0.0, w, glass + 0.06, 0.03, [50, 36, 26]);
    canvas
}

fn vending(width_m: f64, height_m: f64, rng: &mut impl Rng) -> Canvas {
    let body = any_colour(rng, (0.7, 0.95), (0.45, 0.8));
    let mut canvas = Canvas::new(width_m, height_m, FINENESS, body);
    let (w, h) = (canvas.width(), canvas.height());
    canvas.rect(w * 0.06, 0.18, w * 0.62, h * 0.62, [28, 30, 36]);
    for row in 0..5 {
        for column in 0..5 {
            let (x, y) = (w * (0.09 + 0.117 * column as f32), 0.22 + row as f32 * h * 0.12);
            canvas.rect(x, y, w * 0.08, h * 0.085, any_colour(rng, (0.6, 1.0), (0.6, 1.0)));
        }
    }
    canvas.rect(w * 0.74, 0.4, w * 0.2, 0.4, [190, 194, 198]);
    canvas.rect(w * 0.08, h * 0.86, w * 0.58, 0.14, [18, 18, 20]);
    canvas.text(w * 0.1, 0.05, 0.1, "DRINKS", [250, 250, 250]);
    canvas
}

fn plant(width_m: f64, height_m: f64, rng: &mut impl Rng) -> Canvas {
    let mut canvas = Canvas::new(width_m, height_m, FINENESS, [52, 88, 46]);
    let (w, h) = (canvas.width(), canvas.height());
    for _ in 0..70 {
        let (x, y) = (rng.random_range(0.0..w), rng.random_range(0.0..h));
        let leaf = hsv(rng.random_range(0.24..0.36), rng.random_range(0.4..0.8), rng.random_range(0.2..0.65));
        canvas.ellipse(x, y, rng.random_range(0.02..0.05), rng.random_range(0.03..0.09), leaf, 0.95);
    }
    let pot = [[170, 92, 60], [220, 218, 212], [60, 60, 64]][rng.random_range(0..3)];
    canvas.rect(0.0, h - 0.4, w, 0.4, pot);
    canvas.rect(0.0, h - 0.4, w, 0.05, shade(pot, 1.15));
    canvas
}

fn stone(width_m: f64, height_m: f64, rng: &mut impl Rng) -> Canvas {
    let stone = mix([216, 210, 198], [168, 164, 160], rng.random_range(0.0..1.0));
    let mut canvas = Canvas::new(width_m, height_m, FINENESS * 0.6, stone);
    let (w, h) = (canvas.width(), canvas.height());
    canvas.rect(0.0, h - 0.25, w, 0.25, shade(stone, 0.8));
    canvas.rect(0.0, 0.0, w, 0.2, shade(stone, 1.06));
    canvas.rect(0.0, 0.2, w, 0.03, shade(stone, 0.7));
    canvas.grain(6.0, rng);
    canvas
}
