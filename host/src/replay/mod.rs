//! A recording through the bridge's logic and over the wire, as if the devices were there.
//!
//! ```text
//! file --source--> datagrams, UART bytes, LLRP streams, reads --Bridge (firmware)--> packets --Receiver--> Outcome
//! Outcome --radar, range_azimuth, tags, vibration, aligned--> pictures (.png) and numbers (.npz)
//! ```
//!
//! Nothing is written before the recording has gone through, and every file appears whole.

mod aligned;
mod bridge;
mod radar;
mod range_azimuth;
mod source;
mod tags;
mod vibration;

use std::path::{Path, PathBuf};

use num_complex::Complex;
use rfhoi_shared::config::{BridgeConfig, ClutterRemoval, ConfigError, Processing, RadarConfig, RadarInput};
use rfhoi_shared::radar::RadarProfile;
use rfhoi_shared::scene::{Scene, Unmet};
use rfhoi_shared::tag::TagRead;
use rfhoi_shared::units::{BridgeTime, Metres};
use rfhoi_shared::wire::{DatagramCounts, FrameCounts, HopTable};
use serde::Serialize;

use crate::align::{self, AlignError, AlignedFrame, FrameStream, StreamCounts};
use crate::atomic::WriteError;
use crate::detect::{DetectError, Format, detect};
use crate::inspect::{InspectError, ReadFigures};
use crate::npz::NpzError;
use crate::phase;
use crate::plot::PlotError;
use crate::receive::{LinkCounts, RadarFrame, Received, Receiver};

pub use aligned::AlignedFigures;
use bridge::Bridge;
pub use radar::Strongest;
pub use vibration::Vibration;

/// How a recording is replayed.
#[derive(Debug, Clone)]
pub struct Options {
    /// The radar's profile; needed for recordings of a radar.
    pub profile: Option<RadarProfile>,
    /// The scene: how deep a gate is kept, and how fast tags move.
    pub scene: Scene,
    /// Removal of static clutter, where not the default of the profile.
    pub clutter: Option<ClutterRemoval>,
    /// Keep all range bins instead of the scene's depth.
    pub whole_range: bool,
    /// Measure how a target of raw samples vibrates.
    pub vibration: Option<VibratingTarget>,
    /// Align both radios, with maps of so many points.
    pub aligned: Option<usize>,
}

/// Which target's vibration is measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum VibratingTarget {
    /// The strongest.
    Strongest,
    /// That at this range.
    At(Metres),
}

