//! Both branches together, and the two heads (section 3.3.4 of the paper).
//!
//! The target is one of the tags that are there, so each tag gets a score from its own features and the radar's, and the scores
//! of a sample's tags are weighed against each other. The action sees the radar's features, the tags' weighed by these
//! scores, and their mean.

use burn::module::Module;
use burn::nn::Linear;
use burn::tensor::activation;
use burn::tensor::{Device, Tensor};

use super::temporal::attend;
use super::{Batch, RadarFeatures, dense, leaky, linear};
use crate::config::{Fusion, NetworkConfig};
use crate::probability::softmax;
use crate::sample::Answer;

/// Score of a tag that is not there.
const ABSENT: f32 = -1e9;

/// Scores before the softmax.
#[derive(Debug, Clone)]
pub struct Output {
    /// `[B, actions]`.
    pub actions: Tensor<2>,
    /// `[B, T]`, far below all others for tags that are not there.
    pub targets: Tensor<2>,
}

impl Output {
    /// Probabilities; tags that are not there have 0.
    pub fn answers(&self, temperature: f32) -> Vec<Answer> {
        let [samples, tags] = self.targets.dims();
        let [_, classes] = self.actions.dims();
        let values = |tensor: &Tensor<2>| -> Vec<f32> { tensor.to_data().iter::<f32>().collect() };
        let (actions, targets) = (values(&self.actions), values(&self.targets));
        let answer = |sample: usize| Answer {
            actions: softmax(&actions[sample * classes..(sample + 1) * classes], temperature),
            targets: softmax(&targets[sample * tags..(sample + 1) * tags], temperature),
        };
        (0..samples).map(answer).collect()
    }
}

#[derive(Module, Debug)]
pub(super) struct Heads {
    meet: Meet,
    action: Head,
    target: Head,
    #[module(skip)]
    fusion: Fusion,
    #[module(skip)]
    radar_width: usize,
}

#[derive(Module, Debug)]
pub(super) struct Head {
    first: Linear,
    second: Linear,
}

/// What happens between the branches before the heads.
#[derive(Module, Debug)]
#[allow(clippy::large_enum_variant, reason = "one of each network")]
pub(super) enum Meet {
    Plain(Plain),
    Film(Film),
    Attention(Cross),
}

/// Nothing.
#[derive(Module, Debug)]
pub(super) struct Plain {}

/// Scale and shift of the tags' features by the radar's.
#[derive(Module, Debug)]
pub(super) struct Film {
    scale: Linear,
    shift: Linear,
}

/// Attention both ways: each tag over the radar's tokens, the radar over the tags.
#[derive(Module, Debug)]
pub(super) struct Cross {
    tag_query: Linear,
    token_key: Linear,
    token_value: Linear,
    radar_query: Linear,
    tag_key: Linear,
    tag_value: Linear,
}

impl Head {
    fn new(from: usize, inner: usize, to: usize, device: &Device) -> Self {
        Self { first: linear(from, inner, device), second: linear(inner, to, device) }
    }
}

impl Heads {
    pub(super) fn new(config: &NetworkConfig, device: &Device) -> Self {
        let (radar, tags, fusion) = (config.radar.width, config.tags.width, config.fusion);
        let meet = match fusion {
            Fusion::Film => {
                Meet::Film(Film { scale: linear(radar, tags, device), shift: linear(radar, tags, device) })
            }
            Fusion::Attention => Meet::Attention(Cross {
                tag_query: linear(tags, tags, device),
                token_key: linear(radar, tags, device),
                token_value: linear(radar, tags, device),
                radar_query: linear(radar, radar, device),
                tag_key: linear(tags, radar, device),
                tag_value: linear(tags, radar, device),
            }),
            _ => Meet::Plain(Plain {}),
        };
        let (action, target) = fusion.widths(radar, tags);
        let inner = if fusion.has_radar() { radar } else { tags };
        Self {
            meet,
            action: Head::new(action, inner, config.actions, device),
            target: Head::new(target, tags, 1, device),
            fusion,
            radar_width: radar,
        }
    }

