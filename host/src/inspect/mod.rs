//! What is in a recording: one object of figures for each kind of file, units in the names.
//!
//! Bytes go through the same parsers as on the bridge; nothing here decodes a wire format itself.

mod adc;
mod llrp;
mod motion;
mod packets;
mod reads;
mod uart;

pub(crate) use adc::MAX_ROW;
pub(crate) use llrp::MAX_MESSAGE as MAX_LLRP_MESSAGE;
pub use reads::Figures as ReadFigures;
pub(crate) use uart::{CHUNK as UART_CHUNK, MAX_FRAME as MAX_TLV_FRAME};

use std::path::{Path, PathBuf};

use rfhoi_shared::radar::RadarProfile;
use rfhoi_shared::scene::Scene;
use serde::Serialize;
use serde_json::{Map, Value};

use crate::detect::{DetectError, Format, detect};
use crate::motion::MotionError;
use crate::reads::ReadsError;
use crate::recording::RecordingError;
use crate::samples::SampleError;
use crate::uart_log::UartLogError;

/// What a file is looked at with.
#[derive(Debug, Clone, Default)]
pub struct Options {
    /// The radar's profile; raw samples cannot be read without it.
    pub profile: Option<RadarProfile>,
    /// The scene; its fastest tag says which intervals between reads count.
    pub scene: Scene,
    /// Also list frame by frame, message by message, read by read or joint by joint.
    pub list: bool,
}

/// Why a file cannot be looked at.
#[derive(Debug, thiserror::Error)]
pub enum InspectError {
    /// It is not recognised.
    #[error(transparent)]
    Detect(#[from] DetectError),
    /// It cannot be read.
    #[error("cannot read {path}: {source}")]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// Raw samples need a profile.
    #[error(
        "{path} holds raw samples, which do not say how they are to be cut: give --profile FILE (a .cfg, a mmWave Studio \
         log, or paper, fine, bridge), or at least --samples, --receivers, --transmitters and --loops"
    )]
    NoProfile {
        /// The file.
        path: PathBuf,
    },
    /// There is less than one unit of what the file should hold.
    #[error("{path}: {reason}")]
    TooLittle {
        /// The file.
        path: PathBuf,
        /// What is missing, and what to try.
        reason: String,
    },
    /// Raw samples.
    #[error(transparent)]
    Samples(#[from] SampleError),
    /// Packets.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// Tag reads.
    #[error(transparent)]
    Reads(#[from] ReadsError),
    /// Recorded motion.
    #[error(transparent)]
    Motion(#[from] MotionError),
    /// The user stopped it.
    #[error("stopped")]
    Interrupted,
    /// Table of a UART.
    #[error(transparent)]
    UartLog(#[from] UartLogError),
}

/// What a file holds.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// The file.
    pub file: PathBuf,
    /// What it is.
    pub format: &'static str,
    /// Its figures.
    #[serde(flatten)]
    pub figures: Map<String, Value>,
    /// What a person should know about them.
    pub notes: Vec<String>,
    /// Its parts one by one, if asked for.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub list: Vec<Map<String, Value>>,
}

/// Told the share of a file that is done, 0 to 1; says whether to go on.
pub type Progress<'p> = dyn FnMut(f64) -> bool + 'p;

/// Collects a report.
struct Builder<'p> {
    path: PathBuf,
    progress: &'p mut Progress<'p>,
    list: bool,
    notes: Vec<String>,
    parts: Vec<Map<String, Value>>,
}

impl Builder<'_> {
    /// Tells the share that is done.
    fn go_on(&mut self, share: f64) -> Result<(), InspectError> {
        if (self.progress)(share) { Ok(()) } else { Err(InspectError::Interrupted) }
    }

    fn note(&mut self, note: impl Into<String>) {
        self.notes.push(note.into());
    }

    /// Adds to the list, if there is to be one.
    fn part(&mut self, part: impl Serialize) {
        if self.list {
            self.parts.push(object(part));
        }
    }

    fn finish(self, format: &'static str, figures: impl Serialize) -> Report {
        Report { file: self.path, format, figures: object(figures), notes: self.notes, list: self.parts }
    }

    fn too_little(&self, reason: impl Into<String>) -> InspectError {
        InspectError::TooLittle { path: self.path.clone(), reason: reason.into() }
    }
}

/// The fields of a struct.
fn object(value: impl Serialize) -> Map<String, Value> {
    // By way of text, so that an f32 keeps its own digits.
    serde_json::to_string(&value).and_then(|text| serde_json::from_str(&text)).unwrap_or_default()
}

/// Looks at the file at `path`.
///
/// # Errors
/// If it is not recognised, cannot be read, or holds less than one frame, message or read.
pub fn inspect<'p>(
    path: &Path,
    options: &Options,
    progress: &'p mut Progress<'p>,
) -> Result<Report, InspectError> {
    let builder = Builder {
        path: path.to_path_buf(),
        progress,
        list: options.list,
        notes: Vec::new(),
        parts: Vec::new(),
    };
    match detect(path)? {
        Format::AdcBin | Format::AdcNpy => adc::inspect(builder, options),
        Format::Packets => packets::inspect(builder, options),
        Format::Tlv => uart::inspect(builder, &read(path)?, "uart_tlv"),
        Format::TlvCsv => uart::inspect(builder, &crate::uart_log::read(path)?.bytes(), "uart_tlv_csv"),
        Format::Llrp => llrp::inspect(builder, &read(path)?),
        Format::LlrpBody => llrp::inspect_body(builder, &read(path)?),
        Format::Reads => reads::inspect(builder, options),
        Format::Motion => motion::inspect(builder),
    }
}

fn read(path: &Path) -> Result<Vec<u8>, InspectError> {
    std::fs::read(path).map_err(|source| InspectError::Read { path: path.to_path_buf(), source })
}
