//! Transformer layers over tokens.

use rfhoi_int8::{Kernels, Out};

use super::dense::{Dense, Input, Norm, Sink};
use super::{Between, Codes};
use crate::config::{Branch, LEAK, Temporal};
use crate::execute::ExecuteError;
use crate::model::Model;

/// The temporal block of a branch.
#[derive(Debug, Clone)]
pub(super) struct Transformer {
    layers: Vec<Layer>,
    norm: Norm,
    heads: usize,
    width: usize,
}

#[derive(Debug, Clone)]
struct Layer {
    attention_norm: Norm,
    qkv: Dense,
    out: Dense,
    dense_norm: Norm,
    wide: Dense,
    narrow: Dense,
}

/// Memory of a run. Each share of an answer has its own: what is as large as the time before need not be cleared.
#[derive(Debug, Clone, Default)]
pub(super) struct Work {
    scratch: Between,
    qkv: Vec<f32>,
    seen: Between,
    inner: Between,
    scores: Vec<f32>,
}

impl Transformer {
    pub(super) fn load(model: &Model, name: &str, branch: &Branch) -> Result<Self, ExecuteError> {
        if branch.temporal != Temporal::Transformer {
            return Err(ExecuteError::Unsupported("convolutions over time"));
        }
        let name = format!("{name}.temporal.Transformer");
        let layer = |n: usize| -> Result<Layer, ExecuteError> {
            let at = |part: &str| format!("{name}.layers.{n}.{part}");
            Ok(Layer {
                attention_norm: Norm::load(model, &at("attention_norm"))?,
                qkv: Dense::load(model, &at("attention.qkv"), 1.0, None)?,
                out: Dense::load(model, &at("attention.out"), 1.0, None)?,
                dense_norm: Norm::load(model, &at("dense_norm"))?,
                wide: Dense::load(model, &at("wide"), LEAK as f32, None)?,
                narrow: Dense::load(model, &at("narrow"), 1.0, None)?,
            })
        };
        Ok(Self {
            layers: (0..branch.layers).map(layer).collect::<Result<_, _>>()?,
            norm: Norm::load(model, &format!("{name}.norm"))?,
            heads: branch.heads,
            width: branch.width,
        })
    }

    /// Lets the tokens of each of several sequences of `length` see each other. Positions have been added.
    pub(super) fn run(&self, kernels: &Kernels, tokens: &mut [f32], length: usize, work: &mut Work) {
        let Self { layers, norm, heads, width } = self;
        let Work { scratch, qkv, seen, inner, scores } = work;
        let (width, heads) = (*width, *heads);
        for layer in layers {
            let normed = Input::Normed(tokens, &layer.attention_norm);
            layer.qkv.run(kernels, normed, None, scratch, Sink::F32(qkv));
            let float = layer.out.floats().is_some();
            let codes: Codes = layer.out.codes();
            if float {
                seen.floats.resize(tokens.len(), 0.0);
            } else {
                seen.codes.resize(tokens.len(), 0);
            }
            for (number, sequence) in qkv.chunks_exact(length * 3 * width).enumerate() {
                let place = number * length * width..(number + 1) * length * width;
                let out = match float {
                    true => Out::F32(&mut seen.floats[place]),
                    false => Out::U8(&mut seen.codes[place], codes.quant()),
                };
                kernels.attention(sequence, length, heads, scores, out);
            }
            layer.out.run(kernels, Input::Between(seen), None, scratch, Sink::Add(tokens));
            let normed = Input::Normed(tokens, &layer.dense_norm);
            layer.wide.run(kernels, normed, None, scratch, Sink::Between(&layer.narrow, inner));
            layer.narrow.run(kernels, Input::Between(inner), None, scratch, Sink::Add(tokens));
        }
        scratch.floats.resize(tokens.len(), 0.0);
        norm.run(kernels, tokens, Out::F32(&mut scratch.floats));
        tokens.copy_from_slice(&scratch.floats);
    }

    /// Multiplications of a token's dense layers.
    pub(super) fn multiplications(&self) -> usize {
        self.dense().map(|dense| dense.inputs * dense.outputs).sum()
    }

    /// All dense layers.
    pub(super) fn dense(&self) -> impl Iterator<Item = &Dense> {
        self.layers.iter().flat_map(|layer| [&layer.qkv, &layer.out, &layer.wide, &layer.narrow])
    }
}
