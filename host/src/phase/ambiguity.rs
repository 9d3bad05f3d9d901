//! Finds phases that are ambiguous by pi.
//!
//! Some modes of Impinj readers recover the carrier only up to its sign, so that a share p of a still tag's phases is off
//! by pi. Doubling the angles brings both modes together: with the spread of one mode normal, `R2 = rho^4` and
//! `R1 = |1 - 2 p| rho`, so `p = (1 - R1 / R2^(1/4)) / 2`. It needs a tag that stays within a fraction of a quarter
//! wavelength: for a moving one R2 is small and nothing is said.

use super::circular::Resultant;

/// Least mean resultant length of the doubled angles: about 0.5 rad of spread.
const LEAST_CONCENTRATION: f64 = 0.6;
/// Least share of the minor mode; skewed spreads of one mode reach 1 %.
const LEAST_SHARE: f64 = 0.05;
/// Fewest readings in the minor mode: one alone may be an outlier.
const LEAST_READINGS: f64 = 2.0;

/// Collects the phases of one (tag, antenna, channel).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct AmbiguityDetector {
    single: Resultant,
    doubled: Resultant,
}

impl AmbiguityDetector {
    /// Adds a phase in radians.
    pub fn add(&mut self, phase: f64) {
        self.single.add(phase);
        self.doubled.add(2.0 * phase);
    }

    /// The phases as they are.
    pub fn phases(&self) -> &Resultant {
        &self.single
    }

    /// Share of the phases in the minor of two modes pi apart, if there are two.
    pub fn minor_share(&self) -> Option<f64> {
        let (r1, r2) = (self.single.mean_length()?, self.doubled.mean_length()?);
        if r2 < LEAST_CONCENTRATION {
            return None;
        }
        let share = (1.0 - r1 / r2.powf(0.25)) / 2.0;
        let readings = share * self.single.count() as f64;
        // Rounding, as the share is an estimate.
        (share >= LEAST_SHARE && readings.round() >= LEAST_READINGS).then_some(share)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    /// Simulated phases: spread evenly over +-`half_width`, every `flip`th off by pi.
    fn simulated(count: u32, half_width: f64, flip: Option<u32>) -> AmbiguityDetector {
        let mut detector = AmbiguityDetector::default();
        for n in 0..count {
            let spread = half_width * (2.0 * f64::from(n) / f64::from(count - 1) - 1.0);
            let flipped = flip.is_some_and(|every| n % every == 0);
            detector.add(2.5 + spread + if flipped { PI } else { 0.0 });
        }
        detector
    }

    #[test]
    fn two_modes_are_found_with_their_share() {
        for (every, share) in [(2, 0.5), (4, 0.25), (10, 0.1)] {
            let found = simulated(200, 0.3, Some(every)).minor_share().unwrap();
            assert!((found - share).abs() < 0.02, "{every}: {found}");
        }
    }

    #[test]
    fn one_mode_and_moving_tags_are_not_taken_for_two() {
        for half_width in [0.01, 0.3, 0.6, 0.8] {
            assert_eq!(simulated(200, half_width, None).minor_share(), None, "{half_width}");
        }
        assert_eq!(simulated(200, PI, None).minor_share(), None);
        assert_eq!(simulated(200, 0.3, Some(100)).minor_share(), None, "outliers of 1 %");
        assert_eq!(AmbiguityDetector::default().minor_share(), None);
    }
}
