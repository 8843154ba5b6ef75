//! When the loop takes a result.

use serde::{Deserialize, Serialize};

/// What happens when a result is due and the thread is not ready.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Pace {
    /// The loop waits: a run repeats exactly. For simulations and replays, which run faster than
    /// the robot did.
    #[default]
    Repeatable,
    /// The loop goes on and looks again at the next frame: nothing ever blocks a robot that drives.
    RealTime,
}

/// When a result is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Taking {
    /// As soon as it is there: the loop never waits. For robots in real time.
    WhenThere,
    /// This many frames after the question, whatever the thread's speed, so that a simulated run
    /// repeats exactly. Frames stand still while the loop waits for a late answer.
    AfterFrames(u32),
}
