//! Files that a program writes when it ends: whether they can be written is found out before it
//! begins.

use std::fs::OpenOptions;
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};

/// Why a file cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum OutputFileError {
    /// A folder has its name.
    #[error("it is a folder")]
    Folder,
    /// Something has its name, and is to stay.
    #[error("it is there already; choose another name, or remove it")]
    Exists,
    /// It is to be a folder, and is none.
    #[error("it is no folder")]
    NotFolder,
    /// The folder that it is to be in is missing.
    #[error("there is no folder {}", .0.display())]
    NoFolder(PathBuf),
    /// It is to be a picture, and is not called so.
    #[error("a picture's name ends in .png; '{0}' does not")]
    NoPicture(String),
    /// The system refuses.
    #[error("it cannot be written: {0}")]
    Refused(#[source] io::Error),
}

impl OutputFileError {
    /// Whether what was given is wrong; a full disk is not the user's mistake.
    #[must_use]
    pub fn is_input(&self) -> bool {
        let Self::Refused(error) = self else { return true };
        !matches!(error.kind(), ErrorKind::StorageFull | ErrorKind::QuotaExceeded)
    }
}

/// A file that a program will write when it ends: its folder must be there already, and take it.
///
/// # Errors
/// [`OutputFileError`].
pub fn output_file(text: &str) -> Result<PathBuf, OutputFileError> {
    let file = PathBuf::from(text);
    if file.is_dir() {
        return Err(OutputFileError::Folder);
    }
    let folder = folder_of(&file);
    if !folder.is_dir() {
        return Err(OutputFileError::NoFolder(folder.to_owned()));
    }
    try_writing(&file).map_err(OutputFileError::Refused)?;
    Ok(file)
}

/// The same for a picture: its name ends in `.png`, so that nothing else is overwritten.
///
/// # Errors
/// [`OutputFileError`].
pub fn png_file(text: &str) -> Result<PathBuf, OutputFileError> {
    let is_png = Path::new(text).extension().is_some_and(|ending| ending.eq_ignore_ascii_case("png"));
    if is_png { output_file(text) } else { Err(OutputFileError::NoPicture(text.to_owned())) }
}

/// The same for what a program makes, and does not write over what is there: a recording.
///
/// # Errors
/// [`OutputFileError`].
pub fn new_file(text: &str) -> Result<PathBuf, OutputFileError> {
    // A link that leads nowhere is there, too.
    let is_there = std::fs::symlink_metadata(Path::new(text).components().as_path()).is_ok();
    if is_there { Err(OutputFileError::Exists) } else { output_file(text) }
}

/// A folder that a program writes into, and makes if it is not there.
///
/// # Errors
/// [`OutputFileError::NotFolder`].
pub fn folder(text: &str) -> Result<PathBuf, OutputFileError> {
    let folder = PathBuf::from(text);
    if folder.exists() && !folder.is_dir() { Err(OutputFileError::NotFolder) } else { Ok(folder) }
}

/// Whether a file can be written. One that is there is opened for writing, and stays as it is. For
/// one that is not, its folder takes a file without a name, of which nothing is left whenever the
/// program ends.
fn try_writing(file: &Path) -> io::Result<()> {
    // What will be a folder may end in a slash.
    let file = file.components().as_path();
    if file.as_os_str().is_empty() {
        return Err(ErrorKind::NotFound.into());
    }
    match file.symlink_metadata() {
        // A full disk has room for names.
        Err(error) if error.kind() == ErrorKind::NotFound => tempfile::tempfile_in(folder_of(file))?.write_all(b"\n"),
        Err(error) => Err(error),
        // What is no file, such as a pipe, is opened only when there is something for it.
        Ok(_) if !file.is_file() => Ok(()),
        Ok(_) => OpenOptions::new().write(true).open(file).map(|_| ()),
    }
}

/// The folder that a file is in, or will be.
fn folder_of(file: &Path) -> &Path {
    file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::write_output;

    fn complaint(outcome: Result<PathBuf, OutputFileError>) -> Option<String> {
        outcome.err().map(|error| error.to_string())
    }

    #[test]
    fn a_file_that_cannot_be_written_is_refused_at_once() -> io::Result<()> {
        let dir = tempfile::tempdir()?;
        let said = |file: &str| complaint(output_file(&dir.path().join(file).to_string_lossy()));
        assert_eq!((said("report.json"), said("bag/")), (None, None));
        assert_eq!(said("").as_deref(), Some("it is a folder"));
        assert!(said("missing/report.json").is_some_and(|said| said.starts_with("there is no folder")));
        assert!(said(&"x".repeat(300)).is_some_and(|said| said.starts_with("it cannot be written: ")));
        assert!(complaint(output_file("")).is_some_and(|said| said.starts_with("it cannot be written: ")));
        // Looking has left nothing behind, and changes nothing that is there.
        assert_eq!(std::fs::read_dir(dir.path())?.count(), 0);
        std::fs::write(dir.path().join("old.json"), "{}")?;
        assert_eq!(said("old.json"), None);
        assert_eq!(std::fs::read_to_string(dir.path().join("old.json"))?, "{}");
        Ok(())
    }

    #[test]
    fn what_is_there_is_not_recorded_over() -> io::Result<()> {
        let dir = tempfile::tempdir()?;
        let at = |name: &str| dir.path().join(name).to_string_lossy().into_owned();
        std::fs::create_dir(at("run"))?;
        std::fs::write(at("run.mcap"), "a run")?;
        for there in ["run", "run/", "run.mcap"] {
            let said = complaint(new_file(&at(there)));
            assert!(said.is_some_and(|said| said.starts_with("it is there already")), "{there}");
        }
        assert_eq!((complaint(new_file(&at("new.mcap"))), complaint(new_file(&at("new/")))), (None, None));
        assert_eq!(complaint(folder(&at("run.mcap"))).as_deref(), Some("it is no folder"));
        assert_eq!((complaint(folder(&at("run"))), complaint(folder(&at("new")))), (None, None));
        Ok(())
    }

    #[test]
    fn what_is_no_picture_is_not_overwritten() -> io::Result<()> {
        let folder = tempfile::tempdir()?;
        let at = |name: &str| folder.path().join(name).to_string_lossy().into_owned();
        assert_eq!(complaint(png_file(&at("Map.PNG"))), None);
        assert!(complaint(png_file("run.mcap")).is_some_and(|said| said.contains("ends in .png")));
        let gone = complaint(png_file(&at("gone/map.png")));
        assert!(gone.is_some_and(|said| said.contains("no folder") && said.contains("gone")));
        Ok(())
    }

    #[test]
    fn a_full_disk_is_no_wrong_input() {
        let of = |kind: ErrorKind| OutputFileError::Refused(kind.into()).is_input();
        assert!(!of(ErrorKind::StorageFull) && !of(ErrorKind::QuotaExceeded));
        assert!(of(ErrorKind::PermissionDenied) && of(ErrorKind::ReadOnlyFilesystem));
        assert!(OutputFileError::Folder.is_input());
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn a_device_that_takes_nothing_stays() {
        let full = Path::new("/dev/full");
        assert_eq!(complaint(output_file("/dev/full")), None);
        assert!(write_output(full, b"{}").is_err_and(|error| error.kind() == ErrorKind::StorageFull));
        assert!(full.exists());
    }
}
