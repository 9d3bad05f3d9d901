//! Paths straight to the gated range spectra of a frame: each adds to the few bins that it reaches.

use core::f64::consts::TAU;
use core::ops::Range;

use num_complex::{Complex32, Complex64};
use pulp::{Simd, WithSimd};
use rfhoi_firmware::dsp::Cube;
use rfhoi_firmware::simulated::Noise;
use rfhoi_shared::radar::{MAX_RX, RangeGate};
use rfhoi_shared::units::SPEED_OF_LIGHT;

use super::chirps::{Chirps, Course, cis};
use super::front_end::CARRIER_JITTER_HZ;
use super::kernel::{Kernel, TAPS, Taps, bin_turn};
use super::paths::Path;

/// Bins on either side of the gate, so that a path near its edge needs no care.
const MARGIN: usize = TAPS;
/// Loops that are summed up at a time: with 4 receivers and 72 bins 22 KiB.
const BLOCK: usize = 8;

/// Sums of paths.
pub(super) struct Spectrum {
    /// Virtual antenna, loop, range bin, real and imaginary part; the phase of [`bin_turn`] is left out.
    cells: Vec<[f32; 2]>,
    /// Virtual antenna, range bin: what does not move.
    still: Vec<[f32; 2]>,
    kernel: Kernel,
    gate: RangeGate,
    /// Bins of a row with its margins.
    row: usize,
    turns: Vec<Complex32>,
    /// By how much one hertz more of carrier turns each bin of a row, rad.
    rad_per_hz: Vec<f32>,
    /// Bin at which rows begin, margin and all.
    row_start: f32,
    arch: pulp::Arch,
    // Work of one slot.
    walks: Vec<Walk>,
}

impl Spectrum {
    pub(super) fn new(chirps: &Chirps, gate: RangeGate) -> Self {
        let row = usize::from(gate.bins) + 2 * MARGIN;
        let virtuals = chirps.slots() * chirps.receivers();
        let bins = usize::from(gate.first)..usize::from(gate.first) + usize::from(gate.bins);
        let bin_rad_per_hz = 2.0 * TAU / (SPEED_OF_LIGHT * f64::from(chirps.bins_per_m));
        Self {
            cells: vec![[0.0; 2]; virtuals * chirps.loops * row],
            still: vec![[0.0; 2]; virtuals * row],
            kernel: Kernel::new(chirps.samples),
            gate,
            row,
            turns: bins.clone().map(|k| bin_turn(k, chirps.samples)).collect(),
            rad_per_hz: bins.map(|k| (k as f64 * bin_rad_per_hz) as f32).collect(),
            row_start: f32::from(gate.first) - MARGIN as f32,
            arch: pulp::Arch::new(),
            walks: Vec::new(),
        }
    }

