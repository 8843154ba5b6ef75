//! COLLADA 1.4 and 1.5 (`.dae`): the meshes of a scene at rest.
//!
//! Lengths are scaled by `<unit meter>`. `<up_axis>` is ignored, as in Gazebo: models made for it
//! turn themselves upright.

mod element;
mod geometry;
mod looks;

use super::{MOST_TRIANGLES, MeshError, Paint, Part, TriangleMesh};
use element::{Element, Ids, child, children, numbers};
use nalgebra::{Matrix4, Rotation3, Unit, Vector3};
use roxmltree::{Document, Node, ParsingOptions};
use std::collections::HashMap;

/// Deepest nesting of nodes in a scene.
const MOST_DEPTH: usize = 64;
/// Most nodes of a scene; those of instances count each time.
const MOST_NODES: usize = 200_000;

/// Reads a file's content.
pub(crate) fn read(text: &str) -> Result<TriangleMesh, MeshError> {
    let options = ParsingOptions { allow_dtd: true, ..ParsingOptions::default() };
    let document = Document::parse_with_options(text, options)?;
    let root = document.root_element();
    if root.tag_name().name() != "COLLADA" {
        return Err(MeshError::Malformed("the root is no COLLADA element".to_owned()));
    }
    let unit = child(root, "asset").and_then(|asset| child(asset, "unit"));
    let metres = unit.and_then(|unit| unit.attribute("meter")).and_then(|metres| metres.trim().parse::<f64>().ok());
    let metres = metres.filter(|metres| metres.is_finite() && *metres > 0.0).unwrap_or(1.0);
    let mut scene = Scene::new(root);
    let base = Matrix4::new_scaling(metres);
    let instance = child(root, "scene").and_then(|node| child(node, "instance_visual_scene"));
    let visual_scene = instance
        .and_then(|instance| scene.target(instance, "url", "visual_scene"))
        .or_else(|| root.descendants().find(|node| node.tag_name().name() == "visual_scene"));
    match visual_scene {
        Some(visual_scene) => {
            for node in children(visual_scene, "node") {
                scene.node(node, &base, 0)?;
            }
        }
        // Geometry alone stands at the origin.
        None => {
            for geometry in root.descendants().filter(|node| node.tag_name().name() == "geometry") {
                scene.geometry(geometry, None, &base, &[])?;
            }
        }
    }
    Ok(scene.mesh)
}

/// A scene being put together.
struct Scene<'d> {
    root: Element<'d>,
    ids: Ids<'d>,
    sources: HashMap<&'d str, geometry::Source>,
    paints: HashMap<String, Option<Paint>>,
    nodes: usize,
    triangles: usize,
    mesh: TriangleMesh,
}

impl<'d> Scene<'d> {
    fn new(root: Element<'d>) -> Self {
        let id = |node: Element<'d>| Some(((node.tag_name().name(), node.attribute("id")?), node));
        let ids = root.descendants().filter_map(id).collect();
        Self {
            root,
            ids,
            sources: HashMap::new(),
            paints: HashMap::new(),
            nodes: 0,
            triangles: 0,
            mesh: TriangleMesh::default(),
        }
    }

