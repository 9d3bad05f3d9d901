//! Raw samples to maps on the host: all that the bridge's signal processing does, in floats and sixteen range bins abreast.
//!
//! In: one frame as a DCA1000 delivers it, chirp by chirp, receiver by receiver, 16-bit words in the profile's order
//! (`rfhoi_firmware::dca1000::samples`). Out: range-Doppler and range-time power, the moving cells' covariance, and the same of
//! each range bin. Windows, clutter removal, detection and levels are those of `rfhoi_firmware::dsp`, without its
//! rounding to 16 bits. One virtual antenna goes through both FFTs while its spectra are in the nearest cache:
//!
//! ```text
//! words --window, range FFT--> [block of 16 bins][loop][16] --window, Doppler FFT--> [antenna][block][Doppler][16]
//!                                                              |  sum over antennas
//!                                                              +--> power --> moving cells --> covariances
//! ```

mod doppler;
mod fft;
mod lanes;
mod range;
#[cfg(test)]
mod tests;

use num_complex::Complex32;
use pulp::{Simd, WithSimd};
use rfhoi_firmware::dsp::MovingCells;
use rfhoi_shared::config::{ConfigError, RadarConfig};
use rfhoi_shared::radar::MAX_LOOPS;

use doppler::DopplerFft;
use lanes::{Cells, LANES, Transposer};
use range::RangeFft;

/// What came of a frame besides its maps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct RawFrame {
    /// Words at the ADC's limits.
    pub clipped: u32,
    /// Chirps that were lost.
    pub chirps_lost: u32,
    /// Range-Doppler cells that count as moving.
    pub moving_cells: u32,
}

/// The bytes are not one frame of the profile.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("a frame of this profile has {expected} bytes, these are {got}")]
pub struct FrameSize {
    /// Bytes of a frame.
    pub expected: usize,
    /// Bytes that were given.
    pub got: usize,
}

/// Frames of raw samples to maps. Nothing is allocated after [`Self::new`].
#[derive(Debug)]
pub struct RawMaps {
    arch: pulp::Arch,
    range: RangeFft,
    doppler: DopplerFft,
    moving: MovingCells,
    layout: Layout,
    /// Range spectra of the antenna at hand, by block and loop.
    rows: Vec<Cells>,
    /// Doppler spectra by antenna, block and Doppler bin in FFT order.
    spectra: Vec<Cells>,
    /// Chirps that were lost.
    lost: Vec<bool>,
    range_doppler: Vec<f32>,
    range_time: Vec<f32>,
    covariance: Vec<f32>,
    bin_covariances: Vec<f32>,
    bin_cells: Vec<u32>,
}

/// Sizes of a frame and its gate.
#[derive(Debug, Clone, Copy)]
struct Layout {
    loops: usize,
    slots: usize,
    receivers: usize,
    columns: usize,
    row_bytes: usize,
    /// First bin of the gate, and bins.
    first: usize,
    bins: usize,
    /// Blocks of 16 bins that the gate touches.
    first_block: usize,
    blocks: usize,
}

impl Layout {
    fn antennas(&self) -> usize {
        self.slots * self.receivers
    }

    fn frame_bytes(&self) -> usize {
        self.loops * self.antennas() * self.row_bytes
    }

    /// Block and lane of a bin of the gate.
    fn place(&self, bin: usize) -> (usize, usize) {
        let bin = self.first + bin;
        (bin / LANES - self.first_block, bin % LANES)
    }
}

