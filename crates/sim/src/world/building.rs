//! Drawn buildings: floor plans made into walls, furniture and looks.
//!
//! ```text
//!  museum, office ──→ layout ──→ dress ──→ scene
//!  a map ─→ extrude ─↗   ↑
//!                    rearrange
//! ```
//!
//! | module | idea |
//! | --- | --- |
//! | `layout` | a building as plain data: outer walls, things on the floor, zones of one look |
//! | `polygon` | the polygons that it is made of |
//! | `museum`, `office` | the two built-in buildings |
//! | `extrude` | walls from the plan of a map |
//! | `style` | how a zone looks: wall finish, floor, what hangs on the walls |
//! | `zones` | which of them a point is in |
//! | `dress` | the layout as a scene with textures |
//! | `rearrange` | the building some time later |

pub(crate) mod dress;
pub(crate) mod extrude;
pub(crate) mod layout;
pub(crate) mod museum;
pub(crate) mod office;
pub(crate) mod polygon;
pub(crate) mod rearrange;
pub(crate) mod style;
pub(crate) mod zones;
