//! Meshes of any format as plain triangles with their paint.

use super::{collada, obj, stl};
use std::path::Path;

/// Largest mesh file that is read, bytes.
const MOST_BYTES: u64 = 256 << 20;
/// Most triangles of one mesh.
pub(crate) const MOST_TRIANGLES: usize = 4_000_000;

/// A mesh cannot be had.
#[derive(Debug, thiserror::Error)]
pub(crate) enum MeshError {
    /// The file cannot be read.
    #[error("{0}")]
    Read(#[from] std::io::Error),
    /// The file is larger than any mesh of a building.
    #[error("a file of {0} bytes is too large")]
    Large(u64),
    /// The format is not supported.
    #[error("format not supported: expected dae, obj or stl")]
    Format,
    /// The XML of a COLLADA file is malformed.
    #[error("malformed XML: {0}")]
    Xml(#[from] roxmltree::Error),
    /// The file is malformed.
    #[error("malformed: {0}")]
    Malformed(String),
    /// It has more triangles than any mesh of a building.
    #[error("more than {MOST_TRIANGLES} triangles")]
    Triangles,
}

/// What a surface looks like.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Paint {
    /// Red, green, blue, 0 to 1.
    pub(crate) colour: [f32; 3],
    /// A picture that takes the colour's place, as the file names it.
    pub(crate) picture: Option<String>,
}

/// A corner of a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Corner {
    /// Place in the mesh's frame, metres.
    pub(crate) position: [f64; 3],
    /// Place in the picture: right and up from its lower left corner, in its widths and heights.
    pub(crate) uv: [f32; 2],
}

/// Triangles of one paint.
#[derive(Clone, Debug, Default)]
pub(crate) struct Part {
    /// What the file calls it.
    pub(crate) names: Vec<String>,
    /// `None`: the file does not say.
    pub(crate) paint: Option<Paint>,
    /// The triangles; both sides can be seen.
    pub(crate) triangles: Vec<[Corner; 3]>,
}

/// A mesh.
#[derive(Clone, Debug, Default)]
pub(crate) struct Mesh {
    /// Its parts.
    pub(crate) parts: Vec<Part>,
    /// Triangles left out because they are malformed.
    pub(crate) malformed: usize,
}

/// Reads a mesh by the extension of its file.
pub(crate) fn load(path: &Path) -> Result<Mesh, MeshError> {
    let bytes = std::fs::metadata(path)?.len();
    if bytes > MOST_BYTES {
        return Err(MeshError::Large(bytes));
    }
    let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
    let mesh = match extension.as_deref() {
        Some("dae") => collada::read(&String::from_utf8_lossy(&std::fs::read(path)?))?,
        Some("obj") => obj::read(path)?,
        Some("stl") => stl::read(&std::fs::read(path)?)?,
        _ => return Err(MeshError::Format),
    };
    if mesh.parts.iter().map(|part| part.triangles.len()).sum::<usize>() > MOST_TRIANGLES {
        return Err(MeshError::Triangles);
    }
    Ok(mesh)
}
