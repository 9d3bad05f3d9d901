//! The RFID reader and its tags.
//!
//! In: a [`Situation`] (where tags and people are), and a [`ReaderSession`] (hop table, phase offsets, tags), which lasts
//! for many samples. Out: [`TagRead`](rfhoi_shared::tag::TagRead)s, or the LLRP [`report`]s that carry them.
//!
//! ```text
//! [channel] hop table, dwell, offsets -+
//! [link] paths, blockers -> power, phase -> [inventory] rounds of [gen2] slots -> [measurement] -> reads -> [report]
//! ```
//!
//! | effect | on | off |
//! |---|---|---|
//! | `tag_positions` | the caller gives the tags' positions | the caller gives the hand's for the tag that it moves |
//! | `hopping` | 50 channels, 0.2 s on each, an offset for each (channel, antenna, tag) | one channel, no offsets |
//! | `inventory` | slots, collisions, tags without power | even reads in turn, random loss |
//! | `tag_multipath` | six images: walls, floor, ceiling | the direct path |
//! | `blockage` | 8.3 dB by body and hand | nothing is in the way |
//! | `pi_ambiguity` | weak phases may be half a turn off | none is |
//! | `phase_error` | noise, and phase in steps of 4 codes | 12-bit codes of the true value |
//!
//! Fingers on a tag ([`Circumstance::Hand`](super::circumstance::Circumstance::Hand)) are no effect but a circumstance: they
//! add to the tag's loss each way, whatever the switches say, so that the tag may fall silent.
//!
//! Parameters that recordings give stand beside their figures: hops in [`channel`], rounds in [`inventory`], levels in
//! [`link`], noise in [`measurement`]. The recordings are of Impinj R420 readers: `rfid_phase/crozenboom` (one tag on 50
//! channels) and the 2,927 samples of `rfid_phase/cwnu_rda_10_volunteers` ("RDA": 2 to 16 worn tags, one antenna,
//! evaluated with numpy; `tests/rfid_statistics.rs` repeats what the former give). They disagree on rates, as readers'
//! settings do: a round takes 14 ms in the one and about 100 ms in the other. Rounds here are of the former, with the
//! time of each further tag from the air protocol.
//!
//! The Doppler field is filled as R420s fill it: the true shift of a moving tag, 6 Hz at 1 m/s, below noise of some tens
//! of hertz.

pub mod channel;
mod db;
pub mod gen2;
pub mod inventory;
pub mod link;
pub mod measurement;
pub mod report;

pub use channel::{ReaderSession, TagTraits};
pub use inventory::{Inventory, Options, Situation, simulate};

use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

/// A draw of the normal distribution, of mean 0 and standard deviation 1.
fn normal(rng: &mut impl Rng) -> f64 {
    rng.sample(StandardNormal)
}

#[cfg(test)]
pub(crate) mod tests;
