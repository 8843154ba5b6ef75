//! What is fixed to walls: doors, windows, boards, signs, shelves, extinguishers.

use super::Panel;
use super::canvas::{Canvas, Rgb, any_colour, hsv, mix, shade};
use super::surfaces::grain_lines;
use rand::{Rng, RngExt};

/// Pixels per metre.
const FINENESS: f64 = 120.0;

/// A door with its frame, a handle and perhaps a pane and a number.
pub(crate) fn door(colour: Rgb, number: u32, rng: &mut impl Rng) -> Panel {
    let mut canvas = Canvas::new(1.06, 2.14, FINENESS, shade(colour, 0.55));
    canvas.rect(0.07, 0.07, 0.92, 2.07, colour);
    grain_lines(&mut canvas, (0.07, 0.07), (0.92, 2.07), colour, rng);
    match number % 3 {
        0 => {
            canvas.rect(0.62, 0.3, 0.22, 0.8, shade(colour, 0.6));
            canvas.gradient(0.64, 0.32, 0.18, 0.76, [196, 214, 220], [120, 140, 150]);
        }
        1 => {
            for (y, h) in [(0.25, 0.75), (1.15, 0.75)] {
                canvas.frame(0.22, y, 0.62, h, 0.03, shade(colour, 0.75));
            }
        }
        _ => canvas.rect(0.07, 1.85, 0.92, 0.28, [170, 170, 172]),
    }
    canvas.rect(0.14, 1.08, 0.12, 0.03, [190, 190, 192]);
    canvas.ellipse(0.16, 1.095, 0.03, 0.03, [205, 205, 208], 1.0);
    canvas.rect(0.28, 0.36, 0.26, 0.13, [240, 240, 236]);
    canvas.text(0.295, 0.39, 0.075, &format!("{:03}", number % 1000), [30, 30, 40]);
    canvas.into_panel(0.0)
}

/// A window to the outside.
pub(crate) fn window(rng: &mut impl Rng) -> Panel {
    let mut canvas = Canvas::new(rng.random_range(1.4..2.0), 1.35, FINENESS, [232, 232, 228]);
    let (w, h) = (canvas.width(), canvas.height());
    let sky = hsv(rng.random_range(0.54..0.6), rng.random_range(0.15..0.4), 0.98);
    canvas.gradient(0.07, 0.07, w - 0.14, h - 0.14, sky, [236, 240, 240]);
    for _ in 0..7 {
        let (x, r) = (rng.random_range(0.1..w - 0.1), rng.random_range(0.1..0.25));
        let green = hsv(rng.random_range(0.25..0.36), 0.5, rng.random_range(0.3..0.55));
        canvas.ellipse(x, h - 0.2, r, r, green, 0.95);
    }
    canvas.rect(0.0, h - 0.07, w, 0.07, [232, 232, 228]);
    canvas.rect(w / 2.0 - 0.025, 0.0, 0.05, h, [225, 225, 222]);
    if rng.random_bool(0.4) {
        let drawn = rng.random_range(0.2..0.8) * h;
        let mut y = 0.07;
        while y < drawn {
            canvas.rect(0.05, y, w - 0.1, 0.03, [214, 210, 200]);
            y += 0.045;
        }
    }
    canvas.frame(0.0, 0.0, w, h, 0.05, [198, 198, 196]);
    canvas.into_panel(0.92)
}

