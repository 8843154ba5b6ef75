//! All looks of all robots as a table, for whoever fits what robots say to what is right.

use fht_eval::recorded::JudgedDrive;
use std::io::Write;
use std::path::Path;

const HEADER: &str = "log,map,start,ground,driven_m,stated,error_m,error_deg,walls,explained,contradicted,\
                      margin_explained,margin_contradicted,rivals,spread_m";

/// Appends the looks of a run to a table.
pub fn append(file: &Path, (log, map): (&str, &str), drives: &[JudgedDrive]) -> Result<(), String> {
    write(file, log, map, drives).map_err(|error| format!("{}: {error}", file.display()))
}

fn write(file: &Path, log: &str, map: &str, drives: &[JudgedDrive]) -> std::io::Result<()> {
    let mut table = std::fs::OpenOptions::new().create(true).append(true).open(file)?;
    if table.metadata()?.len() == 0 {
        writeln!(table, "{HEADER}")?;
    }
    for drive in drives {
        for look in &drive.statements {
            let (said, for_it) = (&look.said, &look.said.evidence);
            writeln!(
                table,
                "{log},{map},{},{:.3},{:.2},{:.5},{:.3},{:.2},{:.0},{:.4},{:.4},{:.2},{:.2},{},{:.2}",
                drive.start,
                drive.ground,
                said.driven_m,
                said.stated,
                look.error_m,
                look.error_deg,
                for_it.walls,
                for_it.explained,
                for_it.contradicted,
                for_it.margin_explained,
                for_it.margin_contradicted,
                for_it.rivals,
                for_it.spread_m
            )?;
        }
    }
    Ok(())
}
