//! Offsets of one tag and antenna, learnt visit by visit.
//!
//! A visit is a run of reads on one channel. A visit in which the tag is still teaches its channel's offset: relative to the
//! still visit before it if the tag rested in between, else as the first of a new tie. A tag that has been moved and rests
//! again therefore needs no channel anew: offsets are relative, so the hops that follow compare each channel with the one
//! before, as ever, and average away the `4 pi dd df / c` by which the new place differs.
//!
//! Visits are compared with the mean of some visits just before: averaged, so that a round over all channels does not add up
//! their noise, but not for long, as the tag and the air drift.

use std::f64::consts::PI;

use rfhoi_shared::units::ChannelIndex;

use super::MAX_CHANNELS;
use super::calibration::{LearningRule, Offset};
use super::circular::{Resultant, wrap};

/// Offsets of one tag and antenna by channel, and the visit that goes on.
#[derive(Debug, Clone)]
pub(super) struct Offsets {
    channels: Vec<Option<Learnt>>,
    ties: u32,
    visit: Option<Visit>,
    settled: Option<Settled>,
    /// Mean difference of visits' halves, rad.
    drift: f64,
    stale: u32,
}

#[derive(Debug, Clone, Copy)]
struct Learnt {
    offset: Offset,
    /// A hop did not fit: not used until a resting tag has shown it again.
    doubted: bool,
    /// Where it was learnt.
    place: Option<Whereabouts>,
}

/// Where the tag is, as far as steps have been valid since an epoch began.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Whereabouts {
    /// Unwrapped phase, rad.
    pub(super) phase: f64,
    pub(super) epoch: u32,
}

/// The visit that goes on.
#[derive(Debug, Clone, Copy)]
struct Visit {
    channel: ChannelIndex,
    start: u64,
    last: u64,
    /// Phases of the first [`HALF_US`], and those after.
    early: Resultant,
    late: Resultant,
    /// Reads half a turn off.
    flipped: u64,
}

/// Share of flipped reads up to which the others are right.
const MINORITY: f64 = 0.4;
/// Half of the 0.2 s that R420s stay on a channel.
const HALF_US: u64 = 100_000;
/// Share of a visit in the level that it is compared with.
const LEVEL_GAIN: f64 = 0.5;
/// Share of a visit in the mean drift.
const DRIFT_GAIN: f64 = 0.3;

/// Where a still visit left the tag.
#[derive(Debug, Clone, Copy)]
struct Settled {
    /// Mean corrected phase, rad.
    level: f64,
    tie: u32,
    end: u64,
}

/// A phase less its channel's offset.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Corrected {
    /// Radians in (-pi, pi].
    pub(super) phase: f64,
    pub(super) tie: u32,
    pub(super) doubted: bool,
}

impl Default for Offsets {
    fn default() -> Self {
        Self { channels: vec![None; MAX_CHANNELS], ties: 0, visit: None, settled: None, drift: 0.0, stale: 0 }
    }
}

/// Place of a channel in the table; `None` for index 0, which stands for unknown, and past the table.
pub(super) fn place(channel: ChannelIndex) -> Option<usize> {
    usize::from(channel.0).checked_sub(1).filter(|&place| place < MAX_CHANNELS)
}

impl Offsets {
    /// Channels whose offset is known.
    pub(super) fn known(&self) -> impl Iterator<Item = (ChannelIndex, Offset)> {
        let channels = (1..).map(ChannelIndex).zip(&self.channels);
        channels.filter_map(|(channel, learnt)| Some((channel, (*learnt)?.offset)))
    }

    /// Takes an offset learnt before.
    pub(super) fn insert(&mut self, channel: ChannelIndex, offset: Offset) {
        if let Some(cell) = place(channel).and_then(|place| self.channels.get_mut(place)) {
            *cell = Some(Learnt { offset, doubted: false, place: None });
            self.ties = self.ties.max(offset.tie.saturating_add(1));
        }
    }

    /// Corrects a phase of a tag that is at `now`, if its channel's offset is known. `dispersion` is how much more than in the
    /// band's middle the channel's phase turns by the way, as a share: what the tag has moved since the offset was learnt, as
    /// far as that is known, is taken out.
    pub(super) fn correct(
        &self,
        channel: ChannelIndex,
        raw: f64,
        now: Whereabouts,
        dispersion: f64,
    ) -> Option<Corrected> {
        let learnt = (*self.channels.get(place(channel)?)?)?;
        let learnt_at = learnt.place.filter(|place| place.epoch == now.epoch);
        let moved = learnt_at.map_or(0.0, |place| now.phase - place.phase);
        let phase = wrap(raw - learnt.offset.radians - dispersion * moved);
        Some(Corrected { phase, tie: learnt.offset.tie, doubted: learnt.doubted })
    }

    /// A hop to `channel` did not fit.
    pub(super) fn doubt(&mut self, channel: ChannelIndex) {
        if let Some(Some(learnt)) = place(channel).and_then(|place| self.channels.get_mut(place)) {
            learnt.doubted = true;
        }
    }

