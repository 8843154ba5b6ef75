//! How far it is at least between two nodes: the landmarks of A* with landmarks (ALT; Goldberg and
//! Harrelson, "Computing the shortest path: A* search meets graph theory", SODA 2005).
//!
//! A *slot* gives every node a number `D`, and all that is asked of it is that `|D(u) - D(v)| <=
//! length(u, v)` for every edge. Then `|D(u) - D(t)|` is no more than the distance of u and t, and
//! A* with it finds shortest paths. Distances from a place are such numbers, and distances from a
//! set of places are, too. From this follows:
//!
//! * Removing or lengthening an edge keeps all slots right; so does closing it for one query or
//!   letting it count more than its length. The bounds become loose, which costs time and nothing
//!   else.
//! * Adding or shortening an edge may break slots. They are mended by lowering numbers from the
//!   ends of the edge outwards (Dijkstra's algorithm over what changes). If that would be more than
//!   [`LandmarksConfig::repair_nodes`] numbers, the edge is kept aside as a *shortcut*, and
//!   searches count with it themselves (`bounds`), until the next build; if too many wait, the
//!   slots that are wrong about it are not used until then.
//! * One slot serves all parts of a map that nothing joins: it measures from one place in each
//!   part. A node that was reached from nowhere has the greatest number there is, which breaks
//!   nothing as long as nothing joins it; when something does, it is lowered.
//! * Numbers may be rounded and cut off: they are whole multiples of 2^n µm, from lengths rounded
//!   down to them, in 32 bits. Sixteen slots of a node are one cache line.
//!
//! The first eight places of a part are its outermost nodes, in the directions of corners and
//! sides: from its four corners, a grid's bounds are its distances. The others are as far as
//! possible from all chosen before. Of equal ones it is the lowest number.

mod bounds;
mod landmarks;

pub(crate) use bounds::Bounds;
pub(crate) use landmarks::AltLandmarks;
pub use landmarks::LandmarksConfig;