    pub(super) fn forward(
        &self,
        radar: Option<RadarFeatures>,
        tags: Option<Tensor<3>>,
        batch: &Batch,
    ) -> Output {
        let [samples, count] = batch.tag_valid.dims();
        let absent = batch.tag_valid.clone().sub_scalar(1.0).mul_scalar(-ABSENT);
        let (radar, tags) = self.meet(radar, tags, batch);
        let repeated = |radar: &Tensor<2>| {
            radar.clone().unsqueeze_dim::<3>(1).expand([samples, count, self.radar_width])
        };
        let evidence = match (&radar, &tags) {
            (Some(radar), Some(tags)) if self.fusion != Fusion::None => {
                Tensor::cat(vec![tags.clone(), repeated(radar)], 2)
            }
            (_, Some(tags)) => tags.clone(),
            (Some(radar), None) => repeated(radar),
            (None, None) => unreachable!("every fusion has a branch"),
        };
        let inner = leaky(dense(&self.target.first, evidence));
        let targets = dense(&self.target.second, inner).squeeze_dim::<2>(2) + absent;
        let mut evidence: Vec<Tensor<2>> = radar.into_iter().collect();
        if let Some(tags) = tags.filter(|_| self.fusion != Fusion::None) {
            let weights = activation::softmax(targets.clone(), 1) * batch.tag_valid.clone();
            let weighed: Tensor<2> = (tags.clone() * weights.unsqueeze_dim::<3>(2)).sum_dim(1).squeeze_dim(1);
            evidence.push(weighed);
            evidence.push(super::masked_mean(tags, batch.tag_valid.clone()));
        }
        let inner = leaky(self.action.first.forward(Tensor::cat(evidence, 1)));
        Output { actions: self.action.second.forward(inner), targets }
    }

    fn meet(
        &self,
        radar: Option<RadarFeatures>,
        tags: Option<Tensor<3>>,
        batch: &Batch,
    ) -> (Option<Tensor<2>>, Option<Tensor<3>>) {
        match (&self.meet, radar, tags) {
            (Meet::Film(film), Some(radar), Some(tags)) => {
                let pooled = radar.pooled;
                let scale = film.scale.forward(pooled.clone()).unsqueeze_dim::<3>(1);
                let shift = film.shift.forward(pooled.clone()).unsqueeze_dim::<3>(1);
                (Some(pooled), Some(tags.clone() + tags * scale + shift))
            }
            (Meet::Attention(cross), Some(radar), Some(tags)) => {
                let (radar, tags) = cross.forward(radar, tags, batch.tag_valid.clone());
                (Some(radar), Some(tags))
            }
            (_, radar, tags) => (radar.map(|radar| radar.pooled), tags),
        }
    }
}

impl Cross {
    fn forward(&self, radar: RadarFeatures, tags: Tensor<3>, tag_valid: Tensor<2>) -> (Tensor<2>, Tensor<3>) {
        let hidden =
            |valid: Tensor<2>| valid.sub_scalar(1.0).mul_scalar(-ABSENT).unsqueeze_dims::<4>(&[1, 2]);
        let one = |x: Tensor<3>| x.unsqueeze_dim::<4>(1);
        let to_radar = attend(
            one(dense(&self.tag_query, tags.clone())),
            one(dense(&self.token_key, radar.tokens.clone())),
            one(dense(&self.token_value, radar.tokens)),
            hidden(radar.valid),
        );
        let query = self.radar_query.forward(radar.pooled.clone()).unsqueeze_dim::<3>(1);
        let to_tags = attend(
            one(query),
            one(dense(&self.tag_key, tags.clone())),
            one(dense(&self.tag_value, tags.clone())),
            hidden(tag_valid),
        );
        let to_tags: Tensor<3> = to_tags.squeeze_dim(1);
        (radar.pooled + to_tags.squeeze_dim::<2>(1), tags + to_radar.squeeze_dim::<3>(1))
    }
}

impl Fusion {
    /// Widths of what the action's and the target's head see, of branches so wide.
    pub(crate) fn widths(self, radar: usize, tags: usize) -> (usize, usize) {
        match self {
            Self::Concat | Self::Film | Self::Attention => (radar + 2 * tags, radar + tags),
            Self::None => (radar, tags),
            Self::Rfid => (2 * tags, tags),
            Self::Radar => (radar, radar),
        }
    }
}
