//! STL: triangles without looks, binary or text.

use super::{MeshCorner, MeshError, Part, TriangleMesh};

/// Bytes before the first triangle of a binary file: a comment and the number of triangles.
const HEADER: usize = 84;
/// Bytes of a triangle: a normal, three corners, an attribute.
const RECORD: usize = 50;

/// Reads a file's content.
pub(crate) fn read(bytes: &[u8]) -> Result<TriangleMesh, MeshError> {
    let malformed = |reason: &str| MeshError::Malformed(reason.to_owned());
    // A binary file may begin with the keyword of the text format, so the length decides.
    let count = bytes.get(80..HEADER).and_then(|count| count.try_into().ok()).map(u32::from_le_bytes);
    let is_binary = count.is_some_and(|count| bytes.len() - HEADER == count as usize * RECORD);
    let corners = if is_binary {
        binary(&bytes[HEADER..])
    } else if bytes.trim_ascii_start().starts_with(b"solid") {
        text(&String::from_utf8_lossy(bytes)).ok_or_else(|| malformed("a vertex is not three numbers"))?
    } else {
        return Err(malformed("neither a binary STL file of its length nor a text one"));
    };
    let triangles = corners.as_chunks::<3>().0.to_vec();
    Ok(TriangleMesh { parts: vec![Part { triangles, ..Part::default() }], malformed: 0 })
}

fn corner(position: [f32; 3]) -> MeshCorner {
    MeshCorner { position: position.map(f64::from), uv: [0.0; 2] }
}

fn binary(records: &[u8]) -> Vec<MeshCorner> {
    let number = |bytes: &[u8]| bytes.try_into().map_or(f32::NAN, f32::from_le_bytes);
    let vertex = |bytes: &[u8]| corner([0, 4, 8].map(|at| number(&bytes[at..at + 4])));
    records.chunks_exact(RECORD).flat_map(|record| [12, 24, 36].map(|at| vertex(&record[at..at + 12]))).collect()
}

fn text(text: &str) -> Option<Vec<MeshCorner>> {
    let mut corners = Vec::new();
    let mut words = text.split_ascii_whitespace();
    while let Some(word) = words.next() {
        if word == "vertex" {
            let mut number = || words.next()?.parse().ok();
            corners.push(corner([number()?, number()?, number()?]));
        }
    }
    Some(corners)
}

#[cfg(test)]
mod tests {
    use super::read;

    #[test]
    fn both_kinds_are_read() {
        let text = b"solid s\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1.5e0 0\nendloop\n\
                     endfacet\nendsolid s\n";
        let from_text = read(text).unwrap();
        let mut binary = vec![b's'; 80];
        binary.extend(1_u32.to_le_bytes());
        for number in [0.0_f32, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.5, 0.0] {
            binary.extend(number.to_le_bytes());
        }
        binary.extend([0, 0]);
        let from_binary = read(&binary).unwrap();
        assert_eq!(from_text.parts[0].triangles, from_binary.parts[0].triangles);
        assert_eq!(from_text.parts[0].triangles[0][2].position, [0.0, 1.5, 0.0]);
    }

    #[test]
    fn what_is_no_stl_is_told() {
        assert!(read(b"").is_err());
        assert!(read(&[0; 100]).is_err());
        assert!(read(b"solid\nvertex 1 2 x").is_err());
    }
}
