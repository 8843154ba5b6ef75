//! client-robot
