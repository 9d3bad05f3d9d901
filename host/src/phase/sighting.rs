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
        while let Some(seen) = self.waiting.front().filter(|seen| seen.reading.time <= end) {
            reads += 1;
            sum_dbm += f32::from(seen.rssi.0) / 100.0;
            let before = self.before.filter(|_| seen.upright);
            if let Some(step) = before.and_then(|before| before.turn_to(&seen.reading).ok()) {
                turn = Some(turn.unwrap_or(0.0) + step);
            }
            self.pass();
        }
        let rssi_dbm = (reads > 0).then(|| sum_dbm / reads as f32);
        Sighting { reads, rssi_dbm, turn: turn.map(|turn| wrap(turn) as f32) }
    }

    /// Makes the oldest read one of the past.
    fn pass(&mut self) {
        if let Some(seen) = self.waiting.pop_front().filter(|seen| seen.upright) {
            self.before = Some(seen.reading);
        }
    }
}