impl RawMaps {
    /// For frames of `config`.
    ///
    /// # Errors
    /// What is wrong with the configuration.
    pub fn new(config: &RadarConfig) -> Result<Self, ConfigError> {
        config.validate(u32::MAX)?;
        let RadarConfig { profile, processing, .. } = config;
        let (first, bins) = (usize::from(processing.gate.first), usize::from(processing.gate.bins));
        let first_block = first / LANES;
        let layout = Layout {
            loops: profile.loops.into(),
            slots: profile.tx_slots(),
            receivers: profile.rx_count(),
            columns: processing.range_time_columns.into(),
            row_bytes: profile.row_bytes() as usize,
            first,
            bins,
            first_block,
            blocks: (first + bins).div_ceil(LANES) - first_block,
        };
        let mut moving = MovingCells::new();
        moving.configure(profile, processing.detection.0, processing.zero_doppler_guard);
        let antennas = layout.antennas();
        Ok(Self {
            arch: pulp::Arch::new(),
            range: RangeFft::new(profile),
            doppler: DopplerFft::new(config, layout.blocks),
            moving,
            rows: vec![Cells::ZERO; layout.blocks * layout.loops],
            spectra: vec![Cells::ZERO; antennas * layout.blocks * layout.loops],
            lost: vec![false; layout.loops * layout.slots],
            range_doppler: vec![0.0; bins * layout.loops],
            range_time: vec![0.0; bins * layout.columns],
            covariance: vec![0.0; antennas * antennas],
            bin_covariances: vec![0.0; bins * antennas * antennas],
            bin_cells: vec![0; bins],
            layout,
        })
    }

    /// Both halves of a frame's work: [`Self::powers`] and [`Self::moving_cells`].
    ///
    /// # Errors
    /// If the bytes are not as many as a frame has.
    pub fn frame(&mut self, words: &[u8], lost: &[u32]) -> Result<RawFrame, FrameSize> {
        let frame = self.powers(words, lost)?;
        Ok(RawFrame { moving_cells: self.moving_cells(), ..frame })
    }

    /// Takes the words of a frame to its spectra and powers; `lost` are the numbers of chirps that did not come whole, in any order.
    ///
    /// # Errors
    /// If the bytes are not as many as a frame has.
    pub fn powers(&mut self, words: &[u8], lost: &[u32]) -> Result<RawFrame, FrameSize> {
        let expected = self.layout.frame_bytes();
        if words.len() != expected {
            return Err(FrameSize { expected, got: words.len() });
        }
        self.lost.fill(false);
        for &chirp in lost {
            if let Some(lost) = self.lost.get_mut(chirp as usize) {
                *lost = true;
            }
        }
        let chirps_lost = self.lost.iter().filter(|lost| **lost).count() as u32;
        // The widest registers that the machine has.
        let clipped = self.arch.dispatch(Frame { maps: self, words });
        self.doppler.finish();
        Ok(RawFrame { clipped, chirps_lost, moving_cells: 0 })
    }

    /// Power relative to a full-scale tone, by range bin of the gate and Doppler bin from `-loops/2` to `loops/2 - 1`, the
    /// mean over the virtual antennas.
    pub fn range_doppler(&self) -> &[f32] {
        &self.range_doppler
    }

    /// Power by range bin of the gate and group of loops, oldest first, the mean over loops and the first receiver of each
    /// transmitter slot.
    pub fn range_time(&self) -> &[f32] {
        &self.range_time
    }

    /// The mean covariance of the moving cells, packed as `rfhoi_shared::wire::Covariance`.
    pub fn covariance(&self) -> &[f32] {
        &self.covariance
    }

    /// The same of one range bin of the gate: its mean covariance, and moving cells.
    pub fn covariance_of(&self, bin: usize) -> Option<(&[f32], u32)> {
        let size = self.covariance.len();
        Some((self.bin_covariances.get(bin * size..(bin + 1) * size)?, *self.bin_cells.get(bin)?))
    }

