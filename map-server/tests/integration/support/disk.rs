//! A disk in memory that fails when it is told to, and forgets at a power failure what it was not
//! told to bring to safety.

use map_server::store::StoreDisk;
use rand::{Rng, RngExt};
use redb::StorageBackend;
use std::io::{self, ErrorKind};
use std::path::Path;
use std::sync::{Arc, Mutex};

/// What a disk writes whole or not at all, bytes.
const SECTOR: usize = 512;

#[derive(Clone, Debug)]
enum Change {
    Write(usize, Vec<u8>),
    Length(usize),
}

impl Change {
    fn apply(&self, bytes: &mut Vec<u8>) {
        match self {
            Self::Length(length) => bytes.resize(*length, 0),
            Self::Write(begin, data) => {
                if bytes.len() < begin + data.len() {
                    bytes.resize(begin + data.len(), 0);
                }
                bytes[*begin..begin + data.len()].copy_from_slice(data);
            }
        }
    }

    /// A part of it: the sectors that `is_kept` lets through.
    fn apply_torn(&self, bytes: &mut Vec<u8>, mut is_kept: impl FnMut() -> bool) {
        match self {
            Self::Length(_) if is_kept() => self.apply(bytes),
            Self::Length(_) => {}
            Self::Write(begin, data) => {
                let mut at = 0;
                while at < data.len() {
                    let end = data.len().min(at + SECTOR - (begin + at) % SECTOR);
                    if is_kept() {
                        Self::Write(begin + at, data[at..end].to_vec()).apply(bytes);
                    }
                    at = end;
                }
            }
        }
    }
}

#[derive(Debug, Default)]
struct Platter {
    /// What a power failure leaves.
    safe: Vec<u8>,
    /// What the system shows.
    shown: Vec<u8>,
    /// What was changed since it was last brought to safety.
    changes: Vec<Change>,
    /// After so many changes nothing more is taken; none: everything is.
    takes: Option<u64>,
}

/// The disk. Clones are the same disk.
#[derive(Clone, Debug, Default)]
pub struct TestDisk(Arc<Mutex<Platter>>);

impl TestDisk {
    /// From now on it takes so many changes, and then fails.
    pub fn fail_after(&self, changes: u64) {
        self.0.lock().unwrap().takes = Some(changes);
    }

    /// It works again.
    pub fn heal(&self) {
        self.0.lock().unwrap().takes = None;
    }

    /// The power fails: of what was not brought to safety some is there in the end, some is not, in
    /// whole sectors and any order. It works again after that.
    pub fn lose_power(&self, rng: &mut impl Rng) {
        let mut platter = self.0.lock().unwrap();
        let Platter { safe, shown, changes, takes } = &mut *platter;
        let share = [0.0, 0.1, 0.5, 0.9, 1.0][rng.random_range(0..5_usize)];
        let in_order = rng.random_bool(0.3).then(|| rng.random_range(0..=changes.len()));
        for (index, change) in changes.drain(..).enumerate() {
            match in_order {
                Some(end) if index < end => change.apply(safe),
                // The last one is torn, and nothing comes after it.
                Some(end) if index == end => change.apply_torn(safe, || rng.random_bool(0.5)),
                Some(_) => {}
                None => change.apply_torn(safe, || rng.random_bool(share)),
            }
        }
        shown.clone_from(safe);
        *takes = None;
    }

    fn change(&self, change: Change) -> io::Result<()> {
        let mut platter = self.0.lock().unwrap();
        platter.take()?;
        change.apply(&mut platter.shown);
        platter.changes.push(change);
        Ok(())
    }
}

impl Platter {
    fn take(&mut self) -> io::Result<()> {
        match &mut self.takes {
            Some(0) => Err(ErrorKind::StorageFull.into()),
            Some(takes) => {
                *takes -= 1;
                Ok(())
            }
            None => Ok(()),
        }
    }
}

fn at(position: u64) -> usize {
    usize::try_from(position).unwrap()
}

impl StorageBackend for TestDisk {
    fn len(&self) -> io::Result<u64> {
        Ok(self.0.lock().unwrap().shown.len() as u64)
    }

    fn read(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        let platter = self.0.lock().unwrap();
        let there = platter.shown.get(at(offset)..at(offset) + out.len()).ok_or(ErrorKind::UnexpectedEof)?;
        out.copy_from_slice(there);
        Ok(())
    }

    fn set_len(&self, len: u64) -> io::Result<()> {
        self.change(Change::Length(at(len)))
    }

    fn sync_data(&self) -> io::Result<()> {
        let mut platter = self.0.lock().unwrap();
        platter.take()?;
        let Platter { safe, changes, .. } = &mut *platter;
        changes.drain(..).for_each(|change| change.apply(safe));
        Ok(())
    }

    fn write(&self, offset: u64, data: &[u8]) -> io::Result<()> {
        self.change(Change::Write(at(offset), data.to_vec()))
    }
}

impl StoreDisk for TestDisk {
    fn open(&self) -> io::Result<(Box<dyn StorageBackend>, Option<String>)> {
        Ok((Box::new(self.clone()), None))
    }

    fn path(&self) -> &Path {
        Path::new("in-memory/maps.redb")
    }
}
