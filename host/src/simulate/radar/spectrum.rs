//! Paths straight to the gated range spectra of a frame: each adds to the few bins that it reaches.

use core::f64::consts::TAU;

use num_complex::Complex32;
use rfhoi_firmware::dsp::Cube;
use rfhoi_firmware::simulated::Noise;
use rfhoi_shared::radar::RangeGate;
use rfhoi_shared::units::SPEED_OF_LIGHT;

use super::chirps::{Chirps, Course, cis};
use super::front_end::CARRIER_JITTER_HZ;
use super::kernel::{Kernel, TAPS, Taps, bin_turn};
use super::paths::Path;

/// Bins on either side of the gate, so that a path near its edge needs no care.
const MARGIN: usize = TAPS;

/// Sums of paths.
pub(super) struct Spectrum {
    /// Virtual antenna, loop, range bin; the phase of [`bin_turn`] is left out.
    cells: Vec<Complex32>,
    /// Virtual antenna, range bin: what does not move.
    still: Vec<Complex32>,
    kernel: Kernel,
    gate: RangeGate,
    /// Bins of a row with its margins.
    row: usize,
    turns: Vec<Complex32>,
    /// By how much one hertz more of carrier turns each bin of a row, rad.
    rad_per_hz: Vec<f32>,
    // Work of one path.
    phasors: Vec<Complex32>,
}

impl Spectrum {
    pub(super) fn new(chirps: &Chirps, gate: RangeGate) -> Self {
        let row = usize::from(gate.bins) + 2 * MARGIN;
        let virtuals = chirps.slots() * chirps.receivers();
        let bins = usize::from(gate.first)..usize::from(gate.first) + usize::from(gate.bins);
        let bin_rad_per_hz = 2.0 * TAU / (SPEED_OF_LIGHT * f64::from(chirps.bins_per_m));
        Self {
            cells: vec![Complex32::default(); virtuals * chirps.loops * row],
            still: vec![Complex32::default(); virtuals * row],
            kernel: Kernel::new(chirps.samples),
            gate,
            row,
            turns: bins.clone().map(|k| bin_turn(k, chirps.samples)).collect(),
            rad_per_hz: bins.map(|k| (k as f64 * bin_rad_per_hz) as f32).collect(),
            phasors: vec![Complex32::default(); chirps.loops],
        }
    }

    /// Sums up what does not move.
    pub(super) fn keep_still(&mut self, chirps: &Chirps, paths: &[Path]) {
        self.still.fill(Complex32::default());
        for path in paths {
            let half_m = path.half_m[1];
            if !self.reaches(chirps, path) {
                continue;
            }
            let (place, taps) = place(&self.kernel, half_m * chirps.bins_per_m - f32::from(self.gate.first));
            for slot in 0..chirps.slots() {
                let phasor = narrow(cis(chirps.phase(f64::from(half_m), path, slot))) * path.amplitude;
                for rx in 0..chirps.receivers() {
                    let row = (slot * chirps.receivers() + rx) * self.row;
                    add(&mut self.still[row + place..], phasor * chirps.receiver(rx, path), taps);
                }
            }
        }
    }

    /// Sums up the moving paths of a frame.
    pub(super) fn sum(&mut self, chirps: &Chirps, paths: &[Path]) {
        self.cells.fill(Complex32::default());
        let (slots, receivers, loops) = (chirps.slots(), chirps.receivers(), chirps.loops);
        let mut places = Vec::with_capacity(loops);
        for path in paths {
            if !self.reaches(chirps, path) {
                continue;
            }
            let course = Course::of(path);
            for slot in 0..slots {
                places.clear();
                places.extend((0..loops).map(|l| {
                    let half_m = course.at(chirps.x(l * slots + slot)) as f32;
                    place(&self.kernel, half_m * chirps.bins_per_m - f32::from(self.gate.first))
                }));
                let mut phasor = cis(chirps.phase(course.at(chirps.x(slot)), path, slot));
                phasor *= f64::from(path.amplitude);
                let [mut step, growth] = chirps.steps(&course, slot).map(cis);
                for z in &mut self.phasors {
                    *z = narrow(phasor);
                    phasor *= step;
                    step *= growth;
                }
                for rx in 0..receivers {
                    let factor = chirps.receiver(rx, path);
                    let first = (slot * receivers + rx) * loops * self.row;
                    let rows = self.cells[first..].chunks_exact_mut(self.row);
                    for ((row, &phasor), &(place, taps)) in rows.zip(&self.phasors).zip(&places) {
                        add(&mut row[place..], phasor * factor, taps);
                    }
                }
            }
        }
    }

