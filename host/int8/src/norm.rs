//! Row by row or number by number: layer norm, quantisation, sums and means of rows.

use crate::isa::{Isa, LANES, Work};
use crate::lanes::Lanes;
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
    fn run<I: Isa>(self, _: I) {
        let width = self.gamma.len();
        let share = 1.0 / width as f32;
        for (row, x) in self.input.chunks_exact(width).enumerate() {
            let mut sums = Lanes::ZERO;
            for x in x.chunks(LANES) {
                sums = sums.add(Lanes::load(x, 0.0));
            }
            let mean = Lanes::splat(sums.sum() * share);
            let mut squares = Lanes::ZERO;
            for x in x.chunks(LANES) {
                // Lanes beyond the row are the mean, so that they add nothing.
                let deviation = Lanes::load(x, mean.0[0]).subtract(mean);
                squares = squares.add(deviation.multiply(deviation));
            }
            let scale = Lanes::splat(1.0 / (squares.sum() * share + self.epsilon).sqrt());
            let parameters = self.gamma.chunks(LANES).zip(self.beta.chunks(LANES));
            for (group, (x, (gamma, beta))) in x.chunks(LANES).zip(parameters).enumerate() {
                let y = Lanes::load(x, 0.0).subtract(mean).multiply(scale);
                let y = y.multiply(Lanes::load(gamma, 0.0)).add(Lanes::load(beta, 0.0));
                // SAFETY: one thread runs all of it.
                unsafe { self.sink.store(row * width + group * LANES, &y, x.len()) };
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
    fn run<I: Isa>(self, _: I) {
        for (group, x) in self.input.chunks(LANES).enumerate() {
            // SAFETY: one thread runs all of it.
            unsafe { self.sink.store(group * LANES, &Lanes::load(x, 0.0), x.len()) };
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
    fn run<I: Isa>(self, _: I) {
        let share = Lanes::splat(1.0 / (self.input.len() / self.width) as f32);
        for column in (0..self.width).step_by(LANES) {
            let count = LANES.min(self.width - column);
            let mut sums = Lanes::ZERO;
            for row in self.input.chunks_exact(self.width) {
                sums = sums.add(Lanes::load(&row[column..][..count], 0.0));
            }
            // SAFETY: one thread runs all of it.
            unsafe { self.sink.store(column, &sums.multiply(share), count) };
        }
    }
}
