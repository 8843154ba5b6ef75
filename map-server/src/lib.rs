//! map-server
