//! The gated cube to maps, one range bin at a time.

use num_complex::Complex32;
use rfhoi_shared::config::{ClutterRemoval, RadarConfig};
use rfhoi_shared::radar::{MAX_GATE_BINS, MAX_LOOPS, MAX_TX_SLOTS, MAX_VIRTUAL};

use super::moving::MovingCells;
use super::{Cube, fft, window};

/// One range bin of both maps, as power relative to a full-scale tone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Row<'a> {
    /// Power by Doppler bin from `-loops/2` to `loops/2 - 1`, the mean over the virtual antennas.
    pub doppler: [&'a [f32]; 2],
    /// Power by group of loops, oldest first, the mean over loops and virtual antennas.
    pub time: &'a [f32],
}

impl<'a> Row<'a> {
    /// The Doppler bins in order.
    pub fn doppler(&self) -> impl Iterator<Item = f32> + 'a {
        let [negative, positive] = self.doppler;
        negative.iter().chain(positive).copied()
    }
}

/// Clutter removal, window, Doppler FFT, power, and the covariance of what moves.
#[derive(Debug)]
pub struct DopplerStage {
    window: [f32; MAX_LOOPS],
    /// Window of each slot with lost chirps left out, summing to 1.
    weights: [[f32; MAX_LOOPS]; MAX_TX_SLOTS],
    /// Chirps of each slot that came.
    intact: [u32; MAX_TX_SLOTS],
    /// What each cell must be multiplied by, 0 for lost ones.
    scales: [[f32; MAX_LOOPS]; MAX_VIRTUAL],
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
    receivers: usize,
    columns: usize,
}

impl Default for DopplerStage {
    fn default() -> Self {
        Self::new()
    }
}

impl DopplerStage {
    /// A stage that has no profile yet and yields empty rows.
    pub const fn new() -> Self {
        const ZERO: Complex32 = Complex32::new(0.0, 0.0);
        Self {
            window: [0.0; MAX_LOOPS],
            weights: [[0.0; MAX_LOOPS]; MAX_TX_SLOTS],
            intact: [0; MAX_TX_SLOTS],
            scales: [[0.0; MAX_LOOPS]; MAX_VIRTUAL],
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
            receivers: 1,
            columns: 1,
        }
    }

    /// Takes a configuration that is valid, and forgets the background.
    pub fn configure(&mut self, config: &RadarConfig) {
        let RadarConfig { profile, processing, .. } = config;
        self.loops = usize::from(profile.loops).min(MAX_LOOPS);
        self.virtuals = profile.virtual_count().min(MAX_VIRTUAL);
        self.receivers = profile.rx_count().max(1);
        self.columns = usize::from(processing.range_time_columns).clamp(1, self.loops.max(1));
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
        for (v, scales) in self.scales.iter_mut().enumerate().take(self.virtuals) {
            for (scale, stored) in scales.iter_mut().zip(cube.scales(v)) {
                *scale = stored.unwrap_or(0.0);
            }
        }
        let Self { weights, window, intact, scales, receivers, loops, .. } = self;
        let first_of_slot = scales.iter().step_by(*receivers);
        for ((weights, intact), scales) in weights.iter_mut().zip(intact).zip(first_of_slot) {
            let mut sum = 0.0;
            *intact = 0;
            for ((weight, &w), &scale) in weights.iter_mut().zip(&*window).zip(scales).take(*loops) {
                let came = scale != 0.0;
                *weight = if came { w } else { 0.0 };
                *intact += u32::from(came);
                sum += *weight;
            }
            let scale = if sum > 0.0 { 1.0 / sum } else { 0.0 };
            for weight in weights.iter_mut().take(*loops) {
                *weight *= scale;
            }
        }
    }

    /// Computes the rows of range bin `bin` of `cube` and adds its moving cells to the covariance.
    pub fn range_bin(&mut self, cube: &Cube<'_>, bin: usize) -> Row<'_> {
        let (loops, columns) = (self.loops, self.columns);
        self.power.fill(0.0);
        self.time.fill(0.0);
        for v in 0..self.virtuals {
            let slot = v / self.receivers;
            let (Some(spectrum), Some(scales), Some(weights), Some(&intact)) = (
                self.spectra.get_mut(v).and_then(|s| s.get_mut(..loops)),
                self.scales.get(v),
                self.weights.get(slot),
                self.intact.get(slot),
            ) else {
                continue;
            };
            let mut sum = Complex32::default();
            for ((x, cell), &scale) in spectrum.iter_mut().zip(cube.row(bin, v)).zip(scales) {
                *x = Complex32::new(f32::from(cell.re) * scale, f32::from(cell.im) * scale);
                sum += *x;
            }
            let mean = if intact == 0 { Complex32::default() } else { sum * (1.0 / intact as f32) };
            let static_part = match self.clutter {
                ClutterRemoval::Off => Complex32::default(),
                ClutterRemoval::Mean => mean,
                ClutterRemoval::Background { .. } => {
                    let gain = if self.background_empty { 1.0 } else { self.background_gain };
                    let gain = if intact == 0 { 0.0 } else { gain };
                    match self.background.get_mut(bin).and_then(|row| row.get_mut(v)) {
                        Some(background) => {
                            *background += (mean - *background) * gain;
                            *background
                        }
                        None => Complex32::default(),
                    }
                }
            };
            let group = (loops / columns).max(1);
            let groups = spectrum.chunks_mut(group).zip(weights.chunks(group));
            for ((group, weights), time) in groups.zip(&mut self.time) {
                let mut power = 0.0;
                for (x, &weight) in group.iter_mut().zip(weights) {
                    let moving = *x - static_part;
                    // A lost chirp has no weight in either map.
                    power += if weight == 0.0 { 0.0 } else { moving.norm_sqr() };
                    *x = moving * weight;
                }
                *time += power;
            }
            fft::forward(spectrum);
            for (power, x) in self.power.iter_mut().zip(&*spectrum) {
                *power += x.norm_sqr();
            }
        }
        let mean_over_antennas = 1.0 / self.virtuals.max(1) as f32;
        for power in self.power.iter_mut().take(loops) {
            *power *= mean_over_antennas;
        }
        for time in self.time.iter_mut().take(columns) {
            *time *= mean_over_antennas * columns as f32 / loops.max(1) as f32;
        }
        let power = self.power.get(..loops).unwrap_or(&[]);
        self.moving.add(power, &self.spectra);
        // FFT order has the negative half last; a single bin is zero Doppler.
        let (positive, negative) = power.split_at_checked(loops.div_ceil(2)).unwrap_or_default();
        Row { doppler: [negative, positive], time: self.time.get(..columns).unwrap_or(&[]) }
    }

    /// Ends the frame and yields what moved in it.
    pub fn finish(&mut self) -> &MovingCells {
        self.background_empty &= self.intact.iter().all(|&n| n == 0);
        &self.moving
    }
}
