//! What reads of a frame tell as they are, however few: how many, how strong, and by how much the phase seems to have turned.
//!
//! No guard stands over this. A tag that is read too seldom for its speed turns by any amount modulo a turn; which tag does so
//! is just what tells the one that is moved from those that rest.

use std::collections::VecDeque;

use rfhoi_shared::units::CentiDbm;

use super::circular::wrap;
use super::track::Reading;

/// Reads of a tag by an antenna that wait for the end of their frame; of more, the first do not count.
const KEPT: usize = 64;
/// Time between reads in which a tag at 1 m/s, the speed of a hand that does not hurry, turns the phase by no more than half of a
/// half turn: an eighth of a wavelength at 920 MHz is 41 mm.
const SOON_US: u64 = 40_000;

/// What one tag's reads by one antenna in one frame tell as they are.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Sighting {
    /// Reads in the frame.
    pub reads: u32,
    /// Their mean signal strength, dBm; `None` without reads.
    pub rssi_dbm: Option<f32>,
    /// The turn from the last read before the frame to the last one in it, modulo a turn, radians in (-pi, pi]: the paper's
    /// nearest-neighbour difference. It is summed from read to read, of one channel or each corrected for its own; steps that
    /// do not compare are left out. `None` where none does.
    pub turn: Option<f32>,
    /// How fast the phase turns, rad/s, by its steps over at most 40 ms on one channel, each modulo half a turn and so whether or
    /// not the carrier's sign is known: an antenna's visit has several reads of a tag. `None` where there are none.
    pub rate: Option<f32>,
    /// Time that these steps cover, s.
    pub rate_s: f32,
}

/// One read.
#[derive(Debug, Clone, Copy)]
pub(super) struct Seen {
    pub(super) reading: Reading,
    pub(super) rssi: CentiDbm,
    /// Whether its phase is not known to be half a turn off.
    pub(super) upright: bool,
}

/// Reads of a tag by an antenna that wait for the end of their frame.
#[derive(Debug, Clone)]
pub(super) struct Sightings {
    waiting: VecDeque<Seen>,
    /// The last read of the frames that are over.
    before: Option<Reading>,
}

impl Default for Sightings {
    fn default() -> Self {
        Self { waiting: VecDeque::with_capacity(KEPT), before: None }
    }
}

impl Sightings {
    /// Takes a read. Where it is not later than those before, the clock was set back, and nothing compares with them.
    pub(super) fn add(&mut self, seen: Seen) {
        let last = self.waiting.back().map(|last| &last.reading).or(self.before.as_ref());
        if last.is_some_and(|last| last.time >= seen.reading.time) {
            self.waiting.clear();
            self.before = None;
        }
        if self.waiting.len() == KEPT {
            self.pass();
        }
        self.waiting.push_back(seen);
    }

    /// The reads after `begin` and until `end`, us. Frames follow each other.
    pub(super) fn frame(&mut self, begin: u64, end: u64) -> Sighting {
        while self.waiting.front().is_some_and(|seen| seen.reading.time <= begin) {
            self.pass();
        }
        let (mut reads, mut sum_dbm, mut turn) = (0, 0.0, None);
        let (mut soon, mut soon_us) = (0.0, 0);
        while let Some(seen) = self.waiting.front().filter(|seen| seen.reading.time <= end) {
            reads += 1;
            sum_dbm += f32::from(seen.rssi.0) / 100.0;
            if let Some((step, us)) = self.before.and_then(|before| soon_turn(&before, &seen.reading)) {
                soon += step;
                soon_us += us;
            }
            let before = self.before.filter(|_| seen.upright);
            if let Some(step) = before.and_then(|before| before.turn_to(&seen.reading).ok()) {
                turn = Some(turn.unwrap_or(0.0) + step);
            }
            self.pass();
        }
        let rssi_dbm = (reads > 0).then(|| sum_dbm / reads as f32);
        let rate_s = soon_us as f64 * 1e-6;
        let rate = (soon_us > 0).then(|| (soon / rate_s) as f32);
        Sighting { reads, rssi_dbm, turn: turn.map(|turn| wrap(turn) as f32), rate, rate_s: rate_s as f32 }
    }

    /// Makes the oldest read one of the past.
    fn pass(&mut self) {
        if let Some(seen) = self.waiting.pop_front().filter(|seen| seen.upright) {
            self.before = Some(seen.reading);
        }
    }
}

/// The turn between reads of one channel that follow each other soon, modulo half a turn, rad, and the time between them, us.
fn soon_turn(before: &Reading, after: &Reading) -> Option<(f64, u64)> {
    let us = after.time.checked_sub(before.time).filter(|us| (1..=SOON_US).contains(us))?;
    let same = before.channel == after.channel;
    same.then(|| (wrap(2.0 * (after.raw - before.raw)) / 2.0, us))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use rfhoi_shared::units::ChannelIndex;

    use super::*;

    fn seen(time: u64, channel: u16, raw: f64) -> Seen {
        let reading = Reading { time, channel: ChannelIndex(channel), raw, corrected: None };
        Seen { reading, rssi: CentiDbm(-5_000), upright: true }
    }

    #[test]
    fn a_rate_is_of_soon_steps_on_one_channel_whatever_the_sign_of_the_carrier() {
        let mut sightings = Sightings::default();
        // 10 rad/s; the third is half a turn off, the fourth comes late, the last is of another channel.
        let all =
            [(10_000, 1, 0.0), (30_000, 1, 0.2), (50_000, 1, 0.4 + PI), (95_000, 1, 2.0), (98_000, 2, 5.0)];
        all.iter().for_each(|&(time, channel, raw)| sightings.add(seen(time, channel, raw)));
        let found = sightings.frame(0, 100_000);
        assert_eq!(found.reads, 5);
        assert!((found.rate.unwrap() - 10.0).abs() < 1e-3, "{found:?}");
        assert!((found.rate_s - 0.04).abs() < 1e-6, "{found:?}");
        assert_eq!(sightings.frame(100_000, 200_000).rate, None);
    }
}
