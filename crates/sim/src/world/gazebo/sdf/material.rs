//! Materials of SDF visuals as paint.

use super::element::child;
use crate::world::gazebo::mesh::Paint;
use crate::world::gazebo::report::{Flaw, ImportReport};
use roxmltree::Node;

/// Colour of things without a material, 0 to 1.
pub(crate) const GREY: [f32; 3] = [0.7; 3];

/// The named materials that come with Gazebo, as plain colours. Those with pictures get a colour
/// like the picture's.
const NAMED: [(&str, [f32; 3]); 40] = [
    ("Grey", [0.7, 0.7, 0.7]),
    ("Gray", [0.7, 0.7, 0.7]),
    ("DarkGrey", [0.175, 0.175, 0.175]),
    ("DarkGray", [0.175, 0.175, 0.175]),
    ("White", [1.0, 1.0, 1.0]),
    ("FlatBlack", [0.1, 0.1, 0.1]),
    ("Black", [0.0, 0.0, 0.0]),
    ("Red", [1.0, 0.0, 0.0]),
    ("RedBright", [0.87, 0.26, 0.07]),
    ("Green", [0.0, 1.0, 0.0]),
    ("Blue", [0.0, 0.0, 1.0]),
    ("SkyBlue", [0.13, 0.44, 0.70]),
    ("Yellow", [1.0, 1.0, 0.0]),
    ("ZincYellow", [0.97, 0.95, 0.21]),
    ("DarkYellow", [0.7, 0.7, 0.0]),
    ("Purple", [1.0, 0.0, 1.0]),
    ("Turquoise", [0.0, 1.0, 1.0]),
    ("Orange", [1.0, 0.51, 0.06]),
    ("DarkOrange", [0.66, 0.37, 0.03]),
    ("Indigo", [0.33, 0.0, 0.5]),
    ("Gold", [0.8, 0.65, 0.1]),
    ("Wood", [0.55, 0.38, 0.22]),
    ("WoodFloor", [0.60, 0.42, 0.26]),
    ("WoodPallet", [0.62, 0.48, 0.32]),
    ("WoodTile", [0.62, 0.45, 0.30]),
    ("CeilingTiled", [0.85, 0.85, 0.83]),
    ("PaintedWall", [0.82, 0.80, 0.75]),
    ("Bricks", [0.60, 0.35, 0.28]),
    ("CloudySky", [0.65, 0.75, 0.85]),
    ("Grass", [0.30, 0.45, 0.20]),
    ("GrassFloor", [0.30, 0.45, 0.20]),
    ("Road", [0.30, 0.30, 0.30]),
    ("Residential", [0.35, 0.35, 0.35]),
    ("Pedestrian", [0.60, 0.60, 0.58]),
    ("Footway", [0.60, 0.60, 0.58]),
    ("Asphalt", [0.28, 0.28, 0.28]),
    ("Rockwall", [0.50, 0.47, 0.42]),
    ("Rusty", [0.50, 0.30, 0.18]),
    ("Chrome", [0.75, 0.75, 0.78]),
    ("CorrugatedIron", [0.60, 0.60, 0.60]),
];

/// The paint of a visual's `<material>`: the first it has of the picture of its metal workflow, its
/// diffuse or ambient colour, and the colour of a named material. `None` if it has none of these.
pub(crate) fn paint(visual: Node<'_, '_>, report: &mut ImportReport) -> Option<Paint> {
    let material = child(visual, "material")?;
    let colour = ["diffuse", "ambient"].iter().find_map(|name| self::colour(child(material, name)?));
    let picture = material
        .descendants()
        .find(|node| node.has_tag_name("albedo_map"))
        .and_then(|node| node.text())
        .map(str::trim)
        .filter(|text| !text.is_empty());
    if colour.is_some() || picture.is_some() {
        return Some(Paint { colour: colour.unwrap_or(GREY), picture: picture.map(str::to_owned) });
    }
    let name = child(child(material, "script")?, "name")?.text()?.trim();
    // `Gazebo/GreyTransparent`, `Gazebo/WhiteGlow` and the like have the colour that they start
    // with.
    let plain = name.trim_start_matches("Gazebo/");
    let suffixes = ["", "Transparent", "TransparentOverlay", "Glow", "GlowOutline"];
    let known = NAMED
        .iter()
        .find(|(known, _)| suffixes.iter().any(|suffix| plain.strip_suffix(suffix).is_some_and(|stem| stem == *known)));
    if known.is_none() {
        report.note(Flaw::Material, name);
    }
    Some(Paint { colour: known.map_or(GREY, |(_, colour)| *colour), picture: None })
}

/// Red, green and blue of an element's text, 0 to 1; `None` if it does not have three numbers.
pub(crate) fn colour(node: Node<'_, '_>) -> Option<[f32; 3]> {
    let mut words = node.text()?.split_ascii_whitespace();
    let mut number = || words.next()?.parse::<f32>().ok().filter(|value| value.is_finite());
    Some([number()?, number()?, number()?].map(|value| value.clamp(0.0, 1.0)))
}
