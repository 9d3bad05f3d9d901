//! Matrix products of u8 inputs and s8 weights.
//!
//! Tiles of some rows by some panels of outputs, whose sums stay in registers over all of k; panels outside, rows inside, so
//! that weights too large for the cache are read from memory once. Sums of many rows wait in the first cache until what makes
//! them outputs is done to all of them at once.

use std::ops::Range;

#[cfg(target_arch = "x86_64")]
use crate::isa::amx::{self, Tiles};
use crate::isa::{Factors, Isa, LANES, QUAD, Work};
use crate::lanes::load;
use crate::out::{Affine, Rows, Sink, affine};
use crate::pack::{Line, Packed};

/// Sums of a row of a panel.
type Sums = [i32; LANES];

/// Rows of a panel whose sums wait: 4 KiB of them.
const WAITING: usize = 64;

/// Rows from which on tiles are faster, where there are any.
#[cfg(target_arch = "x86_64")]
const TILED: usize = 8;

/// A product, or some panels of it.
#[derive(Debug, Clone)]
pub(crate) struct Linear<'a> {
    /// `[rows][k]`.
    pub(crate) input: &'a [u8],
    pub(crate) rows: usize,
    pub(crate) weights: &'a Packed,
    pub(crate) affine: Affine<'a>,
    /// `[rows][n]`.
    pub(crate) sink: Sink<'a>,
    /// What is to be computed.
    pub(crate) panels: Range<usize>,
}

impl Work for Linear<'_> {
    const TILES: bool = true;

    fn factors(&self) -> Factors {
        self.weights.factors()
    }

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let mut panels = self.panels.clone();
        #[cfg(target_arch = "x86_64")]
        if self.rows >= TILED
            && self.weights.k().is_multiple_of(amx::DEPTH)
            // SAFETY: there are no others on this thread: nothing that has some calls a kernel.
            && let Some(mut tiles) = unsafe { isa.tiles() }
        {
            while panels.len() >= 2 {
                self.tiled(isa, &mut tiles, panels.start);
                panels.start += 2;
            }
        }
        let mut sums = [[0; LANES]; WAITING];
        while !panels.is_empty() {
            let wide = if self.rows == 1 { 8 } else { I::PANELS };
            panels.start += match panels.len().min(wide) {
                8.. => self.block::<I, 8>(isa, panels.start, &mut sums),
                4.. => self.block::<I, 4>(isa, panels.start, &mut sums),
                2.. => self.block::<I, 2>(isa, panels.start, &mut sums),
                _ => self.block::<I, 1>(isa, panels.start, &mut sums),
            };
        }
    }
}

