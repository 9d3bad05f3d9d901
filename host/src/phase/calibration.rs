//! Learns the phase offset of each (tag, antenna, channel) from its first visit.
//!
//! A visit (dwell) is a run of reads of a tag by an antenna on one channel. The offset is the circular mean of the first
//! visit that has enough reads and whose spread says that the tag was still. Later visits change nothing: an offset that
//! followed the tag would erase its movement.

use std::collections::BTreeMap;

use rfhoi_shared::units::BridgeTime;

use super::PhaseKey;
use super::circular::Resultant;

/// When a visit is good to learn from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LearningRule {
    /// Fewest reads.
    pub least_reads: u64,
    /// Largest circular standard deviation, radians. Noise of a still tag is 0.05 to 0.1; a tag at 0.1 m/s turns by 0.8
    /// rad in a visit of 0.2 s, a spread of 0.22.
    pub largest_spread: f64,
    /// Longest visit, us; a longer stay counts as the next one. Readers that do not hop stay on a channel for ever.
    pub longest_us: u64,
    /// A pause within a channel after which it is another visit, us.
    pub pause_us: u64,
}

impl Default for LearningRule {
    fn default() -> Self {
        // The FCC allows 0.4 s on a channel in any 20 s (47 CFR 15.247 (a)(1)(i)).
        Self { least_reads: 3, largest_spread: 0.2, longest_us: 400_000, pause_us: 1_000_000 }
    }
}

/// A learnt offset.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Offset {
    /// The offset in radians, in (-pi, pi].
    pub radians: f64,
    /// Reads it was learnt from.
    pub reads: u64,
    /// Their circular standard deviation, radians.
    pub spread: f64,
}

/// What was learnt of a recording or session.
#[derive(Debug, Clone, PartialEq, Default)]
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
}

/// The visit of one tag and antenna that is going on.
#[derive(Debug, Clone)]
pub(super) struct Visit {
    key: PhaseKey,
    start: BridgeTime,
    last: BridgeTime,
    /// Phases so far, while they are learnt from.
    learning: Option<Resultant>,
}

impl Visit {
    /// The visit in which a read of `key` at `time` falls: `visit` or a new one. What an ended visit has taught goes to
    /// `calibration`.
    pub(super) fn at<'v>(
        visit: &'v mut Option<Self>,
        key: &PhaseKey,
        time: BridgeTime,
        rule: &LearningRule,
        calibration: &mut Calibration,
    ) -> &'v mut Self {
        let goes_on = visit.as_ref().is_some_and(|current| {
            current.key == *key
                && time.since(current.last) <= rule.pause_us
                && time.since(current.start) <= rule.longest_us
        });
        if !goes_on && let Some(ended) = visit.take() {
            ended.teach(rule, calibration);
        }
        let current = visit.get_or_insert_with(|| {
            let learning = calibration.offset(key).is_none().then(Resultant::default);
            Self { key: key.clone(), start: time, last: time, learning }
        });
        current.last = time;
        current
    }

    /// Adds a phase to what is learnt from, if the visit still is.
    pub(super) fn add(&mut self, phase: f64) {
        if let Some(phases) = &mut self.learning {
            phases.add(phase);
        }
    }

    fn teach(self, rule: &LearningRule, calibration: &mut Calibration) {
        let Some(phases) = self.learning else { return };
        let (Some(radians), Some(spread)) = (phases.mean(), phases.standard_deviation()) else { return };
        if phases.count() >= rule.least_reads && spread <= rule.largest_spread {
            let offset = Offset { radians, reads: phases.count(), spread };
            calibration.offsets.insert(self.key, offset);
        }
    }
}
