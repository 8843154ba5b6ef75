//! The triangles of a COLLADA geometry.

use super::element::{Element, Ids, child, children, numbers};
use crate::world::gazebo::mesh::MeshCorner;
use std::collections::HashMap;

/// Most corners of one polygon.
const MOST_CORNERS: usize = 100_000;

/// Rows of numbers.
#[derive(Debug, Default)]
pub(super) struct Source {
    values: Vec<f64>,
    offset: usize,
    stride: usize,
}

impl Source {
    /// Reads a `<source>`.
    fn of(element: Element<'_>) -> Self {
        let values = child(element, "float_array").map(numbers).unwrap_or_default();
        let accessor = child(element, "technique_common").and_then(|technique| child(technique, "accessor"));
        let count = |name: &str| accessor.and_then(|node| node.attribute(name)).and_then(|value| value.parse().ok());
        Self { values, offset: count("offset").unwrap_or(0), stride: count("stride").unwrap_or(1) }
    }

    fn row<const N: usize>(&self, index: usize) -> Option<[f64; N]> {
        let at = index.checked_mul(self.stride)?.checked_add(self.offset)?;
        self.values.get(at..at.checked_add(N)?)?.try_into().ok()
    }
}

/// An input of a primitive: which source, and which of a corner's indices.
struct Input<'d> {
    source: &'d str,
    offset: usize,
}

/// The two inputs that matter, and the number of indices per corner.
struct Inputs<'d> {
    position: Input<'d>,
    uv: Option<Input<'d>>,
    indices: usize,
}

/// The triangles of a primitive element in the geometry's own frame and unit, and the number of
/// malformed ones; none for an element that is not a primitive with surfaces.
pub(super) fn triangles<'d>(
    primitive: Element<'d>,
    ids: &Ids<'d>,
    sources: &mut HashMap<&'d str, Source>,
) -> (Vec<[MeshCorner; 3]>, usize) {
    let kind = primitive.tag_name().name();
    if !matches!(kind, "triangles" | "polylist" | "polygons" | "tristrips" | "trifans") {
        return (Vec::new(), 0);
    }
    let Some(inputs) = inputs(primitive, ids) else { return (Vec::new(), 1) };
    for source in [Some(&inputs.position), inputs.uv.as_ref()].into_iter().flatten().map(|input| input.source) {
        if let Some(&element) = ids.get(&("source", source)) {
            sources.entry(source).or_insert_with(|| Source::of(element));
        }
    }
    let position = sources.get(inputs.position.source);
    let uv = inputs.uv.as_ref().and_then(|input| Some((sources.get(input.source)?, input.offset)));
    let corner = |indices: &[usize]| {
        let [x, y, z] = position?.row::<3>(*indices.get(inputs.position.offset)?)?;
        let uv = uv.and_then(|(source, offset)| source.row::<2>(*indices.get(offset)?));
        Some(MeshCorner { position: [x, y, z], uv: uv.map_or([0.0; 2], |[s, t]| [s as f32, t as f32]) })
    };
    let mut triangles = Vec::new();
    let mut malformed = 0;
    let mut add = |a: &[usize], b: &[usize], c: &[usize]| match (corner(a), corner(b), corner(c)) {
        (Some(a), Some(b), Some(c)) => triangles.push([a, b, c]),
        _ => malformed += 1,
    };
    let lists: Vec<Vec<usize>> = children(primitive, "p")
        .chain(children(primitive, "ph").filter_map(|holed| child(holed, "p")))
        .map(indices)
        .collect();
    for list in &lists {
        let corners: Vec<&[usize]> = list.chunks_exact(inputs.indices).collect();
        match kind {
            "triangles" => corners.as_chunks::<3>().0.iter().for_each(|[a, b, c]| add(a, b, c)),
            "tristrips" => corners.windows(3).for_each(|strip| add(strip[0], strip[1], strip[2])),
            "polylist" => {
                let mut rest = corners.as_slice();
                for count in child(primitive, "vcount").map(indices).unwrap_or_default() {
                    let Some((polygon, after)) = rest.split_at_checked(count.min(MOST_CORNERS)) else { break };
                    fan(polygon, &mut add);
                    rest = after;
                }
            }
            // Holes in polygons are filled.
            _ => fan(&corners, &mut add),
        }
    }
    (triangles, malformed)
}

/// A polygon as triangles around its first corner.
fn fan(polygon: &[&[usize]], add: &mut impl FnMut(&[usize], &[usize], &[usize])) {
    if let [first, rest @ ..] = polygon {
        rest.windows(2).for_each(|pair| add(first, pair[0], pair[1]));
    }
}

/// The whole numbers of an element's text; a malformed one becomes an index out of range.
fn indices(node: Element<'_>) -> Vec<usize> {
    let text = node.text().unwrap_or_default();
    text.split_ascii_whitespace().map(|word| word.parse().unwrap_or(usize::MAX)).collect()
}

fn inputs<'d>(primitive: Element<'d>, ids: &Ids<'d>) -> Option<Inputs<'d>> {
    let number = |node: Element<'d>, name: &str| node.attribute(name).and_then(|value| value.parse::<usize>().ok());
    let source = |node: Element<'d>| node.attribute("source").map(|source| source.trim_start_matches('#'));
    let mut position = None;
    let mut uv: Option<(usize, Input<'d>)> = None;
    let mut most = 0;
    for input in children(primitive, "input") {
        let offset = number(input, "offset").unwrap_or(0);
        most = most.max(offset);
        // Of several mappings, the one with the lowest set number counts.
        let set = number(input, "set").unwrap_or(0);
        match input.attribute("semantic") {
            Some("VERTEX") => {
                for shared in children(*ids.get(&("vertices", source(input)?))?, "input") {
                    let source = source(shared)?;
                    match shared.attribute("semantic") {
                        Some("POSITION") => position = Some(Input { source, offset }),
                        Some("TEXCOORD") if uv.is_none() => uv = Some((0, Input { source, offset })),
                        _ => {}
                    }
                }
            }
            Some("TEXCOORD") if uv.as_ref().is_none_or(|(least, _)| set < *least) => {
                uv = Some((set, Input { source: source(input)?, offset }));
            }
            _ => {}
        }
    }
    let indices = most.checked_add(1).filter(|&indices| indices <= 64)?;
    Some(Inputs { position: position?, uv: uv.map(|(_, input)| input), indices })
}
