//! Results that take minutes, kept as they come: an evaluation that was interrupted goes on where
//! it stopped.

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::{self, BufRead, BufReader, Write};
use std::path::Path;

#[derive(Serialize, Deserialize)]
struct Line<K, V> {
    key: K,
    value: V,
}

/// A file of JSON lines, each a result with its key.
pub struct Ledger<K, V> {
    known: BTreeMap<K, V>,
    file: File,
}

impl<K: Ord + Clone + Serialize + DeserializeOwned, V: Clone + Serialize + DeserializeOwned> Ledger<K, V> {
    /// Opens the file, or creates it. Lines that cannot be read, such as a truncated last one, are
    /// skipped.
    ///
    /// # Errors
    /// When the file cannot be read or written.
    pub fn open(path: &Path) -> io::Result<Self> {
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder)?;
        }
        let mut file = OpenOptions::new().create(true).read(true).append(true).open(path)?;
        let mut known = BTreeMap::new();
        let mut ends_in_line = true;
        let mut reader = BufReader::new(&file);
        let mut line = Vec::new();
        while reader.read_until(b'\n', &mut line)? > 0 {
            ends_in_line = line.ends_with(b"\n");
            if let Ok(Line { key, value }) = serde_json::from_slice(&line) {
                known.insert(key, value);
            }
            line.clear();
        }
        if !ends_in_line {
            file.write_all(b"\n")?;
        }
        Ok(Self { known, file })
    }

    /// The result of `key`: the stored one, or what `find` computes now.
    ///
    /// # Errors
    /// Those of `find`; when the file cannot be written.
    pub fn get_or<E: From<io::Error>>(&mut self, key: K, find: impl FnOnce() -> Result<V, E>) -> Result<V, E> {
        if let Some(known) = self.known.get(&key) {
            return Ok(known.clone());
        }
        let value = find()?;
        let line = Line { key: key.clone(), value: value.clone() };
        let mut bytes = serde_json::to_vec(&line).map_err(io::Error::from)?;
        bytes.push(b'\n');
        self.file.write_all(&bytes)?;
        self.known.insert(key, value.clone());
        Ok(value)
    }

    /// Whether the result of `key` is known.
    pub fn has(&self, key: &K) -> bool {
        self.known.contains_key(key)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_known_is_not_run_again_even_after_a_line_was_cut_short() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("kept").join("trials.jsonl");
        let mut runs = 0;
        let mut ask = |ledger: &mut Ledger<(String, u32), f64>, start: u32| {
            let found = ledger.get_or::<io::Error>(("museum".to_owned(), start), || {
                runs += 1;
                Ok(f64::from(start))
            });
            assert_eq!(found.unwrap(), f64::from(start));
            runs
        };
        let mut ledger = Ledger::open(&path).unwrap();
        assert_eq!(ask(&mut ledger, 1), 1);
        assert_eq!(ask(&mut ledger, 1), 1);
        assert_eq!(ask(&mut ledger, 2), 2);
        drop(ledger);
        let text = std::fs::read_to_string(&path).unwrap();
        std::fs::write(&path, &text[..text.len() - 5]).unwrap();
        let mut ledger = Ledger::open(&path).unwrap();
        assert_eq!(ask(&mut ledger, 1), 2);
        assert_eq!(ask(&mut ledger, 2), 3, "its line was cut");
        drop(ledger);
        let mut ledger = Ledger::open(&path).unwrap();
        assert_eq!(ask(&mut ledger, 2), 3);
    }
}
