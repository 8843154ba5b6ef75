//! What a part reads and writes, looked at before it begins.

use crate::output::OutputArgs;
use fht_program::flags::check_files;
use fht_sim::{SimSetup, check_world, load};
use std::path::PathBuf;

/// The files of a part, each with what it is called.
#[derive(Debug)]
pub struct Files {
    worlds: Vec<String>,
    read: Vec<(&'static str, PathBuf)>,
    written: Vec<(&'static str, PathBuf)>,
}

impl Files {
    /// Those of a part that has `output`.
    pub fn of(output: &OutputArgs) -> Self {
        Self { worlds: Vec::new(), read: Vec::new(), written: Vec::new() }.writes("--json", output.file())
    }

    /// It works in these buildings, too.
    pub fn in_worlds(mut self, worlds: &[String]) -> Self {
        self.worlds.extend_from_slice(worlds);
        self
    }

    /// It reads these, too.
    pub fn reads<'a>(mut self, what: &'static str, files: impl IntoIterator<Item = &'a PathBuf>) -> Self {
        self.read.extend(files.into_iter().map(|file| (what, file.clone())));
        self
    }

    /// It writes these, too.
    pub fn writes<'a>(mut self, what: &'static str, files: impl IntoIterator<Item = &'a PathBuf>) -> Self {
        self.written.extend(files.into_iter().map(|file| (what, file.clone())));
        self
    }

    /// Whether all is there that is read, and nothing of it would be written over.
    pub fn check(mut self) -> Result<(), String> {
        for world in &self.worlds {
            check_world(world).map_err(|error| error.to_string())?;
            self.read.extend(SimSetup::of(world).files().into_iter().map(|file| ("the world", file)));
        }
        for (what, file) in &self.read {
            std::fs::metadata(file).map_err(|error| format!("{what} {} cannot be read: {error}", file.display()))?;
        }
        let read = self.read.iter().map(|(what, file)| (*what, Some(file.as_path())));
        let written = self.written.iter().map(|(what, file)| (*what, Some(file.as_path())));
        check_files(read, written).map_err(|clash| clash.to_string())?;
        // Whether a file makes a building shows only when it is read.
        for world in self.worlds.iter().filter(|world| !SimSetup::of(world).files().is_empty()) {
            load(world, None, 1).map_err(|error| error.to_string())?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(files: Files) -> String {
        files.check().err().unwrap_or_default()
    }

    #[test]
    fn what_is_missing_or_would_be_destroyed_is_told() {
        let folder = tempfile::tempdir().unwrap_or_else(|error| panic!("{error}"));
        let log = folder.path().join("log.mcap");
        std::fs::write(&log, "a log").unwrap_or_else(|error| panic!("{error}"));
        let none = || Files::of(&OutputArgs::default());
        assert_eq!(said(none().in_worlds(&["museum".to_owned()]).reads("the log", [&log])), "");
        assert!(said(none().in_worlds(&["nowhere".to_owned()])).contains("unknown world 'nowhere'"));
        assert!(said(none().in_worlds(&["nowhere.yaml".to_owned()])).contains("there is no world 'nowhere.yaml'"));
        let turned = folder.path().join("turned.yaml");
        let yaml = "image: log.mcap\nresolution: 0.05\norigin: [0, 0, 1]\noccupied_thresh: 0.65\nfree_thresh: 0.2\n";
        std::fs::write(&turned, yaml).unwrap_or_else(|error| panic!("{error}"));
        assert!(said(none().in_worlds(&[turned.display().to_string()])).contains("a turned origin is not supported"));
        let gone = folder.path().join("gone.mcap");
        assert!(said(none().reads("the log", [&gone])).contains("gone.mcap cannot be read"));
        let over = said(none().reads("the log", [&log]).writes("--looks", [&log]));
        assert!(over.starts_with("--looks would write over the log, "), "{over}");
    }
}
