//! The compared systems by name.

pub mod storage;

use crate::maps::Variant;
use clap::ValueEnum;
use fht_eval::systems::amcl::AmclConfig;
use fht_eval::systems::topo_map::TopoMapConfig;
use fht_localization::localizer::LocalizerConfig;
use serde::{Deserialize, Serialize};

/// A map with its way of relocalizing and planning.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum System {
    /// The FHT-Map.
    Ours,
    /// The FHT-Map, by the scanner alone.
    OursLidar,
    /// The paper's ablation: main nodes only.
    MainOnly,
    /// MR-TopoMap.
    MrTopomap,
    /// The grid map with AMCL and the paper's parameters; A* on the grid.
    Amcl,
    /// The same with the defaults of Nav2 and recovery.
    AmclNav2,
}

impl System {
    /// For tables.
    pub fn title(self) -> &'static str {
        match self {
            Self::Ours => "FHT-Map",
            Self::OursLidar => "FHT-Map, LiDAR only",
            Self::MainOnly => "Main Only",
            Self::MrTopomap => "MR-TopoMap",
            Self::Amcl => "Grid, AMCL (paper)",
            Self::AmclNav2 => "Grid, AMCL (Nav2)",
        }
    }

    /// Which explored map it works on.
    pub fn variant(self) -> Variant {
        if self == Self::MainOnly { Variant::MainOnly } else { Variant::Ours }
    }

    /// A hash of its parameters: results of other parameters are not reused.
    pub fn parameters(self) -> String {
        let described = match self {
            Self::Ours | Self::OursLidar | Self::MainOnly => format!("{:?}", LocalizerConfig::default()),
            Self::MrTopomap => format!("{:?}", TopoMapConfig::default()),
            Self::Amcl => format!("{:?}", AmclConfig::paper()),
            Self::AmclNav2 => format!("{:?}", AmclConfig::nav2()),
        };
        blake3::hash(described.as_bytes()).to_hex().chars().take(12).collect()
    }

    /// The system that plans its paths: other parameters of relocalization change no path.
    pub fn planner(self) -> Self {
        match self {
            Self::OursLidar => Self::Ours,
            Self::AmclNav2 => Self::Amcl,
            other => other,
        }
    }
}

/// Whether the building is still as it was mapped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Column {
    /// It is.
    AsMapped,
    /// A tenth of the movable things is gone, shifted or new.
    FurnitureMoved,
}

impl Column {
    /// For tables.
    pub fn title(self) -> &'static str {
        match self {
            Self::AsMapped => "as mapped",
            Self::FurnitureMoved => "furniture moved",
        }
    }
}
