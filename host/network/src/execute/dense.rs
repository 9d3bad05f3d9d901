//! A dense layer, in f32 with an eye on its inputs, or in int8.

use std::sync::{Mutex, PoisonError};

use rfhoi_int8::{Affine, Kernels, Out, Packed};

use super::{Between, Codes, Seen, leaky};
use crate::config::EPSILON;
use crate::model::{Model, ModelError, Precision};

/// Weights of layer normalisation.
#[derive(Debug, Clone)]
pub(super) struct Norm {
    gamma: Vec<f32>,
    beta: Vec<f32>,
}

impl Norm {
    pub(super) fn load(model: &Model, name: &str) -> Result<Self, ModelError> {
        let part = |part| model.f32s(&format!("{name}.{part}")).map(<[f32]>::to_vec);
        Ok(Self { gamma: part("gamma")?, beta: part("beta")? })
    }

    /// Normalises rows.
    pub(super) fn run(&self, kernels: &Kernels, input: &[f32], out: Out<'_>) {
        kernels.layer_norm(input, self.gamma.len(), &self.gamma, &self.beta, EPSILON as f32, out);
    }
}

/// A dense layer.
#[derive(Debug, Clone)]
pub(super) struct Dense {
    pub(super) name: String,
    pub(super) inputs: usize,
    pub(super) outputs: usize,
    leak: f32,
    kind: Kind,
}

#[derive(Debug, Clone)]
enum Kind {
    Float { weights: Vec<f32>, bias: Vec<f32>, seen: Watch },
    Int8 { weights: Packed, scale: Vec<f32>, bias: Vec<f32>, input: Codes },
}

/// What reached a layer so far; threads share the layer.
#[derive(Debug, Default)]
struct Watch(Mutex<Seen>);

