//! The Hann window: side lobes fall by 18 dB an octave from -31 dB, at 1.5 bins of noise bandwidth.

use core::f32::consts::TAU;

/// Writes a periodic Hann window that sums to `sum`. A single coefficient is `sum`.
///
/// F. J. Harris, "On the use of windows for harmonic analysis with the DFT", eq. 23b: `(1 - cos(2 pi n / N)) / 2`,
/// shifted by half a sample, so that no sample is thrown away.
pub fn hann(window: &mut [f32], sum: f32) {
    let length = window.len() as f32;
    // The coefficients 1 - cos(2 pi (n + 1/2) / N) sum to N, but a single one is 2.
    let scale = if window.len() == 1 { sum / 2.0 } else { sum / length };
    for (n, w) in window.iter_mut().enumerate() {
        *w = scale * (1.0 - libm::cosf(TAU * (n as f32 + 0.5) / length));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_symmetric_and_sums_as_asked() {
        for length in [1, 2, 4, 16, 64, 1024] {
            let mut window = [0.0; 1024];
            let window = &mut window[..length];
            hann(window, 3.0);
            let sum: f32 = window.iter().sum();
            assert!((sum - 3.0).abs() < 1e-4, "{length}: {sum}");
            for i in 0..length {
                assert!((window[i] - window[length - 1 - i]).abs() < 1e-5);
                assert!(window[i] > 0.0);
            }
        }
    }
}
