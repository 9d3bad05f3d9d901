//! The convolutions of one map.

use rfhoi_int8::{Affine, ConvShape, Kernels, PackedConv};

use super::{Between, Codes, Seen, leaky};
use crate::config::LEAK;
use crate::model::{Model, ModelError, Precision};

/// A 3 x 3 convolution with LeakyReLU behind it.
#[derive(Debug, Clone)]
pub(super) struct Convolution {
    pub(super) name: String,
    inputs: usize,
    outputs: usize,
    stride: usize,
    kind: Kind,
}

#[derive(Debug, Clone)]
enum Kind {
    Float { weights: Vec<f32>, bias: Vec<f32>, seen: Seen, out: Seen },
    Int8 { weights: PackedConv, scale: Vec<f32>, bias: Vec<f32>, input: Codes, out: Codes },
}

impl Convolution {
    pub(super) fn load(model: &Model, name: &str, stride: usize) -> Result<Self, ModelError> {
        let weight = format!("{name}.weight");
        let shape = model.arrays.get(&weight).map(|array| array.shape.clone());
        let Some([outputs, inputs, 3, 3]) = shape.as_deref() else {
            return Err(ModelError::Weights(format!("{weight} is no 3 x 3 convolution")));
        };
        let (inputs, outputs) = (*inputs, *outputs);
        let bias = model.f32s(&format!("{name}.bias"))?.to_vec();
        let kind = match model.description.precision {
            Precision::F32 => Kind::Float {
                weights: model.f32s(&weight)?.to_vec(),
                bias,
                seen: Seen::default(),
                out: Seen::default(),
            },
            Precision::Int8 => {
                let codes = |part: &str| Codes::load(model, &format!("{name}.{part}"));
                let (input, out) = (codes("input")?, codes("output")?);
                let values = model.i8s(&weight)?;
                let scale: Vec<f32> =
                    model.f32s(&format!("{name}.scale"))?.iter().map(|s| s * input.scale).collect();
                let fold = |n: usize| {
                    let of_one = &values[n * inputs * 9..(n + 1) * inputs * 9];
                    let sum: i32 = of_one.iter().map(|&w| i32::from(w)).sum();
                    bias[n] - scale[n] * (i32::from(input.zero) * sum) as f32
                };
                let bias = (0..outputs).map(fold).collect();
                let weights = PackedConv::new(outputs, inputs, values);
                Kind::Int8 { weights, scale, bias, input, out }
            }
        };
        Ok(Self { name: name.to_owned(), inputs, outputs, stride, kind })
    }

    /// One map of `side` points each way. Returns the points each way of what comes out.
    pub(super) fn run(
        &mut self,
        kernels: &Kernels,
        input: &Between,
        side: usize,
        result: &mut Between,
    ) -> usize {
        let to = side / self.stride;
        match &mut self.kind {
            Kind::Float { weights, bias, seen, out } => {
                seen.look(&input.floats);
                result.floats.clear();
                for n in 0..self.outputs {
                    for place in 0..to * to {
                        let (row, column) = (place / to * self.stride, place % to * self.stride);
                        let mut sum = bias[n];
                        for channel in 0..self.inputs {
                            for tap in 0..9 {
                                let (y, x) = (row + tap / 3, column + tap % 3);
                                if (1..=side).contains(&y) && (1..=side).contains(&x) {
                                    let value = input.floats[(channel * side + y - 1) * side + x - 1];
                                    sum += value * weights[(n * self.inputs + channel) * 9 + tap];
                                }
                            }
                        }
                        result.floats.push(leaky(sum, LEAK as f32));
                    }
                }
                out.look(&result.floats);
            }
            Kind::Int8 { weights, scale, bias, input: codes, out } => {
                let shape =
                    ConvShape { channels: self.inputs, height: side, width: side, stride: self.stride };
                let affine = Affine { scale, bias, leak: LEAK as f32 };
                result.codes.resize(self.outputs * to * to, 0);
                let out = out.quant();
                kernels.conv3x3(&input.codes, shape, weights, codes.zero, affine, out, &mut result.codes);
            }
        }
        to
    }

    /// What reached it, what left it.
    pub(super) fn seen(&self) -> Option<(Seen, Seen, &[f32])> {
        match &self.kind {
            Kind::Float { seen, out, weights, .. } => Some((*seen, *out, weights)),
            Kind::Int8 { .. } => None,
        }
    }

    /// Whether values are f32.
    pub(super) fn is_float(&self) -> bool {
        matches!(self.kind, Kind::Float { .. })
    }

    /// Channels that come out.
    pub(super) fn outputs(&self) -> usize {
        self.outputs
    }
}

/// Largest of each `size x size` cells, appended to `result`.
pub(super) fn max_pool(
    kernels: &Kernels,
    float: bool,
    input: &Between,
    (channels, side, size): (usize, usize, usize),
    result: &mut Between,
) {
    let to = side / size;
    if float {
        for channel in input.floats.chunks_exact(side * side).take(channels) {
            for place in 0..to * to {
                let (row, column) = (place / to * size, place % to * size);
                let cells = (0..size * size).map(|n| channel[(row + n / size) * side + column + n % size]);
                result.floats.push(cells.fold(f32::NEG_INFINITY, f32::max));
            }
        }
    } else {
        let from = result.codes.len();
        result.codes.resize(from + channels * to * to, 0);
        kernels.max_pool(&input.codes, channels, side, side, size, &mut result.codes[from..]);
    }
}
