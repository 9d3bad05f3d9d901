//! Exponential backoff with jitter: how long to wait before the next attempt to connect.

/// Wait after the first failure, us.
const FIRST_US: u64 = 500_000;
/// Longest wait before jitter, us.
const LONGEST_US: u64 = 30_000_000;

/// Doubles from 0.5 s to 30 s, each shortened or lengthened by up to a quarter so that bridges do not knock in step.
#[derive(Debug, Clone)]
pub(super) struct Backoff {
    next_us: u64,
    random: u64,
}

impl Backoff {
    pub(super) fn new(seed: u64) -> Self {
        Self { next_us: FIRST_US, random: seed }
    }

    /// Begins again with the shortest wait.
    pub(super) fn reset(&mut self) {
        self.next_us = FIRST_US;
    }

    /// The next wait in us.
    pub(super) fn wait_us(&mut self) -> u64 {
        let wait = self.next_us;
        self.next_us = wait.saturating_mul(2).min(LONGEST_US);
        let span = wait / 2;
        (wait - wait / 4) + self.random() % (span + 1)
    }

    /// SplitMix64 (Steele, Lea, Flood 2014).
    fn random(&mut self) -> u64 {
        self.random = self.random.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.random;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn doubles_within_its_jitter_and_stays_bounded() {
        for seed in 0..50 {
            let mut backoff = Backoff::new(seed);
            let mut nominal = FIRST_US;
            for _ in 0..70 {
                let wait = backoff.wait_us();
                assert!((nominal * 3 / 4..=nominal * 5 / 4).contains(&wait), "{wait} for {nominal}");
                nominal = (nominal * 2).min(LONGEST_US);
            }
            backoff.reset();
            assert!(backoff.wait_us() <= FIRST_US * 5 / 4);
        }
    }

    #[test]
    fn seeds_differ() {
        assert_ne!(Backoff::new(1).wait_us(), Backoff::new(2).wait_us());
    }
}
