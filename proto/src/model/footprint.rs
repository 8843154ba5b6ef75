//! The ground that a robot covers, and the room that everything keeps around it.
//!
//! All clearances of the system follow from one [`Footprint`], here and nowhere else, so that
//! explorers, servers and client robots agree on what is free for whom. They are counted in whole
//! millimetres: for the default, the paper's robot of 0.105 m radius, they are
//!
//! | clearance | default |
//! | --- | --- |
//! | [`edge_clearance_mm`](Footprint::edge_clearance_mm) | 165 mm |
//! | [`mesh_clearance_mm`](Footprint::mesh_clearance_mm) | 160 mm |
//! | [`sure_clearance_mm`](Footprint::sure_clearance_mm) | 130 mm |
//! | [`grid_clearance_mm`](Footprint::grid_clearance_mm) | 150 mm |
//! | [`comfort_clearance_mm`](Footprint::comfort_clearance_mm) | 350 mm |
//! | [`squeeze_clearance_mm`](Footprint::squeeze_clearance_mm) | 120 mm |
//! | [`entry_clearances_mm`](Footprint::entry_clearances_mm) | 115 mm and 95 mm |
//! | [`edge_thing_mm`](Footprint::edge_thing_mm) | 110 mm |
//! | [`body_mm`](Footprint::body_mm) | 112 mm |
//! | [`stop_margin_mm`](Footprint::stop_margin_mm) | 30 mm |

use crate::model::validate::{Invalid, Validate, check};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// The outline of a robot's body on the ground, in its base frame (REP-103: x ahead, y to the
/// left).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum FootprintShape {
    /// A disc around the base's origin, its radius in metres.
    Radius(f64),
    /// A convex polygon around the base's origin, corners in metres, in either sense.
    Polygon(Vec<[f64; 2]>),
}

/// The ground that a robot covers, and a margin around it.
///
/// ```
/// use fht_proto::Footprint;
///
/// let burger = Footprint::default();
/// assert_eq!((burger.circumscribed_radius_m(), burger.mesh_clearance_mm()), (0.105, 160));
/// let cart: Footprint = "0.3,0.2_-0.3,0.2_-0.3,-0.2_0.3,-0.2".parse()?;
/// assert_eq!(cart.inscribed_radius_m(), 0.2);
/// assert!((cart.circumscribed_radius_m() - 0.3606).abs() < 1e-4);
/// // Paths for it are planned for a disc of whole centimetres.
/// assert_eq!(cart.planned_as().to_string(), "0.37");
/// # Ok::<(), fht_proto::Invalid>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Footprint {
    /// The body.
    pub shape: FootprintShape,
    /// By how much map, pose and driving together may be off, metres: kept free around the body on
    /// top of what maps are too coarse to say. Default 0.025.
    #[serde(default = "default_margin_m")]
    pub margin_m: f64,
}

/// Radius of the paper's robot (TurtleBot3 Burger), millimetres: what explorers promise to be free
/// is free for it.
const EXPLORER_MM: u16 = 105;
/// The default margin, millimetres: half a cell of the explorers' grids (0.05 m).
const MARGIN_MM: u16 = 25;
/// An occupied cell's nearest point is nearer than its centre by at most this, millimetres: half
/// the diagonal of a cell of 0.05 m, rounded.
const HALF_DIAGONAL_MM: u16 = 35;
/// A corner of a wall stands out of its occupied cells by at most this, millimetres.
const CORNER_MM: u16 = 30;
/// Footprints that paths are planned for differ by this much, millimetres.
const STEP_MM: u16 = 10;

fn default_margin_m() -> f64 {
    metres(MARGIN_MM)
}

/// The number of metres that one would write.
fn metres(mm: u16) -> f64 {
    f64::from(mm) / 1000.0
}

/// Whole millimetres, upwards; what rounding added does not count.
fn whole_mm(metres: f64) -> u16 {
    (metres * 1000.0 - 1e-6).ceil() as u16 // saturates
}

