//! Weights as the kernels read them.
//!
//! A panel is 16 outputs of a matrix product, one a lane; its numbers lie in the order in which one pass over k needs them,
//! a cache line for each four of k:
//!
//! ```text
//!              lane 0 (output 16p)        lane 1 (output 16p + 1)       lane 15
//! line 0    w[0] w[1] w[2] w[3]        w[0] w[1] w[2] w[3]        ...
//! line 1    w[4] w[5] w[6] w[7]        w[4] w[5] w[6] w[7]        ...
//! ...       up to k, filled with zeros to a multiple of 4; outputs beyond n are zeros too
//! ```
//!
//! In a convolution the lanes are pixels instead: each row of a 3x3 kernel is four weights, the last one zero.

use crate::isa::{Factors, LANES, QUAD, Quads};

/// The greatest amount of a narrow weight: two products with u8 fit 16 bits, `2 * 255 * 64 = 32,640`. With AVX2 alone such
/// weights are multiplied 1.4 to 1.7 times as fast; elsewhere it makes no difference.
pub const NARROW: i8 = 64;

/// The greatest small input: four products with narrow weights fit 16 bits, `4 * 127 * 64 = 32,512`.
pub const SMALL: u8 = 127;

/// A cache line of weights: four of k for each of a panel's outputs.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
pub(crate) struct Line(pub(crate) Quads);

/// Weights of a matrix product.
#[derive(Debug, Clone)]
pub struct Packed {
    k: usize,
    n: usize,
    /// `[panels][lines of a panel]`.
    lines: Vec<Line>,
    sums: Vec<i32>,
    factors: Factors,
}

impl Packed {
    /// Packs `weights`, `[n][k]`: row by row the weights of one output.
    ///
    /// # Panics
    /// If `weights` is not `n * k` long.
    pub fn new(k: usize, n: usize, weights: &[i8]) -> Self {
        assert_eq!(weights.len(), k * n, "weights of {n} outputs by {k} inputs");
        let height = k.div_ceil(QUAD);
        let mut lines = vec![Line([[0; QUAD]; LANES]); height * n.div_ceil(LANES)];
        for (output, row) in weights.chunks_exact(k.max(1)).enumerate() {
            let panel = &mut lines[output / LANES * height..][..height];
            for (line, quad) in panel.iter_mut().zip(row.chunks(QUAD)) {
                for (to, &weight) in line.0[output % LANES].iter_mut().zip(quad) {
                    *to = weight.cast_unsigned();
                }
            }
        }
        Self { k, n, lines, sums: sums(weights, k, n), factors: factors(weights) }
    }

    /// For inputs of which none is above `top`. With narrow weights, inputs up to [`SMALL`] are multiplied faster yet where AVX2
    /// is all there is.
    ///
    /// Inputs above it are an error of the program: the sums are then wrong, at some levels.
    pub fn for_inputs_to(mut self, top: u8) -> Self {
        if self.factors == Factors::Narrow && top <= SMALL {
            self.factors = Factors::Small;
        }
        self
    }

    /// Inputs.
    pub fn k(&self) -> usize {
        self.k
    }

    /// Outputs.
    pub fn n(&self) -> usize {
        self.n
    }

    /// Sum of an output's weights: what each step of the inputs' zero point adds to it.
    ///
    /// # Panics
    /// If there is no such output.
    pub fn sum(&self, output: usize) -> i32 {
        self.sums[output]
    }

    pub(crate) fn factors(&self) -> Factors {
        self.factors
    }

    pub(crate) fn panels(&self) -> usize {
        self.n.div_ceil(LANES)
    }

    #[inline(always)]
    pub(crate) fn panel(&self, panel: usize) -> &[Line] {
        let height = self.k.div_ceil(QUAD);
        &self.lines[panel * height..][..height]
    }
}

/// Weights of a convolution of 3x3.
#[derive(Debug, Clone)]
pub struct PackedConv {
    outputs: usize,
    channels: usize,
    /// `[outputs][channels][3]`, a kernel's row each.
    rows: Vec<[u8; QUAD]>,
    sums: Vec<i32>,
    factors: Factors,
}

impl PackedConv {
    /// Packs `weights`, `[outputs][channels][3][3]`.
    ///
    /// # Panics
    /// If `weights` is not `outputs * channels * 9` long.
    pub fn new(outputs: usize, channels: usize, weights: &[i8]) -> Self {
        assert_eq!(
            weights.len(),
            outputs * channels * 9,
            "weights of {outputs} by {channels} kernels of 3x3"
        );
        let rows = weights.as_chunks().0.iter().map(|row: &[i8; 3]| {
            let [left, middle, right] = row.map(i8::cast_unsigned);
            [left, middle, right, 0]
        });
        let sums = sums(weights, channels * 9, outputs);
        Self { outputs, channels, rows: rows.collect(), sums, factors: factors(weights) }
    }

    /// Output channels.
    pub fn outputs(&self) -> usize {
        self.outputs
    }

    /// Input channels.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// Sum of an output channel's weights: what each step of the inputs' zero point adds to it.
    ///
    /// # Panics
    /// If there is no such output.
    pub fn sum(&self, output: usize) -> i32 {
        self.sums[output]
    }

    pub(crate) fn factors(&self) -> Factors {
        self.factors
    }

    /// Rows of an output's kernels, `[channels][3]`.
    #[inline(always)]
    pub(crate) fn rows(&self, output: usize) -> &[[u8; QUAD]] {
        let height = self.channels * 3;
        &self.rows[output * height..][..height]
    }
}

fn sums(weights: &[i8], k: usize, n: usize) -> Vec<i32> {
    (0..n).map(|output| weights[output * k..][..k].iter().map(|&w| i32::from(w)).sum()).collect()
}

/// What the weights tell; of inputs nothing.
fn factors(weights: &[i8]) -> Factors {
    let narrow = weights.iter().all(|weight| weight.unsigned_abs() <= NARROW.unsigned_abs());
    if narrow { Factors::Narrow } else { Factors::Any }
}
