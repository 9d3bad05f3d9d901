//! The gated cube to maps, one range bin at a time.
//!
//! Static clutter is taken off behind the FFT: the FFT of `w (x - s)` is that of `w x` less `s W`, with W the spectrum of
//! the window. Bin 0 of the FFT is the mean weighted by the window, which is what is static; and of a Hann window only
//! bins -1, 0 and 1 are not zero. So a row needs no pass of its own for its mean, and none for its removal. Where chirps were
//! lost their weight is zero, W has no zeros, and all bins are corrected: a lost chirp does not bring the clutter back.

use core::num::NonZeroUsize;

use num_complex::{Complex, Complex32};
use rfhoi_shared::config::{ClutterRemoval, RadarConfig};
use rfhoi_shared::radar::{MAX_GATE_BINS, MAX_LOOPS, MAX_TX_SLOTS, MAX_VIRTUAL};

use super::moving::MovingCells;
use super::{Cube, fft, window};

/// One range bin of both maps, as power relative to a full-scale tone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Row<'a> {
    /// Power by Doppler bin from `-loops/2` to `loops/2 - 1`, the mean over the virtual antennas.
    pub doppler: [&'a [f32]; 2],
    /// Power by group of loops, oldest first, the mean over loops and the first receiver of each transmitter slot.
    pub time: &'a [f32],
}

impl<'a> Row<'a> {
    /// The Doppler bins in order.
    pub fn doppler(&self) -> impl Iterator<Item = f32> + 'a {
        let [negative, positive] = self.doppler;
        negative.iter().chain(positive).copied()
    }
}

/// Chirps of one transmitter slot in the frame at hand.
#[derive(Debug, Clone, Copy)]
struct Slot {
    /// Spectrum of the window with lost chirps left out, in FFT order; bin 0 is 1, or 0 if nothing came.
    leakage: [Complex32; MAX_LOOPS],
    /// No chirp was lost.
    intact: bool,
    /// Chirps that came.
    chirps: u32,
}

const ZERO: Complex32 = Complex32::new(0.0, 0.0);
const NO_SLOT: Slot = Slot { leakage: [ZERO; MAX_LOOPS], intact: false, chirps: 0 };

/// Window, Doppler FFT, clutter removal, power, and the covariance of what moves.
#[derive(Debug)]
pub struct DopplerStage {
    window: [f32; MAX_LOOPS],
    slots: [Slot; MAX_TX_SLOTS],
    /// What each cell must be multiplied by, 0 for lost ones.
    scales: [[f32; MAX_LOOPS]; MAX_VIRTUAL],
    /// The same times the window of the slot.
    factors: [[f32; MAX_LOOPS]; MAX_VIRTUAL],
    /// Doppler spectra of the latest range bin by virtual antenna, in FFT order.
    pub(super) spectra: [[Complex32; MAX_LOOPS]; MAX_VIRTUAL],
    background: [[Complex32; MAX_VIRTUAL]; MAX_GATE_BINS],
    power: [f32; MAX_LOOPS],
    time: [f32; MAX_LOOPS],
    moving: MovingCells,
    clutter: ClutterRemoval,
    /// Share of a new frame in the background.
    background_gain: f32,
    /// No frame has entered the background yet.
    background_empty: bool,
    loops: usize,
    virtuals: usize,
    receivers: NonZeroUsize,
    columns: NonZeroUsize,
}

impl Default for DopplerStage {
    fn default() -> Self {
        Self::new()
    }
}

impl DopplerStage {
    /// A stage that has no profile yet and yields empty rows.
    pub const fn new() -> Self {
        Self {
            window: [0.0; MAX_LOOPS],
            slots: [NO_SLOT; MAX_TX_SLOTS],
            scales: [[0.0; MAX_LOOPS]; MAX_VIRTUAL],
            factors: [[0.0; MAX_LOOPS]; MAX_VIRTUAL],
            spectra: [[ZERO; MAX_LOOPS]; MAX_VIRTUAL],
            background: [[ZERO; MAX_VIRTUAL]; MAX_GATE_BINS],
            power: [0.0; MAX_LOOPS],
            time: [0.0; MAX_LOOPS],
            moving: MovingCells::new(),
            clutter: ClutterRemoval::Off,
            background_gain: 0.0,
            background_empty: true,
            loops: 0,
            virtuals: 0,
            receivers: NonZeroUsize::MIN,
            columns: NonZeroUsize::MIN,
        }
    }