impl Default for Footprint {
    /// The paper's robot: a disc of 0.105 m radius. Explorers make maps for it.
    fn default() -> Self {
        Self::of_radius_mm(EXPLORER_MM)
    }
}

impl Footprint {
    /// Least and greatest radius of a disc, and distance of a polygon's farthest corner, metres.
    pub const RADIUS_M: (f64, f64) = (0.01, 2.0);
    /// Greatest margin, metres.
    pub const MAX_MARGIN_M: f64 = 0.5;
    /// Most corners of a polygon.
    pub const MAX_CORNERS: usize = 32;

    /// A disc with the default margin.
    ///
    /// # Errors
    /// When the radius is out of [`RADIUS_M`](Self::RADIUS_M).
    pub fn disc(radius_m: f64) -> Result<Self, Invalid> {
        let disc = Self { shape: FootprintShape::Radius(radius_m), margin_m: default_margin_m() };
        disc.validate().map(|()| disc)
    }

    /// A convex polygon with the default margin, corners in the base frame, metres.
    ///
    /// # Errors
    /// When it is not convex, not around the base's origin, too small or too large.
    pub fn polygon(corners: Vec<[f64; 2]>) -> Result<Self, Invalid> {
        let polygon = Self { shape: FootprintShape::Polygon(corners), margin_m: default_margin_m() };
        polygon.validate().map(|()| polygon)
    }

    fn of_radius_mm(radius_mm: u16) -> Self {
        Self { shape: FootprintShape::Radius(metres(radius_mm)), margin_m: default_margin_m() }
    }

    /// Radius of the largest disc around the base's origin that the body covers, metres.
    #[must_use]
    pub fn inscribed_radius_m(&self) -> f64 {
        match &self.shape {
            FootprintShape::Radius(radius_m) => *radius_m,
            FootprintShape::Polygon(corners) => {
                let from_side = |[a, b]: [[f64; 2]; 2]| {
                    (a[0] * b[1] - a[1] * b[0]).abs() / (b[0] - a[0]).hypot(b[1] - a[1]).max(f64::MIN_POSITIVE)
                };
                sides(corners).map(from_side).fold(f64::INFINITY, f64::min)
            }
        }
    }

    /// Radius of the smallest disc around the base's origin that covers the body, metres: the robot
    /// can turn wherever this disc fits.
    #[must_use]
    pub fn circumscribed_radius_m(&self) -> f64 {
        match &self.shape {
            FootprintShape::Radius(radius_m) => *radius_m,
            FootprintShape::Polygon(corners) => corners.iter().map(|[x, y]| x.hypot(*y)).fold(0.0, f64::max),
        }
    }

    /// Whether it needs more room than the explorers' own, which what a map says of nodes and edges
    /// is true for.
    #[must_use]
    pub fn is_larger_than_explorers(&self) -> bool {
        self.radius_mm() + self.margin_mm() > EXPLORER_MM + MARGIN_MM
    }

    /// The footprint that paths for this one are planned with. For one that is no larger than the
    /// explorers' it is theirs; otherwise a disc with the default margin, its radius rounded up to
    /// whole centimetres. Servers and robots make free space for these alone, so that there are at
    /// most some two hundred and fifty.
    #[must_use]
    pub fn planned_as(&self) -> Self {
        if !self.is_larger_than_explorers() {
            return Self::default();
        }
        let radius_mm = self.radius_mm() + self.margin_mm() - MARGIN_MM;
        Self::of_radius_mm(radius_mm.div_ceil(STEP_MM) * STEP_MM)
    }

    /// Radius of the body's disc, millimetres, upwards.
    #[must_use]
    pub fn radius_mm(&self) -> u16 {
        whole_mm(self.circumscribed_radius_m())
    }

    fn margin_mm(&self) -> u16 {
        whole_mm(self.margin_m)
    }