/// A whiteboard, written on.
pub(crate) fn whiteboard(rng: &mut impl Rng) -> Panel {
    let mut canvas = Canvas::new(rng.random_range(1.6..2.4), 1.15, FINENESS, [244, 246, 248]);
    let (w, h) = (canvas.width(), canvas.height());
    let inks: [Rgb; 4] = [[30, 60, 160], [190, 40, 40], [30, 120, 60], [30, 30, 36]];
    for _ in 0..rng.random_range(5..13) {
        let ink = inks[rng.random_range(0..4)];
        let (x, y) = (rng.random_range(0.1..w - 0.5), rng.random_range(0.1..h - 0.3));
        match rng.random_range(0..4) {
            0 => {
                canvas.frame(x, y, 0.36, 0.2, 0.014, ink);
                canvas.line(&[(x + 0.36, y + 0.1), (x + 0.55, y + 0.1)], 0.012, ink, 1.0);
            }
            1 => {
                let points: Vec<(f32, f32)> =
                    (0..12).map(|i| (x + i as f32 * 0.04, y + rng.random_range(0.0..0.12_f32))).collect();
                canvas.line(&points, 0.012, ink, 1.0);
            }
            2 => canvas.ellipse(x + 0.1, y + 0.1, 0.09, 0.09, ink, 0.35),
            _ => {
                let words = ["TODO", "a=b+c", "2x", "DEMO", "Q3", "plan", "KW 47", "OK?", "n log n"];
                canvas.text(x, y, 0.075, words[rng.random_range(0..words.len())], ink);
            }
        }
    }
    canvas.frame(0.0, 0.0, w, h, 0.03, [150, 152, 156]);
    canvas.into_panel(0.85)
}

/// A cork board with notes.
pub(crate) fn notice_board(rng: &mut impl Rng) -> Panel {
    let cork = [178, 132, 84];
    let mut canvas = Canvas::new(rng.random_range(1.2..1.9), 1.0, FINENESS, cork);
    canvas.grain(22.0, rng);
    let (w, h) = (canvas.width(), canvas.height());
    for _ in 0..rng.random_range(8..20) {
        let (x, y) = (rng.random_range(0.06..w - 0.3), rng.random_range(0.06..h - 0.3));
        let (nw, nh) = (rng.random_range(0.12..0.26), rng.random_range(0.12..0.28));
        let pale = rng.random_bool(0.6);
        let paper = if pale { [240, 238, 230] } else { any_colour(rng, (0.3, 0.8), (0.8, 1.0)) };
        canvas.rect(x + 0.008, y + 0.008, nw, nh, shade(cork, 0.6));
        canvas.rect(x, y, nw, nh, paper);
        let mut line = y + 0.04;
        while line < y + nh - 0.03 {
            canvas.rect(x + 0.02, line, (nw - 0.04) * rng.random_range(0.4..1.0), 0.008, [90, 90, 100]);
            line += 0.025;
        }
        canvas.ellipse(x + nw / 2.0, y + 0.015, 0.012, 0.012, [200, 40, 40], 1.0);
    }
    canvas.frame(0.0, 0.0, w, h, 0.035, [110, 76, 44]);
    canvas.into_panel(0.9)
}

/// A row of shelf boards with books, `width_m` × `height_m`.
pub(crate) fn books(width_m: f64, height_m: f64, rng: &mut impl Rng) -> Canvas {
    let wood = [[120, 84, 52], [168, 134, 96], [92, 62, 42], [214, 208, 198]][rng.random_range(0..4)];
    let mut canvas = Canvas::new(width_m, height_m, FINENESS, shade(wood, 0.4));
    let (w, h) = (canvas.width(), canvas.height());
    let rows = (h / 0.36).floor().max(1.0);
    let pitch = h / rows;
    for row in 0..rows as i32 {
        let floor = (row + 1) as f32 * pitch - 0.03;
        let mut x = 0.04;
        while x < w - 0.06 {
            if rng.random_bool(0.07) {
                x += rng.random_range(0.05..0.25);
                continue;
            }
            let (bw, bh) = (rng.random_range(0.022..0.06_f32).min(w - 0.04 - x), rng.random_range(0.6..0.88) * pitch);
            let spine = any_colour(rng, (0.2, 0.85), (0.2, 0.85));
            canvas.rect(x, floor - bh, bw - 0.003, bh, spine);
            canvas.rect(x, floor - bh * 0.8, bw - 0.003, 0.02, mix(spine, [240, 220, 150], 0.7));
            x += bw;
        }
        canvas.rect(0.0, floor, w, 0.03, wood);
    }
    canvas.frame(0.0, 0.0, w, h, 0.04, wood);
    canvas
}

