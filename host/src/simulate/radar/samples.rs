//! Paths to the ADC's words, chirp by chirp, as the LVDS link carries them.

use core::f64::consts::TAU;

use num_complex::Complex32;
use rfhoi_firmware::dca1000::samples::{FULL_SCALE, pack};
use rfhoi_firmware::simulated::Noise;
use rfhoi_shared::radar::SampleFormat;
use rfhoi_shared::units::SPEED_OF_LIGHT;

use super::chirps::{Chirps, Course, cis};
use super::paths::Path;

/// Sums of paths, sample by sample.
pub(super) struct Samples {
    /// Virtual antenna, sample: what does not move, and the same weighted by phase per hertz of carrier.
    still: Vec<[Complex32; 2]>,
    /// Receiver, sample.
    sums: Vec<Complex32>,
    tone: Vec<Complex32>,
}

/// Phase by a hertz more of carrier of a path of half length 1 m, rad.
const RAD_PER_HZ_M: f64 = 2.0 * TAU / SPEED_OF_LIGHT;

impl Samples {
    /// With the sums of what does not move.
    pub(super) fn new(chirps: &Chirps, still: &[Path]) -> Self {
        let virtuals = chirps.slots() * chirps.receivers();
        let mut samples = Self {
            still: vec![[Complex32::default(); 2]; virtuals * chirps.samples],
            sums: vec![Complex32::default(); chirps.receivers() * chirps.samples],
            tone: vec![Complex32::default(); chirps.samples],
        };
        samples.add_still(chirps, still);
        samples
    }

    fn add_still(&mut self, chirps: &Chirps, paths: &[Path]) {
        for path in paths {
            let half_m = f64::from(path.half_m[1]);
            let per_hz = Complex32::new(0.0, (half_m * RAD_PER_HZ_M) as f32);
            for slot in 0..chirps.slots() {
                tone(chirps, path, half_m, slot, 0.0, &mut self.tone);
                for rx in 0..chirps.receivers() {
                    let factor = chirps.receiver(rx, path);
                    let first = (slot * chirps.receivers() + rx) * chirps.samples;
                    for ([still, turned], z) in self.still[first..].iter_mut().zip(&self.tone) {
                        *still += z * factor;
                        *turned += z * factor * per_hz;
                    }
                }
            }
        }
    }

    /// The samples of chirp `index`, receiver by receiver, relative to full scale, without noise. The carrier is
    /// `jitter_hz` too high.
    pub(super) fn chirp(
        &mut self,
        chirps: &Chirps,
        paths: &[Path],
        index: usize,
        jitter_hz: f32,
    ) -> &[Complex32] {
        let slot = index % chirps.slots();
        let still = self.still[slot * chirps.receivers() * chirps.samples..].iter();
        for (z, [still, turned]) in self.sums.iter_mut().zip(still) {
            *z = still + turned * jitter_hz;
        }
        for path in paths {
            let half_m = Course::of(path).at(chirps.x(index));
            let turned = half_m * RAD_PER_HZ_M * f64::from(jitter_hz);
            tone(chirps, path, half_m, slot, turned, &mut self.tone);
            for (rx, sums) in self.sums.chunks_exact_mut(chirps.samples).enumerate() {
                let factor = chirps.receiver(rx, path);
                for (sum, z) in sums.iter_mut().zip(&self.tone) {
                    *sum += z * factor;
                }
            }
        }
        &self.sums
    }

    /// Writes the samples of the latest chirp to `out` as the link carries them, rounded and clipped, after adding
    /// noise of `thermal` (of full scale, for I and Q each).
    pub(super) fn pack(
        &mut self,
        chirps: &Chirps,
        format: SampleFormat,
        mut thermal: Option<(&mut Noise, f32)>,
        out: &mut [u8],
    ) {
        let receiver_bytes = chirps.samples * format.bytes() as usize;
        let receivers = self.sums.chunks_exact_mut(chirps.samples).zip(out.chunks_exact_mut(receiver_bytes));
        for (samples, out) in receivers {
            for z in &mut *samples {
                if let Some((noise, deviation)) = &mut thermal {
                    *z += Complex32::new(noise.draw(), noise.draw()) * *deviation;
                }
                *z *= FULL_SCALE;
            }
            pack(samples, format, out);
        }
    }
}

/// Writes a path's tone as it leaves transmitter `slot`, turned by `turned`.
fn tone(chirps: &Chirps, path: &Path, half_m: f64, slot: usize, turned: f64, out: &mut [Complex32]) {
    let step = chirps.sample_step(half_m);
    let first = chirps.phase(half_m, path, slot) + turned - step * (chirps.samples as f64 - 1.0) / 2.0;
    // Chunks restart from exact phases and run side by side.
    const LANES: usize = 8;
    let lanes: [_; LANES] =
        core::array::from_fn(|i| cis(first + step * i as f64) * f64::from(path.amplitude));
    let mut lanes = lanes.map(|z| Complex32::new(z.re as f32, z.im as f32));
    let stride = cis(step * LANES as f64);
    let stride = Complex32::new(stride.re as f32, stride.im as f32);
    for chunk in out.chunks_mut(LANES) {
        for (out, lane) in chunk.iter_mut().zip(&mut lanes) {
            *out = *lane;
            *lane *= stride;
        }
    }
}
