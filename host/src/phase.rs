//! From tag phases to phase differences that mean something.
//!
//! In: [`TagRead`]s in the order of time, and the reader's [`ChannelPlan`]. Out: for each read with a phase a
//! [`PhaseSample`]: the raw phase, the phase corrected for its channel, and the step since the last read of the same tag
//! by the same antenna, or [why there is none](Invalid). [`PhaseReport`] sums a recording up in figures.
//!
//! # What is corrected, and what is not
//!
//! The phase of a read is `4 pi d / lambda + offset`, modulo `2 pi`; the offset depends on tag, antenna and channel. A
//! reader in the FCC's band hops to another channel every 0.2 to 0.4 s, so the phase jumps even if nothing moves. The
//! offsets are learnt as the paper does, from the initial readings ([`calibration`]): while tag and people are still, the
//! phase of each (tag, antenna, channel) at its first visit becomes zero.
//!
//! * Reads from which an offset is learnt give no corrected phase, so a figure from corrected phases is held out.
//! * The phase is never unwrapped: a step is a difference wrapped to (-pi, pi], and valid only if the scene's fastest tag
//!   cannot have turned the phase by more than half a turn meanwhile
//!   ([`Scene::longest_read_interval`]).
//! * Within a channel a step needs no offset. Across a hop it needs both channels' offsets, and carries an error of
//!   `4 pi dd df / c` for a tag that is `dd` away from where it was calibrated: 0.42 rad for 1 m and 10 MHz.
//! * Readers lock to the carrier with an ambiguity of pi in some modes. It is [found](ambiguity) and marked, not folded
//!   away: folding would halve the speed that can be carried.

pub mod ambiguity;
pub mod calibration;
mod channels;
pub mod circular;
mod filter;
mod frames;
mod invalid;
mod offsets;
mod pipeline;
mod reader_clock;
mod report;
mod rest;
mod settings;
mod track;
mod tracks;

pub use channels::ChannelPlan;
pub use frames::{Dropped, PhaseFrame, PhaseFrames};
pub use invalid::Invalid;
pub use pipeline::{PhasePipeline, PhaseSample, Step};
pub use report::{IntervalCounts, PhaseReport, analyse};
pub use settings::Settings;

use rfhoi_shared::tag::{Epc, TagRead};
use rfhoi_shared::units::{AntennaPort, ChannelIndex};
use serde::Serialize;

#[cfg(doc)]
use rfhoi_shared::scene::Scene;

/// Tags of a frame; reads of more are counted and left out.
pub const MAX_TAGS: usize = 64;
/// Antennas of a frame, the ports of a reader; reads of more are counted and left out.
pub const MAX_ANTENNAS: usize = 4;
/// Channels of a hop table (the FCC's band has 50); reads on more are as of an unknown channel.
pub const MAX_CHANNELS: usize = 64;

/// Reads that share one offset of the phase.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PhaseKey {
    /// Which tag.
    pub epc: Epc,
    /// Which antenna.
    pub antenna: AntennaPort,
    /// Which channel.
    pub channel: ChannelIndex,
}

impl PhaseKey {
    /// The key of a read.
    pub fn of(read: &TagRead) -> Self {
        Self { epc: read.epc.clone(), antenna: read.antenna, channel: read.channel }
    }
}

/// As `epc/antenna/channel`, for reports.
impl std::fmt::Display for PhaseKey {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}/{}/{}", self.epc, self.antenna.0, self.channel.0)
    }
}

impl Serialize for PhaseKey {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

#[cfg(test)]
mod tests;
