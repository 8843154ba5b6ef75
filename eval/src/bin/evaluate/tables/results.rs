//! What the tables are made of.

use crate::paths::PathFigures;
use crate::systems::storage::StorageFigures;
use crate::systems::{Column, System};
use crate::trials::figures::RelocalizeFigures;
use clap::ValueEnum;
use serde::Serialize;

/// Where plots lie, beside the tables.
pub const PLOTS: &str = "plots";

/// All figures of one system in one world.
#[derive(Debug, Serialize)]
pub struct TableEntry {
    #[serde(flatten)]
    pub relocalize: RelocalizeFigures,
    pub c_path_mean: Option<f64>,
    pub c_path_p95: Option<f64>,
    pub c_path_max: Option<f64>,
    pub paths: usize,
    pub paths_blocked: usize,
    pub paths_refused: usize,
    pub authors_c_path: Option<[f64; 2]>,
    pub plan_ms_mean: f64,
    pub storage_bytes: usize,
    /// The grid deflated, for systems that need the grid.
    pub storage_deflated_bytes: Option<usize>,
}

/// The same, and the system's figures after furniture has moved.
#[derive(Debug, Serialize)]
pub struct SystemEntry<'a> {
    #[serde(flatten)]
    entry: &'a TableEntry,
    furniture_moved: Option<&'a RelocalizeFigures>,
}

/// All results of one world.
pub struct WorldResults {
    /// Its name.
    pub world: String,
    /// Of all systems and columns.
    pub entries: Vec<TableEntry>,
    /// Bytes of our map.
    pub storage: StorageFigures,
    /// Things gone, shifted or new in the column with furniture moved.
    pub changes: usize,
}

impl WorldResults {
    /// One entry for each system: of the building as mapped, if that was measured.
    pub fn by_system(&self) -> Vec<SystemEntry<'_>> {
        let entry = |&system: &System| {
            let moved = self.entry(system, Column::FurnitureMoved);
            let entry = self.entry(system, Column::AsMapped).or(moved)?;
            Some(SystemEntry { entry, furniture_moved: moved.map(|moved| &moved.relocalize) })
        };
        System::value_variants().iter().filter_map(entry).collect()
    }

    /// A system's figures.
    pub fn entry(&self, system: System, column: Column) -> Option<&TableEntry> {
        self.entries.iter().find(|entry| entry.relocalize.system == system && entry.relocalize.column == column)
    }
}

/// What a table says of a system, from its figures.
pub fn entry(relocalize: RelocalizeFigures, paths: &[PathFigures], storage: &StorageFigures) -> Option<TableEntry> {
    let system = relocalize.system;
    let own = |paths: &&PathFigures| paths.world == relocalize.world && paths.system == system.planner();
    let paths = paths.iter().find(own)?;
    let is_grid = matches!(system, System::Amcl | System::AmclNav2);
    Some(TableEntry {
        c_path_mean: paths.c_path_mean,
        c_path_p95: paths.c_path_p95,
        c_path_max: paths.c_path_max,
        paths: paths.pairs,
        paths_blocked: paths.paths_blocked,
        paths_refused: paths.refused,
        authors_c_path: paths.authors_c_path,
        plan_ms_mean: paths.plan_ms_mean,
        storage_bytes: paths.storage_bytes,
        storage_deflated_bytes: is_grid.then_some(storage.grid_deflated),
        relocalize,
    })
}