    /// Takes a configuration that is valid, and forgets the background.
    pub fn configure(&mut self, config: &RadarConfig) {
        let RadarConfig { profile, processing, .. } = config;
        self.loops = usize::from(profile.loops).min(MAX_LOOPS);
        self.virtuals = profile.virtual_count().min(MAX_VIRTUAL);
        self.receivers = NonZeroUsize::new(profile.rx_count()).unwrap_or(NonZeroUsize::MIN);
        let columns = usize::from(processing.range_time_columns).min(self.loops);
        self.columns = NonZeroUsize::new(columns).unwrap_or(NonZeroUsize::MIN);
        self.clutter = processing.clutter;
        self.background_empty = true;
        if let ClutterRemoval::Background { time_constant } = processing.clutter {
            self.background_gain = 1.0 - libm::expf(-profile.frame_period().0 / time_constant.0);
        }
        if let Some(window) = self.window.get_mut(..self.loops) {
            window::hann(window, 1.0);
        }
        self.moving.configure(profile, processing.detection.0, processing.zero_doppler_guard);
    }

    /// Begins a frame: which rows came, and how they are scaled.
    pub fn begin(&mut self, cube: &Cube<'_>) {
        self.moving.clear();
        let Self { window, slots, scales, factors, loops, virtuals, receivers, .. } = self;
        for (v, scales) in scales.iter_mut().enumerate().take(*virtuals) {
            for (scale, stored) in scales.iter_mut().zip(cube.scales(v)) {
                *scale = stored.unwrap_or(0.0);
            }
        }
        let rows = scales.chunks(receivers.get()).zip(factors.chunks_mut(receivers.get()));
        for (slot, (scales, factors)) in slots.iter_mut().zip(rows) {
            // The receivers of a chirp come or are lost together.
            let Some(first) = scales.first() else { continue };
            let came = || first.iter().take(*loops).map(|&scale| scale != 0.0);
            slot.chirps = came().map(u32::from).sum();
            slot.intact = slot.chirps as usize == *loops;
            let sum: f32 = came().zip(&*window).filter(|(came, _)| *came).map(|(_, w)| w).sum();
            let norm = if sum > 0.0 { 1.0 / sum } else { 0.0 };
            let Some(leakage) = slot.leakage.get_mut(..*loops) else { continue };
            for ((leak, came), w) in leakage.iter_mut().zip(came()).zip(&*window) {
                *leak = Complex32::new(if came { w * norm } else { 0.0 }, 0.0);
            }
            for (scales, factors) in scales.iter().zip(factors) {
                for ((factor, scale), weight) in factors.iter_mut().zip(scales).zip(&*leakage) {
                    *factor = scale * weight.re;
                }
            }
            fft::forward(leakage);
        }
    }

