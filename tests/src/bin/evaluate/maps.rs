//! The explored maps that an evaluation works on.

use clap::Args;
use fht_tests::survey::{Survey, SurveyTask};
use mapper::mapping::MapperConfig;
use std::path::PathBuf;

/// Which maps.
#[derive(Debug, Args)]
pub struct MapArgs {
    /// Buildings: museum, office, or paths of map.yaml and .world files.
    #[arg(long, value_delimiter = ',', default_value = "museum,office")]
    pub worlds: Vec<String>,
    /// Seed of the exploration, and of what is drawn in it.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Where explored maps and results are kept.
    #[arg(long, value_name = "FOLDER", default_value = "target/evaluation")]
    pub kept: PathBuf,
}

/// How a map is made of what is explored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Variant {
    /// The FHT-Map.
    Ours,
    /// The paper's ablation: main nodes only.
    MainOnly,
}

impl MapArgs {
    /// The map of a world; explored now if it is not kept yet.
    pub fn survey(&self, world: &str, variant: Variant) -> Result<Survey, String> {
        let (name, mapper) = match variant {
            Variant::Ours => ("ours", MapperConfig::default()),
            Variant::MainOnly => ("main-only", MapperConfig::main_only()),
        };
        let task = SurveyTask {
            world: world.to_owned(),
            textures: None,
            seed: self.seed,
            drift: 1.0,
            variant: name.to_owned(),
            mapper,
        };
        if !Survey::is_kept(&task, &self.kept) {
            eprintln!("evaluate: {world} is explored ({name}), once; that takes some minutes");
        }
        Survey::of(&task, &self.kept).map_err(|error| error.to_string())
    }
}

/// What a world is called in tables and files: the stem of its file; built-in ones are our own.
pub fn short_name(world: &str) -> String {
    let path = std::path::Path::new(world);
    match (path.extension(), path.file_stem()) {
        (Some(_), Some(stem)) => stem.to_string_lossy().into_owned(),
        _ => format!("own-{world}"),
    }
}
