//! The explorer: turns what it senses into an FHT-Map and publishes it as increments.
//!
//! | module | idea |
//! | --- | --- |
//! | [`slam`] | where the robot is, and a map that stays true: submaps, loop closure; [`calibration`] of the wheels |
//! | [`beside`] | work in threads whose results are taken at fixed frames |
//! | [`frontier`], [`explore`] | where to drive next (paper, equation 1) |
//! | [`construct`] | main nodes, support nodes, edges, rectangles (paper, section III-B) |
//! | [`refine`] | shortcuts that the robot never drove |
//! | [`joining`] | finding the place in a map that others have begun |
//! | [`journal`] | operations become numbered increments |
//! | [`camera`] | descriptors, computed beside the loop |
//! | [`mapping`] | all of it, frame by frame |
//! | [`publish`] | increments to the server, kept until acknowledged |
//! | [`spool`], [`deliver`] | what is not acknowledged, on the robot's disk, and how the next run delivers it |
//! | [`window`] | which increment goes out next, and when again |
//! | [`verify`] | whether what the server has is what this run has made |
//! | [`linked`] | a run whose map goes to a server while it is made |
//! | [`fellows`] | the other explorers of the same map |
//! | [`record`] | the run as a bag |
//! | [`run`], [`report`] | exploring a simulated building |
//! | [`replay`] | mapping from a bag |
//! | [`cli`] | the program |

pub mod beside;
pub mod calibration;
pub mod camera;
pub mod cli;
pub mod construct;
pub mod deliver;
pub mod explore;
pub mod fellows;
pub mod frontier;
pub mod joining;
pub mod journal;
pub mod linked;
pub mod mapping;
pub mod publish;
pub mod record;
pub mod refine;
pub mod replay;
pub mod report;
pub mod run;
pub mod slam;
pub mod spool;
pub mod verify;
pub mod window;

pub use cli::main_with_args;
