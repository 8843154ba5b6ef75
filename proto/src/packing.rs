//! Scans and descriptors as short streams of bits.

pub(crate) mod packed;
mod rice;
