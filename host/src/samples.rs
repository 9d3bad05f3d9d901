//! Raw ADC samples from files, as the byte stream that the radar sends over LVDS.
//!
//! In: a DCA1000 `.bin` file, or a NumPy `.npy` array. Out: the bytes of a 2-lane link, I first (TI SWRA581):
//! little-endian 16-bit words `I0 I1 Q0 Q1` for every two complex samples, real samples one word each. The order of
//! receivers and chirps is the file's. [`crate::datagrams`] cuts the stream into what a DCA1000EVM would send.
//!
//! | file | what it holds | words of the stream |
//! |---|---|---|
//! | `.bin` | what the recorder wrote | unchanged, whichever of I and Q came first |
//! | `.npy`, int16 or uint16, 1 to 4 axes | words of a `.bin` file, or real samples | unchanged |
//! | `.npy`, float32 or float64, 1 to 4 axes | real samples in ADC codes | rounded |
//! | `.npy`, complex64 or complex128, 1 to 4 axes, the last one the samples of a chirp | I + jQ in ADC codes | rounded, `I0 I1 Q0 Q1` |
//!
//! Some programs decode samples as unsigned, so that -1 is stored as 65535. Codes above 32767 give that away; they are
//! wrapped back and [counted](Repair::rewrapped).

use std::fs::File;
use std::io::{self, BufReader, Cursor, Read};
use std::path::{Path, PathBuf};

use ndarray::{ArrayD, ArrayViewD};
use ndarray_npy::npy::header::Header;
use ndarray_npy::{ReadNpyExt, ReadableElement};
use num_complex::Complex;

/// Why a file gives no samples.
#[derive(Debug, thiserror::Error)]
pub enum SampleError {
    /// The file cannot be read.
    #[error("cannot read {path}: {source}")]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// Neither `.bin` nor `.npy`.
    #[error("{path}: samples come from `.bin` (DCA1000) or `.npy` (NumPy) files; rename or convert it")]
    Extension {
        /// The file.
        path: PathBuf,
    },
    /// No 16-bit words, or half a word too much.
    #[error("{path} has {bytes} bytes, not a positive number of 16-bit words: is the recording complete?")]
    Words {
        /// The file.
        path: PathBuf,
        /// Its size.
        bytes: u64,
    },
    /// The `.npy` header or data is broken.
    #[error("{path} is no readable .npy file: {reason}; save it again with `numpy.save`")]
    Npy {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// Its array is not one of samples.
    #[error("{path} holds an array of type {descriptor} and shape {shape:?}: {reason}")]
    Array {
        /// The file.
        path: PathBuf,
        /// NumPy's name of the type.
        descriptor: String,
        /// Length of each axis.
        shape: Vec<usize>,
        /// Why it cannot be used and what to do.
        reason: &'static str,
    },
    /// A value is no ADC code.
    #[error(
        "{path}: sample {index} (counted in C order from 0) is {value}, no 16-bit ADC code; scale before saving"
    )]
    NoCode {
        /// The file.
        path: PathBuf,
        /// Index of the sample in C order.
        index: usize,
        /// Its value, or the part (I or Q) that is none.
        value: f64,
    },
    /// Negative values beside values above 32767.
    #[error(
        "{path} has {above} values above 32767 beside negative ones: neither signed nor unsigned 16-bit codes"
    )]
    MixedSigns {
        /// The file.
        path: PathBuf,
        /// How many are above.
        above: u64,
    },
    /// All values within -1 to 1, with fractions.
    #[error(
        "{path}: all values lie between -1 and 1, so they were normalised; multiply by 32768 before saving"
    )]
    Normalised {
        /// The file.
        path: PathBuf,
    },
}

/// What had to be done to the values of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Repair {
    /// Words that had been decoded as unsigned and were wrapped back (65535 is -1).
    pub rewrapped: u64,
    /// Words that were no whole numbers and were rounded.
    pub rounded: u64,
}

/// Samples of a file as a stream of bytes; read it with [`Read`].
pub struct RawSamples {
    stream: Box<dyn Read + Send>,
    bytes: u64,
    repair: Repair,
}

