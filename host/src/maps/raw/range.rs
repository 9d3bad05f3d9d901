//! Samples to range spectra: N = 16 R samples are R vectors of 16 lanes.
//!
//! An FFT of length R across the vectors, twiddle factors, a transpose of 16 x 16, and an FFT of length 16 across what were
//! the lanes give the bins in natural order, sixteen neighbours abreast. Where R is under 16, rows of 16 / R loops share
//! one transpose.

use pulp::Simd;
use rfhoi_firmware::dca1000::samples::{self, FULL_SCALE, SIGNS, sign_changes};
use rfhoi_firmware::dsp::window;
use rfhoi_shared::radar::{IqOrder, RadarProfile, SampleFormat};

use super::fft::{LaneFft, root};
use super::lanes::{Arithmetic, Cells, LANES, Transposer};

const HALF: usize = LANES / 2;

/// The sample modulo 16 that lies in a lane: even ones, then odd ones, as the words come apart.
const fn sample_of(lane: usize) -> usize {
    lane % HALF * 2 + lane / HALF
}

/// Window and range FFT of the rows of one virtual antenna.
#[derive(Debug)]
pub(super) struct RangeFft {
    format: SampleFormat,
    transposer: Transposer,
    /// The window at even and odd samples.
    window: [Vec<f32>; 2],
    /// Words as numbers: even and odd samples of each row's first words, then of its second ones.
    words: [[Vec<f32>; 2]; 2],
    columns: LaneFft,
    /// Vectors of a row.
    vectors: usize,
    /// By group of 16 vectors, then lane of the samples; lanes are those of the transposed block.
    twiddles: Vec<[Cells; LANES]>,
    rows: Vec<Cells>,
    transformed: Vec<Cells>,
    block: Box<[Cells; LANES]>,
    bins: Box<[Cells; LANES]>,
}

impl RangeFft {
    /// For a valid profile.
    pub(super) fn new(profile: &RadarProfile) -> Self {
        let samples = usize::from(profile.samples);
        let vectors = samples / LANES;
        let sum = match profile.format {
            SampleFormat::Complex(_) => 1.0 / FULL_SCALE,
            // Half of a real tone's power is at negative frequencies.
            SampleFormat::Real => 2.0 / FULL_SCALE,
        };
        let mut window = vec![0.0; samples];
        window::hann(&mut window, sum);
        let twiddle = |group: usize, lane: usize| {
            let mut factors = Cells::ZERO;
            for i in 0..LANES {
                let bin = (LANES * group + i) % vectors;
                [factors.re[i], factors.im[i]] = root(bin * sample_of(lane), samples);
            }
            factors
        };
        let groups = vectors.div_ceil(LANES);
        Self {
            format: profile.format,
            transposer: Transposer::new(),
            window: [0, 1].map(|odd| window.iter().copied().skip(odd).step_by(2).collect()),
            words: [(); 2].map(|()| [(); 2].map(|()| vec![0.0; samples / 2])),
            columns: LaneFft::new(vectors),
            vectors,
            twiddles: (0..groups).map(|g| core::array::from_fn(|lane| twiddle(g, lane))).collect(),
            rows: vec![Cells::ZERO; groups * LANES],
            transformed: vec![Cells::ZERO; groups * LANES],
            block: Box::new([Cells::ZERO; LANES]),
            bins: Box::new([Cells::ZERO; LANES]),
        }
    }

