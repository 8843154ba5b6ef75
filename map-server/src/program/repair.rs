//! `map-server check` and `map-server rescue`: what can be done with a store whose file is damaged.
//! They work on files; no server runs on these meanwhile.

use crate::rescue::{Rescued, RescuedAuthor, check, rescue};
use clap::Subcommand;
use std::path::{Path, PathBuf};

/// What can be done with a store while no server uses it.
#[derive(Clone, Debug, Subcommand)]
pub(super) enum Repair {
    /// Says whether a store is whole, and if not, what of it still reads. Nothing is changed; a
    /// copy is looked at, which takes as much room on the disk for a moment.
    #[command(after_help = "Examples:
  map-server check fht-data")]
    Check {
        /// The data directory of a server that does not run [default: that of --config, or
        /// fht-data].
        source: Option<PathBuf>,
    },
    /// Copies everything that still reads of a damaged store into a new one, and says how many
    /// increments of which map and author are lost.
    #[command(after_help = "Examples:
  map-server rescue fht-data fht-rescued        then: map-server --data fht-rescued

The source stays as it is. Explorers and operators write on with the numbers that they had; robots notice that the map
differs from their copies, and fetch it anew.")]
    Rescue {
        /// The data directory of a server that does not run, or the file maps.redb in it.
        source: PathBuf,
        /// A directory without a store; made if absent.
        target: PathBuf,
    },
}

impl Repair {
    /// Does it, and prints what came of it.
    ///
    /// # Errors
    /// What to tell the user: also that a store which was checked is damaged.
    pub(super) fn run(self, data: &Path, json: bool) -> Result<(), String> {
        match self {
            Self::Check { source } => {
                let source = source.unwrap_or_else(|| data.to_owned());
                let scratch = if source.is_dir() { source.clone() } else { std::env::temp_dir() };
                let found = check(&source, &scratch).map_err(|error| error.to_string())?;
                print(&found, "can be rescued", json)?;
                match &found.damage {
                    None => Ok(()),
                    Some(damage) => Err(format!("{} is damaged: {damage}", source.display())),
                }
            }
            Self::Rescue { source, target } => {
                let rescued = rescue(&source, &target).map_err(|error| error.to_string())?;
                print(&rescued, "rescued", json)
            }
        }
    }
}

fn print(found: &Rescued, what: &str, json: bool) -> Result<(), String> {
    if json {
        println!("{}", serde_json::to_string(found).map_err(|error| error.to_string())?);
        return Ok(());
    }
    match &found.damage {
        None => println!("the store is whole"),
        Some(damage) => println!("the store is damaged: {damage}"),
    }
    for RescuedAuthor { map, author, last, lost, first_lost } in &found.authors {
        let numbers: Vec<String> = first_lost.iter().map(ToString::to_string).collect();
        let more = if *lost > first_lost.len() as u64 { " …" } else { "" };
        let lost_ones = if *lost == 0 { String::new() } else { format!(" (number {}{more})", numbers.join(", ")) };
        println!("map {map}, author {author}: {} of {last} increments {what}, {lost} lost{lost_ones}", last - lost);
    }
    if found.authors.is_empty() {
        println!("there are no increments");
    }
    Ok(())
}
