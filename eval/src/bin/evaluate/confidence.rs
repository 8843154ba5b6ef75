//! `evaluate confidence`: fits what grounds are worth to tables of looks.

use crate::files::Files;
use crate::output::{OutputArgs, say};
use clap::Args;
use fht_eval::recorded::{Calibration, Look, calibrate};
use fht_localization::ConfidenceConfig;
use std::path::{Path, PathBuf};

#[derive(Debug, Args)]
pub struct ConfidenceArgs {
    /// Tables of 'evaluate recorded --looks'.
    #[arg(required = true, value_name = "FILE")]
    looks: Vec<PathBuf>,
    #[command(flatten)]
    output: OutputArgs,
}

impl ConfidenceArgs {
    /// What it reads and writes.
    pub fn files(&self) -> Files {
        Files::of(&self.output).reads("the table", &self.looks)
    }
}

pub fn run(args: &ConfidenceArgs) -> Result<(), String> {
    let mut looks = Vec::new();
    for path in &args.looks {
        looks.extend(read(path).map_err(|error| format!("{}: {error}", path.display()))?);
    }
    if looks.is_empty() {
        return Err("there is no look in the tables".to_owned());
    }
    let calibrations = calibrate(&looks, &ConfidenceConfig::default());
    say("log left out     even   slope  right of those that say 0.9, 0.99, 0.999 or more")?;
    for calibration in &calibrations {
        say(&line(calibration))?;
    }
    args.output.write(&calibrations)
}

fn read(path: &Path) -> Result<Vec<Look>, csv::Error> {
    csv::Reader::from_path(path)?.deserialize().collect()
}

fn line(calibration: &Calibration) -> String {
    let Calibration { left_out, even, slope, reliability } = calibration;
    let left_out = left_out.as_deref().unwrap_or("(none)");
    let shown = reliability.iter().filter(|step| [0.9, 0.99, 0.999].contains(&step.stated));
    let shown: Vec<String> = shown.map(|step| format!("{} of {}", step.right, step.moments)).collect();
    format!("{left_out:14} {even:6.3} {slope:7.2}  {}", shown.join(", "))
}
