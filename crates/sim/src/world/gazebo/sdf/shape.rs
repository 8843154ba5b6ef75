//! The `<geometry>` of a visual.

use super::element::child;
use crate::world::gazebo::report::{Flaw, ImportReport};
use nalgebra::{Point2, Vector3};
use roxmltree::Node;

/// Largest size of a simple shape, metres.
const LARGEST_M: f64 = 1e4;
/// Largest scale of a mesh: some are in millimetres or micrometres.
const LARGEST_SCALE: f64 = 1e6;
/// Most points of a polyline.
const MOST_POINTS: usize = 2000;

/// The shape of a visual.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Shape {
    /// A mesh from a file.
    Mesh {
        /// Where it is.
        uri: String,
        /// Along its own axes.
        scale: [f64; 3],
        /// Only the part with this name, and whether it is moved to the origin.
        part: Option<(String, bool)>,
    },
    /// Sizes, metres.
    Box([f64; 3]),
    /// Along z.
    Cylinder {
        /// Metres.
        radius: f64,
        /// Metres.
        length: f64,
    },
    /// A sphere has three equal radii, metres.
    Ellipsoid([f64; 3]),
    /// Along z.
    Capsule {
        /// Metres.
        radius: f64,
        /// Without its round ends, metres.
        length: f64,
    },
    /// A rectangle.
    Plane {
        /// The direction that it faces.
        normal: Vector3<f64>,
        /// Metres.
        size: [f64; 2],
    },
    /// A polygon raised from z = 0.
    Polyline {
        /// Metres.
        outline: Vec<Point2<f64>>,
        /// Metres.
        height: f64,
    },
}

/// Reads a geometry. `None`, and a note on `name`, if its kind is not supported or its sizes make
/// no sense.
pub(super) fn read(geometry: Node<'_, '_>, name: &str, report: &mut ImportReport) -> Option<Shape> {
    let Some(element) = geometry.children().find(Node::is_element) else {
        report.note(Flaw::Shape, format!("empty geometry of {name}"));
        return None;
    };
    let kind = element.tag_name().name();
    if kind == "empty" {
        return None;
    }
    let shape = sized(element, kind, name, report);
    if shape.is_none() {
        report.note(Flaw::Shape, format!("{kind} of {name}"));
    }
    shape
}

fn sized(element: Node<'_, '_>, kind: &str, name: &str, report: &mut ImportReport) -> Option<Shape> {
    let length = |name: &str| values::<1>(child(element, name)?).map(|[value]| value).filter(|&value| is_size(value));
    match kind {
        "mesh" => {
            let uri = child(element, "uri").or_else(|| child(element, "filename"))?.text()?.trim().to_owned();
            let part = child(element, "submesh").and_then(|submesh| {
                let centred = child(submesh, "center").and_then(|node| node.text());
                let centred = centred.is_some_and(|text| matches!(text.trim(), "true" | "1"));
                Some((child(submesh, "name")?.text()?.trim().to_owned(), centred))
            });
            Some(Shape::Mesh { uri, scale: scale(element, name, report), part })
        }
        "box" => {
            let sizes = values::<3>(child(element, "size")?)?;
            sizes.iter().all(|&size| is_size(size)).then_some(Shape::Box(sizes))
        }
        "cylinder" => Some(Shape::Cylinder { radius: length("radius")?, length: length("length")? }),
        "sphere" => Some(Shape::Ellipsoid([length("radius")?; 3])),
        "ellipsoid" => {
            let radii = values::<3>(child(element, "radii")?)?;
            radii.iter().all(|&radius| is_size(radius)).then_some(Shape::Ellipsoid(radii))
        }
        "capsule" => Some(Shape::Capsule { radius: length("radius")?, length: length("length")? }),
        "plane" => {
            let normal = child(element, "normal").map_or(Some([0.0, 0.0, 1.0]), values::<3>)?;
            let size = child(element, "size").map_or(Some([1.0, 1.0]), values::<2>)?;
            let normal = Vector3::from(normal).try_normalize(1e-9)?;
            size.iter().all(|&size| is_size(size)).then_some(Shape::Plane { normal, size })
        }
        "polyline" => {
            let points = element.children().filter(|node| node.has_tag_name("point")).take(MOST_POINTS);
            let outline: Vec<Point2<f64>> =
                points.map(|point| values::<2>(point).map(Point2::from)).collect::<Option<_>>()?;
            let near = outline.iter().all(|point| point.coords.amax() <= LARGEST_M);
            (outline.len() >= 3 && near).then_some(Shape::Polyline { outline, height: length("height")? })
        }
        _ => None,
    }
}

fn scale(mesh: Node<'_, '_>, name: &str, report: &mut ImportReport) -> [f64; 3] {
    let Some(element) = child(mesh, "scale") else { return [1.0; 3] };
    let sound =
        |scale: &[f64; 3]| scale.iter().all(|value| (1.0 / LARGEST_SCALE..=LARGEST_SCALE).contains(&value.abs()));
    values::<3>(element).filter(sound).unwrap_or_else(|| {
        report.note(Flaw::Number, format!("scale of {name}: {}", element.text().unwrap_or_default().trim()));
        [1.0; 3]
    })
}

fn is_size(value: f64) -> bool {
    value > 0.0 && value <= LARGEST_M
}

/// The finite numbers of an element's text, if it has at least as many.
fn values<const N: usize>(node: Node<'_, '_>) -> Option<[f64; N]> {
    let mut words = node.text()?.split_ascii_whitespace();
    let mut values = [0.0; N];
    for value in &mut values {
        *value = words.next()?.parse::<f64>().ok().filter(|value| value.is_finite())?;
    }
    Some(values)
}
