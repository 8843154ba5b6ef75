//! `map-server check`, `map-server rescue` and `map-server restore`: what can be done with a store
//! whose file is damaged, or not wanted. They work on files; no server runs on these meanwhile.

use crate::rescue::{Rescued, RescuedAuthor, RestoreError, Restored, check, check_archives, rescue, restore};
use clap::Subcommand;
use fht_program::{ProgramFailure, Stop, print_line};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// What can be done with a store while no server uses it.
#[derive(Clone, Debug, Subcommand)]
pub(super) enum Repair {
    /// Says whether a store, or a backup of exported maps, is whole, and if not, what of it still
    /// reads and what is lost. Nothing is changed; a copy is looked at, which takes as much room
    /// for a moment in the folder for temporary files (TMPDIR).
    #[command(after_help = "Examples:
  map-server check fht-data
  map-server check /backup/maps                  a folder of exported maps (*.fht), or one of them

In a folder that has both a store and exported maps, the store is looked at, as a server would.")]
    Check {
        /// The data directory of a server that does not run, or exported maps [default: that of
        /// --config, or fht-data].
        source: Option<PathBuf>,
    },
    /// Copies everything that still reads of a damaged store into a new one, and says how many
    /// increments of which map and author are lost.
    #[command(after_help = "Examples:
  map-server rescue fht-data fht-rescued        then: map-server --data fht-rescued

The source stays as it is. Explorers and operators write on with the numbers that they had; robots
notice that the map differs from their copies, and fetch it anew. A store that an earlier version
wrote does not say how many increments there were: the report names the authors of whom others may
be lost. Let those who wrote under these names take other names (--robot, --operator).

Exit code 0: nothing is known to be lost; 1: something is lost, or the rescue failed.")]
    Rescue {
        /// The data directory of a server that does not run, or the file maps.redb in it.
        source: PathBuf,
        /// A directory without a store; made if absent.
        target: PathBuf,
    },
    /// Puts a backup in the place of a store, after checking it. The file that is replaced stays
    /// beside it, and is named. Refused while a server runs on the store.
    #[command(after_help = "Examples:
  map-server restore /backup/fht-data --store fht-data      a copy of a data directory
  map-server restore /backup/maps --store fht-data          a folder of exported maps (*.fht)
  map-server restore fht-data/maps.redb.replaced-2026-11-21T10-00-00Z --store fht-data  back again

Of a folder that has both, the store is taken, and a warning says so.

The store then has the maps of the backup, and no others. Robots notice, and fetch them anew.")]
    Restore {
        /// A data directory, or its file maps.redb; an exported map, or a folder of them.
        backup: PathBuf,
        /// The data directory of a server that does not run; made if absent [default: that of
        /// --config, or fht-data].
        #[arg(long, value_name = "DIR")]
        store: Option<PathBuf>,
    },
}

impl Repair {
    /// Does it, and prints what came of it.
    ///
    /// # Errors
    /// What to tell the user: also that a store which was checked is damaged (exit code 1).
    pub(super) fn run(self, data: &Path, json: bool) -> Result<(), ProgramFailure> {
        let stop = Stop::on_signal("map-server").map_err(ProgramFailure::of_run)?;
        stop.doing(self.doing());
        let made = |folder: &Path| {
            let folder = folder.to_owned();
            stop.finally(move || remove(&folder));
        };
        match self {
            Self::Check { source } => {
                let source = source.unwrap_or_else(|| data.to_owned());
                let archives = of_whole_copy(check_archives(&source), &stop)?;
                if let Some(authors) = archives {
                    let maps: BTreeSet<&str> = authors.iter().map(|author| author.map.as_str()).collect();
                    let subject = if maps.len() == 1 { "the exported map is" } else { "the exported maps are" };
                    return print(&Rescued { damage: None, authors }, subject, "are whole", json);
                }
                let found = of_whole_copy(check(&source, &std::env::temp_dir(), &made), &stop)?;
                let what = if found.damage.is_some() { "can be rescued" } else { "are whole" };
                print(&found, "the store is", what, json)?;
                match &found.damage {
                    None => Ok(()),
                    Some(damage) => Err(ProgramFailure::of_run(format!("{} is damaged: {damage}", source.display()))),
                }
            }
            Self::Rescue { source, target } => {
                if !target.exists() {
                    let folder = target.clone();
                    // Only if there is nothing in it.
                    stop.finally(move || _ = std::fs::remove_dir(folder));
                }
                let rescued = of_whole_copy(rescue(&source, &target, &made), &stop)?;
                print(&rescued, "the store is", "rescued", json)?;
                if rescued.damage.is_some() && rescued.authors.is_empty() {
                    return Err(ProgramFailure::of_run(format!("nothing of {} can be read", source.display())));
                }
                match rescued.lost() {
                    0 => Ok(()),
                    lost => Err(ProgramFailure::of_run(format!(
                        "{lost} of the increments are lost; what reads of {} is in {}",
                        source.display(),
                        target.display()
                    ))),
                }
            }
            Self::Restore { backup, store } => {
                let restored = restore(&backup, store.as_deref().unwrap_or(data), &made);
                print_restored(&of_whole_copy(restored, &stop)?, json)
            }
        }
    }
}

