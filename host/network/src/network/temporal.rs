//! Features over time (section 3.3.3 of the paper): what a token becomes when it has seen the others.

use burn::module::Module;
use burn::nn::{Dropout, DropoutConfig, LayerNorm, Linear};
use burn::tensor::activation::softmax;
use burn::tensor::{Device, Tensor};

use super::{dense, leaky, linear, norm};
use crate::config::{Branch, Temporal};
use crate::positions::positions;

/// Score of what must not be seen.
const MASKED: f32 = -1e9;

#[derive(Module, Debug)]
pub(super) enum TemporalBlock {
    Transformer(Transformer),
    Convolution(Convolutions),
}

impl TemporalBlock {
    pub(super) fn new(branch: &Branch, dropout: f64, device: &Device) -> Self {
        match branch.temporal {
            Temporal::Transformer => Self::Transformer(Transformer::new(branch, dropout, device)),
            Temporal::Convolution => Self::Convolution(Convolutions::new(branch, dropout, device)),
        }
    }

    /// Tokens `[B, L, W]`, 1 or 0 for each, `[B, L]`.
    pub(super) fn forward(&self, tokens: Tensor<3>, valid: Tensor<2>) -> Tensor<3> {
        match self {
            Self::Transformer(block) => block.forward(tokens, valid),
            Self::Convolution(block) => block.forward(tokens, valid),
        }
    }
}

/// Mean over the tokens that are there, `[B, W]`; zeros where none is.
pub(super) fn masked_mean(tokens: Tensor<3>, valid: Tensor<2>) -> Tensor<2> {
    let count = valid.clone().sum_dim(1).clamp_min(1.0);
    let sum: Tensor<2> = (tokens * valid.unsqueeze_dim::<3>(2)).sum_dim(1).squeeze_dim(1);
    sum / count
}

#[derive(Module, Debug)]
pub(super) struct Transformer {
    layers: Vec<Layer>,
    norm: LayerNorm,
}

/// Normalised before attention and before the dense layers, which trains without a warm-up.
#[derive(Module, Debug)]
pub(super) struct Layer {
    attention_norm: LayerNorm,
    attention: Attention,
    dense_norm: LayerNorm,
    wide: Linear,
    narrow: Linear,
    dropout: Dropout,
}

#[derive(Module, Debug)]
pub(super) struct Attention {
    /// Queries, keys and values side by side.
    qkv: Linear,
    out: Linear,
    #[module(skip)]
    heads: usize,
}

impl Transformer {
    fn new(branch: &Branch, dropout: f64, device: &Device) -> Self {
        let width = branch.width;
        let layer = |_| Layer {
            attention_norm: norm(width, device),
            attention: Attention {
                qkv: linear(width, 3 * width, device),
                out: linear(width, width, device),
                heads: branch.heads,
            },
            dense_norm: norm(width, device),
            wide: linear(width, branch.feed_forward, device),
            narrow: linear(branch.feed_forward, width, device),
            dropout: DropoutConfig::new(dropout).init(),
        };
        Self { layers: (0..branch.layers).map(layer).collect(), norm: norm(width, device) }
    }

    fn forward(&self, tokens: Tensor<3>, valid: Tensor<2>) -> Tensor<3> {
        let [_, length, width] = tokens.dims();
        let at = positions(length, width);
        let at = Tensor::<1>::from_floats(&at[..length * width], &tokens.device());
        // What is not there scores too low to be seen: [B, 1, 1, L].
        let hidden = valid.sub_scalar(1.0).mul_scalar(-MASKED).unsqueeze_dims::<4>(&[1, 2]);
        let mut tokens = tokens + at.reshape([1, length, width]);
        for layer in &self.layers {
            tokens = layer.forward(tokens, hidden.clone());
        }
        self.norm.forward(tokens)
    }
}

impl Layer {
    fn forward(&self, tokens: Tensor<3>, hidden: Tensor<4>) -> Tensor<3> {
        let seen = self.attention.forward(self.attention_norm.forward(tokens.clone()), hidden);
        let tokens = tokens + self.dropout.forward(seen);
        let inner = leaky(dense(&self.wide, self.dense_norm.forward(tokens.clone())));
        tokens + self.dropout.forward(dense(&self.narrow, inner))
    }
}

impl Attention {
    fn forward(&self, tokens: Tensor<3>, hidden: Tensor<4>) -> Tensor<3> {
        let [samples, length, width] = tokens.dims();
        let size = width / self.heads;
        let qkv = dense(&self.qkv, tokens);
        let part = |n: usize| {
            let part = qkv.clone().narrow(2, n * width, width);
            part.reshape([samples, length, self.heads, size]).swap_dims(1, 2)
        };
        let (q, k, v) = (part(0), part(1), part(2));
        let seen = attend(q, k, v, hidden);
        dense(&self.out, seen.swap_dims(1, 2).reshape([samples, length, width]))
    }
}

/// `softmax(q k^T / sqrt(d) + hidden) v`, each `[B, heads, L, d]`.
pub(super) fn attend(q: Tensor<4>, k: Tensor<4>, v: Tensor<4>, hidden: Tensor<4>) -> Tensor<4> {
    let [_, _, _, size] = q.dims();
    let scores = q.matmul(k.swap_dims(2, 3)).div_scalar((size as f64).sqrt());
    softmax(scores + hidden, 3).matmul(v)
}

/// Residual convolutions of three tokens.
#[derive(Module, Debug)]
pub(super) struct Convolutions {
    layers: Vec<ConvolutionLayer>,
    norm: LayerNorm,
}

#[derive(Module, Debug)]
pub(super) struct ConvolutionLayer {
    norm: LayerNorm,
    /// Over the token before, the token, and the one after.
    three: Linear,
    narrow: Linear,
    dropout: Dropout,
}

impl Convolutions {
    fn new(branch: &Branch, dropout: f64, device: &Device) -> Self {
        let layer = |_| ConvolutionLayer {
            norm: norm(branch.width, device),
            three: linear(3 * branch.width, branch.feed_forward, device),
            narrow: linear(branch.feed_forward, branch.width, device),
            dropout: DropoutConfig::new(dropout).init(),
        };
        Self { layers: (0..branch.layers).map(layer).collect(), norm: norm(branch.width, device) }
    }

    fn forward(&self, mut tokens: Tensor<3>, valid: Tensor<2>) -> Tensor<3> {
        let [samples, length, width] = tokens.dims();
        let there = valid.unsqueeze_dim::<3>(2);
        let edge = Tensor::zeros([samples, 1, width], &tokens.device());
        for layer in &self.layers {
            let here = layer.norm.forward(tokens.clone()) * there.clone();
            let wide = Tensor::cat(vec![edge.clone(), here.clone(), edge.clone()], 1);
            let (before, after) = (wide.clone().narrow(1, 0, length), wide.narrow(1, 2, length));
            let inner = dense(&layer.three, Tensor::cat(vec![before, here, after], 2));
            tokens = tokens + layer.dropout.forward(dense(&layer.narrow, leaky(inner)));
        }
        self.norm.forward(tokens)
    }
}