/// A framed sheet of text beside exhibits.
pub(crate) fn text_panel(title: &str, rng: &mut impl Rng) -> Panel {
    let ground: Rgb = if rng.random_bool(0.5) { [240, 238, 232] } else { any_colour(rng, (0.3, 0.7), (0.2, 0.4)) };
    let ink: Rgb = if ground[0] > 200 { [40, 40, 44] } else { [236, 234, 228] };
    let mut canvas = Canvas::new(0.9, 1.3, FINENESS, ground);
    let size = (0.76 / title.len().max(4) as f32).min(0.11);
    canvas.text(0.07, 0.08, size, title, ink);
    let mut y = 0.28;
    while y < 1.2 {
        canvas.rect(0.07, y, rng.random_range(0.5..0.76), 0.012, mix(ink, ground, 0.25));
        y += if rng.random_bool(0.15) { 0.08 } else { 0.035 };
    }
    canvas.into_panel(0.8)
}

/// A sign with an arrow.
pub(crate) fn sign(text: &str, colour: Rgb) -> Panel {
    let width = 0.3 + 0.13 * text.len() as f64;
    let mut canvas = Canvas::new(width, 0.3, FINENESS, colour);
    canvas.text(0.06, 0.09, 0.13, text, [250, 250, 248]);
    let x = canvas.width() - 0.2;
    canvas.polygon(&[(x, 0.06), (x + 0.14, 0.15), (x, 0.24)], [250, 250, 248], 1.0);
    canvas.into_panel(1.75)
}

/// A fire extinguisher under its sign.
pub(crate) fn extinguisher() -> Panel {
    let mut canvas = Canvas::new(0.36, 1.3, FINENESS, [238, 236, 230]);
    canvas.rect(0.05, 0.03, 0.26, 0.26, [200, 24, 28]);
    canvas.polygon(&[(0.18, 0.06), (0.25, 0.2), (0.11, 0.2)], [250, 250, 248], 1.0);
    canvas.rect(0.08, 0.55, 0.2, 0.68, [196, 22, 26]);
    canvas.ellipse(0.18, 0.56, 0.1, 0.06, [196, 22, 26], 1.0);
    canvas.rect(0.14, 0.44, 0.08, 0.1, [40, 40, 42]);
    canvas.line(&[(0.22, 0.48), (0.31, 0.6), (0.3, 0.85)], 0.025, [30, 30, 32], 1.0);
    canvas.rect(0.1, 0.72, 0.16, 0.2, [238, 236, 228]);
    canvas.into_panel(0.3)
}

/// A round clock.
pub(crate) fn clock(rng: &mut impl Rng) -> Panel {
    let mut canvas = Canvas::new(0.4, 0.4, FINENESS, [226, 226, 222]);
    canvas.ellipse(0.2, 0.2, 0.19, 0.19, [30, 30, 32], 1.0);
    canvas.ellipse(0.2, 0.2, 0.165, 0.165, [248, 248, 244], 1.0);
    for hand in [0.09, 0.14] {
        let angle: f32 = rng.random_range(0.0..std::f32::consts::TAU);
        canvas.line(&[(0.2, 0.2), (0.2 + hand * angle.cos(), 0.2 + hand * angle.sin())], 0.015, [20, 20, 24], 1.0);
    }
    canvas.into_panel(2.0)
}

/// A plan of the building or of the world.
pub(crate) fn wall_map(rng: &mut impl Rng) -> Panel {
    let mut canvas = Canvas::new(1.5, 1.0, FINENESS, [176, 204, 220]);
    for _ in 0..rng.random_range(5..9) {
        let (x, y) = (rng.random_range(0.1..1.4), rng.random_range(0.1..0.9));
        let land = hsv(rng.random_range(0.08..0.4), 0.4, rng.random_range(0.6..0.9));
        for _ in 0..10 {
            let (dx, dy) = (rng.random_range(-0.16..0.16), rng.random_range(-0.1..0.1));
            canvas.ellipse(x + dx, y + dy, rng.random_range(0.03..0.1), rng.random_range(0.03..0.08), land, 1.0);
        }
    }
    for line in 1..10 {
        canvas.rect(line as f32 * 0.15, 0.0, 0.004, 1.0, [120, 140, 150]);
        canvas.rect(0.0, line as f32 * 0.1, 1.5, 0.004, [120, 140, 150]);
    }
    canvas.frame(0.0, 0.0, 1.5, 1.0, 0.025, [60, 50, 40]);
    canvas.into_panel(0.95)
}
