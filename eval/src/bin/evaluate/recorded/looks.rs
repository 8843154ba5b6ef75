//! All looks of all robots as a table, for whoever fits what robots say to what is right.

use fht_eval::recorded::{JudgedDrive, JudgedStatement, Look};
use std::path::Path;

/// Begins a table, in place of one that an earlier run has left.
pub fn begin(file: &Path) -> Result<(), String> {
    std::fs::File::create(file).map(|_| ()).map_err(|error| format!("{} cannot be written: {error}", file.display()))
}

/// Appends the looks of a run to a table.
pub fn append(file: &Path, (log, map): (&str, &str), drives: &[JudgedDrive]) -> Result<(), String> {
    let looks = drives.iter().flat_map(|drive| drive.statements.iter().map(|look| of(log, map, drive, look)));
    write(file, looks).map_err(|error| format!("{}: {error}", file.display()))
}

fn write(file: &Path, looks: impl Iterator<Item = Look>) -> Result<(), csv::Error> {
    let table = std::fs::OpenOptions::new().create(true).append(true).open(file)?;
    let is_new = table.metadata()?.len() == 0;
    let mut table = csv::WriterBuilder::new().has_headers(is_new).from_writer(table);
    for look in looks {
        table.serialize(look)?;
    }
    Ok(table.flush()?)
}

fn of(log: &str, map: &str, drive: &JudgedDrive, look: &JudgedStatement) -> Look {
    let for_it = &look.said.evidence;
    Look {
        log: log.to_owned(),
        map: map.to_owned(),
        start: drive.start,
        ground: drive.ground,
        driven_m: look.said.driven_m,
        stated: look.said.stated,
        error_m: look.error_m,
        error_deg: look.error_deg,
        right: look.is_right(),
        walls: for_it.walls,
        explained: for_it.explained,
        too_short: for_it.too_short,
        somebody: for_it.somebody,
        seen_through: for_it.seen_through,
        too_long: for_it.too_long,
        over_rivals_sigmas: for_it.over_rivals_sigmas,
        over_moved_sigmas: for_it.over_moved_sigmas,
        spread_m: for_it.spread_m,
        is_held: for_it.is_held,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn looks_of_an_earlier_run_do_not_count() -> std::io::Result<()> {
        let folder = tempfile::tempdir()?;
        let table = folder.path().join("looks.csv");
        std::fs::write(&table, "looks of an earlier run")?;
        assert_eq!(begin(&table), Ok(()));
        assert_eq!(append(&table, ("log", "map"), &[]), Ok(()));
        assert_eq!(std::fs::read_to_string(&table)?, "");
        Ok(())
    }
}