    /// Every cell of an explorer's grid whose centre is within this of an edge must be free,
    /// millimetres: the sure clearance, and half the diagonal of a cell of 0.05 m. Planners take
    /// the explorers' edges to be that wide.
    #[must_use]
    pub fn edge_clearance_mm(&self) -> u16 {
        self.sure_clearance_mm() + HALF_DIAGONAL_MM
    }

    /// The base keeps this far from the border of free space, millimetres: the sure clearance, and
    /// 30 by which a wall's corner may stand out of its occupied cells.
    #[must_use]
    pub fn mesh_clearance_mm(&self) -> u16 {
        self.sure_clearance_mm() + CORNER_MM
    }

    /// Radius and margin, millimetres: what is free on either side of an explorer's edge, and what
    /// a short straight way into free space keeps from walls that were seen.
    #[must_use]
    pub fn sure_clearance_mm(&self) -> u16 {
        self.radius_mm() + self.margin_mm()
    }

    /// On a grid of cells of 0.05 m the base keeps more than this from the centre of every occupied
    /// cell, millimetres: the radius and most of a cell.
    #[must_use]
    pub fn grid_clearance_mm(&self) -> u16 {
        self.sure_clearance_mm() + 20
    }

    /// Nearer to occupied cells than this, a metre of way costs more, millimetres.
    #[must_use]
    pub fn comfort_clearance_mm(&self) -> u16 {
        self.grid_clearance_mm() + 200
    }

    /// A robot that is boxed in leaves with this distance from the centres of occupied cells,
    /// millimetres.
    #[must_use]
    pub fn squeeze_clearance_mm(&self) -> u16 {
        self.radius_mm() + 15
    }

    /// Ways into free space over ground that no node covers keep the first of these from walls that
    /// were seen, millimetres. The second is the least that is allowed at all: for robots like the
    /// explorers, where there is no better way, what is left of the radius when a scan is off; for
    /// larger ones, whom nobody has seen there, the radius, and only where the robot stands.
    #[must_use]
    pub fn entry_clearances_mm(&self) -> [u16; 2] {
        if self.is_larger_than_explorers() {
            return [self.sure_clearance_mm(), self.radius_mm()];
        }
        [self.radius_mm() + 10, self.radius_mm().saturating_sub(10)]
    }

    /// What was seen nearer than this to an edge's line stands on the edge, millimetres.
    #[must_use]
    pub fn edge_thing_mm(&self) -> u16 {
        self.radius_mm() + 5
    }

    /// The ground under the robot reaches this far from its base on a grid of cells of 0.05 m,
    /// millimetres.
    #[must_use]
    pub fn body_mm(&self) -> u16 {
        self.radius_mm() + 7
    }

    /// A driving robot stops before anything comes this near to its body, millimetres: the margin,
    /// and the noise of a scanner.
    #[must_use]
    pub fn stop_margin_mm(&self) -> u16 {
        self.margin_mm() + 5
    }

    /// [`edge_clearance_mm`](Self::edge_clearance_mm), metres.
    #[must_use]
    pub fn edge_clearance_m(&self) -> f64 {
        metres(self.edge_clearance_mm())
    }

    /// [`mesh_clearance_mm`](Self::mesh_clearance_mm), metres.
    #[must_use]
    pub fn mesh_clearance_m(&self) -> f64 {
        metres(self.mesh_clearance_mm())
    }

    /// [`grid_clearance_mm`](Self::grid_clearance_mm), metres.
    #[must_use]
    pub fn grid_clearance_m(&self) -> f64 {
        metres(self.grid_clearance_mm())
    }

    /// [`comfort_clearance_mm`](Self::comfort_clearance_mm), metres.
    #[must_use]
    pub fn comfort_clearance_m(&self) -> f64 {
        metres(self.comfort_clearance_mm())
    }

