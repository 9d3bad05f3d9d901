//! Range spectra to Doppler spectra: window, FFT, static clutter off, power. What it computes is what the bridge's
//! `DopplerStage` computes, sixteen range bins abreast.

use pulp::Simd;
use rfhoi_firmware::dsp::window;
use rfhoi_shared::config::{ClutterRemoval, RadarConfig};

use super::fft::{LaneFft, root};
use super::lanes::{Arithmetic, Cells, LANES};

/// Chirps of one transmitter slot in the frame at hand.
#[derive(Debug, Clone)]
struct Slot {
    /// Window by loop, 0 where the chirp was lost; sums to 1, or to 0 if none came.
    weights: Vec<f32>,
    /// Its spectrum, in FFT order.
    leakage: Vec<[f32; 2]>,
    chirps: usize,
}

/// What is kept of one frame besides its spectra.
#[derive(Debug)]
pub(super) struct DopplerFft {
    fft: LaneFft,
    window: Vec<f32>,
    /// Roots of unity of the length of the FFT.
    roots: Vec<[f32; 2]>,
    slots: Vec<Slot>,
    /// By virtual antenna and block of 16 bins.
    background: Vec<Cells>,
    background_empty: bool,
    background_gain: f32,
    clutter: ClutterRemoval,
    loops: usize,
    blocks: usize,
    receivers: usize,
    columns: usize,
    /// Power summed over the antennas, by block and Doppler bin in FFT order.
    pub(super) power: Vec<[f32; LANES]>,
    /// Energy summed over loops and the first receivers, by block and column.
    pub(super) time: Vec<[f32; LANES]>,
}

impl DopplerFft {
    /// For a valid configuration whose gate lies in `blocks` blocks of 16 bins.
    pub(super) fn new(config: &RadarConfig, blocks: usize) -> Self {
        let RadarConfig { profile, processing, .. } = config;
        let loops = usize::from(profile.loops);
        let columns = usize::from(processing.range_time_columns);
        let mut window = vec![0.0; loops];
        window::hann(&mut window, 1.0);
        let background_gain = match processing.clutter {
            ClutterRemoval::Background { time_constant } => {
                1.0 - libm::expf(-profile.frame_period().0 / time_constant.0)
            }
            _ => 0.0,
        };
        let slot = Slot { weights: vec![0.0; loops], leakage: vec![[0.0; 2]; loops], chirps: 0 };
        Self {
            fft: LaneFft::new(loops),
            window,
            roots: (0..loops).map(|k| root(k, loops)).collect(),
            slots: vec![slot; profile.tx_slots()],
            background: vec![Cells::ZERO; profile.virtual_count() * blocks],
            background_empty: true,
            background_gain,
            clutter: processing.clutter,
            loops,
            blocks,
            receivers: profile.rx_count(),
            columns,
            power: vec![[0.0; LANES]; blocks * loops],
            time: vec![[0.0; LANES]; blocks * columns],
        }
    }

    /// Begins a frame; `came(slot, loop)` says whether a chirp did.
    pub(super) fn begin(&mut self, came: impl Fn(usize, usize) -> bool) {
        self.power.fill([0.0; LANES]);
        self.time.fill([0.0; LANES]);
        for (index, slot) in self.slots.iter_mut().enumerate() {
            let chirps = (0..self.loops).filter(|&l| came(index, l)).count();
            if slot.chirps == self.loops && chirps == self.loops {
                continue;
            }
            slot.chirps = chirps;
            let sum: f32 =
                self.window.iter().enumerate().filter(|&(l, _)| came(index, l)).map(|(_, w)| w).sum();
            let norm = if sum > 0.0 { 1.0 / sum } else { 0.0 };
            for (l, (weight, w)) in slot.weights.iter_mut().zip(&self.window).enumerate() {
                *weight = if came(index, l) { w * norm } else { 0.0 };
            }
            let Slot { weights, leakage, .. } = slot;
            for (k, leak) in leakage.iter_mut().enumerate() {
                *leak = [0.0; 2];
                for (l, &weight) in weights.iter().enumerate().filter(|(_, w)| **w != 0.0) {
                    let [re, im] = self.roots[k * l % self.loops];
                    *leak = [leak[0] + weight * re, leak[1] + weight * im];
                }
            }
        }
    }

    /// Takes the range spectra of a virtual antenna to its Doppler spectra, both by block and loop or Doppler bin.
    #[inline(always)]
    pub(super) fn antenna<S: Simd>(&mut self, simd: S, antenna: usize, rows: &[Cells], out: &mut [Cells]) {
        let Self { fft, slots, background, clutter, loops, blocks, columns, power, time, .. } = self;
        let slot = &slots[antenna / self.receivers];
        let intact = slot.chirps == *loops;
        let background = &mut background[antenna * *blocks..][..*blocks];
        let arithmetic = Arithmetic(simd);
        let gain = match (slot.chirps, self.background_empty) {
            (0, _) => 0.0,
            (_, true) => 1.0,
            (_, false) => self.background_gain,
        };
        let blocks = rows.chunks_exact(*loops).zip(out.chunks_exact_mut(*loops)).zip(background);
        let sums = power.chunks_exact_mut(*loops).zip(time.chunks_exact_mut(*columns));
        for (((rows, out), background), (power, time)) in blocks.zip(sums) {
            fft.forward(simd, rows, out, |l, z| arithmetic.scale(z, slot.weights[l]));
            let removed = match clutter {
                ClutterRemoval::Off => Cells::ZERO,
                ClutterRemoval::Mean => out[0],
                ClutterRemoval::Background { .. } => {
                    let (now, kept) = (out[0], &mut *background);
                    for i in 0..LANES {
                        kept.re[i] += (now.re[i] - kept.re[i]) * gain;
                        kept.im[i] += (now.im[i] - kept.im[i]) * gain;
                    }
                    *kept
                }
            };
            remove(arithmetic, &removed, slot, intact, out);
            if antenna.is_multiple_of(self.receivers) {
                let group = *loops / *columns;
                let groups = rows.chunks_exact(group).zip(slot.weights.chunks_exact(group));
                for ((rows, weights), time) in groups.zip(time) {
                    for (row, _) in rows.iter().zip(weights).filter(|&(_, &w)| intact || w != 0.0) {
                        arithmetic.add_power(row, &removed, time);
                    }
                }
            }
            for (z, power) in out.iter().zip(power) {
                arithmetic.add_power(z, &Cells::ZERO, power);
            }
        }
    }

    /// Ends a frame.
    pub(super) fn finish(&mut self) {
        self.background_empty &= self.slots.iter().all(|slot| slot.chirps == 0);
    }
}

/// Takes what is static off Doppler spectra. Of an intact Hann window only bins -1, 0 and 1 are not zero.
#[inline(always)]
fn remove<S: Simd>(arithmetic: Arithmetic<S>, removed: &Cells, slot: &Slot, intact: bool, out: &mut [Cells]) {
    /// Shortest Hann window of which bins -1 and 1 are two.
    const MIN_SPARSE: usize = 4;
    let last = out.len() - 1;
    let sparse = intact && last + 1 >= MIN_SPARSE;
    for (k, (z, &leak)) in out.iter_mut().zip(&slot.leakage).enumerate() {
        if sparse && k > 1 && k < last {
            continue;
        }
        for register in 0..LANES / S::F32_LANES {
            z.put(register, arithmetic.subtract_turned(z.get(register), removed.get(register), leak));
        }
    }
}
