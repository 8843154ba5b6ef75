//! Arrows, lines, texts in the plane. Metres and radians, in the map's frame.

use foxglove::messages::{
    ArrowPrimitive, Color, CylinderPrimitive, LinePrimitive, Point3, Pose, Quaternion, SceneEntity, TextPrimitive,
    Timestamp, Vector3, line_primitive,
};

/// The frame in which all is told, as REP-105 calls it.
pub(crate) const MAP_FRAME: &str = "map";

/// Opaque red, green, blue.
pub(crate) const fn paint(r: f64, g: f64, b: f64) -> Color {
    Color { r, g, b, a: 1.0 }
}

pub(crate) const RED: Color = paint(0.86, 0.15, 0.15);
pub(crate) const YELLOW: Color = paint(0.95, 0.75, 0.1);
pub(crate) const ORANGE: Color = paint(0.95, 0.5, 0.1);
pub(crate) const GREY: Color = paint(0.55, 0.55, 0.58);
pub(crate) const BLUE: Color = paint(0.15, 0.45, 0.9);
pub(crate) const FREE: Color = Color { r: 0.35, g: 0.75, b: 0.4, a: 0.25 };

/// The same colour, as far to be seen through.
pub(crate) fn faint(colour: Color, a: f64) -> Color {
    Color { a, ..colour }
}

/// Heading `yaw` at a place, `z` above the floor.
pub(crate) fn plane_pose([x, y, yaw]: [f64; 3], z: f64) -> Pose {
    let (sin, cos) = (0.5 * yaw).sin_cos();
    Pose { position: Some(Vector3 { x, y, z }), orientation: Some(Quaternion { x: 0.0, y: 0.0, z: sin, w: cos }) }
}

/// An entity without anything in it yet, that stays until it is replaced or deleted.
pub(crate) fn empty(id: String, at: Timestamp) -> SceneEntity {
    SceneEntity { timestamp: Some(at), frame_id: MAP_FRAME.to_owned(), id, frame_locked: true, ..Default::default() }
}

/// A line through points at one height; a loop ends where it begins.
pub(crate) fn line(points: impl Iterator<Item = (f64, f64)>, z: f64, is_loop: bool, colour: Color) -> LinePrimitive {
    let kind = if is_loop { line_primitive::Type::LineLoop } else { line_primitive::Type::LineStrip };
    LinePrimitive {
        r#type: kind.into(),
        pose: Some(plane_pose([0.0; 3], 0.0)),
        thickness: 0.03,
        points: points.map(|(x, y)| Point3 { x, y, z }).collect(),
        color: Some(colour),
        ..Default::default()
    }
}

/// A text that faces whoever looks.
pub(crate) fn text(text: String, x: f64, y: f64, colour: Color) -> TextPrimitive {
    TextPrimitive {
        pose: Some(plane_pose([x, y, 0.0], 0.4)),
        billboard: true,
        font_size: 14.0,
        scale_invariant: true,
        color: Some(colour),
        text,
    }
}

/// An arrow of a length.
pub(crate) fn arrow(at: [f64; 3], length: f64, colour: Color) -> ArrowPrimitive {
    ArrowPrimitive {
        pose: Some(plane_pose(at, 0.1)),
        shaft_length: 0.6 * length,
        shaft_diameter: 0.15 * length,
        head_length: 0.4 * length,
        head_diameter: 0.35 * length,
        color: Some(colour),
    }
}

/// A disc on the floor.
pub(crate) fn disc(x: f64, y: f64, diameter: f64, height: f64, colour: Color) -> CylinderPrimitive {
    CylinderPrimitive {
        pose: Some(plane_pose([x, y, 0.0], 0.5 * height)),
        size: Some(Vector3 { x: diameter, y: diameter, z: height }),
        bottom_scale: 1.0,
        top_scale: 1.0,
        color: Some(colour),
    }
}
