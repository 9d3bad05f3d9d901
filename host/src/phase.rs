//! From tag phases to phase differences that mean something.
//!
//! In: [`TagRead`]s, and the reader's [`ChannelPlan`]. Out, by one core with two views:
//!
//! * [`PhaseFrames`], for the network: the phase difference of every tag and antenna over each frame, or [why there is
//!   none](Invalid), and [what the frame's reads tell as they are](Sighting). Reads may come a little late; times that cannot be
//!   are told.
//! * [`PhasePipeline`], for inspection: for each read the raw phase, the phase corrected for its channel, and the step since the
//!   last read of the same tag by the same antenna. [`PhaseReport`] sums a recording up in figures.
//!
//! ```text
//! reads --order--> tag, antenna --+--> offsets: learnt, tied, refined while the tag rests
//!                                 +--> filter: one meaning? plausible? --> steps --sum, interpolate--> frames
//!                                 +--> rest: as all antennas see it
//! ```
//!
//! The phase of a read is `4 pi d / lambda + offset`, modulo `2 pi`; it grows as the tag recedes. The offset depends on tag,
//! antenna and channel. A reader in the FCC's band hops to another channel every 0.2 to 0.4 s, so the phase jumps even if
//! nothing moves.
//!
//! # Choices, and their reasons
//!
//! * **Steps are summed.** The paper (section 3.2.2) takes the phase nearest to each instant and differences these; at 0.82 m/s
//!   that turns by pi in 100 ms. A step from read to read of 14 ms carries seven times the speed. A frame's value is the sum of
//!   its valid steps, never unwrapped across one that is not, which leaves the frame invalid with its reason.
//! * **A step has one meaning** if the scene's fastest tag cannot turn the phase by more than half a turn meanwhile
//!   ([`Scene::longest_read_interval`]), or if a Kalman filter of phase and rate says so: where a tag can be after a step is
//!   bounded by its rate so far and by acceleration, and as long as that gate is narrower than a turn, only one number of turns
//!   fits. So a tag that is followed from rest may be faster than promised.
//! * **Out of the gate** is no movement. Near half a turn it is the carrier's sign, which some modes of readers leave open: the
//!   read is left out, not folded, as folding would halve the speed that can be carried. At a hop the offset is stale. Else the
//!   tag is too fast for its reads: that latches until the tag rests, or is read so often that the scene's fastest hand is no
//!   doubt. Doppler does not help: its noise of 7 to 74 Hz is that of 1.2 to 12 m/s.
//! * **Rest is the tag's, not the antenna's.** Four antennas in turn leave 140 ms between the reads of one, for which nothing is
//!   promised. Where the other antennas have seen the tag rest meanwhile, only the time since they looked is unknown.
//! * **Offsets are relative.** A visit of a channel while the tag is still is compared with the visits before; so a tag that was
//!   moved to another place needs no channel anew, channels never visited are learnt whenever the tag rests, and what a place
//!   changes (`4 pi dd df / c`, 0.42 rad for 1 m and 10 MHz) is refined away. While the movement since is known, that term is
//!   taken out of hops. Groups of channels that no rest has tied give no steps between them.
//! * **Held out.** Reads from which an offset is learnt give no corrected phase, and refine it only after they were corrected.
//! * **Phase differences are not rescaled** to one frequency: channels differ by at most 1.4 % from the band's middle.
//! * **Smoothing** is the filter's; a moving average over the paper's instants would blur reads of different channels. The
//!   phase at a border of the grid is interpolated, as up to 7 ms at 1 m/s to the nearest read would be 0.27 rad.

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
mod sighting;
mod track;
mod tracks;

pub use channels::ChannelPlan;
pub use frames::{Dropped, PhaseFrame, PhaseFrames};
pub use invalid::Invalid;
pub use pipeline::{PhasePipeline, PhaseSample, Step};
pub use report::{IntervalCounts, PhaseReport, analyse};
pub use settings::Settings;
pub use sighting::Sighting;

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
