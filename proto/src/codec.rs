//! Bytes: the envelope around every binary message, and a map in one file.

pub mod archive;
pub mod envelope;
mod wire_id;
