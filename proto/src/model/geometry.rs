//! Positions, poses and rectangles as they travel: integer millimetres and 1e-4 rad, in the map
//! frame (REP-103: x forward, y left, yaw counter-clockwise).

use serde::{Deserialize, Serialize};

/// Millimetres in a metre.
const MM: f64 = 1000.0;
/// Yaw units in a radian.
const YAW_UNITS: f64 = 10_000.0;

fn to_mm(metres: f64) -> i32 {
    // `as` saturates and maps NaN to 0: a value out of range is caught by validation, never a
    // panic.
    (metres * MM).round() as i32
}

/// A position in the map frame, to the millimetre.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct FixedPoint {
    /// Millimetres along x.
    pub x_mm: i32,
    /// Millimetres along y.
    pub y_mm: i32,
}

impl FixedPoint {
    /// Farthest that anything may lie from the map's origin along each axis, metres.
    pub const MAX_M: f64 = 100_000.0;
    /// The same in millimetres.
    pub const MAX_MM: i32 = 100_000_000;

    /// From metres, rounded to the millimetre.
    #[must_use]
    pub fn from_metres(x: f64, y: f64) -> Self {
        Self { x_mm: to_mm(x), y_mm: to_mm(y) }
    }

    /// Metres along x.
    #[must_use]
    pub fn x(self) -> f64 {
        f64::from(self.x_mm) / MM
    }

    /// Metres along y.
    #[must_use]
    pub fn y(self) -> f64 {
        f64::from(self.y_mm) / MM
    }

    /// Euclidean distance in metres.
    #[must_use]
    pub fn distance(self, other: Self) -> f64 {
        (self.x() - other.x()).hypot(self.y() - other.y())
    }
}

/// A pose in the map frame: position to the millimetre, yaw to 1e-4 rad in (-π, π].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct FixedPose {
    /// Where.
    pub position: FixedPoint,
    /// Heading in units of 1e-4 rad.
    pub yaw_e4: i16,
}

impl FixedPose {
    /// Greatest yaw that is taken from others in JSON and in queries, either way, radians: a turn,
    /// to the next 1e-4.
    pub const MAX_YAW_RAD: f64 = 62_832.0 / YAW_UNITS;

    /// From metres and radians; the angle is wrapped.
    #[must_use]
    pub fn from_metres(x: f64, y: f64, yaw: f64) -> Self {
        let wrapped = yaw.sin().atan2(yaw.cos());
        // ±π rounds to ±31416, within i16.
        Self { position: FixedPoint::from_metres(x, y), yaw_e4: (wrapped * YAW_UNITS).round() as i16 }
    }

    /// Heading in radians.
    #[must_use]
    pub fn yaw(self) -> f64 {
        f64::from(self.yaw_e4) / YAW_UNITS
    }
}

/// An axis-aligned rectangle of free space in the map frame (the paper's local free space `s_i`),
/// given by how far it reaches from its node. Relative reaches keep the rectangle with its node
/// when a correction moves the node.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Rect {
    /// Millimetres from the node towards -x.
    pub west_mm: u16,
    /// Millimetres from the node towards -y.
    pub south_mm: u16,
    /// Millimetres from the node towards +x.
    pub east_mm: u16,
    /// Millimetres from the node towards +y.
    pub north_mm: u16,
}

impl Rect {
    /// The rectangle `[min_x, max_x] × [min_y, max_y]` (metres) around `node`. Reaches are rounded
    /// down, so that the stored rectangle never exceeds the given one; a corner on the wrong side
    /// of the node gives a reach of 0.
    #[must_use]
    pub fn around(node: FixedPoint, min: (f64, f64), max: (f64, f64)) -> Self {
        let reach = |metres: f64| (metres * MM + 1e-6).floor().clamp(0.0, f64::from(u16::MAX)) as u16;
        Self {
            west_mm: reach(node.x() - min.0),
            south_mm: reach(node.y() - min.1),
            east_mm: reach(max.0 - node.x()),
            north_mm: reach(max.1 - node.y()),
        }
    }

    /// How far it reaches from its node, metres: `[west, south, east, north]`.
    #[must_use]
    pub fn reach_m(&self) -> [f64; 4] {
        [self.west_mm, self.south_mm, self.east_mm, self.north_mm].map(|mm| f64::from(mm) / MM)
    }

    /// Corner of least x and y when the rectangle sits at `node`, metres.
    #[must_use]
    pub fn min(&self, node: FixedPoint) -> (f64, f64) {
        (node.x() - f64::from(self.west_mm) / MM, node.y() - f64::from(self.south_mm) / MM)
    }

    /// Corner of greatest x and y when the rectangle sits at `node`, metres.
    #[must_use]
    pub fn max(&self, node: FixedPoint) -> (f64, f64) {
        (node.x() + f64::from(self.east_mm) / MM, node.y() + f64::from(self.north_mm) / MM)
    }

    /// Whether the rectangle at `node` contains `point` (borders included).
    #[must_use]
    pub fn contains(&self, node: FixedPoint, point: FixedPoint) -> bool {
        // In whole millimetres: in metres a point on the border can be rounded out.
        let (east, north) =
            (i64::from(point.x_mm) - i64::from(node.x_mm), i64::from(point.y_mm) - i64::from(node.y_mm));
        (-i64::from(self.west_mm)..=i64::from(self.east_mm)).contains(&east)
            && (-i64::from(self.south_mm)..=i64::from(self.north_mm)).contains(&north)
    }

    /// Area in square metres.
    #[must_use]
    pub fn area_m2(&self) -> f64 {
        let width = f64::from(self.west_mm) + f64::from(self.east_mm);
        let height = f64::from(self.south_mm) + f64::from(self.north_mm);
        width * height / (MM * MM)
    }
}
