//! When frames begin, by the bridge's clock.
//!
//! The bridge stamps a frame when its first data arrive, which is late now and then. The grid follows these stamps slowly, so
//! that one frame ends where the next begins and both radios share every border.

use rfhoi_shared::units::BridgeTime;

/// Share of a stamp's distance from the grid by which the grid follows it: the noise of stamps is averaged over so many.
const FOLLOW: i64 = 8;

/// Where the frame that comes next lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Grid {
    /// Number of the next frame.
    pub(super) number: u32,
    /// When it begins.
    pub(super) begin: BridgeTime,
    period_us: u64,
}

impl Grid {
    /// A grid of which frame `number` begins at `begin`.
    pub(super) fn new(number: u32, begin: BridgeTime, period_us: u64) -> Self {
        Self { number, begin, period_us }
    }

    /// When the next frame ends.
    pub(super) fn end(&self) -> BridgeTime {
        self.begin.after(self.period_us)
    }

    /// Frames between the next one and `number`, which was stamped `time`; `None` where they do not belong to one grid: it is
    /// of the past, or its stamp is off by more than half a period.
    pub(super) fn ahead(&self, number: u32, time: BridgeTime) -> Option<u32> {
        let ahead = number.checked_sub(self.number)?;
        (self.off(ahead, time).unsigned_abs() <= self.period_us / 2).then_some(ahead)
    }

    /// By how much a stamp is after the begin of the frame that is `ahead`, us.
    fn off(&self, ahead: u32, time: BridgeTime) -> i64 {
        let expected = self.begin.0.saturating_add(u64::from(ahead).saturating_mul(self.period_us));
        (time.0 as i64).saturating_sub(expected as i64)
    }

    /// The next frame's begin and end, where it was stamped `time`, or was never seen; goes on to the one after it.
    pub(super) fn take(&mut self, time: Option<BridgeTime>) -> (BridgeTime, BridgeTime) {
        let begin = self.begin;
        let correction = time.map_or(0, |time| self.off(0, time) / FOLLOW);
        let end = BridgeTime(self.end().0.saturating_add_signed(correction));
        self.number = self.number.wrapping_add(1);
        self.begin = end;
        (begin, end)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_follow_each_other_and_the_radars_clock() {
        // Stamps jitter by 2 ms, and the radar's clock is slow by 100 ppm.
        let mut grid = Grid::new(0, BridgeTime(1_000), 100_000);
        let mut last = BridgeTime(1_000);
        for n in 0..10_000u64 {
            let stamp = BridgeTime(1_000 + n * 100_010 + n * 7919 % 2_000);
            assert_eq!(grid.ahead(n as u32, stamp), Some(0));
            let (begin, end) = grid.take(Some(stamp));
            assert_eq!(begin, last);
            let middle = 1_000 + n * 100_010 + 1_000;
            assert!(
                n < 50 || begin.0.abs_diff(middle) < 600,
                "{n}: {} us off",
                begin.0 as i64 - middle as i64
            );
            last = end;
        }
    }

    #[test]
    fn what_is_elsewhere_is_told() {
        let grid = Grid::new(10, BridgeTime(5_000_000), 100_000);
        assert_eq!(grid.ahead(13, BridgeTime(5_320_000)), Some(3));
        assert_eq!(grid.ahead(9, BridgeTime(4_900_000)), None);
        assert_eq!(grid.ahead(11, BridgeTime(5_000_000)), None, "its stamp is a period early");
        assert_eq!(grid.ahead(u32::MAX, BridgeTime(5_000_000)), None);
    }
}
