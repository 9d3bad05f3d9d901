//! The range spectrum of one path: a few bins.
//!
//! A path whose half length is `d` range bins is a tone. Of N samples under the bridge's Hann window, which is symmetric about
//! the middle, bin k of its spectrum is `exp(j psi) exp(-j pi k (N-1)/N) W(d - k)`: psi is its phase in the middle of the
//! chirp and W the real spectrum of the window. W falls fast, so [`TAPS`] bins hold the path.

use std::f64::consts::PI;

use num_complex::Complex32;
use rfhoi_firmware::dsp::window::hann;

/// Bins that a path reaches. What lies beyond is 48 dB or more below its peak.
pub(super) const TAPS: usize = 8;
/// Bins before the one that `d` lies in.
const BEFORE: usize = TAPS / 2 - 1;
/// Steps of `d` within a bin; the nearest one errs by at most 1/512 of a bin, which is 57 dB below the peak.
const STEPS: usize = 256;

/// One tap twice, for the real and the imaginary part.
pub(super) type Taps = [f32; 2 * TAPS];

/// W in steps of `d`.
pub(super) struct Kernel {
    taps: Box<[Taps; STEPS]>,
}

impl Kernel {
    pub(super) fn new(samples: usize) -> Self {
        let mut window = vec![0.0; samples];
        hann(&mut window, 1.0);
        let middle = (samples as f64 - 1.0) / 2.0;
        let value = |x: f64| -> f64 {
            let terms = window.iter().enumerate();
            terms
                .map(|(n, &w)| f64::from(w) * libm::cos(2.0 * PI * x * (n as f64 - middle) / samples as f64))
                .sum()
        };
        let taps = |step: usize| {
            let fraction = step as f64 / STEPS as f64;
            std::array::from_fn(|i| value(fraction - ((i / 2) as f64 - BEFORE as f64)) as f32)
        };
        Self { taps: Box::new(std::array::from_fn(taps)) }
    }

    /// The first bin that a path at `bins` range bins reaches, and its share in this one and those after it. `bins` must
    /// be [`TAPS`] or more.
    #[inline(always)]
    pub(super) fn at(&self, bins: f32) -> (usize, &Taps) {
        let steps = (bins * STEPS as f32 + 0.5) as usize;
        (steps / STEPS - BEFORE, &self.taps[steps % STEPS])
    }
}

/// Phase factor of bin `bin`: `exp(-j pi k (N-1)/N)`, real and imaginary part.
pub(super) fn bin_turn(bin: usize, samples: usize) -> Complex32 {
    let (sin, cos) =
        libm::sincos(-PI * (bin % (2 * samples)) as f64 * (samples as f64 - 1.0) / samples as f64);
    Complex32::new(cos as f32, sin as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tone_on_a_bin_is_one_and_two_halves() {
        let kernel = Kernel::new(128);
        let (first, taps) = kernel.at(20.0);
        let real: Vec<f32> = taps.iter().step_by(2).copied().collect();
        assert_eq!(first, 17);
        assert!((real[3] - 1.0).abs() < 1e-4 && (real[2] - 0.5).abs() < 1e-3 && (real[4] - 0.5).abs() < 1e-3);
        assert!([0, 1, 5, 6, 7].iter().all(|&i| real[i].abs() < 1e-3), "{real:?}");
    }

    #[test]
    fn what_is_left_out_is_below_the_stated_level() {
        let (kernel, samples) = (Kernel::new(128), 128.0);
        let mut window = [0.0; 128];
        hann(&mut window, 1.0);
        let w = |x: f64| -> f64 {
            let terms = window.iter().enumerate();
            terms.map(|(n, &w)| f64::from(w) * (2.0 * PI * x * (n as f64 - 63.5) / samples).cos()).sum()
        };
        for step in 0..100 {
            let d = 30.0 + f64::from(step) / 100.0;
            let (first, taps) = kernel.at(d as f32);
            for bin in 0..60_usize {
                let within = bin.checked_sub(first).filter(|i| *i < TAPS);
                let approximate = within.map_or(0.0, |i| f64::from(taps[2 * i]));
                let bound = if within.is_some() { -57.0 } else { -48.0 };
                let error = 20.0 * (approximate - w(d - bin as f64)).abs().max(1e-12).log10();
                assert!(error < bound, "{d} bin {bin}: {error:.1} dB");
            }
        }
    }
}
