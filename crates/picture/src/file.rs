//! Where pictures go.

use std::path::{Path, PathBuf};
use tiny_skia::Pixmap;

/// Why there is no picture.
#[derive(Debug, thiserror::Error)]
pub enum PictureError {
    /// Nothing has a place.
    #[error("there is nothing to draw")]
    Empty,
    /// The picture does not fit into memory.
    #[error("a picture of {width} × {height} pixels is too large")]
    Large {
        /// Width, pixels.
        width: i64,
        /// Height, pixels.
        height: i64,
    },
    /// The file cannot be written.
    #[error("{path} cannot be written: {reason}", path = path.display())]
    Write {
        /// Which file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
}

/// The name of a picture that was given none: what was done (`explore`), in which world or log (a
/// name or a path), and by which seed, such as `explore-museum-1.png`. A world in a file is told
/// from a built-in one of the same name: `explore-museum-yaml-1.png`.
#[must_use]
pub fn default_file(kind: &str, source: &str, seed: Option<u64>) -> PathBuf {
    let source = Path::new(source);
    let stem = source.file_stem().map_or_else(|| "map".into(), |stem| stem.to_string_lossy());
    // A log needs none: there are no built-in ones.
    let format = source.extension().filter(|_| seed.is_some());
    let format = format.map(|format| format!("-{}", format.to_string_lossy())).unwrap_or_default();
    let seed = seed.map(|seed| format!("-{seed}")).unwrap_or_default();
    format!("{kind}-{stem}{format}{seed}.png").into()
}

/// Writes a picture.
pub(crate) fn write(pixmap: &Pixmap, path: &Path) -> Result<(), PictureError> {
    let failed = |reason: String| PictureError::Write { path: path.to_owned(), reason };
    let png = pixmap.encode_png().map_err(|error| failed(error.to_string()))?;
    fht_program::write_output(path, &png).map_err(|error| failed(error.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_say_what_where_and_by_which_seed() {
        for (kind, source, seed, expected) in [
            ("explore", "museum", Some(1), "explore-museum-1.png"),
            ("handoff", "floors/second.yaml", Some(3), "handoff-second-yaml-3.png"),
            ("replay", "../data/intel/", None, "replay-intel.png"),
            ("replay", "..", None, "replay-map.png"),
        ] {
            assert_eq!(default_file(kind, source, seed), Path::new(expected));
        }
    }
}