impl RawSamples {
    /// Opens a `.bin` or `.npy` file. A `.bin` file is streamed, an `.npy` file read whole.
    ///
    /// # Errors
    /// Any [`SampleError`].
    pub fn open(path: impl AsRef<Path>) -> Result<Self, SampleError> {
        let path = path.as_ref();
        let read_error = |source| SampleError::Read { path: path.to_path_buf(), source };
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
        match extension.to_ascii_lowercase().as_str() {
            "bin" => {
                let file = File::open(path).map_err(read_error)?;
                let bytes = file.metadata().map_err(read_error)?.len();
                if bytes == 0 || bytes % 2 != 0 {
                    return Err(SampleError::Words { path: path.to_path_buf(), bytes });
                }
                Ok(Self { stream: Box::new(BufReader::new(file)), bytes, repair: Repair::default() })
            }
            "npy" => Self::from_npy(path, &std::fs::read(path).map_err(read_error)?),
            _ => Err(SampleError::Extension { path: path.to_path_buf() }),
        }
    }

    /// Takes the contents of an `.npy` file; `name` stands for the path in errors.
    ///
    /// # Errors
    /// Any [`SampleError`] but `Read` and `Extension`.
    pub fn from_npy(name: impl AsRef<Path>, contents: &[u8]) -> Result<Self, SampleError> {
        let words = Words::from_npy(name.as_ref(), contents)?;
        let stream: Vec<u8> = words.codes.iter().flat_map(|code| code.to_le_bytes()).collect();
        let bytes = stream.len() as u64;
        Ok(Self { stream: Box::new(Cursor::new(stream)), bytes, repair: words.repair })
    }

    /// Bytes of the whole stream.
    pub fn stream_bytes(&self) -> u64 {
        self.bytes
    }

    /// What had to be done to the values. Worth telling the user if it is not nothing.
    pub fn repair(&self) -> Repair {
        self.repair
    }
}

impl Read for RawSamples {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.stream.read(buffer)
    }
}

/// Words of the stream, made from an array.
struct Words {
    codes: Vec<i16>,
    repair: Repair,
}

impl Words {
    fn from_npy(path: &Path, contents: &[u8]) -> Result<Self, SampleError> {
        let npy_error = |reason: String| SampleError::Npy { path: path.to_path_buf(), reason };
        // The header's length is checked before the parser makes room for it.
        if header_bytes(contents).is_none_or(|bytes| bytes > contents.len()) {
            return Err(npy_error("it ends within its header, or is of another format".to_owned()));
        }
        let mut data = contents;
        let header = Header::from_reader(&mut data).map_err(|e| npy_error(e.to_string()))?;
        let descriptor = header.type_descriptor.to_string();
        let array_error = |reason| SampleError::Array {
            path: path.to_path_buf(),
            descriptor: descriptor.clone(),
            shape: header.shape.clone(),
            reason,
        };
        // `'<c16'`: quote, byte order, kind and size.
        let kind = descriptor.trim_matches('\'').get(1..).unwrap_or_default();
        let size = match kind {
            "i2" | "u2" => 2,
            "f4" => 4,
            "f8" | "c8" => 8,
            "c16" => 16,
            _ => return Err(array_error("need int16, uint16, float32, float64, complex64 or complex128")),
        };
        if !(1..=4).contains(&header.shape.len()) {
            return Err(array_error("need 1 to 4 axes, the last one the samples of a chirp"));
        }
        let needed = header.shape.iter().try_fold(size, |product: usize, &n| product.checked_mul(n));
        if needed != Some(data.len()) {
            let have = data.len();
            return Err(npy_error(format!(
                "shape {:?} of {descriptor} does not fit its {have} bytes",
                header.shape
            )));
        }
        if data.is_empty() {
            return Err(array_error("it is empty"));
        }
        let complex = kind.starts_with('c');
        if complex && header.shape.last().is_some_and(|n| n % 2 != 0) {
            return Err(array_error(
                "the last axis must be even: a link's words carry two complex samples at a time",
            ));
        }
        let mut encoder = Encoder::new(path);
        match kind {
            "i2" => encoder.real(read::<i16>(path, contents)?.view())?,
            "u2" => encoder.real(read::<u16>(path, contents)?.view())?,
            "f4" => encoder.real(read::<f32>(path, contents)?.view())?,
            "f8" => encoder.real(read::<f64>(path, contents)?.view())?,
            "c8" => encoder.complex(read::<Complex<f32>>(path, contents)?.view())?,
            _ => encoder.complex(read::<Complex<f64>>(path, contents)?.view())?,
        }
        encoder.finish()
    }
}

/// Bytes up to the end of the header of an `.npy` file (NEP 1): magic and version 8, length 2 or 4, header.
fn header_bytes(contents: &[u8]) -> Option<usize> {
    let version = *contents.get(6)?;
    let length = contents.get(8..)?;
    if version == 1 {
        Some(10 + usize::from(u16::from_le_bytes(*length.first_chunk()?)))
    } else {
        Some(12 + usize::try_from(u32::from_le_bytes(*length.first_chunk()?)).ok()?)
    }
}

