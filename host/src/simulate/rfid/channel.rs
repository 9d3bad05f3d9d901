//! Channels and phase offsets: what a reader and its tags bring along for a whole session.

use std::f64::consts::TAU;

use rand::seq::SliceRandom;
use rand::{Rng, RngExt};
use rfhoi_shared::units::{ChannelIndex, Kilohertz};

use super::normal;
use crate::phase::ChannelPlan;
use crate::simulate::effects::Effects;

/// Longest stay on a channel, s. A still tag's recording (`Test15-5-0`): a hop every 203 ms in the median, in which 14
/// rounds of 14.0 ms fit, then [`HOP_S`].
pub const DWELL_S: f64 = 0.2;
/// Without carrier at a hop, s: reads across a hop are 20.1 ms apart in the median, within a channel 14.0 ms (the same
/// recording).
pub const HOP_S: f64 = 0.0061;
/// Middle of the band, Hz.
const MIDDLE_HZ: f64 = 915e6;
/// Half of the band, Hz.
const HALF_BAND_HZ: f64 = 12.25e6;
/// How far a tag's own phase shifts from the band's middle to its edge, standard deviation, rad. Assumed: no recording
/// here has two tags on named channels.
const TAG_DISPERSION: f64 = 0.35;
/// Loss of a tag on its thing, one way, dB: mean and standard deviation. Between the two that were fitted (see
/// [`super::link`]): 4.7 for a tag alone, 9.2 for a carried one.
const MOUNTING_DB: [f64; 2] = [6.5, 2.0];
/// Weakest power on which a tag answers, dBm: mean and standard deviation. The 2,927 RDA samples: one read in a hundred is
/// weaker than -78 dBm, which this model's link has at -21 dBm at the tag. How far tags differ is assumed.
const SENSITIVITY_DBM: [f64; 2] = [-21.0, 1.0];

/// A tag as it is for a session.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TagTraits {
    /// Phase that its antenna and chip add in the middle of the band, rad.
    pub phase: f64,
    /// What they add more at the band's upper edge, and less at its lower one, rad.
    pub dispersion: f64,
    /// Loss of its antenna on what it is on, one way, dB.
    pub loss_db: f64,
    /// Weakest power on which it answers, dBm.
    pub sensitivity_dbm: f64,
}

impl TagTraits {
    /// Draws a tag, with phases of its own or without.
    fn draw(phases: bool, rng: &mut impl Rng) -> Self {
        let (phase, dispersion) = (TAU * rng.random::<f64>(), TAG_DISPERSION * normal(rng));
        let around = |[mean, deviation]: [f64; 2], normal: f64| mean + deviation * normal;
        Self {
            phase: if phases { phase } else { 0.0 },
            dispersion: if phases { dispersion } else { 0.0 },
            loss_db: around(MOUNTING_DB, normal(rng)).max(0.0),
            sensitivity_dbm: around(SENSITIVITY_DBM, normal(rng)),
        }
    }
}

/// A reader's channels, the phase offsets, and the tags, as drawn when the reader starts. Samples of a data set each have a
/// session of their own, so a tag has another loss in each.
///
/// The reader numbers its channels by a hop table in an order of its own, and visits them by rising index, as the R420 of
/// the recordings does. The phase offset of (channel, antenna, tag) is a reader's part, of (channel, antenna), and a tag's
/// part ([`TagTraits`]). The reader's part is drawn from the whole turn: the mean phases of a still tag on 50 channels
/// (`Test15-5-0`) have a mean resultant length of 0.02, less than the 0.13 that even chance gives, and lie on no line over an
/// R420's known hop table (0.45 at best, where eight draws of even chance reach 0.31 to 0.44).
#[derive(Debug, Clone, PartialEq)]
pub struct ReaderSession {
    /// Frequency of channel 1, 2, ...
    pub channels: Vec<Kilohertz>,
    /// The channel at which it begins.
    pub first: ChannelIndex,
    /// Whether it hops.
    pub hops: bool,
    /// The tags, in the order of the performance.
    pub tags: Vec<TagTraits>,
    /// The reader's part of the offsets, rad: by antenna, then by channel.
    reader: Vec<Vec<f64>>,
}

impl ReaderSession {
    /// Draws a session. Without [`Effects::hopping`] the channels are in rising order, the reader stays in the middle of
    /// the band, and offsets are zero.
    pub fn draw(antennas: usize, tags: usize, effects: &Effects, rng: &mut impl Rng) -> Self {
        let plan = ChannelPlan::fcc();
        let mut channels: Vec<_> = (1..).map_while(|n| plan.frequency(ChannelIndex(n))).collect();
        let mut first = channels.len() / 2;
        let hops = effects.hopping;
        if hops {
            channels.shuffle(rng);
            first = rng.random_range(0..channels.len());
        }
        let offset = |rng: &mut _| if hops { TAU * RngExt::random::<f64>(rng) } else { 0.0 };
        let reader = (0..antennas).map(|_| channels.iter().map(|_| offset(rng)).collect()).collect();
        let tags = (0..tags).map(|_| TagTraits::draw(hops, rng)).collect();
        Self { channels, first: ChannelIndex(first as u16 + 1), hops, tags, reader }
    }

    /// Frequency of the channel in place `channel`, Hz.
    pub(super) fn hertz(&self, channel: usize) -> f64 {
        f64::from(self.channels[channel].0) * 1e3
    }

    /// Phase offset of a channel, antenna and tag, counted from 0, rad.
    pub fn offset(&self, channel: usize, antenna: usize, tag: usize) -> f64 {
        let TagTraits { phase, dispersion, .. } = self.tags[tag];
        let share = (self.hertz(channel) - MIDDLE_HZ) / HALF_BAND_HZ;
        self.reader[antenna][channel] + phase + dispersion * share
    }
}
