//! The reader's clock in the bridge's time.
//!
//! A read carries the reader's time `r`, microseconds of its own clock, and arrives at the bridge's time `a`. With the
//! offset `o` between the clocks and a delay in reader and network of `w >= 0`,
//!
//! ```text
//! a - r = o + w
//! ```
//!
//! so the smallest `a - r` seen is the best estimate of `o`, and the delay of any other read is what its `a - r` has
//! above it: the read happened at `a` less that. This is the lower envelope of `a - r`. Since the clocks drift against
//! each other by up to [`MAX_DRIFT_PPM`], an old smallest value loses its worth: the envelope rises from its last touch
//! at that rate, and a read below it touches it anew,
//!
//! ```text
//! envelope(a) = o_touch + (a - a_touch) * MAX_DRIFT_PPM / 1e6
//! delay       = max(0, (a - r) - envelope(a))
//! time        = a - delay
//! ```
//!
//! Hence the time is never later than the arrival, a varying delay moves it only by what the envelope rises between
//! touches, and any drift up to the bound is followed. What remains unknown is the smallest delay itself.
//!
//! A step of the reader's clock (NTP, reboot) forward is a touch from far above, and followed at once. One backward
//! shows in one of two ways, and the envelope is then learnt anew: the reader's time goes back by more than
//! [`STEP_US`], or all reads of [`STEP_PROOF_US`] lie that far above the envelope. (A stalled link delivers its backlog
//! at once, so its delays are not that long for that long.) Where a clock steps back during a pause, the reads of that
//! proof get times that are too early by the step.

use rfhoi_shared::units::{BridgeTime, ReaderTime};

/// Drift between the clocks that is followed, parts per million: two crystals of 50 ppm.
pub const MAX_DRIFT_PPM: i64 = 100;
/// A change of the offset beyond this is a step of the reader's clock, us. Delays on a local network stay below it.
pub const STEP_US: i64 = 500_000;
/// How long reads must lie beyond [`STEP_US`] to prove a step, us of arrival.
pub const STEP_PROOF_US: u64 = 1_000_000;

/// An offset `a - r` in us, and when it was seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Offset {
    us: i64,
    at: BridgeTime,
}

impl Offset {
    /// The envelope through this touch.
    fn envelope(self, at: BridgeTime) -> i64 {
        let elapsed = i64::try_from(at.since(self.at)).unwrap_or(i64::MAX);
        self.us.saturating_add(elapsed / (1_000_000 / MAX_DRIFT_PPM))
    }
}

/// Reads that lie so far above the envelope that the reader's clock may have stepped back.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Suspicion {
    since: BridgeTime,
    /// The lowest of them.
    lowest: Offset,
}

/// Maps [`ReaderTime`] to [`BridgeTime`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ReaderClock {
    touch: Option<Offset>,
    latest: ReaderTime,
    suspicion: Option<Suspicion>,
    steps: u32,
}

impl ReaderClock {
    /// Forgets what it learnt, for a new connection; the count of [`Self::steps`] stays.
    pub fn reset(&mut self) {
        *self = Self { steps: self.steps, ..Self::default() };
    }

    /// Steps of the reader's clock that were found.
    pub fn steps(&self) -> u32 {
        self.steps
    }

    /// Learns that `reader` arrived at `arrival`, and tells when that was: never later than `arrival`.
    ///
    /// Arrivals must not go back.
    pub fn observe(&mut self, reader: ReaderTime, arrival: BridgeTime) -> BridgeTime {
        let seen = Offset { us: (arrival.0 as i64).wrapping_sub(reader.0 as i64), at: arrival };
        let Some(touch) = self.touch else {
            self.learn(seen, reader);
            return arrival;
        };
        let above = seen.us.saturating_sub(touch.envelope(arrival));
        let back = i128::from(self.latest.0) - i128::from(reader.0);
        if above < -STEP_US || (above > STEP_US && back > i128::from(STEP_US)) {
            self.step(seen, reader);
            return arrival;
        }
        if above > STEP_US {
            let suspicion = self.suspicion.get_or_insert(Suspicion { since: arrival, lowest: seen });
            if seen.us <= suspicion.lowest.us {
                suspicion.lowest = seen;
            }
            let Suspicion { since, lowest } = *suspicion;
            if arrival.since(since) < STEP_PROOF_US {
                return BridgeTime(arrival.0.saturating_sub(above.unsigned_abs()));
            }
            self.step(lowest, reader);
            let delay = seen.us.saturating_sub(lowest.envelope(arrival)).max(0);
            return BridgeTime(arrival.0.saturating_sub(delay.unsigned_abs()));
        }
        self.suspicion = None;
        self.latest = self.latest.max(reader);
        if above <= 0 {
            self.touch = Some(seen);
        }
        BridgeTime(arrival.0.saturating_sub(above.max(0).unsigned_abs()))
    }

    fn learn(&mut self, offset: Offset, reader: ReaderTime) {
        self.touch = Some(offset);
        self.latest = reader;
        self.suspicion = None;
    }

    fn step(&mut self, offset: Offset, reader: ReaderTime) {
        self.steps = self.steps.saturating_add(1);
        self.learn(offset, reader);
    }
}

#[cfg(test)]
#[path = "clock_tests.rs"]
mod tests;
