//! The network as Burn modules: f32, for training and as the reference of the int8 execution.
//!
//! Shapes in the docs: B samples, N frames of all of them one after the other, F frames of the longest, G groups of stacked
//! frames of the longest, T tags of the sample with most, W a width.

mod batch;
mod encoder;
mod fusion;
mod temporal;

use burn::module::Module;
use burn::nn::{LayerNorm, LayerNormConfig, Linear, LinearConfig};
use burn::tensor::activation::relu;
use burn::tensor::{Device, Tensor};

pub use batch::{Batch, BatchError, NameVectors};
pub(crate) use batch::{FrameTensors, limit_turns, token_of_tag, turns_of_read};
pub use fusion::Output;

use crate::config::{ConfigError, EPSILON, LEAK, NetworkConfig};
use encoder::RadarEncoder;
use fusion::Heads;
use temporal::{TemporalBlock, masked_mean};

/// The fusion network.
#[derive(Module, Debug)]
pub struct Network {
    radar: Option<RadarBranch>,
    tags: Option<TagBranch>,
    heads: Heads,
}

/// Features of the radar over time.
#[derive(Module, Debug)]
pub(crate) struct RadarBranch {
    encoder: RadarEncoder,
    stack: Option<Linear>,
    temporal: TemporalBlock,
}

/// Features of each tag over time.
#[derive(Module, Debug)]
pub(crate) struct TagBranch {
    encoder: Linear,
    norm: LayerNorm,
    temporal: TemporalBlock,
    names: Linear,
    join: Linear,
}

/// What a branch hands to the fusion.
#[derive(Debug, Clone)]
pub(crate) struct RadarFeatures {
    /// `[B, W]`.
    pub(crate) pooled: Tensor<2>,
    /// `[B, G, W]` and 1 or 0 for each, `[B, G]`.
    pub(crate) tokens: Tensor<3>,
    pub(crate) valid: Tensor<2>,
}

/// A dense layer on the last of three dimensions.
pub(crate) fn dense(layer: &Linear, input: Tensor<3>) -> Tensor<3> {
    let [a, b, width] = input.dims();
    let out = layer.forward(input.reshape([a * b, width]));
    let [_, width] = out.dims();
    out.reshape([a, b, width])
}

/// LeakyReLU as a sum, whose gradient Burn has faster than that of its own, which is one of masks.
pub(crate) fn leaky<const D: usize>(values: Tensor<D>) -> Tensor<D> {
    relu(values.clone()).mul_scalar(1.0 - LEAK) + values.mul_scalar(LEAK)
}

pub(crate) fn linear(from: usize, to: usize, device: &Device) -> Linear {
    LinearConfig::new(from, to).init(device)
}

pub(crate) fn norm(width: usize, device: &Device) -> LayerNorm {
    LayerNormConfig::new(width).with_epsilon(EPSILON).init(device)
}

impl Network {
    /// A network with random weights, drawn from the device's generator.
    ///
    /// # Errors
    /// If there is no network of that shape.
    pub fn new(config: &NetworkConfig, device: &Device) -> Result<Self, ConfigError> {
        config.check()?;
        let radar = config.fusion.has_radar().then(|| RadarBranch {
            encoder: RadarEncoder::new(config, device),
            stack: (config.radar.stack > 1)
                .then(|| linear(config.radar.stack * config.radar.width, config.radar.width, device)),
            temporal: TemporalBlock::new(&config.radar, config.dropout, device),
        });
        let width = config.tags.width;
        let tags = config.fusion.has_tags().then(|| TagBranch {
            encoder: linear(config.read_features(), width, device),
            norm: norm(width, device),
            temporal: TemporalBlock::new(&config.tags, config.dropout, device),
            names: linear(config.name_dimensions, width, device),
            join: linear(2 * width + config.turn_features(), width, device),
        });
        Ok(Self { radar, tags, heads: Heads::new(config, device) })
    }

    /// Scores of all samples.
    pub fn forward(&self, batch: &Batch) -> Output {
        self.decide(self.embed(&batch.frames), batch)
    }

    /// Scores of all samples, and the radar's features behind them, `[B, W]`.
    #[cfg(feature = "train")]
    pub(crate) fn forward_with_radar(&self, batch: &Batch) -> (Output, Option<Tensor<2>>) {
        let radar = self.radar_features(self.embed(&batch.frames), batch);
        let pooled = radar.as_ref().map(|radar| radar.pooled.clone());
        (self.weigh(radar, batch), pooled)
    }

    /// Radar tokens of frames, `[N, W]`, each by itself.
    pub(crate) fn embed(&self, frames: &FrameTensors) -> Option<Tensor<2>> {
        self.radar.as_ref().map(|radar| radar.encoder.forward(frames))
    }

    /// Scores from radar tokens and all the rest.
    pub(crate) fn decide(&self, embedded: Option<Tensor<2>>, batch: &Batch) -> Output {
        self.weigh(self.radar_features(embedded, batch), batch)
    }

    fn radar_features(&self, embedded: Option<Tensor<2>>, batch: &Batch) -> Option<RadarFeatures> {
        self.radar.as_ref().zip(embedded).map(|(radar, tokens)| radar.forward(tokens, batch))
    }

    fn weigh(&self, radar: Option<RadarFeatures>, batch: &Batch) -> Output {
        let tags = self.tags.as_ref().map(|tags| tags.forward(batch));
        self.heads.forward(radar, tags, batch)
    }
}

impl RadarBranch {
    fn forward(&self, embedded: Tensor<2>, batch: &Batch) -> RadarFeatures {
        let [_, width] = embedded.dims();
        // Behind the frames one of zeros, for places past a sample's end.
        let zero = Tensor::zeros([1, width], &embedded.device());
        let padded = Tensor::cat(vec![embedded, zero], 0).select(0, batch.frame_index.clone());
        let [samples, groups] = batch.radar_valid.dims();
        let tokens = match &self.stack {
            Some(stack) => {
                let stacked = padded.reshape([samples * groups, batch.radar_stack * width]);
                stack.forward(stacked).reshape([samples, groups, width])
            }
            None => padded.reshape([samples, groups, width]),
        };
        let valid = batch.radar_valid.clone();
        let tokens = self.temporal.forward(tokens, valid.clone());
        RadarFeatures { pooled: masked_mean(tokens.clone(), valid.clone()), tokens, valid }
    }
}

impl TagBranch {
    /// Each tag's features, `[B, T, W]`.
    fn forward(&self, batch: &Batch) -> Tensor<3> {
        let [samples, tags] = batch.tag_valid.dims();
        let tokens = leaky(self.norm.forward(dense(&self.encoder, batch.reads.clone())));
        let tokens = self.temporal.forward(tokens, batch.read_valid.clone());
        let moved = masked_mean(tokens, batch.read_valid.clone());
        let [_, width] = moved.dims();
        let named = dense(&self.names, batch.names.clone());
        // How far a tag has moved in all would drown in the mean of its tokens.
        let [_, turns] = batch.turns.dims();
        let turned = batch.turns.clone().reshape([samples, tags, turns]);
        let all = Tensor::cat(vec![moved.reshape([samples, tags, width]), named, turned], 2);
        leaky(dense(&self.join, all))
    }
}
