//! Files of a folder, or of an archive as it was handed out (`.tar`, `.tar.xz`, `.tar.gz`).

use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::{Path, PathBuf};

/// Why there are no files.
#[derive(Debug, thiserror::Error)]
pub enum FilesError {
    /// The folder, the archive or a file cannot be read.
    #[error("cannot read {path}: {source}")]
    Read {
        /// Which.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// Neither a folder nor an archive.
    #[error("{0} is neither a folder nor a .tar, .tar.xz or .tar.gz")]
    Kind(PathBuf),
    /// No file of that kind.
    #[error("{path} holds no file that ends with {suffix}")]
    None {
        /// The folder or archive.
        path: PathBuf,
        /// How it should end.
        suffix: &'static str,
    },
}

/// Takes a file by name and content.
type Take<'a, E> = &'a mut dyn FnMut(&Path, Vec<u8>) -> Result<(), E>;

/// Hands all files below `path` whose names end with one of `suffixes` to `take`, by name and content; those of a folder in the
/// order of their names.
///
/// # Errors
/// If anything cannot be read, there is none, or as `take` says.
pub fn each<E: From<FilesError>>(
    path: &Path,
    suffix: &'static str,
    mut take: impl FnMut(&Path, Vec<u8>) -> Result<(), E>,
) -> Result<(), E> {
    let mut count = 0;
    let mut counted = |name: &Path, bytes: Vec<u8>| {
        count += 1;
        take(name, bytes)
    };
    if path.is_dir() {
        below(path, suffix, &mut counted)?;
    } else {
        archived(path, suffix, &mut counted)?;
    }
    if count == 0 {
        return Err(FilesError::None { path: path.to_path_buf(), suffix }.into());
    }
    Ok(())
}

fn unread(path: &Path) -> impl Fn(io::Error) -> FilesError {
    move |source| FilesError::Read { path: path.to_path_buf(), source }
}

fn below<E: From<FilesError>>(folder: &Path, suffix: &str, take: Take<'_, E>) -> Result<(), E> {
    let entries = std::fs::read_dir(folder).and_then(Iterator::collect::<io::Result<Vec<_>>>);
    let mut paths: Vec<PathBuf> = entries.map_err(unread(folder))?.iter().map(|entry| entry.path()).collect();
    paths.sort();
    for path in paths {
        if path.is_dir() {
            below(&path, suffix, take)?;
        } else if path.to_string_lossy().ends_with(suffix) {
            let bytes = std::fs::read(&path).map_err(unread(&path))?;
            take(&path, bytes)?;
        }
    }
    Ok(())
}

fn archived<E: From<FilesError>>(path: &Path, suffix: &str, take: Take<'_, E>) -> Result<(), E> {
    let wrong = unread(path);
    let file = BufReader::new(File::open(path).map_err(&wrong)?);
    let name = path.to_string_lossy();
    let plain: Box<dyn Read> = if name.ends_with(".tar") {
        Box::new(file)
    } else if name.ends_with(".tar.xz") {
        Box::new(liblzma::read::XzDecoder::new_multi_decoder(file))
    } else if name.ends_with(".tar.gz") || name.ends_with(".tgz") {
        Box::new(flate2::read::MultiGzDecoder::new(file))
    } else {
        return Err(FilesError::Kind(path.to_path_buf()).into());
    };
    let mut archive = tar::Archive::new(plain);
    for entry in archive.entries().map_err(&wrong)? {
        let mut entry = entry.map_err(&wrong)?;
        let inner = entry.path().map_err(&wrong)?.into_owned();
        if entry.header().entry_type().is_file() && inner.to_string_lossy().ends_with(suffix) {
            let mut bytes = Vec::new();
            entry.read_to_end(&mut bytes).map_err(&wrong)?;
            take(&inner, bytes)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(path: &Path) -> Result<Vec<(String, Vec<u8>)>, FilesError> {
        let mut found = Vec::new();
        each::<FilesError>(path, ".txt", |name, bytes| {
            found.push((name.file_name().unwrap_or_default().to_string_lossy().into_owned(), bytes));
            Ok(())
        })?;
        Ok(found)
    }

    #[test]
    fn a_folder_and_its_archives_hold_the_same() {
        let folder = tempfile::tempdir().unwrap();
        let inner = folder.path().join("set/people");
        std::fs::create_dir_all(&inner).unwrap();
        std::fs::write(inner.join("a.txt"), "one").unwrap();
        std::fs::write(inner.join("b.txt"), "two").unwrap();
        std::fs::write(inner.join("c.csv"), "three").unwrap();
        let mut builder = tar::Builder::new(Vec::new());
        builder.append_dir_all("set", folder.path().join("set")).unwrap();
        let tar = builder.into_inner().unwrap();
        let want = [("a.txt".to_owned(), b"one".to_vec()), ("b.txt".to_owned(), b"two".to_vec())];
        assert_eq!(all(folder.path()).unwrap(), want);
        let mut xz = liblzma::read::XzEncoder::new(&tar[..], 1);
        let mut packed = Vec::new();
        xz.read_to_end(&mut packed).unwrap();
        for (name, bytes) in [("set.tar", &tar), ("set.tar.xz", &packed)] {
            let path = folder.path().join(name);
            std::fs::write(&path, bytes).unwrap();
            let mut found = all(&path).unwrap();
            found.sort();
            assert_eq!(found, want, "{name}");
        }
        std::fs::write(folder.path().join("cut.tar.xz"), &packed[..packed.len() / 2]).unwrap();
        assert!(matches!(all(&folder.path().join("cut.tar.xz")), Err(FilesError::Read { .. })));
        assert!(matches!(all(&inner.join("c.csv")), Err(FilesError::Kind(_))));
        std::fs::remove_file(inner.join("a.txt")).unwrap();
        std::fs::remove_file(inner.join("b.txt")).unwrap();
        assert!(matches!(all(&inner), Err(FilesError::None { .. })));
        assert!(matches!(all(&inner.join("nothing")), Err(FilesError::Read { .. })));
    }
}
