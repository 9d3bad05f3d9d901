//! Row by row or number by number: layer norm, quantisation, sums and means of rows.

use crate::isa::{Isa, LANES, Work};
use crate::lanes::load;
use crate::out::{Given, Sink};

/// `(x - mean) / sqrt(variance + epsilon) * gamma + beta` of each row.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LayerNorm<'a> {
    /// `[rows][width]`.
    pub(crate) input: &'a [f32],
    /// `[width]`.
    pub(crate) gamma: &'a [f32],
    /// `[width]`.
    pub(crate) beta: &'a [f32],
    pub(crate) epsilon: f32,
    /// `[rows][width]`.
    pub(crate) sink: Sink<'a>,
}

/// Rows that take turns, so that none waits for its own sums.
const ROWS: usize = 4;

impl Work for LayerNorm<'_> {
    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let rows = self.input.len() / self.gamma.len();
        for row in (0..rows - rows % ROWS).step_by(ROWS) {
            self.rows::<I, ROWS>(isa, row);
        }
        for row in rows - rows % ROWS..rows {
            self.rows::<I, 1>(isa, row);
        }
    }
}

impl LayerNorm<'_> {
    /// `R` rows from `first` on.
    #[expect(clippy::needless_range_loop, reason = "of each group, all rows")]
    #[inline(always)]
    fn rows<I: Isa, const R: usize>(&self, isa: I, first: usize) {
        let width = self.gamma.len();
        let (groups, share) = (width / LANES, 1.0 / width as f32);
        // Whole groups of lanes, and what is left.
        let mut x: [&[[f32; LANES]]; R] = [&[]; R];
        let mut rest: [&[f32]; R] = [&[]; R];
        for (row, values) in self.input[first * width..].chunks_exact(width).take(R).enumerate() {
            let (whole, left) = values.as_chunks();
            (x[row], rest[row]) = (&whole[..groups], left);
        }
        let mut sums = [isa.splat(0.0); R];
        for group in 0..groups {
            for row in 0..R {
                sums[row] = isa.add(sums[row], isa.floats(&x[row][group]));
            }
        }
        let mut means = [isa.splat(0.0); R];
        for row in 0..R {
            let sum = isa.sum(isa.add(sums[row], load(isa, rest[row], 0.0)));
            means[row] = isa.splat(sum * share);
        }
        let mut squares = [isa.splat(0.0); R];
        for group in 0..groups {
            for row in 0..R {
                let deviation = isa.subtract(isa.floats(&x[row][group]), means[row]);
                squares[row] = isa.fused(deviation, deviation, squares[row]);
            }
        }
        let mut scales = [isa.splat(0.0); R];
        for row in 0..R {
            // Lanes beyond the row are the mean, so that they add nothing.
            let rest = load(isa, rest[row], isa.store(means[row])[0]);
            let deviation = isa.subtract(rest, means[row]);
            let variance = isa.sum(isa.fused(deviation, deviation, squares[row])) * share;
            scales[row] = isa.splat(1.0 / (variance + self.epsilon).sqrt());
        }
        for group in 0..groups {
            let mut of_group = [isa.splat(0.0); R];
            for row in 0..R {
                of_group[row] = isa.floats(&x[row][group]);
            }
            self.put(isa, first, group * LANES, of_group, (means, scales));
        }
        if !width.is_multiple_of(LANES) {
            let mut left = [isa.splat(0.0); R];
            for row in 0..R {
                left[row] = load(isa, rest[row], 0.0);
            }
            self.put(isa, first, groups * LANES, left, (means, scales));
        }
    }

    /// What becomes of a group of columns from `column` on, of `R` rows from `first` on.
    #[inline(always)]
    fn put<I: Isa, const R: usize>(
        &self,
        isa: I,
        first: usize,
        column: usize,
        x: [I::Floats; R],
        (means, scales): ([I::Floats; R], [I::Floats; R]),
    ) {
        let width = self.gamma.len();
        let (gamma, beta) = (load(isa, &self.gamma[column..], 0.0), load(isa, &self.beta[column..], 0.0));
        let mut y = x;
        for row in 0..R {
            let deviation = isa.subtract(x[row], means[row]);
            y[row] = isa.fused(isa.multiply(deviation, scales[row]), gamma, beta);
        }
        // SAFETY: one thread runs all of it; there are as many outputs as inputs.
        unsafe {
            self.sink.store_rows(isa, (first * width + column, width), Given(y), LANES.min(width - column))
        };
    }
}

/// Each number as it is, which the sink quantises, or adds.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Copy<'a> {
    pub(crate) input: &'a [f32],
    pub(crate) sink: Sink<'a>,
}

impl Work for Copy<'_> {
    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        for (group, x) in self.input.chunks(LANES).enumerate() {
            // SAFETY: one thread runs all of it; there are as many outputs as inputs.
            unsafe { self.sink.store(isa, group * LANES, load(isa, x, 0.0), x.len()) };
        }
    }
}

/// Mean of all rows, column by column, rows added in their order.
#[derive(Debug, Clone, Copy)]
pub(crate) struct MeanRows<'a> {
    /// `[rows][width]`.
    pub(crate) input: &'a [f32],
    pub(crate) width: usize,
    /// `[width]`.
    pub(crate) sink: Sink<'a>,
}

impl Work for MeanRows<'_> {
    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let share = isa.splat(1.0 / (self.input.len() / self.width) as f32);
        for column in (0..self.width).step_by(LANES) {
            let count = LANES.min(self.width - column);
            let mut sums = isa.splat(0.0);
            for row in self.input.chunks_exact(self.width) {
                sums = isa.add(sums, load(isa, &row[column..][..count], 0.0));
            }
            // SAFETY: one thread runs all of it; there are as many outputs as columns.
            unsafe { self.sink.store(isa, column, isa.multiply(sums, share), count) };
        }
    }
}