/// Why a recording cannot be replayed.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// It is not recognised.
    #[error(transparent)]
    Detect(#[from] DetectError),
    /// It cannot be read.
    #[error(transparent)]
    Source(#[from] InspectError),
    /// The bridge refuses the profile or the processing.
    #[error("the bridge refuses this configuration: {0}")]
    Config(#[from] ConfigError),
    /// The profile does not see the scene.
    #[error("{0}; give a smaller --depth or another profile")]
    Scene(#[from] Unmet),
    /// Nothing came out.
    #[error("{path} gave no radar frame and no tag read; `rfhoi inspect` tells what is in it")]
    Nothing {
        /// The recording.
        path: PathBuf,
    },
    /// The user stopped it.
    #[error("stopped; nothing was written")]
    Interrupted,
    /// The folder of the results.
    #[error("cannot make the folder {path}: {source}")]
    Folder {
        /// The folder.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// Aligned frames.
    #[error("no aligned frames: {0}")]
    Align(#[from] AlignError),
    /// A result.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// A result.
    #[error(transparent)]
    Npz(#[from] NpzError),
    /// A picture.
    #[error(transparent)]
    Plot(#[from] PlotError),
}

/// Cells of one gated cube on a PC: that of the largest profile with all its bins.
const CUBE_CELLS: usize = 12 * 256 * 256;

/// What the bridge's logic counted, and what a person should know.
#[derive(Debug, Clone, Default)]
pub struct Bridged {
    /// Datagrams of the radar.
    pub datagrams: DatagramCounts,
    /// Frames of the radar.
    pub frames: FrameCounts,
    /// What was left out of the recording, and why.
    pub notes: Vec<String>,
}

/// Feeds the recording at `path` through the logic of a bridge whose radar is configured for `radar`, and hands each packet
/// that comes out to `emit`, with the time at which it is sent. Packets that a bridge had sent when the recording was made
/// are handed on as they are. `progress` is told the share that is done, 0 to 1, and says whether to go on.
///
/// # Errors
/// If the recording cannot be read, or the bridge refuses the configuration.
pub fn packets(
    path: &Path,
    radar: Option<&RadarConfig>,
    emit: &mut dyn FnMut(BridgeTime, &[u8]),
    progress: &mut dyn FnMut(f64) -> bool,
) -> Result<Bridged, ReplayError> {
    let mut cube = vec![Complex::default(); CUBE_CELLS];
    let mut bridge = Bridge::new(&mut cube, emit);
    let mut notes = Vec::new();
    source::feed(path, radar, &mut bridge, &mut notes, progress)?;
    let (datagrams, frames) = bridge.counts();
    Ok(Bridged { datagrams, frames, notes })
}

/// The host's end of the wire: all that came out of the bridge.
struct Outcome {
    receiver: Receiver,
    frames: Vec<RadarFrame>,
    tag_reads: Vec<TagRead>,
    hop_table: Option<HopTable>,
    stream: Option<FrameStream>,
    aligned: Vec<AlignedFrame>,
}

impl Outcome {
    fn new(stream: Option<FrameStream>) -> Self {
        Self {
            receiver: Receiver::new(),
            frames: Vec::new(),
            tag_reads: Vec::new(),
            hop_table: None,
            stream,
            aligned: Vec::new(),
        }
    }

    fn packet(&mut self, bytes: &[u8]) {
        // What is wrong is counted.
        let _ = self.receiver.push(bytes);
        self.collect();
    }

    fn finish(&mut self) {
        self.receiver.finish();
        self.collect();
    }

    fn collect(&mut self) {
        let now = self.receiver.time();
        while let Some(received) = self.receiver.next() {
            if let Some(stream) = &mut self.stream {
                stream.take(&received, now);
                self.aligned.extend(std::iter::from_fn(|| stream.next()));
            }
            match received {
                Received::Frame(frame) => self.frames.push(frame),
                Received::Reads(reads) => self.tag_reads.extend(reads),
                Received::HopTable(table) => self.hop_table = Some(table),
                _ => {}
            }
        }
    }
}

/// What a replay found and wrote.
#[derive(Debug, Clone, Serialize)]
pub struct Summary {
    /// The recording.
    pub file: PathBuf,
    /// Frames at the host.
    pub radar_frames: usize,
    /// Frames without a hole.
    pub frames_complete: u32,
    /// Frames with a hole: zero-filled, marked.
    pub frames_incomplete: u32,
    /// Frames of which nothing came.
    pub frames_lost: u32,
    /// Datagrams of the radar that were taken.
    pub datagrams: u32,
    /// Datagrams that never came.
    pub datagrams_lost: u32,
    /// Datagrams that came twice.
    pub datagrams_duplicate: u32,
    /// Datagrams that came too late.
    pub datagrams_late: u32,
    /// Datagrams that are none, or do not fit.
    pub datagrams_malformed: u32,
    /// Words at the ADC's limits.
    pub words_clipped: u64,
    /// The wire between bridge and host.
    pub uplink: LinkCounts,
    /// Strongest moving target over all frames.
    pub strongest_moving: Option<Strongest>,
    /// How the strongest target vibrates, or that at the range asked for.
    pub vibration: Option<Vibration>,
    /// Figures of the tag reads.
    pub tag_reads: Option<ReadFigures>,
    /// Frames of both radios.
    pub aligned: Option<AlignedFigures>,
    /// Files that were written.
    pub outputs: Vec<PathBuf>,
    /// What a person should know.
    pub notes: Vec<String>,
}

/// Replays the recording at `path` and writes pictures and numbers to the folder `out`. `progress` is told the share
/// that is done, 0 to 1, and says whether to go on.
///
/// # Errors
/// If the recording cannot be read, the bridge refuses the configuration, nothing comes out, or a result cannot be
/// written.
pub fn replay(
    path: &Path,
    options: &Options,
    out: &Path,
    progress: &mut dyn FnMut(f64) -> bool,
) -> Result<Summary, ReplayError> {
    let config = options.profile.as_ref().map(|profile| configuration(profile, options)).transpose()?;
    let stream = options.aligned.map(|points| {
        // Tags alone have no radar to be aligned with, but its frame period.
        let radar = config.clone().unwrap_or_else(|| BridgeConfig::default().radar);
        let settings = align::Settings { points, ..align::Settings::new(radar) };
        let phases = phase::Settings { scene: options.scene, ..settings.phases };
        FrameStream::new(align::Settings { phases, ..settings })
    });
    let mut outcome = Outcome::new(stream.transpose()?);
    let Bridged { datagrams, frames, mut notes } =
        packets(path, config.as_ref(), &mut |_, packet| outcome.packet(packet), progress)?;
    outcome.finish();
    if outcome.frames.is_empty() && outcome.tag_reads.is_empty() {
        return Err(ReplayError::Nothing { path: path.to_path_buf() });
    }
    std::fs::create_dir_all(out).map_err(|source| ReplayError::Folder { path: out.to_path_buf(), source })?;
    let mut outputs = Vec::new();
    let mut strongest_moving = None;
    if let Some(config) = config.as_ref().filter(|_| !outcome.frames.is_empty()) {
        let series = radar::RadarSeries::new(config, &outcome.frames);
        strongest_moving = series.strongest();
        outputs.extend(series.write(out)?);
        if matches!(detect(path)?, Format::AdcBin | Format::AdcNpy) {
            outputs.extend(range_azimuth::write(path, config, out, progress)?);
        }
    }
    let vibration = match (options.vibration, &options.profile) {
        (Some(target), Some(profile)) => {
            let range = match target {
                VibratingTarget::Strongest => None,
                VibratingTarget::At(range) => Some(range),
            };
            let found = vibration::measure(path, profile, range, progress)?;
            outputs.extend(found.write(out)?);
            Some(found)
        }
        _ => None,
    };
    let tag_reads = if outcome.tag_reads.is_empty() {
        None
    } else {
        let (figures, written) =
            tags::write(out, &outcome.tag_reads, outcome.hop_table.as_ref(), options.scene, &mut notes)?;
        outputs.extend(written);
        Some(figures)
    };
    let aligned = match &mut outcome.stream {
        Some(stream) => {
            stream.finish();
            outcome.aligned.extend(std::iter::from_fn(|| stream.next()));
            let counts = StreamCounts { link: outcome.receiver.counts(), ..stream.counts() };
            let (figures, written) = aligned::write(out, &outcome.aligned, stream, counts)?;
            outputs.extend(written);
            Some(figures)
        }
        None => None,
    };
    Ok(Summary {
        file: path.to_path_buf(),
        radar_frames: outcome.frames.len(),
        frames_complete: frames.complete,
        frames_incomplete: frames.incomplete,
        frames_lost: frames.lost,
        datagrams: datagrams.received,
        datagrams_lost: datagrams.lost,
        datagrams_duplicate: datagrams.duplicate,
        datagrams_late: datagrams.late,
        datagrams_malformed: datagrams.malformed,
        words_clipped: outcome.frames.iter().filter_map(|f| f.info).map(|i| u64::from(i.clipped)).sum(),
        uplink: outcome.receiver.counts(),
        strongest_moving,
        vibration,
        tag_reads,
        aligned,
        outputs,
        notes,
    })
}

/// What the bridge is told for `profile` and the options.
fn configuration(profile: &RadarProfile, options: &Options) -> Result<RadarConfig, ReplayError> {
    // A recording is replayed as far as it reaches: only a gate that was asked for must fit.
    let depth = if options.whole_range { profile.range_span() } else { options.scene.depth };
    let gate = if depth > profile.range_span() {
        return Err(Unmet::Depth { needed: depth, span: profile.range_span() }.into());
    } else {
        profile.gate_to(Metres(depth.0))
    };
    let mut processing = Processing::with_gate(profile, gate);
    processing.clutter = options.clutter.unwrap_or(processing.clutter);
    Ok(RadarConfig { profile: profile.clone(), input: RadarInput::Uart, processing })
}
