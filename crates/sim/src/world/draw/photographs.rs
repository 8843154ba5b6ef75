//! A folder of pictures for the walls of a map.

use image::{DynamicImage, RgbImage};
use std::path::{Path, PathBuf};

/// Larger pictures are scaled down to this longest side, pixels: finer than a wall shows.
const LONGEST_SIDE: u32 = 512;
/// Most pictures read from one folder.
const MOST: usize = 200;

/// Why a folder of pictures cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum PhotographError {
    /// The folder cannot be read.
    #[error("cannot read the pictures' folder {path}: {source}")]
    Folder {
        /// The folder.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// There is no readable PNG or JPEG in the folder.
    #[error("no readable PNG or JPEG in {0}")]
    None(PathBuf),
}

/// The PNG and JPEG pictures of a folder in the order of their names, scaled down if they are
/// large. Files that cannot be read are skipped with a warning.
pub(crate) fn load(folder: &Path) -> Result<Vec<RgbImage>, PhotographError> {
    let failed = |source| PhotographError::Folder { path: folder.to_owned(), source };
    let mut paths: Vec<PathBuf> = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        paths.push(entry.map_err(failed)?.path());
    }
    paths.retain(|path| {
        let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
        matches!(extension.as_deref(), Some("png" | "jpg" | "jpeg"))
    });
    paths.sort();
    paths.truncate(MOST);
    let mut photographs = Vec::new();
    for path in paths {
        match image::open(&path) {
            Ok(picture) => photographs.push(small(&picture)),
            Err(error) => tracing::warn!(path = %path.display(), %error, "picture skipped"),
        }
    }
    if photographs.is_empty() { Err(PhotographError::None(folder.to_owned())) } else { Ok(photographs) }
}

fn small(picture: &DynamicImage) -> RgbImage {
    if picture.width().max(picture.height()) > LONGEST_SIDE {
        picture.thumbnail(LONGEST_SIDE, LONGEST_SIDE).to_rgb8()
    } else {
        picture.to_rgb8()
    }
}