    /// A read on `channel` at `time`, us: ends the visit before if it is of another. `rests` is since when the tag rests, `now`
    /// where it is.
    pub(super) fn visit(
        &mut self,
        channel: ChannelIndex,
        time: u64,
        rests: Option<u64>,
        now: Whereabouts,
        rule: &LearningRule,
    ) {
        let goes_on = self.visit.is_some_and(|visit| {
            visit.channel == channel
                && time.saturating_sub(visit.last) <= rule.pause_us
                && time.saturating_sub(visit.start) <= rule.longest_us
        });
        if goes_on {
            return;
        }
        if let Some(ended) = self.visit.take() {
            self.teach(ended, rests, now, rule);
        }
        self.visit = Some(Visit {
            channel,
            start: time,
            last: time,
            early: Resultant::default(),
            late: Resultant::default(),
            flipped: 0,
        });
    }

    /// Adds a phase to the visit that goes on.
    pub(super) fn add(&mut self, time: u64, raw: f64) {
        if let Some(visit) = &mut self.visit {
            visit.last = time;
            let half =
                if time.saturating_sub(visit.start) < HALF_US { &mut visit.early } else { &mut visit.late };
            half.add(raw);
        }
    }

    /// A read of the visit was half a turn off those added.
    pub(super) fn flipped(&mut self) {
        if let Some(visit) = &mut self.visit {
            visit.flipped += 1;
        }
    }

    /// The reads of the visit that were half a turn off were right, and those added were not.
    pub(super) fn begin_again(&mut self) {
        if let Some(visit) = &mut self.visit {
            *visit = Visit {
                early: Resultant::default(),
                late: Resultant::default(),
                flipped: visit.early.count() + visit.late.count(),
                ..*visit
            };
        }
    }

    /// Nothing that came before compares with what comes now.
    pub(super) fn interrupt(&mut self) {
        self.visit = None;
        self.settled = None;
    }

    fn teach(&mut self, visit: Visit, rests: Option<u64>, now: Whereabouts, rule: &LearningRule) {
        let phases = visit.early.and(visit.late);
        let (Some(mean), Some(spread)) = (phases.mean(), phases.standard_deviation()) else { return };
        if phases.count() < rule.least_reads || spread > rule.largest_spread {
            return;
        }
        // The carrier's sign is what most reads say, if they do.
        let mean = match visit.flipped as f64 / (visit.flipped + phases.count()) as f64 {
            share if share < MINORITY => mean,
            share if share > 1.0 - MINORITY => wrap(mean + PI),
            _ => return,
        };
        if let Some((early, late)) = visit.early.mean().zip(visit.late.mean()) {
            let drift = wrap(late - early);
            self.drift += DRIFT_GAIN * (drift - self.drift);
            // Half a standard deviation of the difference of two halves is this.
            let noise = spread / (phases.count() as f64).sqrt();
            if drift.abs() > rule.largest_drift + 3.0 * noise
                || self.drift.abs() > rule.largest_mean_drift + noise
            {
                return;
            }
        }
        let before = self.settled.filter(|settled| {
            visit.start.saturating_sub(settled.end) <= rule.between_us
                || rests.is_some_and(|since| since <= settled.end)
        });
        let Some(place) = place(visit.channel) else { return };
        let learnt = self.channels[place];
        let known = learnt.map(|learnt| learnt.offset);
        let old_place = learnt.and_then(|learnt| learnt.place).filter(|place| place.epoch == now.epoch);
        let mut new_place = now;
        let new = |radians, tie| Offset { radians, reads: phases.count(), visits: 1, spread, tie };
        let offset = match (known, before) {
            (None, None) => {
                self.ties += 1;
                new(mean, self.ties - 1)
            }
            (None, Some(before)) => new(wrap(mean - before.level), before.tie),
            // Nothing to compare with; it may not have changed.
            (Some(known), None) => {
                new_place = old_place.unwrap_or(now);
                known
            }
            (Some(known), Some(before)) => {
                let off = wrap(mean - known.radians - before.level);
                if known.tie != before.tie {
                    self.join(known.tie, off, before.tie);
                    Offset { radians: wrap(known.radians + off), tie: before.tie, ..known }
                } else if off.abs() <= rule.stale {
                    self.stale = self.stale.saturating_sub(1);
                    let visits = (known.visits + 1).min(rule.memory);
                    let share = 1.0 / f64::from(visits);
                    if let Some(old) = old_place {
                        new_place.phase = old.phase + (now.phase - old.phase) * share;
                    }
                    let radians = wrap(known.radians + off * share);
                    Offset { radians, reads: known.reads + phases.count(), visits, ..known }
                } else {
                    self.stale += 1;
                    if self.stale >= rule.stale_channels {
                        self.forget();
                    }
                    new(wrap(mean - before.level), before.tie)
                }
            }
        };
        // An offset that nothing was compared with stays doubted.
        let doubted = before.is_none() && learnt.is_some_and(|learnt| learnt.doubted);
        self.channels[place] = Some(Learnt { offset, doubted, place: Some(new_place) });
        let here = wrap(mean - offset.radians);
        let level = before.map_or(here, |before| wrap(before.level + LEVEL_GAIN * wrap(here - before.level)));
        self.settled = Some(Settled { level, tie: offset.tie, end: visit.last });
    }

    /// Makes the offsets of one tie relative to those of another.
    fn join(&mut self, from: u32, off: f64, to: u32) {
        for learnt in self.channels.iter_mut().flatten().filter(|learnt| learnt.offset.tie == from) {
            learnt.offset.radians = wrap(learnt.offset.radians + off);
            learnt.offset.tie = to;
        }
    }

    fn forget(&mut self) {
        self.channels.fill(None);
        self.stale = 0;
    }
}