    /// Whether a path stays within the gate and its margins for a whole frame.
    fn reaches(&self, chirps: &Chirps, path: &Path) -> bool {
        let last = (self.row - TAPS) as f32;
        path.half_m.iter().all(|half_m| {
            let bins = half_m * chirps.bins_per_m - f32::from(self.gate.first);
            (1.0..last).contains(&(bins + MARGIN as f32 - TAPS as f32 / 2.0))
        })
    }

    /// Stores the frame: what moves, what does not, the carrier's jitter, and noise of `noise` (of full scale, for I and
    /// Q each).
    pub(super) fn store(
        &mut self,
        chirps: &Chirps,
        jitter: Option<&mut Noise>,
        thermal: Option<(&mut Noise, f32)>,
        cube: &mut Cube<'_>,
    ) {
        let bins = usize::from(self.gate.bins);
        let mut out = vec![Complex32::default(); bins];
        let mut white = vec![Complex32::default(); bins + 2];
        let jitters: Option<Vec<f32>> = jitter.map(|noise| {
            (0..chirps.slots() * chirps.loops).map(|_| noise.draw() * CARRIER_JITTER_HZ).collect()
        });
        let mut thermal = thermal;
        let rows = self.cells.chunks_exact(self.row).enumerate();
        for (index, row) in rows {
            let (virtual_antenna, loop_index) = (index / chirps.loops, index % chirps.loops);
            let still = &self.still[virtual_antenna * self.row + MARGIN..];
            for ((z, &moving), &still) in out.iter_mut().zip(&row[MARGIN..]).zip(still) {
                *z = moving + still;
            }
            if let Some(jitters) = &jitters {
                let hertz = jitters[loop_index * chirps.slots() + virtual_antenna / chirps.receivers()];
                for (z, rad_per_hz) in out.iter_mut().zip(&self.rad_per_hz) {
                    // Some milliradians: the angle is its sine.
                    let angle = hertz * rad_per_hz;
                    *z += Complex32::new(-z.im * angle, z.re * angle);
                }
            }
            if let Some((noise, deviation)) = &mut thermal {
                for z in &mut white {
                    *z = Complex32::new(noise.draw(), noise.draw()) * *deviation;
                }
                // The window's spectrum is 1 and two halves: neighbouring bins share noise.
                for (z, near) in out.iter_mut().zip(white.windows(3)) {
                    *z += near[1] + (near[0] + near[2]) * 0.5;
                }
            }
            for (z, turn) in out.iter_mut().zip(&self.turns) {
                *z *= turn;
            }
            cube.store(virtual_antenna, loop_index, &out);
        }
    }
}

/// Where in a row the bins that a path at `bins` from the gate reaches begin, and its shares in them.
fn place(kernel: &Kernel, bins: f32) -> (usize, &Taps) {
    let (first, taps) = kernel.at(bins);
    ((first + MARGIN as isize) as usize, taps)
}

fn add(row: &mut [Complex32], z: Complex32, taps: &Taps) {
    let Some(row) = row.first_chunk_mut::<TAPS>() else { return };
    for (cell, tap) in row.iter_mut().zip(taps.as_chunks::<2>().0) {
        cell.re += z.re * tap[0];
        cell.im += z.im * tap[1];
    }
}

fn narrow(z: num_complex::Complex64) -> Complex32 {
    Complex32::new(z.re as f32, z.im as f32)
}
