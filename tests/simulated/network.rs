//! A network of datagrams in virtual time: it loses, doubles and delays them, by a seed.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rfhoi_shared::units::BridgeTime;

/// What a network does to datagrams; shares are of 1.
#[derive(Debug, Clone, Copy, Default)]
pub struct Conditions {
    /// Share that is lost.
    pub loss: f64,
    /// Share that arrives twice; the second time is late.
    pub duplicates: f64,
    /// Share that is late, and so overtaken by others.
    pub late: f64,
    /// Delay of every datagram, us.
    pub delay_us: u64,
    /// What a late one is delayed more, at most, us.
    pub lateness_us: u64,
}

impl Conditions {
    /// A network that does nothing but lose this share.
    pub fn losing(loss: f64) -> Self {
        Self { loss, ..Self::default() }
    }
}

/// A datagram under way, ordered by arrival, then by when it was sent.
type Flying = (BridgeTime, u64, Vec<u8>);

/// Datagrams under way, and what became of all.
#[derive(Debug)]
pub struct Network {
    conditions: Conditions,
    random: ChaCha8Rng,
    flying: BinaryHeap<Reverse<Flying>>,
    sent: u64,
    dropped: Vec<u64>,
    most_flying: usize,
}

impl Network {
    /// A network in these conditions.
    pub fn new(conditions: Conditions, seed: u64) -> Self {
        Self {
            conditions,
            random: ChaCha8Rng::seed_from_u64(seed),
            flying: BinaryHeap::new(),
            sent: 0,
            dropped: Vec::new(),
            most_flying: 0,
        }
    }

    /// From now on it is in these conditions.
    pub fn set_conditions(&mut self, conditions: Conditions) {
        self.conditions = conditions;
    }

    /// Takes a datagram.
    pub fn send(&mut self, now: BridgeTime, datagram: Vec<u8>) {
        let Conditions { loss, duplicates, late, delay_us, .. } = self.conditions;
        let number = self.sent;
        self.sent += 1;
        if self.random.random_bool(loss) {
            self.dropped.push(number);
            return;
        }
        let on_time = now.after(delay_us);
        if self.random.random_bool(duplicates) {
            let again = on_time.after(self.lateness());
            self.flying.push(Reverse((again, number, datagram.clone())));
        }
        let arrival = if self.random.random_bool(late) { on_time.after(self.lateness()) } else { on_time };
        self.flying.push(Reverse((arrival, number, datagram)));
        self.most_flying = self.most_flying.max(self.flying.len());
    }

    fn lateness(&mut self) -> u64 {
        self.random.random_range(0..=self.conditions.lateness_us)
    }

    /// When the next datagram arrives.
    pub fn next_arrival(&self) -> Option<BridgeTime> {
        self.flying.peek().map(|Reverse((arrival, ..))| *arrival)
    }

    /// The next datagram that has arrived by `now`.
    pub fn arrive(&mut self, now: BridgeTime) -> Option<Vec<u8>> {
        if self.next_arrival()? > now {
            return None;
        }
        self.flying.pop().map(|Reverse((.., datagram))| datagram)
    }

    /// Datagrams that were sent.
    pub fn sent(&self) -> u64 {
        self.sent
    }

    /// Numbers of the datagrams that were lost, from 0 in the order of sending.
    pub fn dropped(&self) -> &[u64] {
        &self.dropped
    }

    /// Most datagrams that were under way at once.
    pub fn most_flying(&self) -> usize {
        self.most_flying
    }
}