impl Watch {
    fn look(&self, values: &[f32]) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).look(values);
    }

    fn get(&self) -> Seen {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Clone for Watch {
    fn clone(&self) -> Self {
        Self(Mutex::new(self.get()))
    }
}

/// What goes in.
pub(super) enum Input<'a> {
    /// Values.
    F32(&'a [f32]),
    /// Values that are normalised first.
    Normed(&'a [f32], &'a Norm),
    /// What a layer before has left for this one.
    Between(&'a Between),
}

/// Where it goes.
pub(super) enum Sink<'a> {
    /// Values.
    F32(&'a mut Vec<f32>),
    /// Added to what is there.
    Add(&'a mut [f32]),
    /// For the next layer.
    Between(&'a Dense, &'a mut Between),
}

impl Dense {
    /// Layer `name` of a model, with LeakyReLU behind it if `leak` is not 1. Of its inputs, those in `part`.
    pub(super) fn load(
        model: &Model,
        name: &str,
        leak: f32,
        part: Option<core::ops::Range<usize>>,
    ) -> Result<Self, ModelError> {
        let weight = format!("{name}.weight");
        let shape = model.arrays.get(&weight).map(|array| array.shape.clone());
        let Some([a, b]) = shape.as_deref() else {
            return Err(ModelError::Weights(format!("{weight} is no matrix")));
        };
        let bias = model.f32s(&format!("{name}.bias"))?.to_vec();
        let (inputs, outputs, kind) = match model.description.precision {
            Precision::F32 => {
                // As Burn keeps them, [in][out].
                let (all, outputs) = (*a, *b);
                let part = part.unwrap_or(0..all);
                let values = model.f32s(&weight)?;
                let mut weights = Vec::with_capacity(part.len() * outputs);
                for out in 0..outputs {
                    weights.extend(part.clone().map(|input| values[input * outputs + out]));
                }
                (part.len(), outputs, Kind::Float { weights, bias, seen: Watch::default() })
            }
            Precision::Int8 => {
                let (outputs, inputs) = (*a, *b);
                let input = Codes::load(model, &format!("{name}.input"))?;
                let packed = Packed::new(inputs, outputs, model.i8s(&weight)?).for_inputs_to(input.top);
                let scales = model.f32s(&format!("{name}.scale"))?;
                let scale: Vec<f32> = scales.iter().map(|scale| scale * input.scale).collect();
                // What the zero point adds to each sum is taken off beforehand.
                let fold = |n: usize| bias[n] - scale[n] * (i32::from(input.zero) * packed.sum(n)) as f32;
                let bias = (0..outputs).map(fold).collect();
                (inputs, outputs, Kind::Int8 { weights: packed, scale, bias, input })
            }
        };
        Ok(Self { name: name.to_owned(), inputs, outputs, leak, kind })
    }

    /// Runs on all rows. `scratch` is for codes; `shift` is added to the bias of a single row.
    pub(super) fn run(
        &self,
        kernels: &Kernels,
        input: Input<'_>,
        shift: Option<&[f32]>,
        scratch: &mut Between,
        sink: Sink<'_>,
    ) {
        match &self.kind {
            Kind::Float { weights, bias, seen } => {
                let values = match input {
                    Input::F32(values) => values,
                    Input::Between(between) => &between.floats,
                    Input::Normed(values, norm) => {
                        scratch.floats.resize(values.len(), 0.0);
                        norm.run(kernels, values, Out::F32(&mut scratch.floats));
                        &scratch.floats
                    }
                };
                seen.look(values);
                let leak = self.leak;
                let outputs = values.chunks_exact(self.inputs).flat_map(|row| {
                    weights.chunks_exact(self.inputs).enumerate().map(move |(n, weights)| {
                        let sum: f32 = row.iter().zip(weights).map(|(x, w)| x * w).sum();
                        leaky(sum + bias[n] + shift.map_or(0.0, |shift| shift[n]), leak)
                    })
                });
                match sink {
                    Sink::F32(out) => {
                        out.clear();
                        out.extend(outputs);
                    }
                    Sink::Add(out) => out.iter_mut().zip(outputs).for_each(|(out, value)| *out += value),
                    Sink::Between(_, between) => {
                        let outputs: Vec<f32> = outputs.collect();
                        between.floats = outputs;
                    }
                }
            }
            Kind::Int8 { weights, scale, bias, input: codes } => {
                let Between { codes: scratch, floats: shifted } = scratch;
                let given: &[u8] = match input {
                    Input::F32(values) => {
                        scratch.resize(values.len(), 0);
                        kernels.quantise(values, codes.quant(), scratch);
                        scratch
                    }
                    Input::Normed(values, norm) => {
                        scratch.resize(values.len(), 0);
                        norm.run(kernels, values, Out::U8(scratch, codes.quant()));
                        scratch
                    }
                    Input::Between(between) => &between.codes,
                };
                let rows = given.len() / self.inputs;
                let bias: &[f32] = match shift {
                    Some(shift) => {
                        shifted.clear();
                        shifted.extend(bias.iter().zip(shift).map(|(bias, shift)| bias + shift));
                        shifted
                    }
                    None => bias,
                };
                let affine = Affine { scale, bias, leak: self.leak };
                match sink {
                    Sink::F32(out) => {
                        out.resize(rows * self.outputs, 0.0);
                        kernels.linear(given, rows, weights, affine, Out::F32(out));
                    }
                    Sink::Add(out) => kernels.linear(given, rows, weights, affine, Out::Add(out)),
                    Sink::Between(next, between) => {
                        between.codes.resize(rows * self.outputs, 0);
                        let quant = next.codes().quant();
                        kernels.linear(given, rows, weights, affine, Out::U8(&mut between.codes, quant));
                    }
                }
            }
        }
    }

    /// Codes that it takes.
    pub(super) fn codes(&self) -> Codes {
        match &self.kind {
            Kind::Int8 { input, .. } => *input,
            Kind::Float { seen, .. } => seen.get().codes(),
        }
    }

    /// Whether values are f32.
    pub(super) fn is_float(&self) -> bool {
        matches!(self.kind, Kind::Float { .. })
    }

    /// f32 weights `[out][in]`, if it has them.
    pub(super) fn floats(&self) -> Option<&[f32]> {
        match &self.kind {
            Kind::Float { weights, .. } => Some(weights),
            Kind::Int8 { .. } => None,
        }
    }
}