    /// Finds the moving cells of the latest powers, and their covariances. Returns how many there are.
    pub fn moving_cells(&mut self) -> u32 {
        let Self { moving, layout, spectra, range_doppler, covariance, bin_covariances, bin_cells, .. } =
            self;
        let Layout { loops, blocks, .. } = *layout;
        let mut power = [0.0; MAX_LOOPS];
        let power = &mut power[..loops];
        let mut cells = 0;
        covariance.fill(0.0);
        let bins = range_doppler.chunks_exact(loops).zip(bin_cells).enumerate();
        for ((bin, (row, count)), out) in bins.zip(bin_covariances.chunks_exact_mut(covariance.len())) {
            power.copy_from_slice(row);
            power.rotate_left(loops / 2);
            let strongest = moving.strongest(power);
            *count = strongest.len() as u32;
            out.fill(0.0);
            if strongest.is_empty() {
                continue;
            }
            moving.clear();
            let (block, lane) = layout.place(bin);
            for (doppler, _) in strongest {
                let of_antennas = spectra.chunks_exact(blocks * loops);
                moving.add_cell(
                    doppler,
                    of_antennas.map(|spectra| {
                        let cells = &spectra[block * loops + doppler];
                        Complex32::new(cells.re[lane], cells.im[lane])
                    }),
                );
            }
            cells += *count;
            let share = 1.0 / *count as f32;
            for ((out, total), sum) in out.iter_mut().zip(&mut *covariance).zip(moving.sum()) {
                *out = sum * share;
                *total += sum;
            }
        }
        let share = 1.0 / cells.max(1) as f32;
        covariance.iter_mut().for_each(|c| *c *= share);
        cells
    }
}

/// The part of a frame's work that is done in wide registers.
struct Frame<'a> {
    maps: &'a mut RawMaps,
    words: &'a [u8],
}

impl WithSimd for Frame<'_> {
    type Output = u32;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> u32 {
        let Self { maps, words } = self;
        let RawMaps { range, doppler, layout, rows, spectra, lost, range_doppler, range_time, .. } = maps;
        let Layout { loops, slots, receivers, columns, row_bytes, first_block, blocks, .. } = *layout;
        doppler.begin(|slot, l| !lost[l * slots + slot]);
        let mut clipped = 0;
        for (antenna, spectra) in spectra.chunks_exact_mut(blocks * loops).enumerate() {
            let (slot, receiver) = (antenna / receivers, antenna % receivers);
            let row = |l: usize| {
                let chirp = l * slots + slot;
                let start = (chirp * receivers + receiver) * row_bytes;
                (l < loops && !lost[chirp]).then(|| words.get(start..start + row_bytes)).flatten()
            };
            clipped += range.antenna(simd, loops, row, first_block, rows);
            doppler.antenna(simd, antenna, rows, spectra);
        }
        let antennas = layout.antennas();
        let columns_mean = columns as f32 / (loops * slots) as f32;
        for block in 0..blocks {
            let power = &doppler.power[block * loops..][..loops];
            by_bin(power, layout, block, 1.0 / antennas as f32, loops / 2, range_doppler);
            let time = &doppler.time[block * columns..][..columns];
            by_bin(time, layout, block, columns_mean, 0, range_time);
        }
        clipped
    }
}

/// Sums by column and lane to rows of `out` by bin, times `scale`, turned to the right by `turn`.
#[inline(always)]
fn by_bin(sums: &[[f32; LANES]], layout: &Layout, block: usize, scale: f32, turn: usize, out: &mut [f32]) {
    let columns = sums.len();
    let first_bin = (layout.first_block + block) * LANES;
    for start in (0..columns).step_by(LANES) {
        let count = LANES.min(columns - start);
        let mut source = [Cells::ZERO; LANES];
        for (source, sums) in source.iter_mut().zip(&sums[start..start + count]) {
            source.re = *sums;
        }
        let mut rows = [Cells::ZERO; LANES];
        Transposer::new().transpose(&source, &mut rows);
        for (lane, row) in rows.iter().enumerate() {
            let Some(bin) = (first_bin + lane).checked_sub(layout.first).filter(|&b| b < layout.bins) else {
                continue;
            };
            let out = &mut out[bin * columns..][..columns];
            let row = &row.re;
            if count == LANES && turn.is_multiple_of(LANES) {
                let to = (start + turn) % columns;
                for (out, x) in out[to..to + LANES].iter_mut().zip(row) {
                    *out = x * scale;
                }
            } else {
                for (i, x) in row.iter().take(count).enumerate() {
                    out[(start + i + turn) % columns] = x * scale;
                }
            }
        }
    }
}
