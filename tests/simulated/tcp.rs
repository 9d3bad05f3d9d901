//! One direction of a TCP connection in virtual time: bytes stay in order and come in other pieces than they were sent.

use std::collections::VecDeque;
use std::ops::RangeInclusive;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rfhoi_shared::units::BridgeTime;

/// Bytes under way.
#[derive(Debug)]
pub struct Pipe {
    delay_us: RangeInclusive<u64>,
    random: ChaCha8Rng,
    flying: VecDeque<(BridgeTime, Vec<u8>)>,
}

impl Pipe {
    /// A pipe in which a segment takes a time of this range, longer where it waits for the one before.
    pub fn new(delay_us: RangeInclusive<u64>, seed: u64) -> Self {
        Self { delay_us, random: ChaCha8Rng::seed_from_u64(seed), flying: VecDeque::new() }
    }

    /// Takes bytes; one time in four they go as two segments.
    pub fn send(&mut self, now: BridgeTime, bytes: &[u8]) {
        let cut = if self.random.random_bool(0.25) { self.random.random_range(0..=bytes.len()) } else { 0 };
        let (first, second) = bytes.split_at(cut);
        for segment in [first, second] {
            if segment.is_empty() {
                continue;
            }
            let arrival = now.after(self.random.random_range(self.delay_us.clone()));
            let last = self.flying.back().map_or(arrival, |(last, _)| *last);
            self.flying.push_back((arrival.max(last), segment.to_vec()));
        }
    }

    /// When the next segment arrives.
    pub fn next_arrival(&self) -> Option<BridgeTime> {
        self.flying.front().map(|(arrival, _)| *arrival)
    }

    /// The next segment that has arrived by `now`.
    pub fn arrive(&mut self, now: BridgeTime) -> Option<Vec<u8>> {
        if self.next_arrival()? > now {
            return None;
        }
        self.flying.pop_front().map(|(_, segment)| segment)
    }

    /// Loses what is under way, as when the connection breaks.
    pub fn clear(&mut self) {
        self.flying.clear();
    }
}
