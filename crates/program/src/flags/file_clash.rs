//! Files that a run would both read and write, or write twice.

use std::path::{Path, PathBuf};

/// What a run reads of folders: bags, worlds and pictures. Other files in them may be written.
const READ_OF_FOLDERS: [&str; 5] = ["mcap", "yaml", "png", "jpg", "jpeg"];

/// A file, and what it is called; none, if there is no such file.
pub type NamedFile<'a> = (&'a str, Option<&'a Path>);

/// Two files of a run that must not be one.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FileClash {
    /// An output would destroy what the run reads.
    #[error("{output} would write over {input}, {}; give it another name", file.display())]
    Input {
        /// What the output is called.
        output: String,
        /// What the input is called.
        input: String,
        /// The file.
        file: PathBuf,
    },
    /// Two outputs would destroy each other.
    #[error("{first} and {second} would both write {}; give one of them another name", file.display())]
    Outputs {
        /// What one output is called.
        first: String,
        /// What the other is called.
        second: String,
        /// The file.
        file: PathBuf,
    },
}

/// Checks that a run destroys neither what it reads nor what it writes: that no output is one of
/// its `inputs`, or another of its `outputs`, whatever path leads there. Of an input that is a
/// folder its bags and pictures count.
///
/// # Errors
/// [`FileClash`].
pub fn check_files<'a>(
    inputs: impl IntoIterator<Item = NamedFile<'a>>,
    outputs: impl IntoIterator<Item = NamedFile<'a>>,
) -> Result<(), FileClash> {
    let given = |(name, file): NamedFile<'a>| Some((name, file?));
    let inputs: Vec<(&str, PathBuf)> =
        inputs.into_iter().filter_map(given).map(|(name, file)| (name, true_path(file))).collect();
    let mut known: Vec<(&str, PathBuf)> = Vec::new();
    for (name, file) in outputs.into_iter().filter_map(given).filter(|(_, file)| keeps(file)) {
        let place = true_path(file);
        if let Some((input, _)) = inputs.iter().find(|(_, input)| is_of(&place, input)) {
            let (output, input) = (name.to_owned(), (*input).to_owned());
            return Err(FileClash::Input { output, input, file: file.to_owned() });
        }
        if let Some((first, _)) = known.iter().find(|(_, other)| *other == place) {
            let (first, second) = ((*first).to_owned(), name.to_owned());
            return Err(FileClash::Outputs { first, second, file: file.to_owned() });
        }
        known.push((name, place));
    }
    Ok(())
}

/// Whether what is written there stays: pipes and devices take anything from anybody.
fn keeps(file: &Path) -> bool {
    !file.exists() || file.is_file() || file.is_dir()
}

/// Whether writing `output` destroys something of `input`.
fn is_of(output: &Path, input: &Path) -> bool {
    let is_inside = || {
        let ending = output.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
        output.parent() == Some(input) && output.is_file() && READ_OF_FOLDERS.contains(&ending)
    };
    output == input || is_inside()
}

/// The file, without links and detours. One that is not there yet is in its folder.
fn true_path(file: &Path) -> PathBuf {
    let in_folder = || {
        let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or_else(|| Path::new("."));
        Some(folder.canonicalize().ok()?.join(file.file_name()?))
    };
    file.canonicalize().ok().or_else(in_folder).unwrap_or_else(|| file.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(inputs: &[(&str, &Path)], outputs: &[(&str, &Path)]) -> String {
        let outcome = check_files(
            inputs.iter().map(|&(name, file)| (name, Some(file))),
            outputs.iter().map(|&(name, file)| (name, Some(file))),
        );
        outcome.err().map(|clash| clash.to_string()).unwrap_or_default()
    }

    #[test]
    fn no_output_destroys_an_input_or_another_output() -> std::io::Result<()> {
        let dir = tempfile::tempdir()?;
        let at = |name: &str| dir.path().join(name);
        std::fs::create_dir(at("bag"))?;
        for file in ["run.mcap", "old.json", "bag/bag_0.mcap", "bag/old.json"] {
            std::fs::write(at(file), "")?;
        }
        let (run, bag) = (at("run.mcap"), at("bag"));
        let over = said(&[("the bag", run.as_path())], &[("--report", at("bag/../run.mcap").as_path())]);
        assert!(over.starts_with("--report would write over the bag, "), "{over}");
        let within = said(&[("the bag", bag.as_path())], &[("--report", at("bag/bag_0.mcap").as_path())]);
        assert!(within.starts_with("--report would write over the bag, "), "{within}");
        let (picture, detour) = (at("same.png"), at("bag/../same.png"));
        let twice = said(&[], &[("--picture", picture.as_path()), ("--report", detour.as_path())]);
        assert!(twice.starts_with("--picture and --report would both write "), "{twice}");
        // What nobody of the run reads may be written over, and devices take anything.
        let (old, older, new) = (at("bag/old.json"), at("old.json"), at("bag/new.mcap"));
        let reports = [("--report", old.as_path()), ("--json", older.as_path()), ("--record", new.as_path())];
        assert_eq!(said(&[("the bag", bag.as_path()), ("the log", run.as_path())], &reports), "");
        let nowhere = Path::new("/dev/null");
        assert_eq!(said(&[], &[("--picture", nowhere), ("--report", nowhere)]), "");
        assert_eq!(check_files([("the model", None)], [("--report", None)]), Ok(()));
        Ok(())
    }
}
