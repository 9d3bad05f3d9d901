//! Row by row or number by number: layer norm, quantisation, sums and means of rows.

use crate::isa::{Isa, LANES, Work};
use crate::lanes::{load, sum};
use crate::out::Sink;

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

impl Work for LayerNorm<'_> {
    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let width = self.gamma.len();
        let share = 1.0 / width as f32;
        for (row, x) in self.input.chunks_exact(width).enumerate() {
            let mut sums = isa.splat(0.0);
            for x in x.chunks(LANES) {
                sums = isa.add(sums, load(isa, x, 0.0));
            }
            let mean = sum(isa, sums) * share;
            let mut squares = isa.splat(0.0);
            for x in x.chunks(LANES) {
                // Lanes beyond the row are the mean, so that they add nothing.
                let deviation = isa.subtract(load(isa, x, mean), isa.splat(mean));
                squares = isa.add(squares, isa.multiply(deviation, deviation));
            }
            let scale = 1.0 / (sum(isa, squares) * share + self.epsilon).sqrt();
            let parameters = self.gamma.chunks(LANES).zip(self.beta.chunks(LANES));
            for (group, (x, (gamma, beta))) in x.chunks(LANES).zip(parameters).enumerate() {
                let deviation = isa.subtract(load(isa, x, 0.0), isa.splat(mean));
                let y = isa.multiply(isa.multiply(deviation, isa.splat(scale)), load(isa, gamma, 0.0));
                let y = isa.add(y, load(isa, beta, 0.0));
                // SAFETY: one thread runs all of it.
                unsafe { self.sink.store(isa, row * width + group * LANES, y, x.len()) };
            }
        }
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
            // SAFETY: one thread runs all of it.
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
            // SAFETY: one thread runs all of it.
            unsafe { self.sink.store(isa, column, isa.multiply(sums, share), count) };
        }
    }
}
