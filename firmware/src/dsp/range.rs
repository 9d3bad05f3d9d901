//! Chirps to gated range spectra.

use num_complex::Complex32;
use rfhoi_shared::radar::{MAX_SAMPLES, RadarProfile, RangeGate, SampleFormat};

use super::{Cube, fft, window};
use crate::dca1000::samples;

/// One over the largest magnitude of a 16-bit word.
const FULL_SCALE: f32 = 1.0 / 32768.0;

/// Window and range FFT, receiver by receiver.
#[derive(Debug)]
pub struct RangeStage {
    window: [f32; MAX_SAMPLES],
    work: [Complex32; MAX_SAMPLES],
    samples: usize,
    receivers: usize,
    slots: usize,
    format: SampleFormat,
    gate: RangeGate,
}

impl Default for RangeStage {
    fn default() -> Self {
        Self::new()
    }
}

impl RangeStage {
    /// A stage that has no profile yet and passes nothing.
    pub const fn new() -> Self {
        Self {
            window: [0.0; MAX_SAMPLES],
            work: [Complex32::new(0.0, 0.0); MAX_SAMPLES],
            samples: 0,
            receivers: 0,
            slots: 1,
            format: SampleFormat::Real,
            gate: RangeGate { first: 0, bins: 0 },
        }
    }

    /// Takes a profile that is valid, and the gate.
    pub fn configure(&mut self, profile: &RadarProfile, gate: RangeGate) {
        self.samples = usize::from(profile.samples).min(MAX_SAMPLES);
        self.receivers = profile.rx_count();
        self.slots = profile.tx_slots().max(1);
        self.format = profile.format;
        self.gate = gate;
        // Half of a real tone's power is at negative frequencies.
        let sum = if self.format == SampleFormat::Real { 2.0 * FULL_SCALE } else { FULL_SCALE };
        if let Some(window) = self.window.get_mut(..self.samples) {
            window::hann(window, sum);
        }
    }

    /// The range spectrum of one receiver: all bins, from 0; bins past the half of a real chirp's mean nothing.
    ///
    /// Returns the spectrum and how many words were at the ADC's limits.
    pub fn spectrum(&mut self, receiver: &[u8]) -> (&[Complex32], u32) {
        let Self { window, work, samples, format, .. } = self;
        let Some((window, work)) = window.get(..*samples).zip(work.get_mut(..*samples)) else {
            return (&[], 0);
        };
        let clipped = samples::unpack(receiver, *format, window, work);
        fft::forward(work);
        (work, clipped)
    }

    /// Takes chirp `index` of a frame, all receivers, into `cube`. Returns how many words were at the ADC's limits.
    pub fn chirp(&mut self, index: u32, bytes: &[u8], cube: &mut Cube<'_>) -> u32 {
        if cube.is_nothing() {
            return 0;
        }
        let index = index as usize;
        let (loop_index, slot) = (index / self.slots, index % self.slots);
        let receiver_bytes = self.samples * self.format.bytes() as usize;
        let first = usize::from(self.gate.first);
        let receivers = self.receivers;
        let mut clipped = 0;
        for (rx, receiver) in bytes.chunks_exact(receiver_bytes.max(1)).take(receivers).enumerate() {
            let (spectrum, limits) = self.spectrum(receiver);
            cube.store(slot * receivers + rx, loop_index, spectrum.get(first..).unwrap_or(&[]));
            clipped += limits;
        }
        clipped
    }
}