fn read<T: ReadableElement>(path: &Path, contents: &[u8]) -> Result<ArrayD<T>, SampleError> {
    ArrayD::read_npy(contents)
        .map_err(|e| SampleError::Npy { path: path.to_path_buf(), reason: e.to_string() })
}

/// Makes ADC codes of values.
struct Encoder<'a> {
    path: &'a Path,
    words: Words,
    negative: bool,
    largest: f64,
}

impl<'a> Encoder<'a> {
    fn new(path: &'a Path) -> Self {
        let words = Words { codes: Vec::new(), repair: Repair::default() };
        Self { path, words, negative: false, largest: 0.0 }
    }

    fn real<T: Copy + Into<f64>>(&mut self, values: ArrayViewD<'_, T>) -> Result<(), SampleError> {
        for (index, &value) in values.iter().enumerate() {
            let code = self.code(index, value.into())?;
            self.words.codes.push(code);
        }
        Ok(())
    }

    fn complex<T: Copy + Into<f64>>(
        &mut self,
        values: ArrayViewD<'_, Complex<T>>,
    ) -> Result<(), SampleError> {
        let mut values = values.iter().enumerate();
        while let (Some((n, first)), Some((_, second))) = (values.next(), values.next()) {
            for (index, value) in [(n, first.re), (n + 1, second.re), (n, first.im), (n + 1, second.im)] {
                let code = self.code(index, value.into())?;
                self.words.codes.push(code);
            }
        }
        Ok(())
    }

    fn code(&mut self, index: usize, value: f64) -> Result<i16, SampleError> {
        let whole = value.round();
        self.words.repair.rounded += u64::from(whole != value);
        self.largest = self.largest.max(value.abs());
        self.negative |= whole < 0.0;
        if (f64::from(i16::MIN)..=f64::from(i16::MAX)).contains(&whole) {
            return Ok(whole as i16);
        }
        if (0.0..=f64::from(u16::MAX)).contains(&whole) {
            self.words.repair.rewrapped += 1;
            return Ok((whole as u16).cast_signed());
        }
        Err(SampleError::NoCode { path: self.path.to_path_buf(), index, value })
    }

    fn finish(self) -> Result<Words, SampleError> {
        let Repair { rewrapped: above, rounded } = self.words.repair;
        if above > 0 && self.negative {
            return Err(SampleError::MixedSigns { path: self.path.to_path_buf(), above });
        }
        if self.largest <= 1.0 && rounded > 0 {
            return Err(SampleError::Normalised { path: self.path.to_path_buf() });
        }
        Ok(self.words)
    }
}

#[cfg(test)]
mod tests {
    use ndarray::{Array1, Array2, ArrayD, IxDyn, ShapeBuilder, array};
    use ndarray_npy::{WritableElement, WriteNpyExt};
    use proptest::prelude::*;

    use super::*;

    fn npy<T: WritableElement>(array: &ArrayD<T>) -> Vec<u8> {
        let mut file = Vec::new();
        array.write_npy(&mut file).unwrap();
        file
    }

    fn words(contents: &[u8]) -> Result<(Vec<i16>, Repair), SampleError> {
        let mut samples = RawSamples::from_npy("test.npy", contents)?;
        let mut bytes = Vec::new();
        samples.read_to_end(&mut bytes).unwrap();
        assert_eq!(bytes.len() as u64, samples.stream_bytes());
        let words = bytes.chunks_exact(2).map(|b| i16::from_le_bytes([b[0], b[1]])).collect();
        Ok((words, samples.repair()))
    }

    fn complex(values: &[(f64, f64)]) -> ArrayD<Complex<f64>> {
        values.iter().map(|&(i, q)| Complex::new(i, q)).collect::<Array1<_>>().into_dyn()
    }

    #[test]
    fn complex_samples_go_out_two_by_two_i_first() {
        let array = complex(&[(1.0, 2.0), (3.0, -4.0), (5.0, 6.0), (7.0, 8.0)]);
        assert_eq!(words(&npy(&array)).unwrap(), (vec![1, 3, 2, -4, 5, 7, 6, 8], Repair::default()));
        let single = array.mapv(|z| Complex::new(z.re as f32, z.im as f32));
        assert_eq!(words(&npy(&single)).unwrap().0, [1, 3, 2, -4, 5, 7, 6, 8]);
    }

