//! The mapper's knobs that can be turned one at a time.

use clap::ValueEnum;
use mapper::MapperConfig;
use mapper::construct::CoverageConfig;
use mapper::explore::FrontierConfig;
use serde::Serialize;

/// One knob, turned.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Knob {
    /// σ_c 4 m: main nodes farther apart.
    FewMainNodes,
    /// σ_c 1.8 m: main nodes closer together.
    ManyMainNodes,
    /// No main nodes for walls that no other knows: σ_c alone, as in the paper.
    NoNews,
    /// No support nodes for free space that no rectangle covers: only the paper's.
    NoCoverage,
    /// No support nodes for gaps narrower than an edge.
    NoGround,
    /// The explorer does not look into gaps that it would fit into.
    NoGaps,
    /// No shortcuts: no refinement.
    NoShortcuts,
    /// Nodes follow corrections of a millimetre and half a milliradian.
    FollowAll,
}

impl Knob {
    /// For files and flags.
    pub fn name(self) -> String {
        self.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
    }

    /// For tables.
    pub fn title(self) -> &'static str {
        match self {
            Self::FewMainNodes => "σ_c 4 m",
            Self::ManyMainNodes => "σ_c 1.8 m",
            Self::NoNews => "no main nodes for unknown walls",
            Self::NoCoverage => "no coverage",
            Self::NoGround => "no coverage of gaps",
            Self::NoGaps => "no looks into gaps",
            Self::NoShortcuts => "no refinement",
            Self::FollowAll => "nodes follow 1 mm",
        }
    }

    /// Turns it.
    pub fn turn(self, config: &mut MapperConfig) {
        let builder = &mut config.builder;
        match self {
            Self::FewMainNodes => builder.selection.sigma_c_m = 4.0,
            Self::ManyMainNodes => builder.selection.sigma_c_m = 1.8,
            Self::NoNews => {
                builder.selection.least_known = 0.0;
                builder.selection.least_news_m = f64::INFINITY;
            }
            Self::NoCoverage => builder.coverage = CoverageConfig::none(),
            Self::NoGround => builder.coverage.least_ground_m2 = f64::INFINITY,
            Self::NoGaps => config.explore.frontier = FrontierConfig::without_gaps(),
            Self::NoShortcuts => config.refine.max_shortcuts = 0,
            Self::FollowAll => {
                builder.follow.least_m = 0.001;
                builder.follow.least_rad = 0.0005;
            }
        }
    }
}
