//! Phase offsets of (tag, antenna, channel): when they are learnt, and how a session keeps them.

use std::collections::BTreeMap;

use rfhoi_shared::tag::Epc;
use rfhoi_shared::units::{AntennaPort, ChannelIndex};
use serde::{Deserialize, Serialize};

use super::PhaseKey;

/// When a visit of a channel is good to learn from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LearningRule {
    /// Fewest reads.
    pub least_reads: u64,
    /// Largest circular standard deviation, radians. Noise of a still tag is 0.05 to 0.1; a tag at 0.1 m/s turns by 0.8
    /// rad in a visit of 0.2 s, a spread of 0.22.
    pub largest_spread: f64,
    /// Largest difference of a visit's halves, radians, beyond their noise: a tag at 0.05 m/s makes 0.19 in 0.2 s.
    pub largest_drift: f64,
    /// The same of some visits' mean.
    pub largest_mean_drift: f64,
    /// Longest visit, us; a longer stay counts as the next one. Readers that do not hop stay on a channel for ever.
    pub longest_us: u64,
    /// A pause within a channel after which it is another visit, us.
    pub pause_us: u64,
    /// Longest time between two visits that are compared, us, unless the tag is known to rest meanwhile.
    pub between_us: u64,
    /// Visits over which an offset is averaged; older ones fade.
    pub memory: u32,
    /// Difference between what a resting tag's offset was and is that is no refinement, radians: the channel's offset has
    /// changed. A tag carried by 1 m makes up to 1.0 over the FCC's band (`4 pi dd df / c` with 24.5 MHz).
    pub stale: f64,
    /// So many stale channels, with no more good ones between them, make all offsets of a tag and antenna be forgotten.
    pub stale_channels: u32,
}

impl Default for LearningRule {
    fn default() -> Self {
        Self {
            least_reads: 3,
            largest_spread: 0.2,
            largest_drift: 0.1,
            largest_mean_drift: 0.05,
            // The FCC allows 0.4 s on a channel in any 20 s (47 CFR 15.247 (a)(1)(i)).
            longest_us: 400_000,
            pause_us: 1_000_000,
            between_us: 300_000,
            memory: 8,
            stale: 1.0,
            stale_channels: 2,
        }
    }
}

/// A learnt offset.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Offset {
    /// The offset in radians, in (-pi, pi].
    pub radians: f64,
    /// Reads it was learnt from.
    pub reads: u64,
    /// Visits it was learnt from.
    pub visits: u32,
    /// Circular standard deviation of the first visit's reads, radians.
    pub spread: f64,
    /// Offsets of a tag and antenna are relative to each other if this number is the same: a resting tag has tied them.
    pub tie: u32,
}

/// What was learnt of a recording or session. As JSON it is a list of offsets, each with `epc` in hexadecimal, `antenna` and
/// `channel`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(from = "Vec<Row>", into = "Vec<Row>")]
pub struct Calibration {
    offsets: BTreeMap<PhaseKey, Offset>,
}

impl Calibration {
    /// The offset of a key, if it was learnt.
    pub fn offset(&self, key: &PhaseKey) -> Option<Offset> {
        self.offsets.get(key).copied()
    }

    /// All offsets.
    pub fn offsets(&self) -> impl Iterator<Item = (&PhaseKey, &Offset)> {
        self.offsets.iter()
    }

    pub(super) fn insert(&mut self, key: PhaseKey, offset: Offset) {
        self.offsets.insert(key, offset);
    }
}

/// An offset as JSON has it.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Row {
    #[serde(with = "hex")]
    epc: Epc,
    antenna: AntennaPort,
    channel: ChannelIndex,
    #[serde(flatten)]
    offset: Offset,
}

mod hex {
    use rfhoi_shared::tag::Epc;
    use serde::de::Error;
    use serde::{Deserialize, Deserializer, Serializer};

    pub(super) fn serialize<S: Serializer>(epc: &Epc, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(epc)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Epc, D::Error> {
        let hex = String::deserialize(deserializer)?;
        Epc::from_hex(&hex).ok_or_else(|| D::Error::custom(format!("`{hex}` is no EPC in hexadecimal")))
    }
}

impl From<Vec<Row>> for Calibration {
    fn from(rows: Vec<Row>) -> Self {
        let offsets = rows
            .into_iter()
            .map(|row| (PhaseKey { epc: row.epc, antenna: row.antenna, channel: row.channel }, row.offset));
        Self { offsets: offsets.collect() }
    }
}

impl From<Calibration> for Vec<Row> {
    fn from(calibration: Calibration) -> Self {
        let rows = calibration.offsets.into_iter().map(|(key, offset)| Row {
            epc: key.epc,
            antenna: key.antenna,
            channel: key.channel,
            offset,
        });
        rows.collect()
    }
}
