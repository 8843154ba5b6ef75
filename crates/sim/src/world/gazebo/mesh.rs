//! Meshes of any format as plain triangles with their paint.
//!
//! | module | idea |
//! | --- | --- |
//! | `file` | a mesh by the extension of its file |
//! | `collada`, `obj`, `stl` | one format each |

mod collada;
pub(crate) mod file;
mod obj;
mod stl;

/// Most triangles of one mesh.
pub(crate) const MOST_TRIANGLES: usize = 4_000_000;

/// Why a mesh cannot be loaded.
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
    /// A picture that replaces the colour, as the file names it.
    pub(crate) picture: Option<String>,
}

/// A corner of a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct MeshCorner {
    /// Position in the mesh's frame, metres.
    pub(crate) position: [f64; 3],
    /// Texture coordinates: right and up from the picture's lower left corner, in its widths and
    /// heights.
    pub(crate) uv: [f32; 2],
}

/// Triangles of one paint.
#[derive(Clone, Debug, Default)]
pub(crate) struct Part {
    /// Its names in the file.
    pub(crate) names: Vec<String>,
    /// `None`: the file does not say.
    pub(crate) paint: Option<Paint>,
    /// The triangles; both sides are visible.
    pub(crate) triangles: Vec<[MeshCorner; 3]>,
}

/// A mesh.
#[derive(Clone, Debug, Default)]
pub(crate) struct TriangleMesh {
    /// Its parts.
    pub(crate) parts: Vec<Part>,
    /// Number of triangles left out because they are malformed.
    pub(crate) malformed: usize,
}
