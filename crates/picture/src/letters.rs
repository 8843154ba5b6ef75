//! Text in a bitmap font of 8 × 8 dots.

use crate::plot::{Rgb, put};
use font8x8::UnicodeFonts;
use tiny_skia::Pixmap;

/// Side of a dot, pixels.
const DOT_PX: i32 = 2;
/// Width and height of a letter with its gap, pixels.
pub(crate) const LETTER_PX: i32 = 8 * DOT_PX;

/// Width of a line of text, pixels.
pub(crate) fn width_px(text: &str) -> i32 {
    text.chars().count() as i32 * LETTER_PX
}

/// Writes a line of text with its top left corner at (x, y). What the font does not have becomes a
/// question mark.
pub(crate) fn write(pixmap: &mut Pixmap, (x, y): (i32, i32), text: &str, colour: Rgb) {
    for (index, letter) in text.chars().enumerate() {
        let glyph = font8x8::BASIC_FONTS.get(letter).or_else(|| font8x8::LATIN_FONTS.get(letter));
        let Some(glyph) = glyph.or_else(|| font8x8::BASIC_FONTS.get('?')) else { continue };
        let left = x + index as i32 * LETTER_PX;
        for (row, bits) in (0..).zip(glyph) {
            for column in (0..8).filter(|column| bits >> column & 1 == 1) {
                let (dot_x, dot_y) = (left + column * DOT_PX, y + row * DOT_PX);
                for (dx, dy) in (0..DOT_PX).flat_map(|dx| (0..DOT_PX).map(move |dy| (dx, dy))) {
                    put(pixmap, (dot_x + dx, dot_y + dy), colour);
                }
            }
        }
    }
}
