//! Drawings: what hangs on walls, covers floors and stands around. Everything is drawn in metres.

pub(crate) mod art;
pub(crate) mod canvas;
pub(crate) mod fittings;
pub(crate) mod furniture;
pub(crate) mod photographs;
pub(crate) mod surfaces;

use crate::scene::texture::Texture;

/// A picture that hangs on a wall.
#[derive(Clone, Debug)]
pub(crate) struct Panel {
    /// What is on it.
    pub(crate) texture: Texture,
    /// Width, metres.
    pub(crate) width_m: f64,
    /// Height, metres.
    pub(crate) height_m: f64,
    /// Lower edge above the floor, metres.
    pub(crate) bottom_m: f64,
}
