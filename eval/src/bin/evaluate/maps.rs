//! The explored maps that an evaluation works on.

pub mod cases;
pub mod knob;

use clap::Args;
use fht_eval::{Ledger, Survey, SurveyTask};
use fht_program::flags::folder;
use knob::Knob;
use mapper::MapperConfig;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::io::ErrorKind::NotFound;
use std::path::PathBuf;

/// Which maps.
#[derive(Clone, Debug, Args)]
pub struct MapArgs {
    /// Buildings: museum, office, or paths of map.yaml and .world files, separated by
    /// commas.
    #[arg(long, value_delimiter = ',', default_value = "museum,office")]
    pub worlds: Vec<String>,
    /// Seed of the exploration, and of what is drawn in it.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// So many people walk about while the building is explored.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub people: u16,
    /// Explore with one knob of the mapper turned.
    #[arg(long, value_enum)]
    pub knob: Option<Knob>,
    /// Where explored maps and results are kept.
    #[arg(long, value_name = "FOLDER", default_value = "target/evaluation", value_parser = folder)]
    pub kept: PathBuf,
    /// Forget the results that are kept, as after a change of a system's code; explored maps stay.
    #[arg(long)]
    pub afresh: bool,
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
    /// The results kept in the file `name`, as far as they are still wanted.
    pub fn ledger<K, V>(&self, name: &str) -> Result<Ledger<K, V>, String>
    where
        K: Ord + Clone + Serialize + DeserializeOwned,
        V: Clone + Serialize + DeserializeOwned,
    {
        let path = self.kept.join(name);
        let forget = if self.afresh { std::fs::remove_file(&path) } else { Ok(()) };
        let forgotten = forget.or_else(|error| if error.kind() == NotFound { Ok(()) } else { Err(error) });
        forgotten.and_then(|()| Ledger::open(&path)).map_err(|error| format!("{}: {error}", path.display()))
    }

    /// The map of a world; explored now if it is not kept yet.
    pub fn survey(&self, world: &str, variant: Variant) -> Result<Survey, String> {
        self.survey_with(world, variant, true)
    }

    /// The same, with cameras or by the scanner alone.
    pub fn survey_with(&self, world: &str, variant: Variant, cameras: bool) -> Result<Survey, String> {
        let (name, mut mapper) = match variant {
            Variant::Ours => ("ours", MapperConfig::default()),
            Variant::MainOnly => ("main-only", MapperConfig::main_only()),
        };
        let mut name = name.to_owned();
        if let Some(knob) = self.knob {
            knob.turn(&mut mapper);
            name = format!("{name}-{}", knob.name());
        }
        let task = SurveyTask {
            seed: self.seed,
            people: self.people.into(),
            cameras,
            variant: name.clone(),
            mapper,
            ..SurveyTask::usual(world)
        };
        if !Survey::is_kept(&task, &self.kept) {
            fht_program::tell_line!("evaluate: {world} is explored ({name}), once; that takes some minutes");
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