    /// Writes the spectra of `row(loop)`, zeros where there is none, to `out`: by block of 16 bins, from `first_block` on,
    /// then loop. Returns how many words were at the ADC's limits.
    #[inline(always)]
    pub(super) fn antenna<'r, S: Simd>(
        &mut self,
        simd: S,
        loops: usize,
        row: impl Fn(usize) -> Option<&'r [u8]>,
        first_block: usize,
        out: &mut [Cells],
    ) -> u32 {
        let vectors = self.vectors;
        let rows_at_once = (LANES / vectors).max(1);
        let mut clipped = 0;
        for first in (0..loops).step_by(rows_at_once) {
            for share in 0..rows_at_once {
                let place = share * vectors..(share + 1) * vectors;
                match row(first + share) {
                    Some(words) => clipped += self.unpack(words, place.start),
                    None => self.rows[place.clone()].fill(Cells::ZERO),
                }
                let (source, out) = (&self.rows[place.clone()], &mut self.transformed[place]);
                self.columns.forward(simd, source, out, |_, z| z);
            }
            for group in 0..self.twiddles.len() {
                self.across_lanes(simd, group);
                // Bins of a vector that belong to one row.
                let share = vectors.min(LANES);
                for (k, bins) in self.bins.iter().enumerate() {
                    let bin = vectors * k + LANES * group;
                    let Some(block) = (bin / LANES).checked_sub(first_block) else { continue };
                    let Some(out) = out.get_mut(block * loops..(block + 1) * loops) else { continue };
                    if share == LANES {
                        out[first] = *bins;
                        continue;
                    }
                    let to = bin % LANES;
                    for (r, out) in out[first..].iter_mut().take(rows_at_once).enumerate() {
                        out.re[to..to + share].copy_from_slice(&bins.re[r * share..][..share]);
                        out.im[to..to + share].copy_from_slice(&bins.im[r * share..][..share]);
                    }
                }
            }
        }
        clipped
    }

    /// The second step, of 16 vectors.
    #[inline(always)]
    fn across_lanes<S: Simd>(&mut self, simd: S, group: usize) {
        let Self { transformed, transposer, block, bins, twiddles, .. } = self;
        let Some(source) = transformed.as_chunks::<LANES>().0.get(group) else { return };
        transposer.transpose(source, block);
        let twiddles = &twiddles[group];
        let arithmetic = Arithmetic(simd);
        for register in 0..LANES / S::F32_LANES {
            let mut x = [arithmetic.zero(); LANES];
            for (lane, (z, twiddle)) in block.iter().zip(twiddles).enumerate() {
                x[sample_of(lane)] = arithmetic.multiply(z.get(register), twiddle.get(register));
            }
            let x = arithmetic.fft::<LANES>(x);
            for (k, out) in bins.iter_mut().enumerate() {
                out.put(register, x[k]);
            }
        }
    }

    /// Words of one row, times the window, to the vectors from `first` on.
    #[inline(always)]
    fn unpack(&mut self, raw: &[u8], first: usize) -> u32 {
        let Self { format, window: [even, odd], words: [[a, b], [c, d]], rows, vectors, .. } = self;
        let pairs = raw.as_chunks().0;
        let (changes, [even, odd], [even_im, odd_im]) = match format {
            SampleFormat::Complex(order) => {
                let changes = split_complex(pairs.as_chunks().0, even, odd, a, b, c, d);
                match order {
                    IqOrder::IFirst => (changes, [&*a, &*b], [&*c, &*d]),
                    IqOrder::QFirst => (changes, [&*c, &*d], [&*a, &*b]),
                }
            }
            // The second words stay zero.
            SampleFormat::Real => (split_real(pairs, even, odd, a, b), [&*a, &*b], [&*c, &*d]),
        };
        let parts = [even, odd, even_im, odd_im].map(|part| part.as_chunks::<HALF>().0);
        for (i, z) in rows[first..first + *vectors].iter_mut().enumerate() {
            z.re[..HALF].copy_from_slice(&parts[0][i]);
            z.re[HALF..].copy_from_slice(&parts[1][i]);
            z.im[..HALF].copy_from_slice(&parts[2][i]);
            z.im[HALF..].copy_from_slice(&parts[3][i]);
        }
        if changes & SIGNS == 0 { 0 } else { samples::words_at_limits(raw) }
    }
}

/// Words to even and odd samples of their first part, then of their second one, times the window. Returns the changes of all
/// words' signs.
///
/// A function of its own, so that its slices are known to be apart.
#[inline(always)]
fn split_complex(
    pairs: &[[[u8; 4]; 2]],
    even: &[f32],
    odd: &[f32],
    a: &mut [f32],
    b: &mut [f32],
    c: &mut [f32],
    d: &mut [f32],
) -> u32 {
    let mut changes = 0;
    let out = a.iter_mut().zip(b).zip(c.iter_mut().zip(d));
    for ((&[p, q], (even, odd)), ((a, b), (c, d))) in pairs.iter().zip(even.iter().zip(odd)).zip(out) {
        // Two words of one part, then two of the other.
        let [p, q] = [u32::from_le_bytes(p), u32::from_le_bytes(q)];
        changes |= sign_changes(p) | sign_changes(q);
        let ([p0, p1], [q0, q1]) = (samples::words(p), samples::words(q));
        (*a, *b, *c, *d) = (p0 * even, p1 * odd, q0 * even, q1 * odd);
    }
    changes
}

/// The same of real samples, of which there is one part.
#[inline(always)]
fn split_real(pairs: &[[u8; 4]], even: &[f32], odd: &[f32], a: &mut [f32], b: &mut [f32]) -> u32 {
    let mut changes = 0;
    for ((&pair, (even, odd)), (a, b)) in pairs.iter().zip(even.iter().zip(odd)).zip(a.iter_mut().zip(b)) {
        let pair = u32::from_le_bytes(pair);
        changes |= sign_changes(pair);
        let [first, second] = samples::words(pair);
        (*a, *b) = (first * even, second * odd);
    }
    changes
}
