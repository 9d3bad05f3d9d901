//! Named arrays in one `.npz` file, as `numpy.load` reads them.

use std::path::{Path, PathBuf};

use ndarray::{ArrayBase, Data, Dimension};
use ndarray_npy::{NpzWriter, WritableElement, WriteNpzError};

use crate::atomic::{AtomicFile, WriteError};

/// Why an `.npz` file was not written.
#[derive(Debug, thiserror::Error)]
pub enum NpzError {
    /// The file itself.
    #[error(transparent)]
    File(#[from] WriteError),
    /// One of its arrays.
    #[error("cannot write array `{name}` to {path}: {source}")]
    Array {
        /// The file.
        path: PathBuf,
        /// Name of the array.
        name: String,
        /// What the encoder said.
        source: WriteNpzError,
    },
    /// The archive's directory.
    #[error("cannot finish {path}: {source}; check that the disk has room")]
    Finish {
        /// The file.
        path: PathBuf,
        /// What the encoder said.
        source: WriteNpzError,
    },
}

/// An `.npz` file in the making; it appears when it is [finished](Self::finish).
///
/// ```
/// # let directory = tempfile::tempdir().unwrap();
/// # let path = directory.path().join("maps.npz");
/// use ndarray::{Array2, array};
/// use rfhoi::npz::Npz;
///
/// Npz::create(&path)?
///     .array("range_doppler_db", &Array2::<f32>::zeros((72, 64)))?
///     .array("time_us", &array![0_u64])?
///     .finish()?;
/// # Ok::<(), rfhoi::npz::NpzError>(())
/// ```
pub struct Npz {
    writer: NpzWriter<AtomicFile>,
    path: PathBuf,
}

impl Npz {
    /// Starts the file; its arrays are compressed.
    ///
    /// # Errors
    /// [`NpzError::File`].
    pub fn create(path: impl AsRef<Path>) -> Result<Self, NpzError> {
        let path = path.as_ref().to_path_buf();
        Ok(Self { writer: NpzWriter::new_compressed(AtomicFile::create(&path)?), path })
    }

    /// Starts the file with arrays as they are, which are read much faster: for files that are read often.
    ///
    /// # Errors
    /// [`NpzError::File`].
    pub fn create_stored(path: impl AsRef<Path>) -> Result<Self, NpzError> {
        let path = path.as_ref().to_path_buf();
        Ok(Self { writer: NpzWriter::new(AtomicFile::create(&path)?), path })
    }

    /// Adds an array of any shape and numeric type. Names must differ.
    ///
    /// # Errors
    /// [`NpzError::Array`].
    pub fn array<A, S, D>(mut self, name: &str, array: &ArrayBase<S, D>) -> Result<Self, NpzError>
    where
        A: WritableElement,
        S: Data<Elem = A>,
        D: Dimension,
    {
        match self.writer.add_array(name, array) {
            Ok(()) => Ok(self),
            Err(source) => Err(NpzError::Array { path: self.path, name: name.to_owned(), source }),
        }
    }

    /// Completes the file and puts it in its place.
    ///
    /// # Errors
    /// [`NpzError::Finish`] or [`NpzError::File`].
    pub fn finish(self) -> Result<(), NpzError> {
        match self.writer.finish() {
            Ok(file) => Ok(file.commit()?),
            Err(source) => Err(NpzError::Finish { path: self.path, source }),
        }
    }
}

#[cfg(test)]
mod tests {
    use ndarray::{Array1, Array3, array};
    use ndarray_npy::NpzReader;
    use num_complex::Complex;

    use super::*;

    #[test]
    fn arrays_come_back_and_bytes_repeat() {
        let directory = tempfile::tempdir().unwrap();
        let cube = Array3::from_shape_fn((2, 3, 4), |(a, b, c)| Complex::new(a as f32, (b * 4 + c) as f32));
        let times = array![1_u64, 100_001];
        let write = |name: &str| {
            let path = directory.path().join(name);
            Npz::create(&path)
                .unwrap()
                .array("cube", &cube)
                .unwrap()
                .array("time_us", &times)
                .unwrap()
                .finish()
                .unwrap();
            std::fs::read(path).unwrap()
        };
        let bytes = write("a.npz");
        assert_eq!(bytes, write("b.npz"), "the same arrays give the same file");
        let mut reader = NpzReader::new(std::io::Cursor::new(bytes)).unwrap();
        let read: Array3<Complex<f32>> = reader.by_name("cube").unwrap();
        assert_eq!(read, cube);
        let read: Array1<u64> = reader.by_name("time_us").unwrap();
        assert_eq!(read, times);
    }

    #[test]
    fn a_name_twice_is_refused_and_leaves_nothing() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("twice.npz");
        let error =
            Npz::create(&path).unwrap().array("x", &array![1.0_f32]).unwrap().array("x", &array![2.0_f32]);
        let message = error.err().unwrap().to_string();
        assert!(message.contains("`x`") && message.contains("twice.npz"), "{message}");
        assert!(!path.exists());
    }
}
