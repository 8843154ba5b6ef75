//! Walls, floors and ceilings.

use super::canvas::{Canvas, Rgb, mix, shade};
use crate::scene::texture::{Repeat, Texture};
use rand::{Rng, RngExt};

/// Width of a strip of wall, after which it repeats, metres.
const WALL_TILE_M: f64 = 2.4;
/// Pixels per metre of walls and floors.
const FINENESS: f64 = 72.0;

/// How a wall is finished.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Wall {
    /// Painted plaster.
    Plaster(Rgb),
    /// Painted in two tones with a rail between.
    TwoTone(Rgb, Rgb),
    /// Patterned fabric.
    Damask(Rgb),
    /// Striped paper.
    Stripes(Rgb, Rgb),
    /// Bricks.
    Brick(Rgb),
    /// Wooden boards.
    Wood(Rgb),
    /// Slabs of stone.
    Marble(Rgb),
    /// Bare concrete with the marks of its formwork.
    Concrete,
}

/// Floor coverings.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum FloorSurface {
    /// Strips of wood.
    Parquet(Rgb),
    /// Square tiles.
    Tiles(Rgb, Rgb),
    /// Carpet.
    Carpet(Rgb),
    /// Linoleum.
    Linoleum(Rgb),
}

/// Ceilings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ceiling {
    /// Plaster with rails of spotlights.
    Gallery,
    /// Panels in a grid, some of them lamps.
    Grid,
}

/// A wall's texture, from floor to `height_m`.
pub(crate) fn wall(kind: Wall, height_m: f64, rng: &mut impl Rng) -> Texture {
    let base = match kind {
        Wall::Plaster(c) | Wall::Damask(c) | Wall::Brick(c) | Wall::Wood(c) | Wall::Marble(c) => c,
        Wall::TwoTone(upper, _) | Wall::Stripes(upper, _) => upper,
        Wall::Concrete => [150, 148, 144],
    };
    let mut canvas = Canvas::new(WALL_TILE_M, height_m, FINENESS, base);
    let (width, height) = (canvas.width(), canvas.height());
    match kind {
        Wall::Plaster(_) => stains(&mut canvas, base, rng),
        Wall::TwoTone(_, lower) => {
            stains(&mut canvas, base, rng);
            canvas.rect(0.0, height - 1.1, width, 1.1, lower);
            canvas.rect(0.0, height - 1.14, width, 0.05, shade(lower, 0.7));
        }
        Wall::Damask(_) => damask(&mut canvas, base),
        Wall::Stripes(_, other) => {
            for stripe in 0..12 {
                canvas.rect(stripe as f32 * 0.2, 0.0, 0.1, height, other);
            }
        }
        Wall::Brick(_) => bricks(&mut canvas, base, rng),
        Wall::Wood(_) => boards(&mut canvas, base, rng),
        Wall::Marble(_) => slabs(&mut canvas, base, rng),
        Wall::Concrete => concrete(&mut canvas, base, rng),
    }
    let skirting = match kind {
        Wall::Brick(_) | Wall::Concrete | Wall::Marble(_) => shade(base, 0.5),
        _ => mix(shade(base, 0.45), [70, 60, 52], 0.5),
    };
    canvas.rect(0.0, height - 0.12, width, 0.12, skirting);
    canvas.rect(0.0, 0.0, width, 0.06, mix(base, [240, 238, 230], 0.7));
    canvas.grain(4.0, rng);
    canvas.into_texture(Repeat::Sideways)
}

fn stains(canvas: &mut Canvas, base: Rgb, rng: &mut impl Rng) {
    for _ in 0..18 {
        let (x, y) = (rng.random_range(0.0..canvas.width()), rng.random_range(0.0..canvas.height()));
        let (rx, ry) = (rng.random_range(0.1..0.5), rng.random_range(0.1..0.6));
        canvas.ellipse(x, y, rx, ry, shade(base, rng.random_range(0.93..1.06)), 0.25);
    }
}

