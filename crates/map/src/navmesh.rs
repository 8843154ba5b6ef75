//! Free space as a mesh of triangles, and the shortest way through it at any angle.
//!
//! | module | idea |
//! | --- | --- |
//! | `free_space` | where a robot's centre may be: rectangles and corridors without obstacles |
//! | `limits` | how much work a mesh may be |
//! | `mesh` | triangles: neighbours, places, and which of them a way can lead through |
//! | `cell_grid` | things by place |
//! | `plane` | points and lines |
//! | `polyanya` | the shortest way through a mesh |
//! | `entry` | the way into the mesh over ground that no rectangle covers |
//! | `entry_config` | how places outside of the mesh are joined to it |
//! | `outside` | ground outside of the mesh: walls, what nobody saw, where the mesh is nearest |

mod cell_grid;
pub(crate) mod entry;
pub(crate) mod entry_config;
pub(crate) mod free_space;
pub(crate) mod limits;
pub(crate) mod mesh;
pub(crate) mod outside;
pub(crate) mod plane;
pub(crate) mod polyanya;
