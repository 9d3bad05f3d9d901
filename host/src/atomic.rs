//! Files that are whole or not there.
//!
//! Bytes go to a temporary file beside the target, which replaces the target in one step when it is complete. A crash,
//! a full disk or an error on the way leaves the target as it was.

use std::ffi::OsString;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

/// Why a file was not written; the target is as it was before.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// No file can be made beside the target.
    #[error(
        "cannot create a file beside {path}: {source}; check that the directory exists and may be written"
    )]
    Create {
        /// The target.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// Writing stopped.
    #[error("cannot write {path}: {source}; check that the disk has room")]
    Write {
        /// The target.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The finished file cannot take the target's place.
    #[error("cannot replace {path}: {source}; check that it is no directory and not write-protected")]
    Replace {
        /// The target.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
}

/// A file that appears under its name only when it is [committed](Self::commit); dropped before that, it never was.
#[derive(Debug)]
pub struct AtomicFile {
    file: BufWriter<NamedTempFile>,
    target: PathBuf,
}

impl AtomicFile {
    /// Starts a file that is to be `target`.
    ///
    /// # Errors
    /// [`WriteError::Create`].
    pub fn create(target: impl AsRef<Path>) -> Result<Self, WriteError> {
        let target = target.as_ref().to_path_buf();
        // A target without a directory part lies in the working directory.
        let directory = target.parent().filter(|d| !d.as_os_str().is_empty()).unwrap_or(Path::new("."));
        // Encoders choose the format by the extension, so the temporary file keeps it.
        let mut suffix = OsString::new();
        if let Some(extension) = target.extension() {
            suffix.push(".");
            suffix.push(extension);
        }
        let mut builder = tempfile::Builder::new();
        builder.prefix(".rfhoi-").suffix(&suffix);
        #[cfg(unix)]
        {
            // Temporary files are private by default; a result is as readable as any other file (umask applies).
            use std::os::unix::fs::PermissionsExt;
            builder.permissions(std::fs::Permissions::from_mode(0o666));
        }
        match builder.tempfile_in(directory) {
            Ok(file) => Ok(Self { file: BufWriter::new(file), target }),
            Err(source) => Err(WriteError::Create { path: target, source }),
        }
    }

    /// The file that is to be.
    pub fn target(&self) -> &Path {
        &self.target
    }

    /// Where the bytes are until then, for encoders that open files by name.
    pub fn temporary(&self) -> &Path {
        self.file.get_ref().path()
    }

    /// [`WriteError::Write`] for this file.
    pub fn write_error(&self, source: io::Error) -> WriteError {
        WriteError::Write { path: self.target.clone(), source }
    }

    /// Writes out what is buffered and puts the file in its place.
    ///
    /// # Errors
    /// [`WriteError::Write`] or [`WriteError::Replace`].
    pub fn commit(self) -> Result<(), WriteError> {
        let Self { file, target } = self;
        let file = match file.into_inner() {
            Ok(file) => file,
            Err(e) => return Err(WriteError::Write { path: target, source: e.into_error() }),
        };
        if let Err(source) = file.as_file().sync_all() {
            return Err(WriteError::Write { path: target, source });
        }
        match file.persist(&target) {
            Ok(_) => Ok(()),
            Err(e) => Err(WriteError::Replace { path: target, source: e.error }),
        }
    }
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Seek for AtomicFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.file.seek(to)
    }
}

/// Makes `contents` the contents of `target`.
///
/// # Errors
/// Any [`WriteError`].
pub fn write(target: impl AsRef<Path>, contents: &[u8]) -> Result<(), WriteError> {
    let mut file = AtomicFile::create(target)?;
    file.write_all(contents).map_err(|e| file.write_error(e))?;
    file.commit()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn target_appears_whole_or_stays_as_it_was() {
        let directory = tempfile::tempdir().unwrap();
        let target = directory.path().join("map.png");
        write(&target, b"old").unwrap();

        let mut file = AtomicFile::create(&target).unwrap();
        assert_eq!(file.temporary().extension(), target.extension());
        file.write_all(b"half").unwrap();
        drop(file);
        assert_eq!(std::fs::read(&target).unwrap(), b"old");

        write(&target, b"new").unwrap();
        assert_eq!(std::fs::read(&target).unwrap(), b"new");
        let names: Vec<_> = std::fs::read_dir(&directory).unwrap().collect();
        assert_eq!(names.len(), 1, "no temporary file remains: {names:?}");
    }

    #[cfg(unix)]
    #[test]
    fn result_is_readable_by_others() {
        use std::os::unix::fs::PermissionsExt;
        let directory = tempfile::tempdir().unwrap();
        let (ours, plain) = (directory.path().join("ours"), directory.path().join("plain"));
        write(&ours, b"").unwrap();
        std::fs::write(&plain, b"").unwrap();
        let mode = |p: &Path| std::fs::metadata(p).unwrap().permissions().mode();
        assert_eq!(mode(&ours), mode(&plain));
    }

    #[test]
    fn errors_name_the_target() {
        let directory = tempfile::tempdir().unwrap();
        let target = directory.path().join("missing").join("x.npz");
        let message = write(&target, b"").unwrap_err().to_string();
        assert!(message.contains("x.npz") && message.contains("directory exists"), "{message}");
        assert!(matches!(write(directory.path(), b""), Err(WriteError::Replace { .. })));
    }
}
