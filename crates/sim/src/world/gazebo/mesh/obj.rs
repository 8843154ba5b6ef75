//! Wavefront OBJ with its materials (MTL).

use super::{MeshCorner, MeshError, Paint, Part, TriangleMesh};
use std::io::{BufReader, Cursor};
use std::path::Path;

/// Faces become triangles; points and lines are dropped, since they have no surface.
const OPTIONS: tobj::LoadOptions =
    tobj::LoadOptions { single_index: false, triangulate: true, ignore_points: true, ignore_lines: true };

/// Reads a file and the materials that it names. Without them the mesh has no paint.
pub(crate) fn read(path: &Path) -> Result<TriangleMesh, MeshError> {
    // Only names can contain bytes that are not UTF-8.
    let text = String::from_utf8_lossy(&std::fs::read(path)?).into_owned();
    let folder = path.parent().unwrap_or_else(|| Path::new("."));
    let materials_of = |name: &Path| {
        let bytes = std::fs::read(folder.join(name)).map_err(|_| tobj::LoadError::OpenFileFailed)?;
        tobj::load_mtl_buf(&mut BufReader::new(Cursor::new(String::from_utf8_lossy(&bytes).into_owned())))
    };
    let (models, materials) = tobj::load_obj_buf(&mut BufReader::new(Cursor::new(text)), &OPTIONS, materials_of)
        .map_err(|error| MeshError::Malformed(error.to_string()))?;
    let materials = materials.unwrap_or_default();
    let mut mesh = TriangleMesh::default();
    for model in models {
        let paint = model.mesh.material_id.and_then(|id| materials.get(id)).map(paint);
        let mut part = Part { names: vec![model.name], paint, triangles: Vec::new() };
        let shape = &model.mesh;
        for (triangle, indices) in shape.indices.as_chunks::<3>().0.iter().enumerate() {
            let corner = |side: usize| {
                let at = 3 * indices[side] as usize;
                let position = shape.positions.get(at..at + 3)?;
                let uv = shape.texcoord_indices.get(3 * triangle + side).and_then(|&index| {
                    let at = 2 * index as usize;
                    shape.texcoords.get(at..at + 2)
                });
                Some(MeshCorner {
                    position: [position[0].into(), position[1].into(), position[2].into()],
                    uv: uv.map_or([0.0; 2], |uv| [uv[0], uv[1]]),
                })
            };
            match (corner(0), corner(1), corner(2)) {
                (Some(a), Some(b), Some(c)) => part.triangles.push([a, b, c]),
                _ => mesh.malformed += 1,
            }
        }
        mesh.parts.push(part);
    }
    Ok(mesh)
}

fn paint(material: &tobj::Material) -> Paint {
    // Options come before the name, which may contain spaces.
    let picture = material.diffuse_texture.as_deref().map(str::trim).filter(|name| !name.is_empty());
    let picture = picture.map(|name| {
        let name = if name.starts_with('-') { name.rsplit(' ').next().unwrap_or(name) } else { name };
        name.to_owned()
    });
    Paint { colour: material.diffuse.unwrap_or([0.8; 3]), picture }
}
