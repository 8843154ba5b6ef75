//! Trials of systems: which are run, and what came of them.

pub mod figures;

use crate::numbers::metres;
use crate::systems::{Column, System};
use clap::Args;
use fht_eval::TrialOutcome;
use serde::{Deserialize, Serialize};

/// Which trials.
#[derive(Debug, Args)]
pub struct TrialArgs {
    /// Starts in each world, drawn uniformly from where the robot has room, with any heading; the
    /// authors' own come on top.
    #[arg(long, default_value_t = 100, value_parser = fht_program::flags::count)]
    pub starts: u64,
    /// Systems, separated by commas.
    #[arg(
        long,
        value_enum,
        value_delimiter = ',',
        default_value = "ours,ours-lidar,main-only,mr-topomap,amcl,amcl-nav2"
    )]
    pub systems: Vec<System>,
    /// Buildings as mapped, or with a tenth of what is movable gone, shifted or new;
    /// separated by commas.
    #[arg(long, value_enum, value_delimiter = ',', default_value = "as-mapped,furniture-moved")]
    pub columns: Vec<Column>,
    /// Distance after which a drive ends, metres.
    #[arg(long, default_value_t = 40.0, value_parser = metres)]
    pub drive_m: f64,
    /// Nothing is driven: only what is kept is shown, and of that only systems and columns of which
    /// all starts are.
    #[arg(long)]
    pub only_kept: bool,
}

/// The key of a result.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct TrialKey {
    pub world: String,
    /// The identity of the map.
    pub map: String,
    pub system: System,
    pub parameters: String,
    pub column: Column,
    pub start: Start,
    pub drive_dm: u64,
}

/// Where a robot is dropped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Start {
    /// Drawn by this seed.
    Drawn(u64),
    /// One of the authors'.
    Authors(u64),
}

/// All results of one system in one world.
pub struct Trials {
    pub world: String,
    pub system: System,
    pub column: Column,
    pub outcomes: Vec<(Start, TrialOutcome)>,
}