    /// The element with this tag that an attribute such as `url="#id"` points at.
    fn target(&self, node: Element<'d>, attribute: &str, tag: &'static str) -> Option<Element<'d>> {
        self.ids.get(&(tag, node.attribute(attribute)?.trim_start_matches('#'))).copied()
    }

    fn node(&mut self, node: Element<'d>, parent: &Matrix4<f64>, depth: usize) -> Result<(), MeshError> {
        self.nodes += 1;
        if depth > MOST_DEPTH || self.nodes > MOST_NODES {
            return Err(MeshError::Malformed("the scene's nodes are too deep, too many or in a circle".to_owned()));
        }
        let placed = parent * own_transform(node);
        for element in node.children().filter(Node::is_element) {
            match element.tag_name().name() {
                "node" => self.node(element, &placed, depth + 1)?,
                "instance_node" => {
                    if let Some(target) = self.target(element, "url", "node") {
                        self.node(target, &placed, depth + 1)?;
                    }
                }
                "instance_geometry" => {
                    if let Some(geometry) = self.target(element, "url", "geometry") {
                        self.geometry(geometry, Some(node), &placed, &bindings(element))?;
                    }
                }
                "instance_controller" => {
                    // A skinned mesh in its rest pose.
                    let skin =
                        self.target(element, "url", "controller").and_then(|controller| child(controller, "skin"));
                    if let Some(geometry) = skin.and_then(|skin| self.target(skin, "source", "geometry")) {
                        self.geometry(geometry, Some(node), &placed, &bindings(element))?;
                    }
                }
                _ => {}
            }
        }
        Ok(())
    }

    fn geometry(
        &mut self,
        geometry: Element<'d>,
        node: Option<Element<'d>>,
        placed: &Matrix4<f64>,
        bindings: &[(&'d str, &'d str)],
    ) -> Result<(), MeshError> {
        let Some(mesh) = child(geometry, "mesh") else { return Ok(()) };
        let names: Vec<String> = [Some(geometry), node]
            .into_iter()
            .flatten()
            .flat_map(|element| [element.attribute("id"), element.attribute("name")])
            .flatten()
            .map(str::to_owned)
            .collect();
        for primitive in mesh.children().filter(Node::is_element) {
            let (mut triangles, malformed) = geometry::triangles(primitive, &self.ids, &mut self.sources);
            self.mesh.malformed += malformed;
            self.triangles += triangles.len();
            if self.triangles > MOST_TRIANGLES {
                return Err(MeshError::Triangles);
            }
            if triangles.is_empty() {
                continue;
            }
            for corner in triangles.iter_mut().flatten() {
                let [x, y, z] = corner.position;
                corner.position = placed.transform_point(&nalgebra::Point3::new(x, y, z)).coords.into();
            }
            let paint = primitive.attribute("material").and_then(|symbol| {
                let bound = bindings.iter().find(|(bound, _)| *bound == symbol).map_or(symbol, |(_, target)| target);
                self.paint(bound)
            });
            self.mesh.parts.push(Part { names: names.clone(), paint, triangles });
        }
        Ok(())
    }

    fn paint(&mut self, material: &str) -> Option<Paint> {
        if let Some(paint) = self.paints.get(material) {
            return paint.clone();
        }
        let element = self.ids.get(&("material", material)).copied();
        let paint = element.and_then(|element| looks::paint(element, self.root, &self.ids));
        self.paints.insert(material.to_owned(), paint.clone());
        paint
    }
}

/// The materials that an instance binds to a geometry's symbols.
fn bindings<'d>(instance: Element<'d>) -> Vec<(&'d str, &'d str)> {
    instance
        .descendants()
        .filter(|node| node.tag_name().name() == "instance_material")
        .filter_map(|node| Some((node.attribute("symbol")?, node.attribute("target")?.trim_start_matches('#'))))
        .collect()
}

/// A node's transforms, the first outermost. Malformed ones are ignored, and so are `<skew>` and
/// `<lookat>`.
fn own_transform(node: Element<'_>) -> Matrix4<f64> {
    let mut transform = Matrix4::identity();
    for element in node.children().filter(Node::is_element) {
        let name = element.tag_name().name();
        if !matches!(name, "matrix" | "translate" | "rotate" | "scale") {
            continue;
        }
        let numbers = numbers(element);
        let step = match (name, numbers.as_slice()) {
            ("matrix", rows) if rows.len() == 16 => Matrix4::from_row_slice(rows),
            ("translate", &[x, y, z]) => Matrix4::new_translation(&Vector3::new(x, y, z)),
            ("scale", &[x, y, z]) => Matrix4::new_nonuniform_scaling(&Vector3::new(x, y, z)),
            ("rotate", &[x, y, z, degrees]) => Unit::try_new(Vector3::new(x, y, z), 1e-12)
                .map_or_else(Matrix4::identity, |axis| {
                    Rotation3::from_axis_angle(&axis, degrees.to_radians()).to_homogeneous()
                }),
            _ => Matrix4::identity(),
        };
        transform *= step;
    }
    transform
}