    #[test]
    fn axes_are_taken_in_c_order_whatever_the_layout() {
        let c = Array2::from_shape_fn((2, 4), |(chirp, n)| Complex::new((10 * chirp + n) as f64, 0.0));
        let mut fortran = Array2::zeros((2, 4).f());
        fortran.assign(&c);
        assert_eq!(words(&npy(&c.clone().into_dyn())).unwrap(), words(&npy(&fortran.into_dyn())).unwrap());
        assert_eq!(words(&npy(&c.into_dyn())).unwrap().0[8..12], [10, 11, 0, 0]);
    }

    #[test]
    fn unsigned_codes_are_wrapped_back_and_counted() {
        let repaired = Repair { rewrapped: 2, rounded: 0 };
        let array = complex(&[(43.0, 65_535.0), (32_768.0, 32_767.0)]);
        assert_eq!(words(&npy(&array)).unwrap(), (vec![43, i16::MIN, -1, i16::MAX], repaired));
        let array = array![65_535_u16, 32_768, 1].into_dyn();
        assert_eq!(words(&npy(&array)).unwrap(), (vec![-1, i16::MIN, 1], repaired));
    }

    #[test]
    fn what_is_no_code_is_refused_with_its_place() {
        let refused = |values: &[(f64, f64)]| words(&npy(&complex(values))).unwrap_err();
        assert!(matches!(refused(&[(0.0, 65_535.0), (-1.0, 0.0)]), SampleError::MixedSigns { above: 1, .. }));
        assert!(matches!(refused(&[(0.0, 0.0), (0.0, 65_536.0)]), SampleError::NoCode { index: 1, .. }));
        assert!(matches!(refused(&[(f64::NAN, 0.0), (0.0, 0.0)]), SampleError::NoCode { index: 0, .. }));
        assert!(matches!(refused(&[(0.25, 0.5), (-1.0, 0.0)]), SampleError::Normalised { .. }));
        assert!(matches!(refused(&[(1.0, 0.0)]), SampleError::Array { .. }), "an odd number of samples");
        let error = words(&npy(&array![1_i64].into_dyn())).unwrap_err().to_string();
        assert!(
            error.contains("test.npy") && error.contains("i8") && error.contains("complex128"),
            "{error}"
        );
        let five = ArrayD::<i16>::zeros(IxDyn(&[1; 5]));
        assert!(matches!(words(&npy(&five)), Err(SampleError::Array { .. })));
    }

    #[test]
    fn a_shape_that_the_file_cannot_hold_is_refused_before_memory_is_taken() {
        let good = npy(&array![1_i16, 2].into_dyn());
        let text = String::from_utf8_lossy(&good[..128]).replace("(2,)", "(9999999999999,)");
        let header = text.find('{').map(|at| &text[at..]).unwrap().trim_end();
        let mut file = b"\x93NUMPY\x01\x00".to_vec();
        file.extend((header.len() as u16 + 1).to_le_bytes());
        file.extend(header.bytes().chain(*b"\n").chain([0; 4]));
        let error = words(&file).unwrap_err().to_string();
        assert!(error.contains("9999999999999"), "{error}");
        let mut long_header = good.clone();
        long_header[6] = 2;
        long_header[8..12].fill(0xff);
        assert!(matches!(words(&long_header), Err(SampleError::Npy { .. })));
    }

    #[test]
    fn bin_files_pass_unchanged() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("adc.bin");
        std::fs::write(&path, [1, 2, 3, 4]).unwrap();
        let mut bytes = Vec::new();
        RawSamples::open(&path).unwrap().read_to_end(&mut bytes).unwrap();
        assert_eq!(bytes, [1, 2, 3, 4]);
        std::fs::write(&path, [1, 2, 3]).unwrap();
        assert!(matches!(RawSamples::open(&path), Err(SampleError::Words { bytes: 3, .. })));
        assert!(matches!(RawSamples::open("adc.mat"), Err(SampleError::Extension { .. })));
        assert!(matches!(RawSamples::open("/nonexistent.npy"), Err(SampleError::Read { .. })));
    }

    proptest! {
        #[test]
        fn arbitrary_bytes_never_panic(
            bytes in prop::collection::vec(any::<u8>(), 0..200),
            whole in any::<bool>(),
            flip in any::<prop::sample::Index>(),
            with in any::<u8>(),
        ) {
            let start = if whole { npy(&array![1_i16, 2].into_dyn()) } else { b"\x93NUMPY".to_vec() };
            let mut file = [start, bytes].concat();
            let at = flip.index(file.len());
            file[at] ^= with;
            let _ = words(&file);
        }
    }
}
