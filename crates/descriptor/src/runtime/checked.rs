//! A library whose hash is known, as a file that nobody can change between the check and the load.

#[cfg(target_os = "linux")]
use rustix::io::Errno;
use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
#[cfg(target_os = "linux")]
use std::time::{Duration, Instant};

/// A library whose bytes have the hash that was asked for. They lie in a sealed copy in memory, so
/// that what was checked is what is loaded, whatever becomes of the file on the disk.
pub(super) struct CheckedLibrary {
    path: PathBuf,
    sealed: File,
}

impl CheckedLibrary {
    /// Reads the library at `path`, once, and refuses it if its BLAKE3 hash is not `expected`.
    pub(super) fn open(path: PathBuf, expected: &str) -> Result<Self, String> {
        let named = |error: io::Error| format!("{}: {error}", path.display());
        let bytes = std::fs::read(&path).map_err(named)?;
        let hash = blake3::hash(&bytes).to_hex();
        if hash.as_str() != expected {
            return Err(format!(
                "{} is not the library that was fetched: its BLAKE3 hash is {hash}, not {expected}; it was altered or cut, and \
                 is not loaded: remove it, and the next run fetches it again",
                path.display()
            ));
        }
        let sealed = sealed_copy(&bytes)
            .map_err(|error| format!("{} cannot be copied to memory to be loaded: {error}", path.display()))?;
        Ok(Self { path, sealed })
    }

    /// Where the library lies.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// What to load, while this value lives: the sealed copy.
    #[cfg(target_os = "linux")]
    pub(super) fn loadable(&self) -> PathBuf {
        use std::os::fd::AsRawFd;
        PathBuf::from(format!("/proc/self/fd/{}", self.sealed.as_raw_fd()))
    }

    /// There is no sealed copy on this system, and so no value of this type.
    #[cfg(not(target_os = "linux"))]
    pub(super) fn loadable(&self) -> PathBuf {
        self.path.clone()
    }
}

#[cfg(target_os = "linux")]
fn sealed_copy(bytes: &[u8]) -> io::Result<File> {
    use rustix::fs::{MemfdFlags, SealFlags, fcntl_add_seals, memfd_create};
    const SEALS: SealFlags = SealFlags::WRITE.union(SealFlags::GROW).union(SealFlags::SHRINK).union(SealFlags::SEAL);
    let copy = memfd_create("onnxruntime", MemfdFlags::CLOEXEC | MemfdFlags::ALLOW_SEALING)?;
    let mut copy = File::from(copy);
    copy.write_all(bytes)?;
    while_busy(|| fcntl_add_seals(&copy, SEALS))?;
    Ok(copy)
}

/// Tries to seal until the system is done with the memory: where it moves pages about, on a busy
/// machine, it refuses for a moment (`EBUSY`).
#[cfg(target_os = "linux")]
fn while_busy(mut seal: impl FnMut() -> Result<(), Errno>) -> Result<(), Errno> {
    /// A copy that cannot be sealed for longer is a fault.
    const LONGEST: Duration = Duration::from_secs(10);
    const TRY_AGAIN: Duration = Duration::from_millis(10);
    let began = Instant::now();
    loop {
        match seal() {
            Err(Errno::BUSY) if began.elapsed() < LONGEST => std::thread::sleep(TRY_AGAIN),
            other => return other,
        }
    }
}

#[cfg(not(target_os = "linux"))]
fn sealed_copy(_: &[u8]) -> io::Result<File> {
    Err(io::ErrorKind::Unsupported.into())
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::{CheckedLibrary, while_busy};
    use rustix::io::Errno;
    use std::io::{Read, Write};

    #[test]
    fn a_copy_that_cannot_be_sealed_just_now_is_sealed_a_little_later() {
        let mut answers = [Err(Errno::BUSY), Err(Errno::BUSY), Ok(())].into_iter();
        assert_eq!(while_busy(|| answers.next().unwrap()), Ok(()));
        assert_eq!(while_busy(|| Err(Errno::PERM)), Err(Errno::PERM));
    }

    #[test]
    fn what_was_checked_is_what_is_loaded_and_nobody_changes_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lib.so");
        std::fs::write(&path, b"the library").unwrap();
        let hash = blake3::hash(b"the library").to_hex();
        let library = CheckedLibrary::open(path.clone(), &hash).unwrap();
        std::fs::write(&path, b"another one").unwrap();
        let mut loaded = String::new();
        std::fs::File::open(library.loadable()).unwrap().read_to_string(&mut loaded).unwrap();
        assert_eq!(loaded, "the library");
        let mut writer = std::fs::OpenOptions::new().write(true).open(library.loadable()).unwrap();
        assert!(writer.write_all(b"x").is_err(), "the copy is sealed");
        let refusal = CheckedLibrary::open(path.clone(), &hash).err().unwrap();
        assert!(refusal.starts_with(&path.display().to_string()) && refusal.contains("hash"), "{refusal}");
    }
}
