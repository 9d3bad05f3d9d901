//! Tables of tag reads.
//!
//! In: one of three kinds of text files, told apart by their first line. Out: a [`ReadTable`], sorted by time, exact
//! duplicates dropped and counted. A row that breaks the format is an error with its line: a table is not repaired by
//! guessing.
//!
//! | kind | first line | see |
//! |---|---|---|
//! | RF-HOI | header with `time_us` | [`COLUMNS`], written by [`write_csv`] |
//! | sllurp | header with `timestamp` and `phase_angle` | [`sllurp`] |
//! | RDA sample | numbers | [`rda`] |

pub mod rda;
pub mod sllurp;
mod table;

use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};

use rfhoi_shared::tag::{Epc, TagRead};
use rfhoi_shared::units::{BridgeTime, CentiDbm, DopplerCode, PhaseCode, ReaderTime};

pub use table::{COLUMNS, write_csv};

/// Why a table of reads cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum ReadsError {
    /// The file cannot be read.
    #[error("cannot read the tag reads of {path}: {source}")]
    Open {
        /// The file.
        path: PathBuf,
        /// What the system said; text that is no UTF-8 is `InvalidData`.
        source: io::Error,
    },
    /// The first line fits none of the kinds.
    #[error(
        "{path} is no table of tag reads: its first line has neither the column `time_us` (RF-HOI), nor `timestamp` and \
         `phase_angle` (sllurp), nor seven numbers (RDA)"
    )]
    UnknownKind {
        /// The file.
        path: PathBuf,
    },
    /// No reads.
    #[error("{path} holds no tag reads: did the reader see a tag?")]
    Empty {
        /// The file.
        path: PathBuf,
    },
    /// A column is not there.
    #[error("{path} has no column `{column}`; its header is `{header}`")]
    MissingColumn {
        /// The file.
        path: PathBuf,
        /// Name of the column.
        column: &'static str,
        /// First line of the file.
        header: String,
    },
    /// A row breaks the format.
    #[error("{path}, line {line}: {reason}")]
    Row {
        /// The file.
        path: PathBuf,
        /// Number of the line, from 1.
        line: u64,
        /// What is wrong with it.
        reason: String,
    },
}

/// What a sample is labelled with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Annotation {
    /// Number of the person.
    pub person: u32,
    /// Number of the activity.
    pub activity: u32,
}

/// Reads of a table.
#[derive(Debug, Clone, PartialEq)]
pub struct ReadTable {
    /// The reads, sorted by time. Where [`Self::epoch`] is set their time counts from it, else it is the bridge's.
    pub reads: Vec<TagRead>,
    /// Rows that repeated another one exactly and were dropped.
    pub duplicates: usize,
    /// Reader's time of the first read, where the table is in reader's time.
    pub epoch: Option<ReaderTime>,
    /// What the table is labelled with, if anything.
    pub annotation: Option<Annotation>,
}

impl ReadTable {
    /// Reads the table at `path`, whichever kind it is.
    ///
    /// # Errors
    /// Any [`ReadsError`].
    pub fn open(path: impl AsRef<Path>) -> Result<Self, ReadsError> {
        let path = path.as_ref();
        let contents = std::fs::read_to_string(path)
            .map_err(|source| ReadsError::Open { path: path.to_path_buf(), source })?;
        Self::parse(path, &contents)
    }

    /// Reads a table from its contents; `name` stands for the path in errors.
    ///
    /// # Errors
    /// Any [`ReadsError`] but `Open`.
    pub fn parse(name: impl AsRef<Path>, contents: &str) -> Result<Self, ReadsError> {
        let path = name.as_ref();
        // Spreadsheets put a byte order mark before the first column's name.
        let contents = contents.trim_start_matches('\u{feff}');
        let Some(first) = contents.lines().find(|line| !line.trim().is_empty()) else {
            return Err(ReadsError::Empty { path: path.to_path_buf() });
        };
        let has = |column: &str| first.split(',').any(|c| c.trim() == column);
        if has(table::TIME) {
            Self::sorted(path, Columns::new(path, contents)?.reads(table::row)?, None)
        } else if has(sllurp::TIMESTAMP) && has(sllurp::PHASE_ANGLE) {
            Self::in_reader_time(path, Columns::new(path, contents)?.reads(sllurp::row)?, None)
        } else if rda::is_row(first) {
            let (reads, annotation) = rda::reads(path, contents)?;
            Self::in_reader_time(path, reads, Some(annotation))
        } else {
            Err(ReadsError::UnknownKind { path: path.to_path_buf() })
        }
    }

    /// A table whose rows are in the reader's time: its times count from the first read.
    fn in_reader_time(
        path: &Path,
        reads: Vec<TagRead>,
        annotation: Option<Annotation>,
    ) -> Result<Self, ReadsError> {
        let mut table = Self::sorted(path, reads, annotation)?;
        let first = table.reads.first().map_or(BridgeTime(0), |read| read.time);
        for read in &mut table.reads {
            read.time = BridgeTime(read.time.since(first));
        }
        table.epoch = Some(ReaderTime(first.0));
        Ok(table)
    }

