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
use super::lanes::{Arithmetic, Cells, LANES, transpose};

const HALF: usize = LANES / 2;

/// The sample modulo 16 that lies in a lane: even ones, then odd ones, as the words come apart.
const fn sample_of(lane: usize) -> usize {
    lane % HALF * 2 + lane / HALF
}

/// Window and range FFT of the rows of one virtual antenna.
#[derive(Debug)]
pub(super) struct RangeFft {
    format: SampleFormat,
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
        let Self { transformed, block, bins, twiddles, .. } = self;
        let Some(source) = transformed.as_chunks::<LANES>().0.get(group) else { return };
        let mut part = [[0.0; LANES]; LANES];
        transpose(&source.map(|z| z.re), &mut part);
        for (z, part) in block.iter_mut().zip(&part) {
            z.re = *part;
        }
        transpose(&source.map(|z| z.im), &mut part);
        for (z, part) in block.iter_mut().zip(&part) {
            z.im = *part;
        }
        let twiddles = &twiddles[group];
        let multiply = Arithmetic(simd);
        for register in 0..LANES / S::F32_LANES {
            let x = core::array::from_fn(|sample| {
                let lane = sample % 2 * HALF + sample / 2;
                multiply.multiply(block[lane].get(register), twiddles[lane].get(register))
            });
            for (out, z) in bins.iter_mut().zip(multiply.fft::<LANES>(x)) {
                out.put(register, z);
            }
        }
    }

    /// Words of one row, times the window, to the vectors from `first` on.
    #[inline(always)]
    fn unpack(&mut self, raw: &[u8], first: usize) -> u32 {
        let Self { format, window: [even, odd], words: [[a, b], [c, d]], rows, vectors, .. } = self;
        let mut changes = 0;
        let (pairs, _) = raw.as_chunks::<4>();
        let (re, im) = match format {
            SampleFormat::Complex(order) => {
                // Two words of one part, then two of the other.
                let out = a.iter_mut().zip(&mut *b).zip(c.iter_mut().zip(&mut *d));
                let (fours, _) = pairs.as_chunks::<2>();
                for ((&[p, q], (even, odd)), ((a, b), (c, d))) in
                    fours.iter().zip(even.iter().zip(&*odd)).zip(out)
                {
                    let [p, q] = [p, q].map(u32::from_le_bytes);
                    changes |= sign_changes(p) | sign_changes(q);
                    let ([p0, p1], [q0, q1]) = (samples::words(p), samples::words(q));
                    (*a, *b, *c, *d) = (p0 * even, p1 * odd, q0 * even, q1 * odd);
                }
                match order {
                    IqOrder::IFirst => ([&*a, &*b], [&*c, &*d]),
                    IqOrder::QFirst => ([&*c, &*d], [&*a, &*b]),
                }
            }
            SampleFormat::Real => {
                let out = a.iter_mut().zip(&mut *b);
                for ((&p, (even, odd)), (a, b)) in pairs.iter().zip(even.iter().zip(&*odd)).zip(out) {
                    let p = u32::from_le_bytes(p);
                    changes |= sign_changes(p);
                    let [p0, p1] = samples::words(p);
                    (*a, *b) = (p0 * even, p1 * odd);
                }
                // The second words stay zero.
                ([&*a, &*b], [&*c, &*d])
            }
        };
        for (i, z) in rows[first..first + *vectors].iter_mut().enumerate() {
            let of = i * HALF..(i + 1) * HALF;
            z.re[..HALF].copy_from_slice(&re[0][of.clone()]);
            z.re[HALF..].copy_from_slice(&re[1][of.clone()]);
            z.im[..HALF].copy_from_slice(&im[0][of.clone()]);
            z.im[HALF..].copy_from_slice(&im[1][of]);
        }
        if changes & SIGNS == 0 { 0 } else { samples::words_at_limits(raw) }
    }
}
