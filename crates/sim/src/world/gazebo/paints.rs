//! Textures for paints, each made once.

use super::mesh::Paint;
use super::report::{Flaw, ImportReport};
use super::resolve::Paths;
use crate::scene::texture::{Repeat, Texture};
use crate::scene::{SceneBuilder, TextureId};
use image::ImageReader;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// Larger pictures are scaled down to this longest side, texels.
const LONGEST_SIDE: u32 = 512;

/// The textures made so far.
#[derive(Default)]
pub(crate) struct Paints {
    colours: HashMap<[u8; 3], TextureId>,
    pictures: HashMap<PathBuf, Option<TextureId>>,
}

impl Paints {
    /// The texture of a paint from a file in the folder `base`: its picture, one unit wide and
    /// high, or its colour.
    pub(crate) fn texture(
        &mut self,
        paint: &Paint,
        base: &Path,
        paths: &Paths,
        builder: &mut SceneBuilder,
        report: &mut ImportReport,
    ) -> TextureId {
        if let Some(reference) = &paint.picture {
            let found = paths.find_picture(reference, base);
            if found.is_none() {
                report.note(Flaw::Picture, format!("{reference} (missing)"));
            }
            if let Some(texture) = found.and_then(|path| self.picture(path, builder, report)) {
                return texture;
            }
        }
        self.colour(paint.colour, builder)
    }

    fn picture(&mut self, path: PathBuf, builder: &mut SceneBuilder, report: &mut ImportReport) -> Option<TextureId> {
        if let Some(texture) = self.pictures.get(&path) {
            return *texture;
        }
        let decoded = ImageReader::open(&path)
            .and_then(ImageReader::with_guessed_format)
            .map_err(image::ImageError::IoError)
            .and_then(ImageReader::decode);
        let texture = match decoded {
            Ok(picture) => {
                let small = if picture.width().max(picture.height()) > LONGEST_SIDE {
                    picture.thumbnail(LONGEST_SIDE, LONGEST_SIDE)
                } else {
                    picture
                };
                let texels = small.to_rgba8();
                let (width, height) = (texels.width() as usize, texels.height() as usize);
                let texels = texels.pixels().map(|pixel| pixel.0).collect();
                Texture::new(width, height, texels, [1.0, 1.0], Repeat::Everywhere)
            }
            Err(error) => {
                let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
                report.note(Flaw::Picture, format!("{name} ({error})"));
                None
            }
        };
        let texture = texture.map(|texture| builder.texture(texture));
        self.pictures.insert(path, texture);
        texture
    }

    /// The texture of a plain colour, 0 to 1.
    pub(crate) fn colour(&mut self, colour: [f32; 3], builder: &mut SceneBuilder) -> TextureId {
        let [red, green, blue] = colour.map(|value| (value.clamp(0.0, 1.0) * 255.0).round() as u8);
        *self.colours.entry([red, green, blue]).or_insert_with(|| builder.texture(Texture::plain([red, green, blue])))
    }
}
