//! Bytes of maps: the whole as it travels, by kind of node and by field, beside the grid and
//! MR-TopoMap.

use crate::systems::System;
use fht_eval::Storage as Split;
use fht_eval::Survey;
use fht_eval::systems::topo_map::{TopoMap, TopoMapConfig};
use serde::Serialize;
use std::collections::BTreeMap;

/// Bytes of one world's maps.
#[derive(Clone, Debug, Serialize)]
pub struct StorageFigures {
    /// All increments with their envelopes.
    pub total: usize,
    /// The same by what it is for.
    pub parts: BTreeMap<&'static str, usize>,
    /// Main and support nodes, edges.
    pub counts: [usize; 3],
    /// The explorer's grid, a byte a cell of the cropped grid (paper).
    pub grid_raw: usize,
    /// The same, deflated.
    pub grid_deflated: usize,
    /// MR-TopoMap, in our own coding.
    pub topo_map: usize,
}

impl StorageFigures {
    /// From an exploration.
    pub fn of(survey: &Survey) -> Result<Self, String> {
        let split = Split::of(&survey.increments).map_err(|error| error.to_string())?;
        let parts = BTreeMap::from([
            ("main nodes: ids and poses", split.main_nodes),
            ("main nodes: descriptors", split.descriptors),
            ("main nodes: scans", split.scans),
            ("main nodes: rectangles", split.main_rectangles),
            ("support nodes: ids and poses", split.support_nodes),
            ("support nodes: rectangles", split.support_rectangles),
            ("edges", split.edges),
            ("corrections", split.corrections),
            ("the descriptor's model", split.models),
            ("envelopes", split.envelopes),
        ]);
        let topo_map = TopoMap::build(&survey.passes, &TopoMapConfig::default());
        let counts = survey.map.counts();
        Ok(Self {
            total: split.total,
            parts,
            counts: [counts.main_nodes, survey.map.nodes().count() - counts.main_nodes, survey.map.edges().count()],
            grid_raw: survey.grid.raw_bytes(),
            grid_deflated: survey.grid.deflated_bytes(),
            topo_map: topo_map.bytes().map_err(|error| error.to_string())?,
        })
    }

    /// The bytes that a system needs.
    pub fn bytes_of(&self, system: System) -> usize {
        match system {
            System::Ours | System::OursLidar | System::MainOnly => self.total,
            System::MrTopomap => self.topo_map,
            System::Amcl | System::AmclNav2 => self.grid_raw,
        }
    }
}