    /// Computes the rows of range bin `bin` of `cube` and adds its moving cells to the covariance.
    pub fn range_bin(&mut self, cube: &Cube<'_>, bin: usize) -> Row<'_> {
        let (loops, columns) = (self.loops, self.columns);
        let time = self.time.get_mut(..columns.get()).unwrap_or(&mut []);
        time.fill(0.0);
        let mut timed = 0;
        for v in 0..self.virtuals {
            let (Some(spectrum), Some(factors), Some(slot)) = (
                self.spectra.get_mut(v).and_then(|s| s.get_mut(..loops)),
                self.factors.get(v),
                self.slots.get(v / self.receivers),
            ) else {
                continue;
            };
            let row = cube.row(bin, v);
            for ((x, cell), &factor) in spectrum.iter_mut().zip(row).zip(factors) {
                *x = Complex32::new(f32::from(cell.re) * factor, f32::from(cell.im) * factor);
            }
            fft::forward(spectrum);
            let mean = spectrum.first().copied().unwrap_or_default();
            let static_part = match self.clutter {
                ClutterRemoval::Off => ZERO,
                ClutterRemoval::Mean => mean,
                ClutterRemoval::Background { .. } => {
                    let gain = if self.background_empty { 1.0 } else { self.background_gain };
                    let gain = if slot.chirps == 0 { 0.0 } else { gain };
                    match self.background.get_mut(bin).and_then(|row| row.get_mut(v)) {
                        Some(background) => {
                            *background += (mean - *background) * gain;
                            *background
                        }
                        None => ZERO,
                    }
                }
            };
            remove(static_part, slot, spectrum);
            if v % self.receivers == 0
                && let Some(scales) = self.scales.get(v)
            {
                let group = (loops / columns).max(1);
                timed += 1;
                for ((row, scales), time) in row.chunks(group).zip(scales.chunks(group)).zip(&mut *time) {
                    *time += residual_power(row, scales, static_part, slot.intact);
                }
            }
        }
        let mean_over_loops = columns.get() as f32 / (loops * timed).max(1) as f32;
        for time in &mut *time {
            *time *= mean_over_loops;
        }
        let power = self.power.get_mut(..loops).unwrap_or(&mut []);
        let spectra = self.spectra.get(..self.virtuals).unwrap_or(&[]);
        mean_power(spectra, power);
        self.moving.add(power, &self.spectra);
        // FFT order has the negative half last; a single bin is zero Doppler.
        let (positive, negative) = power.split_at_checked(loops.div_ceil(2)).unwrap_or_default();
        Row { doppler: [negative, positive], time }
    }

    /// Ends the frame and yields what moved in it.
    pub fn finish(&mut self) -> &MovingCells {
        self.background_empty &= self.slots.iter().all(|slot| slot.chirps == 0);
        &self.moving
    }
}

/// Takes `static_part` off the spectrum of a row.
fn remove(static_part: Complex32, slot: &Slot, spectrum: &mut [Complex32]) {
    /// Shortest Hann window of which bins -1 and 1 are two.
    const MIN_SPARSE: usize = 4;
    let correct = |(x, leak): (&mut Complex32, &Complex32)| *x -= static_part * leak;
    let length = spectrum.len();
    if slot.intact && length >= MIN_SPARSE {
        spectrum.iter_mut().zip(&slot.leakage).take(2).for_each(correct);
        spectrum.iter_mut().zip(&slot.leakage).skip(length - 1).for_each(correct);
    } else {
        spectrum.iter_mut().zip(&slot.leakage).for_each(correct);
    }
}

/// Energy of what is left of some loops of a row without its static part; lost chirps have none.
fn residual_power(row: &[Complex<i16>], scales: &[f32], static_part: Complex32, intact: bool) -> f32 {
    row.iter().zip(scales).filter(|&(_, &scale)| intact || scale != 0.0).fold(0.0, |sum, (cell, &scale)| {
        let x = Complex32::new(f32::from(cell.re) * scale, f32::from(cell.im) * scale) - static_part;
        sum + x.re * x.re + x.im * x.im
    })
}

/// Writes the power by bin, the mean over the rows of `spectra`.
fn mean_power(spectra: &[[Complex32; MAX_LOOPS]], power: &mut [f32]) {
    power.fill(0.0);
    // Sums of four rows stay in registers.
    let (fours, rest) = spectra.as_chunks::<4>();
    for [a, b, c, d] in fours {
        for ((((p, a), b), c), d) in power.iter_mut().zip(a).zip(b).zip(c).zip(d) {
            let re = *p + a.re * a.re + b.re * b.re + c.re * c.re + d.re * d.re;
            *p = re + (a.im * a.im + b.im * b.im + c.im * c.im + d.im * d.im);
        }
    }
    for row in rest {
        for (p, z) in power.iter_mut().zip(row) {
            *p += z.norm_sqr();
        }
    }
    let share = 1.0 / spectra.len().max(1) as f32;
    for p in power {
        *p *= share;
    }
}
