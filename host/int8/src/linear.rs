//! Matrix products of u8 inputs and s8 weights.
//!
//! Tiles of some rows by some panels of outputs, whose sums stay in registers over all of k; panels outside, rows inside, so
//! that weights too large for the cache are read from memory once.

use std::ops::Range;

#[cfg(target_arch = "x86_64")]
use crate::isa::amx::{self, Tiles};
use crate::isa::{Isa, LANES, QUAD, Work};
use crate::lanes::load;
use crate::out::{Affine, Sink, affine};
use crate::pack::{Line, Packed};

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

    fn is_narrow(&self) -> bool {
        self.weights.is_narrow()
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
        while !panels.is_empty() {
            let wide = if self.rows == 1 { 8 } else { I::PANELS };
            panels.start += match panels.len().min(wide) {
                8.. => self.block::<I, 8>(isa, panels.start),
                4.. => self.block::<I, 4>(isa, panels.start),
                2.. => self.block::<I, 2>(isa, panels.start),
                _ => self.block::<I, 1>(isa, panels.start),
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
            for (p, outputs) in [panel, panel + 1].into_iter().enumerate() {
                let epilogue = self.epilogue(isa, outputs);
                let mut row = start;
                for (sums, height) in sums.iter().zip(heights) {
                    for sums in &sums[p][..height] {
                        self.put(isa, &epilogue, row, isa.ints(sums));
                        row += 1;
                    }
                }
            }
            start = end;
        }
    }

    /// All rows of `P` panels; gives `P`.
    #[inline(always)]
    fn block<I: Isa, const P: usize>(&self, isa: I, panel: usize) -> usize {
        let mut panels: [&[Line]; P] = [&[]; P];
        for (offset, lines) in panels.iter_mut().enumerate() {
            *lines = self.weights.panel(panel + offset);
        }
        // As even as it goes: a last block of one row would cost as much as three.
        let height = if P == 8 { 1 } else { I::ROWS };
        let blocks = self.rows.div_ceil(height);
        let mut start = 0;
        for block in 1..=blocks {
            let end = block * self.rows / blocks;
            match end - start {
                1 => self.tile::<I, 1, P>(isa, start, panel, &panels),
                2 if height >= 2 => self.tile::<I, 2, P>(isa, start, panel, &panels),
                3 if height >= 3 => self.tile::<I, 3, P>(isa, start, panel, &panels),
                4 if height >= 4 => self.tile::<I, 4, P>(isa, start, panel, &panels),
                5 if height >= 5 => self.tile::<I, 5, P>(isa, start, panel, &panels),
                6 if height >= 6 => self.tile::<I, 6, P>(isa, start, panel, &panels),
                height => unreachable!("a tile of {height} rows"),
            }
            start = end;
        }
        P
    }

    /// `R` rows of `P` panels.
    #[inline(always)]
    fn tile<I: Isa, const R: usize, const P: usize>(
        &self,
        isa: I,
        row: usize,
        panel: usize,
        panels: &[&[Line]; P],
    ) {
        let k = self.weights.k();
        let whole = k / QUAD;
        let mut inputs: [&[[u8; QUAD]]; R] = [&[]; R];
        // What is left of each row beyond whole quads, filled with zeros.
        let mut rest = [[0; QUAD]; R];
        for r in 0..R {
            let (quads, tail) = self.input[(row + r) * k..][..k].as_chunks();
            inputs[r] = &quads[..whole];
            for (to, &from) in rest[r].iter_mut().zip(tail) {
                *to = from;
            }
        }
        let mut lines = *panels;
        for lines in &mut lines {
            *lines = &lines[..whole];
        }
        // Each block of rows fetches a panel of those that come next; a single row waits for memory as it is.
        let next = panels[0].as_ptr().wrapping_add(P * panels[0].len() + row / I::ROWS * whole);
        let mut sums = [[isa.splat_ints(0); P]; R];
        for quad in 0..whole {
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
            for p in 0..P {
                let weights = isa.bytes(&panels[p][whole].0);
                for r in 0..R {
                    sums[r][p] = isa.dot(sums[r][p], isa.splat_bytes(rest[r]), weights);
                }
            }
        }
        for p in 0..P {
            let epilogue = self.epilogue(isa, panel + p);
            for (row, sums) in (row..).zip(&sums) {
                self.put(isa, &epilogue, row, sums[p]);
            }
        }
    }

    #[inline(always)]
    fn epilogue<I: Isa>(&self, isa: I, panel: usize) -> Epilogue<I> {
        let output = panel * LANES;
        Epilogue {
            output,
            count: LANES.min(self.weights.n() - output),
            scale: load(isa, &self.affine.scale[output..], 0.0),
            bias: load(isa, &self.affine.bias[output..], 0.0),
            leak: isa.splat(self.affine.leak),
        }
    }

    /// What the sums of a panel become, in a row of the output.
    #[inline(always)]
    fn put<I: Isa>(&self, isa: I, epilogue: &Epilogue<I>, row: usize, sums: I::Ints) {
        let &Epilogue { output, count, scale, bias, leak } = epilogue;
        let y = affine(isa, sums, scale, bias, leak);
        // SAFETY: no other thread has these panels, so none writes these outputs of any row; there are `rows` by `n`.
        unsafe { self.sink.store(isa, row * self.weights.n() + output, y, count) };
    }
}

/// What a panel's sums meet.
struct Epilogue<I: Isa> {
    /// The first of its outputs, and how many there are.
    output: usize,
    count: usize,
    scale: I::Floats,
    bias: I::Floats,
    leak: I::Floats,
}
