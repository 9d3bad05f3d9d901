//! The view read by read: one read in, one sample out.

use rfhoi_shared::tag::TagRead;
use rfhoi_shared::units::BridgeTime;

use super::calibration::Calibration;
use super::tracks::Tracks;
use super::{Invalid, PhaseKey, Settings};

/// From one read of a tag by an antenna to the next.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// How long it took, us.
    pub us: u64,
    /// By how much the phase turned, radians, or why that means nothing. Positive recedes. A tag whose speed is known may turn
    /// it by more than half a turn.
    pub turned: Result<f64, Invalid>,
}

/// What a read says.
#[derive(Debug, Clone, PartialEq)]
pub struct PhaseSample {
    /// When the tag was read.
    pub time: BridgeTime,
    /// Tag, antenna and channel.
    pub key: PhaseKey,
    /// Phase as reported, radians in [0, 2 pi).
    pub raw: f64,
    /// Phase less its channel's offset, radians in (-pi, pi]; `None` until the offset is learnt, and for the reads it is
    /// learnt from. Later reads refine the offset after they have been corrected by it.
    pub corrected: Option<f64>,
    /// Step from the last read of the same tag by the same antenna; `None` for the first. Reads with the carrier's sign turned
    /// are left out: the step after begins before them.
    pub step: Option<Step>,
}

/// Corrects phases read by read. What it keeps grows with the tags, antennas and channels seen, not with time.
#[derive(Debug, Clone)]
pub struct PhasePipeline {
    tracks: Tracks,
}

impl PhasePipeline {
    /// A pipeline that has learnt nothing yet.
    pub fn new(settings: Settings) -> Self {
        Self::with_calibration(settings, &Calibration::default())
    }

    /// A pipeline that starts with offsets learnt before, and learns those that are missing.
    pub fn with_calibration(settings: Settings, calibration: &Calibration) -> Self {
        Self { tracks: Tracks::new(settings, calibration) }
    }

    /// The offsets so far.
    pub fn calibration(&self) -> Calibration {
        self.tracks.calibration()
    }

    /// Takes a read, in the order of time. `None` if it carries no phase.
    pub fn push(&mut self, read: &TagRead) -> Option<PhaseSample> {
        let raw = f64::from(read.phase?.radians());
        let tag = self.tracks.intern(&read.epc);
        let (_, look) = self.tracks.push(tag, read)?;
        Some(PhaseSample {
            time: read.time,
            key: PhaseKey::of(read),
            raw,
            corrected: look.reading.corrected.map(|corrected| corrected.phase),
            step: look.step,
        })
    }
}