    /// Sums up what does not move.
    pub(super) fn keep_still(&mut self, chirps: &Chirps, paths: &[Path]) {
        self.still.fill([0.0; 2]);
        for path in paths {
            let half_m = path.half_m[1];
            if !reaches(self.row, self.row_start, chirps, path) {
                continue;
            }
            let (place, taps) = self.kernel.at(half_m * chirps.bins_per_m - self.row_start);
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
        self.cells.fill([0.0; 2]);
        let (receivers, loops) = (chirps.receivers(), chirps.loops);
        let mut walks = std::mem::take(&mut self.walks);
        let of_slots = self.cells.chunks_exact_mut(receivers * loops * self.row);
        for (slot, cells) in of_slots.enumerate() {
            walks.clear();
            let within = paths.iter().filter(|p| reaches(self.row, self.row_start, chirps, p));
            walks.extend(within.map(|path| Walk::new(chirps, path, slot, self.row_start)));
            // As many rows at a time as stay in the nearest cache, for all paths.
            for first in (0..loops).step_by(BLOCK) {
                // The widest registers that the machine has; each cell's sum is the same with any.
                self.arch.dispatch(Block {
                    walks: &mut walks,
                    kernel: &self.kernel,
                    loops: first..loops.min(first + BLOCK),
                    receivers,
                    receiver: loops * self.row,
                    row: self.row,
                    cells,
                });
            }
        }
        self.walks = walks;
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
                *z = Complex32::new(moving[0] + still[0], moving[1] + still[1]);
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

/// Whether a path stays within rows of `row` bins from `row_start` on for a whole frame.
fn reaches(row: usize, row_start: f32, chirps: &Chirps, path: &Path) -> bool {
    let within = TAPS as f32..(row - TAPS) as f32;
    path.half_m.iter().all(|half_m| within.contains(&(half_m * chirps.bins_per_m - row_start)))
}

/// A path on its way through the chirps of a slot.
#[derive(Debug, Clone, Copy)]
struct Walk {
    phasor: Complex64,
    step: Complex64,
    growth: Complex64,
    /// Its place in a row by loop: `a + b l + c l^2`.
    bins: [f32; 3],
    receivers: [Complex32; MAX_RX],
}

impl Walk {
    fn new(chirps: &Chirps, path: &Path, slot: usize, row_start: f32) -> Self {
        let course = Course::of(path);
        let [step, growth] = chirps.steps(&course, slot).map(cis);
        let [begin, slope, curve] = course.bins(chirps, slot).map(|x| x as f32);
        let mut receivers = [Complex32::default(); MAX_RX];
        for (rx, factor) in receivers.iter_mut().enumerate().take(chirps.receivers()) {
            *factor = chirps.receiver(rx, path);
        }
        Self {
            phasor: cis(chirps.phase(course.at(chirps.x(slot)), path, slot)) * f64::from(path.amplitude),
            step,
            growth,
            bins: [begin - row_start, slope, curve],
            receivers,
        }
    }
}

/// All paths through some loops of a slot.
struct Block<'a> {
    walks: &'a mut [Walk],
    kernel: &'a Kernel,
    loops: Range<usize>,
    receivers: usize,
    /// Cells from receiver to receiver.
    receiver: usize,
    /// Cells from loop to loop.
    row: usize,
    cells: &'a mut [[f32; 2]],
}

impl WithSimd for Block<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { walks, kernel, loops, receivers, receiver, row, cells } = self;
        for Walk { phasor, step, growth, bins: [begin, slope, curve], receivers: factors } in walks {
            for l in loops.clone() {
                let x = l as f32;
                let (place, taps) = kernel.at(*begin + x * (*slope + x * *curve));
                let (taps, _) = S::as_simd_f32s(taps);
                let z = narrow(*phasor);
                for (rx, factor) in factors.iter().enumerate().take(receivers) {
                    let z = z * factor;
                    let z: Taps = std::array::from_fn(|i| if i % 2 == 0 { z.re } else { z.im });
                    let (z, _) = S::as_simd_f32s(&z);
                    let cells = cells[rx * receiver + l * row + place..][..TAPS].as_flattened_mut();
                    let (cells, _) = S::as_mut_simd_f32s(cells);
                    for ((cell, &z), &tap) in cells.iter_mut().zip(z).zip(taps) {
                        *cell = simd.add_f32s(*cell, simd.mul_f32s(z, tap));
                    }
                }
                *phasor *= *step;
                *step *= *growth;
            }
        }
    }
}

#[inline(always)]
fn add(row: &mut [[f32; 2]], z: Complex32, taps: &Taps) {
    let Some(row) = row.first_chunk_mut::<TAPS>() else { return };
    let z: Taps = std::array::from_fn(|i| if i % 2 == 0 { z.re } else { z.im });
    for ((cell, z), tap) in row.as_flattened_mut().iter_mut().zip(z).zip(taps) {
        *cell += z * tap;
    }
}

#[inline(always)]
fn narrow(z: Complex64) -> Complex32 {
    Complex32::new(z.re as f32, z.im as f32)
}