fn damask(canvas: &mut Canvas, base: Rgb) {
    let (light, dark) = (mix(base, [235, 200, 140], 0.22), shade(base, 0.78));
    let (mut row, mut y) = (0, 0.0);
    while y < canvas.height() + 0.3 {
        let mut x = if row % 2 == 0 { 0.0 } else { 0.2 };
        while x < canvas.width() + 0.4 {
            canvas.polygon(&[(x, y - 0.17), (x + 0.1, y), (x, y + 0.17), (x - 0.1, y)], light, 0.8);
            canvas.polygon(&[(x, y - 0.1), (x + 0.05, y), (x, y + 0.1), (x - 0.05, y)], dark, 0.9);
            canvas.ellipse(x - 0.13, y + 0.1, 0.035, 0.06, light, 0.7);
            canvas.ellipse(x + 0.13, y + 0.1, 0.035, 0.06, light, 0.7);
            x += 0.4;
        }
        y += 0.27;
        row += 1;
    }
}

fn bricks(canvas: &mut Canvas, base: Rgb, rng: &mut impl Rng) {
    let (w, h) = (0.24, 0.08);
    canvas.rect(0.0, 0.0, canvas.width(), canvas.height(), mix(base, [200, 195, 185], 0.6));
    let rows = (canvas.height() / h) as i32 + 1;
    for row in 0..rows {
        let offset = if row % 2 == 0 { 0.0 } else { -w / 2.0 };
        for column in 0..=(canvas.width() / w) as i32 {
            let tone = shade(base, rng.random_range(0.78..1.15));
            canvas.rect(offset + column as f32 * w, row as f32 * h, w - 0.014, h - 0.014, tone);
        }
    }
}

fn boards(canvas: &mut Canvas, base: Rgb, rng: &mut impl Rng) {
    let w = 0.3;
    for board in 0..(canvas.width() / w).round() as i32 {
        let x = board as f32 * w;
        canvas.rect(x, 0.0, w, canvas.height(), shade(base, rng.random_range(0.82..1.12)));
        grain_lines(canvas, (x, 0.0), (w, canvas.height()), base, rng);
        canvas.rect(x, 0.0, 0.012, canvas.height(), shade(base, 0.5));
    }
}

/// Lines of wood that run along the longer side.
pub(super) fn grain_lines(canvas: &mut Canvas, at: (f32, f32), size: (f32, f32), base: Rgb, rng: &mut impl Rng) {
    let upright = size.1 > size.0;
    for _ in 0..((size.0.min(size.1) * 40.0) as i32).max(3) {
        let tone = shade(base, rng.random_range(0.65..1.1));
        let wave = rng.random_range(-0.02..0.02);
        let part: f32 = rng.random_range(0.0..1.0);
        let points = if upright {
            let x = at.0 + part * size.0;
            [(x, at.1), (x + wave, at.1 + size.1 / 3.0), (x - wave, at.1 + size.1 * 0.66), (x, at.1 + size.1)]
        } else {
            let y = at.1 + part * size.1;
            [(at.0, y), (at.0 + size.0 / 3.0, y + wave), (at.0 + size.0 * 0.66, y - wave), (at.0 + size.0, y)]
        };
        canvas.curve(points, 0.006, tone, 0.4);
    }
}

fn slabs(canvas: &mut Canvas, base: Rgb, rng: &mut impl Rng) {
    for _ in 0..26 {
        let (x, y) = (rng.random_range(0.0..canvas.width()), rng.random_range(0.0..canvas.height()));
        let mut bend = || (rng.random_range(-0.6..0.6), rng.random_range(-0.4..0.4));
        let (a, b, c) = (bend(), bend(), bend());
        let points = [(x, y), (x + a.0, y + a.1), (x + b.0, y + b.1), (x + c.0, y + c.1)];
        let tone = if rng.random_bool(0.5) { shade(base, 0.75) } else { mix(base, [255, 252, 245], 0.5) };
        canvas.curve(points, rng.random_range(0.008..0.04), tone, 0.35);
    }
    let joint = shade(base, 0.6);
    for row in 0..6 {
        canvas.rect(0.0, canvas.height() - row as f32 * 0.8, canvas.width(), 0.012, joint);
        for column in 0..3 {
            let x = column as f32 * 0.8 + if row % 2 == 0 { 0.0 } else { 0.4 };
            canvas.rect(x, canvas.height() - (row + 1) as f32 * 0.8, 0.012, 0.8, joint);
        }
    }
}