    fn sorted(
        path: &Path,
        mut reads: Vec<TagRead>,
        annotation: Option<Annotation>,
    ) -> Result<Self, ReadsError> {
        if reads.is_empty() {
            return Err(ReadsError::Empty { path: path.to_path_buf() });
        }
        let rows = reads.len();
        // All fields, so that exact duplicates lie side by side.
        let key = |r: &TagRead| (r.time, r.antenna, r.channel, r.phase.map(|p| p.0), r.rssi, r.doppler);
        reads.sort_by(|a, b| key(a).cmp(&key(b)).then_with(|| a.epc.cmp(&b.epc)));
        reads.dedup();
        Ok(Self { duplicates: rows - reads.len(), reads, epoch: None, annotation })
    }
}

/// A comma-separated table with a header.
struct Columns<'a> {
    path: &'a Path,
    reader: csv::Reader<&'a [u8]>,
    header: csv::StringRecord,
    places: BTreeMap<String, usize>,
}

impl<'a> Columns<'a> {
    fn new(path: &'a Path, contents: &'a str) -> Result<Self, ReadsError> {
        let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(contents.as_bytes());
        let header = reader.headers().map_err(|e| csv_error(path, &e))?.clone();
        let places = header.iter().enumerate().map(|(place, name)| (name.to_owned(), place)).collect();
        Ok(Self { path, reader, header, places })
    }

    /// The reads of all rows, each made by `row`.
    fn reads(mut self, row: fn(&Row<'_>) -> Result<TagRead, RowError>) -> Result<Vec<TagRead>, ReadsError> {
        let mut reads = Vec::new();
        let mut record = csv::StringRecord::new();
        while self.reader.read_record(&mut record).map_err(|e| csv_error(self.path, &e))? {
            let line = record.position().map_or(0, csv::Position::line);
            match row(&Row { record: &record, places: &self.places }) {
                Ok(read) => reads.push(read),
                Err(RowError::MissingColumn(column)) => {
                    let header = self.header.iter().collect::<Vec<_>>().join(",");
                    return Err(ReadsError::MissingColumn { path: self.path.to_path_buf(), column, header });
                }
                Err(RowError::Field(reason)) => {
                    return Err(ReadsError::Row { path: self.path.to_path_buf(), line, reason });
                }
            }
        }
        Ok(reads)
    }
}

fn csv_error(path: &Path, error: &csv::Error) -> ReadsError {
    let line = error.position().map_or(1, csv::Position::line);
    let reason = match error.kind() {
        csv::ErrorKind::UnequalLengths { expected_len, len, .. } => {
            format!("{len} fields where the header has {expected_len}: was the file cut?")
        }
        _ => error.to_string(),
    };
    ReadsError::Row { path: path.to_path_buf(), line, reason }
}

/// Why a row gives no read.
#[derive(Debug)]
enum RowError {
    MissingColumn(&'static str),
    Field(String),
}

fn field_error(name: &str, text: &str, expected: &str) -> RowError {
    RowError::Field(format!("{name} is `{text}`, expected {expected}"))
}

/// One row of a table with a header.
struct Row<'a> {
    record: &'a csv::StringRecord,
    places: &'a BTreeMap<String, usize>,
}

impl<'a> Row<'a> {
    /// The field of a column; `None` if the table has no such column or the field is empty.
    fn optional(&self, column: &str) -> Option<&'a str> {
        self.record.get(*self.places.get(column)?).filter(|text| !text.is_empty())
    }

    fn required(&self, column: &'static str) -> Result<&'a str, RowError> {
        let place = self.places.get(column).ok_or(RowError::MissingColumn(column))?;
        Ok(self.record.get(*place).unwrap_or_default())
    }

    fn number<T: std::str::FromStr>(&self, column: &'static str, expected: &str) -> Result<T, RowError> {
        let text = self.required(column)?;
        text.parse().map_err(|_| field_error(column, text, expected))
    }
}

fn epc(name: &str, hex: &str) -> Result<Epc, RowError> {
    match Epc::from_hex(hex) {
        Some(epc) if !epc.bytes().is_empty() => Ok(epc),
        _ => Err(field_error(name, hex, "hexadecimal digits, two for each of 1 to 62 bytes")),
    }
}

fn phase_code(name: &str, text: &str) -> Result<PhaseCode, RowError> {
    match text.parse() {
        Ok(code) if code < PhaseCode::CODES_PER_TURN => Ok(PhaseCode(code)),
        _ => Err(field_error(name, text, "a 12-bit code, 0 to 4095")),
    }
}

fn doppler_code(name: &str, text: &str) -> Result<DopplerCode, RowError> {
    text.parse()
        .map(DopplerCode)
        .map_err(|_| field_error(name, text, "sixteenths of a hertz, -32768 to 32767"))
}

/// A level in dBm, with or without decimals.
fn dbm(name: &str, text: &str) -> Result<CentiDbm, RowError> {
    let centi = text.parse::<f32>().map(|dbm| (dbm * 100.0).round()).unwrap_or(f32::NAN);
    if (-20_000.0..=5_000.0).contains(&centi) {
        Ok(CentiDbm(centi as i16))
    } else {
        Err(field_error(name, text, "a level in dBm, -200 to 50"))
    }
}

#[cfg(test)]
mod tests;