    /// [`squeeze_clearance_mm`](Self::squeeze_clearance_mm), metres.
    #[must_use]
    pub fn squeeze_clearance_m(&self) -> f64 {
        metres(self.squeeze_clearance_mm())
    }

    /// [`stop_margin_mm`](Self::stop_margin_mm), metres.
    #[must_use]
    pub fn stop_margin_m(&self) -> f64 {
        metres(self.stop_margin_mm())
    }
}

fn sides(corners: &[[f64; 2]]) -> impl Iterator<Item = [[f64; 2]; 2]> + '_ {
    corners.iter().zip(corners.iter().cycle().skip(1)).map(|(a, b)| [*a, *b])
}

/// Whether all corners and the origin lie on one and the same side of each side: the polygon is
/// convex, winds once, and is around the origin.
fn is_convex_around_origin(corners: &[[f64; 2]]) -> bool {
    let cross = |[a, b]: [[f64; 2]; 2], at: [f64; 2]| (b[0] - a[0]) * (at[1] - a[1]) - (b[1] - a[1]) * (at[0] - a[0]);
    let lies_within = |sense: f64| {
        sides(corners)
            .all(|side| sense * cross(side, [0.0; 2]) > 0.0 && corners.iter().all(|at| sense * cross(side, *at) >= 0.0))
    };
    lies_within(1.0) || lies_within(-1.0)
}

impl Validate for Footprint {
    fn validate(&self) -> Result<(), Invalid> {
        let (least, most) = Self::RADIUS_M;
        if let FootprintShape::Polygon(corners) = &self.shape {
            check((3..=Self::MAX_CORNERS).contains(&corners.len()), || {
                format!("a footprint of {} corners (3 to {} are allowed)", corners.len(), Self::MAX_CORNERS)
            })?;
            check(corners.iter().flatten().all(|it| it.is_finite()), || {
                "a footprint's corner is not finite".to_owned()
            })?;
            check(is_convex_around_origin(corners), || {
                "a footprint's polygon must be convex and around the base's origin".to_owned()
            })?;
        }
        let radius_m = self.circumscribed_radius_m();
        check((least..=most).contains(&radius_m), || {
            format!("a footprint that reaches {radius_m} m from the base ({least} to {most} m are allowed)")
        })?;
        check((0.0..=Self::MAX_MARGIN_M).contains(&self.margin_m), || {
            format!("a footprint's margin of {} m (0 to {} m are allowed)", self.margin_m, Self::MAX_MARGIN_M)
        })
    }
}

impl fmt::Display for Footprint {
    /// The shape as in a query: `0.3`, or `0.3,0.2_-0.3,0.2_-0.3,-0.2_0.3,-0.2`. The margin is not
    /// in it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.shape {
            FootprintShape::Radius(radius_m) => write!(f, "{radius_m}"),
            FootprintShape::Polygon(corners) => corners.iter().enumerate().try_for_each(|(index, [x, y])| {
                let between = if index > 0 { "_" } else { "" };
                write!(f, "{between}{x},{y}")
            }),
        }
    }
}

impl FromStr for Footprint {
    type Err = Invalid;

    /// Reads a radius, or a polygon's corners, as they are displayed. The margin is the default.
    fn from_str(text: &str) -> Result<Self, Invalid> {
        let complaint = || Invalid::new("a footprint is a radius in metres, or corners x,y_x,y_x,y".to_owned());
        let number = |text: &str| text.trim().parse::<f64>().map_err(|_| complaint());
        if !text.contains(',') {
            return Self::disc(number(text)?);
        }
        let corner = |corner: &str| {
            let (x, y) = corner.split_once(',').ok_or_else(complaint)?;
            Ok([number(x)?, number(y)?])
        };
        Self::polygon(text.split('_').take(Self::MAX_CORNERS + 1).map(corner).collect::<Result<_, Invalid>>()?)
    }
}

#[cfg(test)]
mod tests;
