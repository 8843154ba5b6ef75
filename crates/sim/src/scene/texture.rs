//! Pictures on surfaces: area-averaged levels of detail, bilinear sampling.

/// How a texture continues beyond its border.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Repeat {
    /// Not at all: the texels of the border continue.
    No,
    /// To the left and right, as along a wall.
    Sideways,
    /// In all directions, as on a floor.
    Everywhere,
}

/// Texels are sRGB, as the drawings and photographs are.
#[derive(Clone, Debug)]
struct Level {
    width: usize,
    height: usize,
    texels: Vec<[u8; 4]>,
}

impl Level {
    fn texel(&self, x: i32, y: i32, repeat: Repeat) -> [f32; 3] {
        let (width, height) = (self.width as i32, self.height as i32);
        let x = if repeat == Repeat::No { x.clamp(0, width - 1) } else { x.rem_euclid(width) };
        let y = if repeat == Repeat::Everywhere { y.rem_euclid(height) } else { y.clamp(0, height - 1) };
        let [r, g, b, _] = self.texels[(y * width + x) as usize];
        [f32::from(r), f32::from(g), f32::from(b)]
    }

    /// Half the size; each texel is the mean of those it covers.
    fn halved(&self) -> Self {
        let (width, height) = ((self.width / 2).max(1), (self.height / 2).max(1));
        let span = |at: usize, of: usize, to: usize| (at * of / to, ((at + 1) * of).div_ceil(to).min(of));
        let mut texels = Vec::with_capacity(width * height);
        for y in 0..height {
            let (y0, y1) = span(y, self.height, height);
            for x in 0..width {
                let (x0, x1) = span(x, self.width, width);
                let mut sum = [0_u32; 3];
                for row in y0..y1 {
                    for texel in &self.texels[row * self.width + x0..row * self.width + x1] {
                        for (sum, &value) in sum.iter_mut().zip(texel) {
                            *sum += u32::from(value);
                        }
                    }
                }
                let count = ((y1 - y0) * (x1 - x0)) as u32;
                let mean = sum.map(|sum| ((sum + count / 2) / count) as u8);
                texels.push([mean[0], mean[1], mean[2], 255]);
            }
        }
        Self { width, height, texels }
    }
}

/// A picture with a size in metres.
#[derive(Clone, Debug)]
pub(crate) struct Texture {
    levels: Vec<Level>,
    texels_per_m: [f32; 2],
    repeat: Repeat,
}

impl Texture {
    /// `texels` are `width` × `height` rows from the top, covering `size_m` (metres, wide and
    /// high); where it does not `repeat`, the texels of its border continue without end. `None` if
    /// a side is zero or texels are missing.
    pub(crate) fn new(
        width: usize,
        height: usize,
        texels: Vec<[u8; 4]>,
        size_m: [f32; 2],
        repeat: Repeat,
    ) -> Option<Self> {
        if width == 0 || height == 0 || texels.len() != width * height || size_m.iter().any(|&size| size <= 0.0) {
            return None;
        }
        let mut levels = vec![Level { width, height, texels }];
        while let Some(last) = levels.last()
            && last.width.max(last.height) > 1
        {
            levels.push(last.halved());
        }
        Some(Self { levels, texels_per_m: [width as f32 / size_m[0], height as f32 / size_m[1]], repeat })
    }

    /// A grey texture, in place of drawings that are too large.
    pub(crate) fn grey() -> Self {
        Self::plain([128; 3])
    }

    /// One colour everywhere.
    pub(crate) fn plain([red, green, blue]: [u8; 3]) -> Self {
        Self {
            levels: vec![Level { width: 1, height: 1, texels: vec![[red, green, blue, 255]] }],
            texels_per_m: [1.0, 1.0],
            repeat: Repeat::Everywhere,
        }
    }

    /// Colour (0 to 255) at `u` metres to the right and `v` metres down from the top left corner,
    /// averaged over about `footprint_m`.
    pub(crate) fn sample(&self, u: f32, v: f32, footprint_m: f32) -> [f32; 3] {
        let texels = footprint_m * self.texels_per_m[0].max(self.texels_per_m[1]);
        // The float's exponent is the level: cheaper than a logarithm, and the level is an integer
        // anyway.
        let level = ((texels.max(1.0) * 1.2).to_bits() >> 23).saturating_sub(127) as usize;
        let level = level.min(self.levels.len() - 1);
        let full = &self.levels[0];
        let chosen = &self.levels[level];
        let x = u * self.texels_per_m[0] * (chosen.width as f32 / full.width as f32) - 0.5;
        let y = v * self.texels_per_m[1] * (chosen.height as f32 / full.height as f32) - 0.5;
        let (x0, y0) = (x.floor(), y.floor());
        let (fx, fy) = (x - x0, y - y0);
        let (x0, y0) = (x0 as i32, y0 as i32);
        let corners = [
            chosen.texel(x0, y0, self.repeat),
            chosen.texel(x0 + 1, y0, self.repeat),
            chosen.texel(x0, y0 + 1, self.repeat),
            chosen.texel(x0 + 1, y0 + 1, self.repeat),
        ];
        let mix = |channel: usize| {
            let top = corners[0][channel] + fx * (corners[1][channel] - corners[0][channel]);
            let bottom = corners[2][channel] + fx * (corners[3][channel] - corners[2][channel]);
            top + fy * (bottom - top)
        };
        [mix(0), mix(1), mix(2)]
    }
}

#[cfg(test)]
mod tests {
    use super::{Repeat, Texture};

    fn checker() -> Texture {
        let texels = (0..64 * 64).map(|i| if (i / 64 + i % 64) % 2 == 0 { [255; 4] } else { [0, 0, 0, 255] }).collect();
        Texture::new(64, 64, texels, [1.0, 1.0], Repeat::Everywhere).unwrap()
    }

    #[test]
    fn near_texels_are_sharp_and_far_ones_average() {
        let texture = checker();
        let near = texture.sample(0.5 / 64.0, 0.5 / 64.0, 0.0);
        assert!((near[0] - 255.0).abs() < 1.0);
        let far = texture.sample(0.37, 0.11, 0.2);
        assert!((far[0] - 127.5).abs() < 2.0);
    }

    #[test]
    fn sizes_must_fit() {
        assert!(Texture::new(2, 2, vec![[0; 4]; 3], [1.0, 1.0], Repeat::No).is_none());
        assert!(Texture::new(0, 2, vec![], [1.0, 1.0], Repeat::No).is_none());
    }
}
