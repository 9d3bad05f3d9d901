//! Simulated clocks, delays, drift and steps; seeds are fixed.

extern crate std;
use std::vec::Vec;

use proptest::prelude::*;

use super::*;

/// SplitMix64.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// Uniform in (0, 1].
    fn uniform(&mut self) -> f64 {
        ((self.next() >> 11) + 1) as f64 / (1u64 << 53) as f64
    }

    fn exponential(&mut self, mean: f64) -> f64 {
        -mean * libm::log(self.uniform())
    }
}

const UTC: f64 = 1.7e15;

/// A simulated link: reads at Poisson times, a delay of `FLOOR_US` and an exponential part, in order.
struct Link {
    random: Random,
    /// True time of the bridge, us.
    true_us: f64,
    last_arrival: f64,
    drift_ppm: f64,
    step_us: f64,
    mean_delay_us: f64,
}

const FLOOR_US: f64 = 300.0;
const READS_PER_S: f64 = 200.0;

impl Link {
    fn new(seed: u64, drift_ppm: f64) -> Self {
        let random = Random(seed);
        Self { random, true_us: 1e6, last_arrival: 0.0, drift_ppm, step_us: 0.0, mean_delay_us: 2_000.0 }
    }

    /// True time, reader's time and arrival of the next read.
    fn read(&mut self) -> (f64, ReaderTime, BridgeTime) {
        self.true_us += self.random.exponential(1e6 / READS_PER_S);
        let reader = UTC + self.true_us * (1.0 + self.drift_ppm * 1e-6) + self.step_us;
        let delay = FLOOR_US + self.random.exponential(self.mean_delay_us);
        self.last_arrival = self.last_arrival.max(self.true_us + delay);
        (self.true_us, ReaderTime(reader as u64), BridgeTime(self.last_arrival as u64))
    }

    /// Errors in us of the next reads, the floor of the delay taken off.
    fn errors(&mut self, clock: &mut ReaderClock, seconds: f64) -> Vec<f64> {
        let end = self.true_us + seconds * 1e6;
        let mut errors = Vec::new();
        while self.true_us < end {
            let (truth, reader, arrival) = self.read();
            let time = clock.observe(reader, arrival);
            assert!(time <= arrival, "a read cannot be seen after it arrived");
            errors.push(time.0 as f64 - truth - FLOOR_US);
        }
        errors
    }
}

fn rms(errors: &[f64]) -> f64 {
    libm::sqrt(errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64)
}

fn largest(errors: &[f64]) -> f64 {
    errors.iter().fold(0.0, |largest, e| libm::fmax(largest, libm::fabs(*e)))
}

#[test]
fn delay_does_not_jitter_the_time_at_any_drift() {
    for drift in [-100.0, -50.0, 0.0, 50.0, 100.0] {
        for seed in 0..5 {
            let (mut clock, mut link) = (ReaderClock::default(), Link::new(seed, drift));
            link.errors(&mut clock, 2.0);
            let errors = link.errors(&mut clock, 120.0);
            std::eprintln!("drift {drift} ppm: rms {:.0} us, max {:.0} us", rms(&errors), largest(&errors));
            // The delays alone have an RMS of 2 ms and reach 20 ms.
            assert!(rms(&errors) < 120.0, "rms {} us at {drift} ppm", rms(&errors));
            assert!(largest(&errors) < 500.0, "max {} us at {drift} ppm", largest(&errors));
            assert_eq!(clock.steps(), 0);
        }
    }
}

#[test]
fn a_stalled_link_is_no_step() {
    let (mut clock, mut link) = (ReaderClock::default(), Link::new(7, 20.0));
    link.errors(&mut clock, 5.0);
    for _ in 0..10 {
        // Three seconds of reads arrive at once.
        link.last_arrival = link.true_us + 3e6;
        let errors = link.errors(&mut clock, 10.0);
        assert!(largest(&errors) < 1_000.0, "max {} us", largest(&errors));
    }
    assert_eq!(clock.steps(), 0);
}

#[test]
fn steps_while_reading_are_followed_at_once() {
    for step in [-3600e6, -2e6, 2e6, 3600e6] {
        let (mut clock, mut link) = (ReaderClock::default(), Link::new(3, 50.0));
        link.errors(&mut clock, 5.0);
        link.step_us += step;
        let errors = link.errors(&mut clock, 5.0);
        assert_eq!(clock.steps(), 1);
        assert!(largest(&errors) < 20_000.0, "at first no worse than the delays: {}", largest(&errors));
        assert!(rms(&errors[400..]) < 120.0, "learnt anew within 2 s: {}", rms(&errors[400..]));
    }
}

#[test]
fn a_step_back_during_a_pause_is_proven_within_its_time() {
    let (mut clock, mut link) = (ReaderClock::default(), Link::new(9, -50.0));
    link.errors(&mut clock, 5.0);
    link.true_us += 60e6;
    link.step_us -= 20e6;
    let early = link.errors(&mut clock, 1.1);
    assert_eq!(clock.steps(), 1);
    assert!(early[0] < -19e6, "until it is proven the times are too early by the step");
    let errors = link.errors(&mut clock, 10.0);
    assert!(largest(&errors) < 1_000.0, "max {} us", largest(&errors));
}

#[test]
fn one_absurd_timestamp_does_not_last() {
    for absurd in [0, u64::MAX, 1 << 63] {
        let (mut clock, mut link) = (ReaderClock::default(), Link::new(4, 0.0));
        link.errors(&mut clock, 5.0);
        let at = BridgeTime(link.last_arrival as u64);
        assert!(clock.observe(ReaderTime(absurd), at) <= at);
        link.errors(&mut clock, 3.0);
        assert!(rms(&link.errors(&mut clock, 10.0)) < 120.0, "{absurd}");
    }
}

#[test]
fn the_first_read_of_a_connection_is_at_its_arrival() {
    let mut clock = ReaderClock::default();
    assert_eq!(clock.observe(ReaderTime(5_000), BridgeTime(900)), BridgeTime(900));
    assert_eq!(clock.observe(ReaderTime(5_100), BridgeTime(1_050)), BridgeTime(1_000));
    clock.reset();
    assert_eq!(clock.observe(ReaderTime(7), BridgeTime(2_000)), BridgeTime(2_000));
}

proptest! {
    #[test]
    fn any_times_map_to_no_later_than_arrival(
        reads in proptest::collection::vec((any::<u64>(), any::<u64>()), 0..50)
    ) {
        let mut clock = ReaderClock::default();
        let mut arrivals: Vec<_> = reads.iter().map(|r| r.1).collect();
        arrivals.sort_unstable();
        for (&(reader, _), arrival) in reads.iter().zip(arrivals) {
            prop_assert!(clock.observe(ReaderTime(reader), BridgeTime(arrival)).0 <= arrival);
        }
    }
}
