//! Which range-Doppler cells move, and their spatial covariance.

use core::num::NonZeroUsize;

use num_complex::Complex32;
use rfhoi_shared::radar::{MAX_LOOPS, MAX_VIRTUAL, RadarProfile};
use rfhoi_shared::wire::MAX_COVARIANCE;

use super::level;

/// Blocks of a row among which the least mean power is its noise: a target and its window's skirts leave some free.
const NOISE_BLOCKS: usize = 8;
/// Cells of one range bin that enter the covariance at most, the strongest; bounds the work of a frame.
pub const MAX_CELLS: usize = 8;
/// Rows shorter than this have no noise to be measured against.
const MIN_LOOPS: usize = 2 * NOISE_BLOCKS;

/// Accumulates the covariance of a frame's moving cells.
#[derive(Debug)]
pub struct MovingCells {
    /// `exp(-j 2 pi l / (M N))` for every Doppler bin in FFT order, l its signed number, M slots, N loops.
    compensation: [Complex32; MAX_LOOPS],
    sum: [f32; MAX_COVARIANCE],
    cells: u32,
    loops: usize,
    virtuals: usize,
    receivers: NonZeroUsize,
    threshold: f32,
    guard: usize,
}

impl Default for MovingCells {
    fn default() -> Self {
        Self::new()
    }
}

impl MovingCells {
    /// For no profile yet: nothing moves.
    pub const fn new() -> Self {
        Self {
            compensation: [Complex32::new(0.0, 0.0); MAX_LOOPS],
            sum: [0.0; MAX_COVARIANCE],
            cells: 0,
            loops: 0,
            virtuals: 0,
            receivers: NonZeroUsize::MIN,
            threshold: 0.0,
            guard: 0,
        }
    }

    /// Takes a valid profile, how far a moving cell rises over the noise (dB) and the guard about zero Doppler.
    pub fn configure(&mut self, profile: &RadarProfile, detection_db: f32, guard: u8) {
        self.loops = usize::from(profile.loops).min(MAX_LOOPS);
        self.virtuals = profile.virtual_count().min(MAX_VIRTUAL);
        self.receivers = NonZeroUsize::new(profile.rx_count()).unwrap_or(NonZeroUsize::MIN);
        self.threshold = level::power_of_db(detection_db);
        self.guard = guard.into();
        let step = -core::f32::consts::TAU / (profile.tx_slots().max(1) * self.loops.max(1)) as f32;
        for (bin, z) in self.compensation.iter_mut().enumerate().take(self.loops) {
            let (sin, cos) = libm::sincosf(step * signed_bin(bin, self.loops) as f32);
            *z = Complex32::new(cos, sin);
        }
        self.clear();
    }

    /// Forgets all cells.
    pub fn clear(&mut self) {
        self.sum = [0.0; MAX_COVARIANCE];
        self.cells = 0;
    }

    /// Adds the moving cells of one range bin: `power` by Doppler bin and `spectra` by virtual antenna, in FFT order.
    pub(super) fn add(&mut self, power: &[f32], spectra: &[[Complex32; MAX_LOOPS]; MAX_VIRTUAL]) {
        for &(bin, _) in &self.strongest(power) {
            self.add_cell(bin, spectra.iter().map(|s| s.get(bin).copied().unwrap_or_default()));
        }
    }

    /// The cells of one range bin that move: Doppler bin in FFT order, and power. `power` is by Doppler bin in FFT order.
    pub fn strongest(&self, power: &[f32]) -> heapless::Vec<(usize, f32), MAX_CELLS> {
        let mut strongest = heapless::Vec::new();
        let loops = self.loops;
        if loops < MIN_LOOPS || power.len() != loops {
            return strongest;
        }
        let block = loops / NOISE_BLOCKS;
        let noise = power
            .chunks_exact(block)
            .map(|b| b.iter().sum::<f32>() / block as f32)
            .fold(f32::INFINITY, f32::min);
        let least = noise * self.threshold;
        for (bin, &p) in power.iter().enumerate() {
            if p > least && signed_bin(bin, loops).unsigned_abs() > self.guard {
                keep_strongest(&mut strongest, (bin, p));
            }
        }
        strongest
    }