#[cfg(test)]
mod tests {
    use super::read;

    /// Two triangles, and a malformed one, in a node with a transform. Elements of different sorts
    /// have the same id.
    fn scene(transform: &str, up: &str) -> String {
        format!(
            r##"<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
            <asset><unit meter="0.01"/><up_axis>{up}</up_axis></asset>
            <library_images><image id="wood image"><init_from>wood.png</init_from></image></library_images>
            <library_effects><effect id="fx"><profile_COMMON>
              <newparam sid="s"><surface type="2D"><init_from>wood image</init_from></surface></newparam>
              <newparam sid="p"><sampler2D><source>s</source></sampler2D></newparam>
              <technique sid="t"><phong><diffuse><texture texture="p" texcoord="UV"/></diffuse></phong></technique>
            </profile_COMMON></effect></library_effects>
            <library_materials><material id="m"><instance_effect url="#fx"/></material></library_materials>
            <library_geometries><geometry id="n"><mesh>
              <source id="pos"><float_array id="pa" count="12">0 0 0 100 0 0 100 100 0 0 100 0</float_array>
                <technique_common><accessor source="#pa" count="4" stride="3"/></technique_common></source>
              <source id="uv"><float_array id="ua" count="8">0 0 1 0 1 1 0 1</float_array>
                <technique_common><accessor source="#ua" count="4" stride="2"/></technique_common></source>
              <vertices id="v"><input semantic="POSITION" source="#pos"/></vertices>
              <polylist count="2" material="sym"><input semantic="VERTEX" offset="0" source="#v"/>
                <input semantic="TEXCOORD" offset="1" source="#uv" set="0"/>
                <vcount>4 3</vcount><p>0 0 1 1 2 2 3 3  0 0 1 1 9 1</p></polylist>
            </mesh></geometry></library_geometries>
            <library_visual_scenes><visual_scene id="n"><node id="n">{transform}<instance_geometry url="#n">
              <bind_material><technique_common><instance_material symbol="sym" target="#m"/></technique_common>
              </bind_material></instance_geometry></node></visual_scene></library_visual_scenes>
            <scene><instance_visual_scene url="#n"/></scene></COLLADA>"##
        )
    }

    #[test]
    fn units_transforms_and_looks_are_applied() {
        let transform = "<translate>0 0 200</translate><rotate>0 0 1 90</rotate><scale>2 1 1</scale>";
        let mesh = read(&scene(transform, "Z_UP")).unwrap();
        assert_eq!((mesh.parts.len(), mesh.malformed), (1, 1));
        let part = &mesh.parts[0];
        assert_eq!(part.triangles.len(), 2);
        assert_eq!(part.paint.as_ref().unwrap().picture.as_deref(), Some("wood.png"));
        let corner = part.triangles[0][1];
        for (value, expected) in corner.position.iter().zip([0.0, 2.0, 2.0]) {
            assert!((value - expected).abs() < 1e-9, "{:?}", corner.position);
        }
        assert_eq!(corner.uv, [1.0, 0.0]);
    }

    #[test]
    fn the_up_axis_is_left_alone_as_gazebo_does() {
        let corners = |up: &str| read(&scene("", up)).unwrap().parts.remove(0).triangles;
        assert_eq!(corners("Y_UP"), corners("Z_UP"));
    }

    #[test]
    fn nodes_in_a_circle_are_told() {
        let text = scene(r##"<instance_node url="#n"/>"##, "Z_UP");
        assert!(read(&text).is_err());
        assert!(read("<a/>").is_err());
        assert!(read("<COLLADA>").is_err());
    }
}
