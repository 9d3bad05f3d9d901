//! A serial line that flips bits: uplink packets go in, what its receiver makes of them comes out.

use std::collections::{BTreeSet, VecDeque};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rfhoi_shared::wire::serial::{Decoder, MAX_FRAME, SerialCounts, encode};
use rfhoi_shared::wire::{MAX_PACKET, WireError};

/// A line and its receiver.
#[derive(Debug)]
pub struct SerialLine {
    /// Share of bits that arrive changed.
    bit_errors: f64,
    random: ChaCha8Rng,
    decoder: Decoder,
    arrived: VecDeque<Vec<u8>>,
    sent: u64,
    damaged: BTreeSet<u64>,
}

impl SerialLine {
    /// A line on which this share of the bits arrives changed.
    pub fn new(bit_errors: f64, seed: u64) -> Self {
        Self {
            bit_errors,
            random: ChaCha8Rng::seed_from_u64(seed),
            decoder: Decoder::new(),
            arrived: VecDeque::new(),
            sent: 0,
            damaged: BTreeSet::new(),
        }
    }

    /// Takes a packet.
    ///
    /// # Errors
    /// If it is longer than a packet may be.
    pub fn send(&mut self, packet: &[u8]) -> Result<(), WireError> {
        let mut frame = [0; MAX_FRAME];
        let length = encode(packet, &mut frame)?.len();
        for (at, byte) in frame[..length].iter_mut().enumerate() {
            for bit in 0..8 {
                if self.random.random_bool(self.bit_errors) {
                    *byte ^= 1 << bit;
                    self.damaged.insert(self.sent);
                    if at == length - 1 {
                        // Without its end it is one with the next.
                        self.damaged.insert(self.sent + 1);
                    }
                }
            }
        }
        self.sent += 1;
        let arrived = &mut self.arrived;
        self.decoder.push(&frame[..length], |packet| {
            let mut buffer = [0; MAX_PACKET];
            if let Ok(bytes) = packet.and_then(|p| p.encode(&mut buffer).map(<[u8]>::to_vec)) {
                arrived.push_back(bytes);
            }
        });
        Ok(())
    }

    /// The next packet that came through.
    pub fn arrive(&mut self) -> Option<Vec<u8>> {
        self.arrived.pop_front()
    }

    /// Whether a packet waits.
    pub fn has_arrived(&self) -> bool {
        !self.arrived.is_empty()
    }

    /// Packets that were sent.
    pub fn sent(&self) -> u64 {
        self.sent
    }

    /// Numbers of the packets whose frame was damaged, or whose frame before lost its end.
    pub fn damaged(&self) -> &BTreeSet<u64> {
        &self.damaged
    }

    /// What the receiver counted.
    pub fn counts(&self) -> SerialCounts {
        self.decoder.counts()
    }
}