impl Linear<'_> {
    /// All rows of two panels, by tiles.
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    fn tiled<I: Isa>(&self, isa: I, tiles: &mut Tiles, panel: usize) {
        let k = self.weights.k();
        let panels = [self.weights.panel(panel), self.weights.panel(panel + 1)];
        let blocks = self.rows.div_ceil(2 * amx::HEIGHT);
        let mut sums = [[[[0; LANES]; amx::HEIGHT]; 2]; 2];
        let mut start = 0;
        for block in 1..=blocks {
            let end = block * self.rows / blocks;
            let heights = tiles.product(&self.input[start * k..end * k], k, panels, &mut sums);
            let mut row = start;
            for (sums, height) in sums.iter().zip(heights) {
                self.put(isa, row, panel, &sums[0][..height]);
                self.put(isa, row, panel + 1, &sums[1][..height]);
                row += height;
            }
            start = end;
        }
    }

    /// All rows of `P` panels; gives `P`.
    #[inline(always)]
    fn block<I: Isa, const P: usize>(&self, isa: I, panel: usize, sums: &mut [Sums; WAITING]) -> usize {
        let mut panels: [&[Line]; P] = [&[]; P];
        for (offset, lines) in panels.iter_mut().enumerate() {
            *lines = self.weights.panel(panel + offset);
        }
        // As even as it goes: a last block of one row would cost as much as three.
        let height = if P == 8 { 1 } else { I::ROWS };
        let blocks = self.rows.div_ceil(height);
        let (least, one_more) = (self.rows / blocks.max(1), self.rows % blocks.max(1));
        let share = WAITING / P;
        let (mut first, mut start) = (0, 0);
        for block in 0..blocks {
            let count = least + usize::from(block < one_more);
            let at = start - first;
            match count {
                1 => self.tile::<I, 1, P>(isa, start, &panels, at, sums),
                2 if height >= 2 => self.tile::<I, 2, P>(isa, start, &panels, at, sums),
                3 if height >= 3 => self.tile::<I, 3, P>(isa, start, &panels, at, sums),
                4 if height >= 4 => self.tile::<I, 4, P>(isa, start, &panels, at, sums),
                5 if height >= 5 => self.tile::<I, 5, P>(isa, start, &panels, at, sums),
                6 if height >= 6 => self.tile::<I, 6, P>(isa, start, &panels, at, sums),
                count => unreachable!("a tile of {count} rows"),
            }
            start += count;
            if start == self.rows || start - first + height > share {
                for p in 0..P {
                    self.put(isa, first, panel + p, &sums[p * share..][..start - first]);
                }
                first = start;
            }
        }
        P
    }

    /// `R` rows of `P` panels. Sums go to place `at` and after of each panel's share of `sums`.
    #[inline(always)]
    fn tile<I: Isa, const R: usize, const P: usize>(
        &self,
        isa: I,
        row: usize,
        panels: &[&[Line]; P],
        at: usize,
        sums_of_all: &mut [Sums; WAITING],
    ) {
        let k = self.weights.k();
        let whole = k / QUAD;
        let mut inputs: [&[[u8; QUAD]]; R] = [&[]; R];
        let rows = &self.input[row * k..][..R * k];
        for r in 0..R {
            inputs[r] = &rows[r * k..][..k].as_chunks().0[..whole];
        }
        let mut lines = *panels;
        for lines in &mut lines {
            *lines = &lines[..whole];
        }
        // Each block of rows fetches a panel of those that come next; a single row waits for memory as it is.
        let next = panels[0].as_ptr().wrapping_add(P * panels[0].len() + row / I::ROWS * whole);
        let mut sums = [[isa.splat_ints(0); P]; R];
        let pairs = if I::PAIRS { whole / 2 } else { 0 };
        let mut input_pairs: [&[[[u8; QUAD]; 2]]; R] = [&[]; R];
        for r in 0..R {
            input_pairs[r] = &inputs[r].as_chunks().0[..pairs];
        }
        let mut line_pairs: [&[[Line; 2]]; P] = [&[]; P];
        for p in 0..P {
            line_pairs[p] = &lines[p].as_chunks().0[..pairs];
        }
        for pair in 0..pairs {
            if R > 1 {
                isa.prefetch(next.wrapping_add(2 * pair));
                isa.prefetch(next.wrapping_add(2 * pair + 1));
            }
            let [first, second] = &line_pairs[0][pair];
            let mut weights = [[isa.bytes(&first.0), isa.bytes(&second.0)]; P];
            for p in 1..P {
                let [first, second] = &line_pairs[p][pair];
                weights[p] = [isa.bytes(&first.0), isa.bytes(&second.0)];
            }
            for r in 0..R {
                let [first, second] = input_pairs[r][pair];
                let u = [isa.splat_bytes(first), isa.splat_bytes(second)];
                for p in 0..P {
                    sums[r][p] = isa.dot_two(sums[r][p], u, weights[p]);
                }
            }
        }
        for quad in 2 * pairs..whole {
            if R > 1 {
                isa.prefetch(next.wrapping_add(quad));
            }
            let mut weights = [isa.bytes(&lines[0][quad].0); P];
            for p in 1..P {
                weights[p] = isa.bytes(&lines[p][quad].0);
            }
            for r in 0..R {
                let u = isa.splat_bytes(inputs[r][quad]);
                for p in 0..P {
                    sums[r][p] = isa.dot(sums[r][p], u, weights[p]);
                }
            }
        }
        if whole * QUAD < k {
            // What is left of each row beyond whole quads, filled with zeros.
            let mut rest = [[0; QUAD]; R];
            for r in 0..R {
                let left = &rows[r * k + whole * QUAD..(r + 1) * k];
                rest[r][..left.len()].copy_from_slice(left);
            }
            for p in 0..P {
                let weights = isa.bytes(&panels[p][whole].0);
                for r in 0..R {
                    sums[r][p] = isa.dot(sums[r][p], isa.splat_bytes(rest[r]), weights);
                }
            }
        }
        for p in 0..P {
            let to = &mut sums_of_all[p * (WAITING / P) + at..][..R];
            for r in 0..R {
                to[r] = isa.store_ints(sums[r][p]);
            }
        }
    }

    /// What the sums of a panel become, in rows of the output from `row` on.
    #[inline(always)]
    fn put<I: Isa>(&self, isa: I, row: usize, panel: usize, sums: &[Sums]) {
        let (output, n) = (panel * LANES, self.weights.n());
        let scale = load(isa, &self.affine.scale[output..], 0.0);
        let bias = load(isa, &self.affine.bias[output..], 0.0);
        let rows = Outputs { sums, scale, bias, leak: isa.splat(self.affine.leak) };
        // SAFETY: no other thread has these panels, so none writes these outputs of any row; there are `rows` by `n`.
        unsafe { self.sink.store_rows(isa, (row * n + output, n), rows, LANES.min(n - output)) };
    }
}

/// What rows of sums become.
struct Outputs<'a, I: Isa> {
    sums: &'a [Sums],
    scale: I::Floats,
    bias: I::Floats,
    leak: I::Floats,
}

impl<I: Isa> Rows<I> for Outputs<'_, I> {
    const NUMBERS: bool = true;

    #[inline(always)]
    fn len(&self) -> usize {
        self.sums.len()
    }

    #[inline(always)]
    fn row(&self, isa: I, row: usize) -> I::Floats {
        affine(isa, isa.ints(&self.sums[row]), self.scale, self.bias, self.leak)
    }
}
