//! Whether a tag rests, as all antennas together see it.
//!
//! A look is still if the phase is where it was, within noise. A tag rests once all looks by all antennas have been still for
//! a while. Antennas take turns, so where one is silent for 140 ms the others have looked meanwhile: what a resting tag can do
//! unseen is bounded by the time since the last look, not by that antenna's own.

use super::circular::wrap;

/// How long all looks must have been still, us.
const LEAST_US: u64 = 300_000;
/// And how many.
const LEAST_LOOKS: u32 = 4;
/// Time over which a level is averaged, us: a tag at 0.1 m/s is 0.8 rad ahead of it.
const LEVEL_US: f64 = 200_000.0;

/// A tag's rest.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Rest {
    /// Last sign of movement, us; at first, the first look.
    moved: Option<u64>,
    /// Last still look, us.
    until: u64,
    looks: u32,
    /// Looks after so short a time that they tell movement from rest whatever the speed.
    direct: u32,
}

impl Rest {
    /// The tag was seen at `time`, us, and nothing compares yet.
    pub(super) fn begin(&mut self, time: u64) {
        if self.moved.is_none() {
            *self = Self { moved: Some(time), until: time, ..Self::default() };
        }
    }

    /// A look at `time`, us. `direct` says that the look before was recent enough for the scene's fastest tag.
    pub(super) fn look(&mut self, time: u64, still: bool, direct: bool) {
        if !still {
            *self = Self { moved: Some(time), until: time, ..Self::default() };
            return;
        }
        self.until = self.until.max(time);
        self.looks += 1;
        self.direct += u32::from(direct);
    }

    /// Since when the tag rests and when it was last seen to, us, if it rests.
    pub(super) fn span(&self) -> Option<(u64, u64)> {
        let since = self.moved?;
        let long = self.until.saturating_sub(since) >= LEAST_US;
        (long && self.looks >= LEAST_LOOKS && self.direct >= LEAST_LOOKS / 2).then_some((since, self.until))
    }
}

/// Phases that compare with each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Basis {
    /// Corrected, of this tie.
    Tie(u32),
    /// As read, of this channel.
    Channel(u16),
}

/// Where the phase of one tag and antenna stays while it rests.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Level {
    level: Option<(Basis, f64, u64)>,
}

impl Level {
    /// Compares a phase with the level: whether it is within `band`, rad, and us since the phase before; `None` if nothing
    /// compares.
    pub(super) fn look(&mut self, basis: Basis, phase: f64, time: u64, band: f64) -> Option<(bool, u64)> {
        let before = self.level.filter(|&(other, ..)| other == basis);
        let Some((_, level, last)) = before else {
            self.level = Some((basis, phase, time));
            return None;
        };
        let off = wrap(phase - level);
        let still = off.abs() <= band;
        let us = time.saturating_sub(last);
        let gain = us as f64 / (us as f64 + LEVEL_US);
        let level = if still { wrap(level + gain * off) } else { phase };
        self.level = Some((basis, level, time));
        Some((still, us))
    }
}
