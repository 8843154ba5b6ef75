//! Mesh files of any supported format.

use super::{MOST_TRIANGLES, MeshError, TriangleMesh, collada, obj, stl};
use std::path::Path;

/// Largest mesh file that is read, bytes.
const MOST_BYTES: u64 = 256 << 20;

/// Reads a mesh by the extension of its file.
pub(crate) fn load(path: &Path) -> Result<TriangleMesh, MeshError> {
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