    /// Adds the cell of Doppler bin `bin` in FFT order: `spectra` is what the virtual antennas have there.
    #[inline]
    pub fn add_cell(&mut self, bin: usize, spectra: impl Iterator<Item = Complex32>) {
        // TIDUD31B eq. 1: slot m was sent m / M of a loop later, in which the phase has turned by 2 pi l m / (M N).
        let step = self.compensation.get(bin).copied().unwrap_or_default();
        let mut turn = Complex32::new(1.0, 0.0);
        let mut snapshot = [Complex32::default(); MAX_VIRTUAL];
        let mut spectra = spectra;
        for snapshot in snapshot.chunks_mut(self.receivers.get()) {
            for (x, spectrum) in snapshot.iter_mut().zip(&mut spectra) {
                *x = spectrum * turn;
            }
            turn *= step;
        }
        let mut packed = self.sum.as_mut_slice();
        let mut rest = snapshot.get(..self.virtuals).unwrap_or(&[]);
        // Rows of the upper triangle, as they are packed.
        while let ([x, after @ ..], [diagonal, others @ ..]) = (rest, packed) {
            *diagonal += x.norm_sqr();
            let (row, below) = others.split_at_mut_checked(2 * after.len()).unwrap_or_default();
            for ([re, im], y) in row.as_chunks_mut::<2>().0.iter_mut().zip(after) {
                let product = x * y.conj();
                *re += product.re;
                *im += product.im;
            }
            (rest, packed) = (after, below);
        }
        self.cells += 1;
    }

    /// Cells so far.
    pub fn cells(&self) -> u32 {
        self.cells
    }

    /// The sum over the cells, packed as [`Self::covariance`].
    pub fn sum(&self) -> &[f32] {
        self.sum.get(..self.virtuals * self.virtuals).unwrap_or(&[])
    }

    /// The mean over the cells, packed as `rfhoi_shared::wire::Covariance`; zeros where nothing moves.
    pub fn covariance(&self) -> impl Iterator<Item = f32> + '_ {
        let scale = if self.cells == 0 { 0.0 } else { 1.0 / self.cells as f32 };
        self.sum().iter().map(move |s| s * scale)
    }
}

/// Signed number of Doppler bin `bin` in FFT order: `-loops/2` to `loops/2 - 1`.
fn signed_bin(bin: usize, loops: usize) -> isize {
    let bin = bin as isize;
    if bin < (loops as isize + 1) / 2 { bin } else { bin - loops as isize }
}

fn keep_strongest(strongest: &mut heapless::Vec<(usize, f32), MAX_CELLS>, cell: (usize, f32)) {
    if strongest.push(cell).is_ok() {
        return;
    }
    let weakest = strongest.iter_mut().min_by(|a, b| a.1.total_cmp(&b.1));
    if let Some(weakest) = weakest.filter(|w| w.1 < cell.1) {
        *weakest = cell;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signed_bins_cover_both_signs() {
        let bins: heapless::Vec<isize, 8> = (0..8).map(|b| signed_bin(b, 8)).collect();
        assert_eq!(bins.as_slice(), [0, 1, 2, 3, -4, -3, -2, -1]);
        assert_eq!(signed_bin(0, 1), 0);
    }

    #[test]
    fn the_strongest_are_kept() {
        let mut strongest = heapless::Vec::new();
        for i in 0..100usize {
            keep_strongest(&mut strongest, (i, (i * 37 % 101) as f32));
        }
        let mut powers: heapless::Vec<u32, MAX_CELLS> = strongest.iter().map(|c| c.1 as u32).collect();
        powers.sort_unstable();
        assert_eq!(powers.as_slice(), [93, 94, 95, 96, 97, 98, 99, 100]);
    }
}
