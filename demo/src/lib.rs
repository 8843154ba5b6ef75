//! The demo: a robot maps a building, a server keeps the map, and a second robot finds out where it
//! is and drives to a goal.
//!
//! All programs are in one executable, `handoff`, and run as processes of their own
//! (`handoff role NAME -- ARGS`). So one build makes everything that the demo and the tests start.
//!
//! ```text
//!  handoff ──┬── map-server      keeps the map
//!            ├── mapper …        one explorer, several, or one that succeeds a dead one
//!            ├── client-robot    relocalizes and drives
//!            └── a replica       fetches the map as any robot would, and draws it
//! ```
//!
//! | module | idea |
//! | --- | --- |
//! | `command_line` | what `handoff` takes: [`HandoffArgs`] |
//! | `handoff` | the demo: [`hand_off`], its configuration and its figures |
//! | `process` | programs as child processes that end with their parent: [`Process`] |
//! | `roles` | the `main` of each program: [`run_role`] |
//! | `true_floor` | the true floor of a simulated building, for pictures of maps: [`TrueFloor`] |
//!
//! ```
//! // Servers of demos and tests listen on free ports of this machine.
//! assert!(fht_demo::free_endpoint()?.starts_with("tcp/127.0.0.1:"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod command_line;
mod handoff;
mod process;
mod roles;
mod true_floor;

pub use command_line::{HandoffArgs, HandoffCommand};
pub use handoff::{
    ContactFigures, Crew, ExplorerFigures, HandoffConfig, HandoffError, HandoffReport, RosFigures, hand_off,
    shared_world,
};
pub use process::{Process, ProcessError, Role, free_endpoint, leave_nothing_behind, this_executable};
pub use roles::run_role;
pub use true_floor::TrueFloor;
