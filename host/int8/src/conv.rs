//! Convolutions of 3x3, a border of one pixel, strides of 1 and 2.
//!
//! Lanes are pixels: 64 bytes of a row, taken as sixteen quads, hold the three inputs of sixteen outputs and one that meets
//! a weight of zero. With stride 1 the quads at offset 0 belong to outputs 0, 4, 8, ...; those at offset 1 to outputs 1, 5,
//! 9, ...: four loads, each one byte further, cover 64 outputs without a shuffle, and the four results of a lane are four
//! neighbours, which a shift and an or put together:
//!
//! ```text
//! bytes   -1  0  1  2  3  4  5  6  7  ...     output x needs bytes x-1, x, x+1
//! phase 0 [ 0      ] [ 4      ] ...           lane 0: output 0, lane 1: output 4
//! phase 1    [ 1      ] [ 5      ] ...
//! phase 2       [ 2      ] [ 6      ] ...
//! phase 3          [ 3      ] [ 7      ] ...
//! ```
//!
//! With stride 2 two phases, two bytes apart, cover 32 outputs.

use crate::isa::{Factors, Isa, LANES, QUAD, Quads, Work};
use crate::lanes::quantise_lanes;
use crate::out::{Affine, Quant, affine};
use crate::pack::PackedConv;

/// Bytes of a register.
const BYTES: usize = LANES * QUAD;

/// What goes into a convolution.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ConvShape {
    /// Input channels.
    pub channels: usize,
    /// Rows of each.
    pub height: usize,
    /// Pixels of a row.
    pub width: usize,
    /// Pixels from one output to the next, both ways: 1 or 2.
    pub stride: usize,
}

impl ConvShape {
    /// Rows, and pixels of a row, of each output channel: one for each `stride` of the input's, the last perhaps short.
    pub fn output(&self) -> (usize, usize) {
        (self.height.div_ceil(self.stride), self.width.div_ceil(self.stride))
    }

    /// Bytes from a row with its border to the next: as many loads as it takes, the last of which may go beyond.
    fn pitch(&self) -> usize {
        (self.width.next_multiple_of(BYTES)) + BYTES
    }
}

#[derive(Debug)]
pub(crate) struct Conv<'a> {
    /// `[channels][height][width]`.
    pub(crate) input: &'a [u8],
    pub(crate) shape: ConvShape,
    pub(crate) weights: &'a PackedConv,
    /// Code of the border's pixels.
    pub(crate) zero: u8,
    pub(crate) affine: Affine<'a>,
    pub(crate) quant: Quant,
    /// `[outputs][height][width]` of [`ConvShape::output`].
    pub(crate) out: &'a mut [u8],
    /// For the input with its border.
    pub(crate) bordered: &'a mut Vec<u8>,
}

impl Work for Conv<'_> {
    fn factors(&self) -> Factors {
        self.weights.factors()
    }

    #[inline(always)]
    fn run<I: Isa>(mut self, isa: I) {
        self.border();
        match self.shape.stride {
            1 => self.convolve::<I, 4>(isa),
            _ => self.convolve::<I, 2>(isa),
        }
    }
}

impl Conv<'_> {
    #[inline(always)]
    fn border(&mut self) {
        let ConvShape { channels, height, width, .. } = self.shape;
        let pitch = self.shape.pitch();
        let rows = height + 2;
        self.bordered.clear();
        self.bordered.resize(channels * rows * pitch, self.zero);
        for channel in 0..channels {
            for row in 0..height {
                let to = (channel * rows + row + 1) * pitch + 1;
                let from = (channel * height + row) * width;
                self.bordered[to..][..width].copy_from_slice(&self.input[from..][..width]);
            }
        }
    }

    /// `PHASES` loads of a row cover all its bytes.
    #[inline(always)]
    fn convolve<I: Isa, const PHASES: usize>(self, isa: I) {
        let stride = QUAD / PHASES;
        let (height, width) = self.shape.output();
        let pitch = self.shape.pitch();
        let plane = (self.shape.height + 2) * pitch;
        let leak = isa.splat(self.affine.leak);
        for output in 0..self.weights.outputs() {
            let weights = self.weights.rows(output).as_chunks::<3>().0;
            let (scale, bias) = (isa.splat(self.affine.scale[output]), isa.splat(self.affine.bias[output]));
            for row in 0..height {
                let out = &mut self.out[(output * height + row) * width..][..width];
                for (block, out) in out.chunks_mut(LANES * PHASES).enumerate() {
                    let mut sums = [isa.splat_ints(0); PHASES];
                    for (plane, weights) in self.bordered.chunks_exact(plane).zip(weights) {
                        let rows = &plane[row * stride * pitch + block * BYTES..];
                        for (y, &quad) in weights.iter().enumerate() {
                            let quad = isa.splat_bytes(quad);
                            let pixels = &rows[y * pitch..][..BYTES + QUAD];
                            for (phase, sums) in sums.iter_mut().enumerate() {
                                let pixels = quads(&pixels[phase * stride..][..BYTES]);
                                *sums = isa.dot(*sums, isa.bytes(pixels), quad);
                            }
                        }
                    }
                    let mut codes = isa.splat_ints(0);
                    for (phase, &sums) in sums.iter().enumerate() {
                        let code = quantise_lanes(isa, affine(isa, sums, scale, bias, leak), self.quant);
                        codes = isa.or(codes, isa.shift_left(code, 8 * phase as u32));
                    }
                    put::<PHASES>(out, isa.store_ints(codes));
                }
            }
        }
    }
}

/// The low `PHASES` bytes of each lane, one after the other, as far as `out` goes.
#[inline(always)]
fn put<const PHASES: usize>(out: &mut [u8], codes: [i32; LANES]) {
    let mut bytes = [[0; PHASES]; LANES];
    for (bytes, code) in bytes.iter_mut().zip(codes) {
        bytes.copy_from_slice(&code.to_le_bytes()[..PHASES]);
    }
    if let Some(out) = out.as_chunks_mut().0.as_mut_array() {
        *out = bytes;
    } else {
        let count = out.len();
        out.copy_from_slice(&bytes.as_flattened()[..count]);
    }
}

#[inline(always)]
fn quads(bytes: &[u8]) -> &Quads {
    bytes.as_chunks().0.as_array().expect("as long as a register")
}
