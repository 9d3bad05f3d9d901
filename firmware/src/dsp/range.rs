//! Chirps to gated range spectra.

use core::num::NonZeroUsize;

use num_complex::Complex32;
use rfhoi_shared::radar::{MAX_SAMPLES, RadarProfile, RangeGate, SampleFormat};

use super::{Cube, fft, window};
use crate::dca1000::samples::{self, FULL_SCALE};

/// Window and range FFT, receiver by receiver.
#[derive(Debug)]
pub struct RangeStage {
    window: [f32; MAX_SAMPLES],
    work: [Complex32; MAX_SAMPLES],
    samples: usize,
    receivers: usize,
    slots: NonZeroUsize,
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
            slots: NonZeroUsize::MIN,
            format: SampleFormat::Real,
            gate: RangeGate { first: 0, bins: 0 },
        }
    }

    /// Takes a profile that is valid, and the gate.
    pub fn configure(&mut self, profile: &RadarProfile, gate: RangeGate) {
        self.samples = usize::from(profile.samples).min(MAX_SAMPLES);
        self.receivers = profile.rx_count();
        self.slots = NonZeroUsize::new(profile.tx_slots()).unwrap_or(NonZeroUsize::MIN);
        self.format = profile.format;
        self.gate = gate;
        // Half of a real tone's power is at negative frequencies.
        let sum = if self.format == SampleFormat::Real { 2.0 / FULL_SCALE } else { 1.0 / FULL_SCALE };
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

    /// Takes one receiver's samples of chirp `chirp` of a frame into `cube`. Returns how many words were at the ADC's
    /// limits.
    pub fn row(&mut self, chirp: u32, receiver: u32, bytes: &[u8], cube: &mut Cube<'_>) -> u32 {
        if cube.is_nothing() {
            return 0;
        }
        let (loop_index, first_antenna) = self.place(chirp);
        let first_bin = usize::from(self.gate.first);
        let (spectrum, clipped) = self.spectrum(bytes);
        let gated = spectrum.get(first_bin..).unwrap_or(&[]);
        cube.store(first_antenna + receiver as usize, loop_index, gated);
        clipped
    }

    /// Takes the rows of chirp `chirp` that are in `cube` back out.
    pub fn take_back(&self, chirp: u32, cube: &mut Cube<'_>) {
        let (loop_index, first_antenna) = self.place(chirp);
        for receiver in 0..self.receivers {
            cube.remove(first_antenna + receiver, loop_index);
        }
    }

    /// Loop and first virtual antenna of a chirp.
    fn place(&self, chirp: u32) -> (usize, usize) {
        let chirp = chirp as usize;
        (chirp / self.slots, chirp % self.slots * self.receivers)
    }
}
