//! A data UART logged as a table: a host time and the bytes of one read in each row, as decimal numbers.
//!
//! ```text
//! Timestamp,RawData
//! 2024-11-28 14:37:18.935901959,"2,1,4,3,6,5,8,7,0,0,6,3,..."
//! ```

use std::path::{Path, PathBuf};

/// Why a table gives no bytes.
#[derive(Debug, thiserror::Error)]
pub enum UartLogError {
    /// It cannot be read, or is no CSV.
    #[error("cannot read {path}: {source}")]
    Csv {
        /// The file.
        path: PathBuf,
        /// What is wrong, and where.
        source: csv::Error,
    },
    /// It has no column of bytes.
    #[error("{path} has no column RawData; its first line must name the columns Timestamp and RawData")]
    NoColumn {
        /// The file.
        path: PathBuf,
    },
    /// A number is no byte.
    #[error("{path}, line {line}: `{value}` is no byte (0 to 255)")]
    NoByte {
        /// The file.
        path: PathBuf,
        /// Number of the line, from 1.
        line: u64,
        /// What is there.
        value: String,
    },
}

/// The rows' bytes, in the order of the table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct UartLog {
    /// One read of the UART a row.
    pub rows: Vec<Vec<u8>>,
}

impl UartLog {
    /// All bytes.
    pub fn bytes(&self) -> Vec<u8> {
        self.rows.concat()
    }
}

/// Reads the table at `path`.
///
/// # Errors
/// Any [`UartLogError`].
pub fn read(path: &Path) -> Result<UartLog, UartLogError> {
    let csv_error = |source| UartLogError::Csv { path: path.to_path_buf(), source };
    let mut table = csv::Reader::from_path(path).map_err(csv_error)?;
    let header = table.headers().map_err(csv_error)?;
    let column = header
        .iter()
        .position(|name| name.trim().eq_ignore_ascii_case("RawData"))
        .ok_or_else(|| UartLogError::NoColumn { path: path.to_path_buf() })?;
    let mut rows = Vec::new();
    for record in table.records() {
        let record = record.map_err(csv_error)?;
        let line = record.position().map_or(0, csv::Position::line);
        let numbers = record.get(column).unwrap_or_default().split(',').map(str::trim);
        let bytes = numbers.filter(|n| !n.is_empty()).map(|n| {
            let error = || UartLogError::NoByte { path: path.to_path_buf(), line, value: n.to_owned() };
            n.parse().map_err(|_| error())
        });
        rows.push(bytes.collect::<Result<_, _>>()?);
    }
    Ok(UartLog { rows })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(contents: &str) -> Result<UartLog, UartLogError> {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), contents).unwrap();
        read(file.path())
    }

    #[test]
    fn rows_become_bytes() {
        let log = parse("Timestamp,RawData\n2024,\"2,1, 4\"\n2025,\"255,\"\n").unwrap();
        assert_eq!(log.rows, [vec![2, 1, 4], vec![255]]);
        assert_eq!(log.bytes(), [2, 1, 4, 255]);
    }

    #[test]
    fn faults_name_their_line() {
        let error = parse("Timestamp,RawData\n1,\"2,1\"\n2,\"256\"\n").unwrap_err().to_string();
        assert!(error.contains("line 3") && error.contains("`256`"), "{error}");
        assert!(parse("a,b\n1,2\n").unwrap_err().to_string().contains("RawData"));
    }
}
