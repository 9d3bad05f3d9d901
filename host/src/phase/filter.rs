//! Where a tag's phase can be next: a Kalman filter of unwrapped phase and its rate.
//!
//! The state is the unwrapped phase and its rate, driven by an acceleration that is white over longer times than
//! [`CORRELATION_S`] (Bar-Shalom, Li and Kirubarajan, "Estimation with Applications to Tracking and Navigation", 2001, section
//! 6.2.2). The noise of the reads is matched to the innovations. Two things come of it: a step that leads out of the gate is
//! no movement, and a step has one meaning as long as the gate is narrower than a turn.

/// For how long an acceleration lasts, s: a reach's main parts take 0.1 s and more. Over longer steps it is taken for constant.
const CORRELATION_S: f64 = 0.05;
/// Reads over which the noise is measured.
const NOISE_MEMORY: f64 = 64.0;
/// Largest squared innovation over its variance that counts for the noise: one outlier shall not open the gate.
const LARGEST_RATIO: f64 = 25.0;
/// Least phase noise, rad: below is rounding to codes and the sway of people and air.
const LEAST_NOISE: f64 = 0.05;

/// Unwrapped phase, its rate, and how well both are known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PhaseFilter {
    /// Phase since the first read, rad.
    pub(super) total: f64,
    /// Its rate, rad/s.
    pub(super) rate: f64,
    /// Last read's phase less `total`, rad.
    residual: f64,
    /// Variances of phase and rate, and what they share.
    phase_variance: f64,
    rate_variance: f64,
    shared: f64,
    /// Variance of a read's phase, rad^2.
    noise: f64,
}

/// What is expected of the next read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Expected {
    /// Turn since the last read's phase, rad.
    pub(super) turn: f64,
    /// Variance of the read about it, rad^2.
    pub(super) variance: f64,
    predicted: PhaseFilter,
    noise: f64,
}

impl PhaseFilter {
    /// A filter at phase 0 of which only a likely rate is known, standard deviation in rad/s.
    pub(super) fn new(noise: f64, rate: f64) -> Self {
        let noise = noise * noise;
        Self {
            total: 0.0,
            rate: 0.0,
            residual: 0.0,
            phase_variance: noise,
            rate_variance: rate * rate,
            shared: 0.0,
            noise,
        }
    }

    /// Standard deviation of a read's phase, rad.
    pub(super) fn noise(&self) -> f64 {
        self.noise.sqrt()
    }

    /// Forgets the rate but for its likely size, rad/s, and takes the next read's phase for where the tag is.
    pub(super) fn restart(&mut self, rate: f64) {
        *self = Self { total: self.total, noise: self.noise, ..Self::new(self.noise(), rate) };
    }

    /// The tag rests: its rate is 0 within `rate`, rad/s (a zero-velocity update).
    pub(super) fn rest(&mut self, rate: f64) {
        self.rate = 0.0;
        self.rate_variance = rate * rate;
        self.shared = 0.0;
    }

    /// What is expected after `seconds` in which the rate changes with a standard deviation of `acceleration`, rad/s^2.
    /// `extra` is the variance that the next read has beyond noise, rad^2.
    pub(super) fn expect(&self, seconds: f64, acceleration: f64, extra: f64) -> Expected {
        let mut predicted = *self;
        let (t, q) = (seconds, acceleration * acceleration * seconds.max(CORRELATION_S));
        predicted.total += self.rate * t;
        predicted.phase_variance += t * (2.0 * self.shared + t * self.rate_variance) + q * t * t * t / 3.0;
        predicted.shared += t * self.rate_variance + q * t * t / 2.0;
        predicted.rate_variance += q * t;
        let noise = self.noise + extra;
        Expected {
            turn: self.rate * t - self.residual,
            variance: predicted.phase_variance + noise,
            predicted,
            noise,
        }
    }

    /// Takes the expected read, which turned by `beyond` rad more than expected.
    pub(super) fn update(&mut self, expected: &Expected, beyond: f64) {
        *self = expected.predicted;
        let (gain, rate_gain) = (self.phase_variance / expected.variance, self.shared / expected.variance);
        self.total += gain * beyond;
        self.rate += rate_gain * beyond;
        self.residual = beyond * (1.0 - gain);
        self.rate_variance -= rate_gain * self.shared;
        self.shared -= gain * self.shared;
        self.phase_variance -= gain * self.phase_variance;
    }

    /// Goes on to the time of a read whose phase says nothing of the way there; the rate stays known.
    pub(super) fn coast(&mut self, expected: &Expected) {
        *self = expected.predicted;
        self.residual = 0.0;
        self.phase_variance = expected.noise;
        self.shared = 0.0;
    }

    /// Matches the noise to how far a read was from what was expected.
    pub(super) fn measure(&mut self, expected: &Expected, beyond: f64) {
        let ratio = (beyond * beyond / expected.variance).min(LARGEST_RATIO);
        self.noise += self.noise * (ratio - 1.0) / NOISE_MEMORY;
        self.noise = self.noise.clamp(LEAST_NOISE * LEAST_NOISE, 1.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_steady_rate_is_found_and_expected() {
        let mut filter = PhaseFilter::new(0.1, 30.0);
        for _ in 0..60 {
            let expected = filter.expect(0.014, 250.0, 0.0);
            filter.update(&expected, 0.35 - expected.turn);
        }
        assert!((filter.rate - 25.0).abs() < 1e-3, "{filter:?}");
        assert!((filter.total - 60.0 * 0.35).abs() < 1e-2, "{filter:?}");
        let later = filter.expect(0.1, 250.0, 0.0);
        assert!((later.turn - 2.5).abs() < 1e-2 && later.variance > 1.0, "{later:?}");
    }

    #[test]
    fn noise_is_matched_to_the_reads() {
        for size in [0.06, 0.3] {
            let mut filter = PhaseFilter::new(0.1, 1.0);
            let mut phase = 0.0;
            for n in 0..400 {
                // Of standard deviation `size`, a pattern without a trend.
                let now = size * [1.4, -0.6, 0.3, -1.5, 1.0, -0.9, 0.8, -0.5][n * 5 % 8];
                let expected = filter.expect(0.014, 100.0, 0.0);
                filter.update(&expected, now - phase - expected.turn);
                filter.measure(&expected, now - phase - expected.turn);
                phase = now;
            }
            assert!((0.6..1.5).contains(&(filter.noise() / size)), "{size}: {}", filter.noise());
        }
    }
}
