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
    worlds: Vec<String>,
    /// Seed of the exploration, and of what is drawn in it.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// How far a main node's relocalization capability reaches (the paper's σ_c), metres [default: the mapper's].
    #[arg(long, value_name = "M")]
    sigma_c: Option<f64>,
    /// Where explored maps are kept.
    #[arg(long, value_name = "FOLDER", default_value = "target/evaluation")]
    kept: PathBuf,
}

impl MapArgs {
    /// The maps one after another; those that are not kept yet are explored now.
    pub fn surveys(&self) -> impl Iterator<Item = Result<Survey, String>> + '_ {
        let mut mapper = MapperConfig::default();
        let mut variant = "ours".to_owned();
        if let Some(sigma_c_m) = self.sigma_c {
            mapper.builder.selection.sigma_c_m = sigma_c_m;
            variant = format!("{variant}-sigma{sigma_c_m}");
        }
        self.worlds.iter().map(move |world| {
            let task = SurveyTask {
                world: world.clone(),
                textures: None,
                seed: self.seed,
                drift: 1.0,
                variant: variant.clone(),
                mapper: mapper.clone(),
            };
            Survey::of(&task, &self.kept).map_err(|error| error.to_string())
        })
    }
}