fn concrete(canvas: &mut Canvas, base: Rgb, rng: &mut impl Rng) {
    stains(canvas, base, rng);
    for column in 0..2 {
        let x = column as f32 * 1.2;
        canvas.rect(x, 0.0, 0.01, canvas.height(), shade(base, 0.7));
        for row in 0..4 {
            canvas.rect(0.0, row as f32 * 1.0 + 0.4, canvas.width(), 0.01, shade(base, 0.75));
            canvas.ellipse(x + 0.2, row as f32 + 0.7, 0.025, 0.025, shade(base, 0.45), 1.0);
            canvas.ellipse(x + 1.0, row as f32 + 0.7, 0.025, 0.025, shade(base, 0.45), 1.0);
        }
    }
}

/// A floor's texture.
pub(crate) fn floor(kind: FloorSurface, rng: &mut impl Rng) -> Texture {
    let base = match kind {
        FloorSurface::Parquet(c) | FloorSurface::Tiles(c, _) | FloorSurface::Carpet(c) | FloorSurface::Linoleum(c) => c,
    };
    let mut canvas = Canvas::new(2.4, 2.4, FINENESS, base);
    match kind {
        FloorSurface::Parquet(_) => {
            for row in 0..20 {
                let offset: f32 = [0.0, -0.4, -0.8][row % 3];
                for column in 0..5 {
                    let (x, y) = (offset + column as f32 * 0.8, row as f32 * 0.12);
                    let tone = shade(base, rng.random_range(0.80..1.12));
                    canvas.rect(x, y, 0.795, 0.115, tone);
                    grain_lines(&mut canvas, (x, y), (0.79, 0.11), tone, rng);
                }
            }
        }
        FloorSurface::Tiles(_, other) => {
            for row in 0..4 {
                for column in 0..4 {
                    let colour = if (row + column) % 2 == 0 { base } else { other };
                    let tone = shade(colour, rng.random_range(0.95..1.05));
                    canvas.rect(column as f32 * 0.6, row as f32 * 0.6, 0.6, 0.6, shade(tone, 0.8));
                    canvas.rect(column as f32 * 0.6 + 0.005, row as f32 * 0.6 + 0.005, 0.59, 0.59, tone);
                }
            }
        }
        FloorSurface::Carpet(_) => canvas.grain(16.0, rng),
        FloorSurface::Linoleum(_) => {
            for _ in 0..900 {
                let (x, y) = (rng.random_range(0.0..2.4), rng.random_range(0.0..2.4));
                canvas.ellipse(x, y, 0.015, 0.01, shade(base, rng.random_range(0.8..1.2)), 0.7);
            }
        }
    }
    canvas.grain(4.0, rng);
    canvas.into_texture(Repeat::Everywhere)
}

/// A ceiling's texture.
pub(crate) fn ceiling(kind: Ceiling, rng: &mut impl Rng) -> Texture {
    let mut canvas = match kind {
        Ceiling::Gallery => Canvas::new(4.8, 4.8, 40.0, [205, 202, 196]),
        Ceiling::Grid => Canvas::new(4.8, 4.8, 40.0, [214, 214, 210]),
    };
    match kind {
        Ceiling::Gallery => {
            for beam in 0..2 {
                let x = beam as f32 * 2.4;
                canvas.rect(x, 0.0, 0.25, 4.8, [176, 172, 166]);
                canvas.rect(x + 1.3, 0.0, 0.05, 4.8, [60, 60, 62]);
                for lamp in 0..4 {
                    let y = 0.5 + lamp as f32 * 1.2;
                    canvas.ellipse(x + 1.32, y, 0.11, 0.11, [50, 50, 52], 1.0);
                    canvas.ellipse(x + 1.32, y, 0.075, 0.075, [255, 252, 235], 1.0);
                }
            }
        }
        Ceiling::Grid => {
            for row in 0..8 {
                for column in 0..8 {
                    let (x, y) = (column as f32 * 0.6, row as f32 * 0.6);
                    let lamp = row % 4 == 1 && (column % 4 == 1 || column % 4 == 2);
                    let tone =
                        if lamp { [255, 255, 250] } else { shade([212, 212, 208], rng.random_range(0.96..1.02)) };
                    canvas.rect(x, y, 0.6, 0.6, [168, 168, 166]);
                    canvas.rect(x + 0.015, y + 0.015, 0.57, 0.57, tone);
                }
            }
        }
    }
    canvas.grain(3.0, rng);
    canvas.into_texture(Repeat::Everywhere)
}