/// Removes a folder into which another thread may be writing, and what that makes anew meanwhile.
fn remove(folder: &Path) {
    const TRIES: usize = 50;
    const PAUSE: Duration = Duration::from_millis(10);
    for _ in 0..TRIES {
        let _ = std::fs::remove_dir_all(folder); // or else the next time
        std::thread::sleep(PAUSE);
        if !folder.exists() {
            return;
        }
    }
}

impl Repair {
    /// What is interrupted.
    fn doing(&self) -> &'static str {
        match self {
            Self::Check { .. } => "looking at a copy; nothing was changed",
            Self::Rescue { .. } => "copying what reads; there may be no new store, and the old one is as it was",
            Self::Restore { .. } => "putting the backup in place: what the store is, `map-server check` says",
        }
    }
}

/// What came of it, unless that is of a copy which an interruption takes away meanwhile.
fn of_whole_copy<T>(outcome: Result<T, impl Into<RestoreError>>, stop: &Stop) -> Result<T, ProgramFailure> {
    if stop.is_set() {
        stop.leave();
    }
    outcome.map_err(|error| {
        let error = error.into();
        ProgramFailure::of(error.is_input(), error)
    })
}

fn print_restored(restored: &Restored, json: bool) -> Result<(), ProgramFailure> {
    if json {
        print_line!("{}", serde_json::to_string(restored).map_err(ProgramFailure::of_run)?);
        return Ok(());
    }
    let Restored { file, replaced, authors } = restored;
    for RescuedAuthor { map, author, last, .. } in authors {
        let end = if *last == 1 { "" } else { "s" };
        print_line!("map {map}, author {author}: {last} increment{end}");
    }
    print_line!("{} is the backup now", file.display());
    match replaced {
        Some(replaced) => print_line!("what it was is kept: {}", replaced.display()),
        None => print_line!("there was no store before"),
    }
    Ok(())
}

/// How much there is of an author's increments. Of folded ones nobody can say which are there.
fn author_in_words(author: &RescuedAuthor, what: &str) -> String {
    let RescuedAuthor { last, lost, first_lost, folded, .. } = author;
    let folded_ones = format!("{folded} are folded (which of these there were cannot be told any more)");
    if *lost == 0 && *folded > 0 {
        return format!("{last} increments, of which {folded_ones} and {} {what}", last.saturating_sub(*folded));
    }
    let numbers: Vec<String> = first_lost.iter().map(ToString::to_string).collect();
    let more = if *lost > first_lost.len() as u64 { " …" } else { "" };
    let lost_ones = if *lost == 0 { String::new() } else { format!(" (number {}{more})", numbers.join(", ")) };
    let folded_ones = if *folded == 0 { String::new() } else { format!("; {folded_ones}") };
    format!("{} of {last} increments {what}, {lost} lost{lost_ones}{folded_ones}", last - lost)
}

fn print(found: &Rescued, subject: &str, what: &str, json: bool) -> Result<(), ProgramFailure> {
    if json {
        print_line!("{}", serde_json::to_string(found).map_err(ProgramFailure::of_run)?);
        return Ok(());
    }
    match &found.damage {
        None => print_line!("{subject} whole"),
        Some(damage) => print_line!("{subject} damaged: {damage}"),
    }
    for author in &found.authors {
        print_line!("map {}, author {}: {}", author.map, author.author, author_in_words(author, what));
    }
    let lost_before: BTreeMap<_, _> = found.authors.iter().map(|author| (&author.map, author.lost_before)).collect();
    for (map, lost) in lost_before.into_iter().filter(|(_, lost)| *lost > 0) {
        print_line!("map {map}: an earlier rescue did not find {lost} of its increments: they are lost");
    }
    if found.authors.is_empty() {
        print_line!(
            "{}",
            if found.damage.is_some() { "no increment of it can be read" } else { "there are no increments" }
        );
    }
    let unknown: Vec<String> =
        found.unknown_ends().map(|author| format!("{} (map {})", author.author, author.map)).collect();
    if !unknown.is_empty() {
        print_line!(
            "nothing that reads says how many increments these authors had: {}. Those after the last one above may be \
             lost, too. Whoever writes on under these names may use their numbers a second time: take other names, or \
             restore a backup",
            unknown.join(", ")
        );
    }
    Ok(())
}
