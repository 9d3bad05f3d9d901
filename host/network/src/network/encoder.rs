//! From the maps of a frame to its token (section 3.3.2 of the paper).

use burn::module::{Module, Param};
use burn::nn::conv::{Conv2d, Conv2dConfig};
use burn::nn::pool::{MaxPool2d, MaxPool2dConfig};
use burn::nn::{LayerNorm, Linear, PaddingConfig2d};
use burn::tensor::{Device, Distribution, Tensor};

use super::batch::FrameTensors;
use super::{leaky, linear, norm};
use crate::config::{Encoder, NetworkConfig};
use crate::sample::SCALARS;

/// Each map by itself, then two dense layers over all of them and the frame's scalars, each normalised: without it a token is
/// small beside its position and hardly learns where the person is.
#[derive(Module, Debug)]
pub(super) struct RadarEncoder {
    maps: Vec<MapEncoder>,
    beams: Option<Beams>,
    first: Linear,
    first_norm: LayerNorm,
    second: Linear,
    second_norm: LayerNorm,
}

#[derive(Module, Debug)]
#[allow(clippy::large_enum_variant, reason = "three of each network")]
pub(super) enum MapEncoder {
    Convolutions(Convolutions),
    Patches(Patches),
}

#[derive(Module, Debug)]
pub(super) struct Convolutions {
    first: Conv2d,
    second: Conv2d,
    pool: Option<MaxPool2d>,
}

#[derive(Module, Debug)]
pub(super) struct Patches {
    dense: Linear,
    #[module(skip)]
    size: usize,
}

impl RadarEncoder {
    pub(super) fn new(config: &NetworkConfig, device: &Device) -> Self {
        let maps: Vec<_> = config.encoded().map(|_| MapEncoder::new(config.encoder, device)).collect();
        let beams = config.beams.filter(|_| config.maps[config.maps.len() - 1]);
        let features = maps.len() * config.map_features() + beams.map_or(0, |beams| beams.beams) + SCALARS;
        let width = config.radar.width;
        Self {
            maps,
            beams: beams.map(|beams| Beams::new(beams, device)),
            first: linear(features, width, device),
            first_norm: norm(width, device),
            second: linear(width, width, device),
            second_norm: norm(width, device),
        }
    }

    /// `[N, W]`.
    pub(super) fn forward(&self, frames: &FrameTensors) -> Tensor<2> {
        let encoded = self.maps.iter().zip(&frames.maps).map(|(encoder, map)| encoder.forward(map.clone()));
        let mut features: Vec<Tensor<2>> = encoded.collect();
        if let (Some(beams), Some(covariance)) = (&self.beams, &frames.covariance) {
            features.push(beams.forward(covariance.clone()));
        }
        features.push(frames.scalars.clone());
        let joined = leaky(self.first_norm.forward(self.first.forward(Tensor::cat(features, 1))));
        self.second_norm.forward(self.second.forward(joined))
    }
}

impl MapEncoder {
    fn new(encoder: Encoder, device: &Device) -> Self {
        match encoder {
            Encoder::Convolutions { channels, strides, pool } => {
                let convolution = |from, to, stride| {
                    Conv2dConfig::new([from, to], [3, 3])
                        .with_stride([stride, stride])
                        .with_padding(PaddingConfig2d::Explicit(1, 1, 1, 1))
                        .init(device)
                };
                let pool =
                    (pool > 1).then(|| MaxPool2dConfig::new([pool, pool]).with_strides([pool, pool]).init());
                Self::Convolutions(Convolutions {
                    first: convolution(1, channels[0], strides[0]),
                    second: convolution(channels[0], channels[1], strides[1]),
                    pool,
                })
            }
            Encoder::Patches { size, channels } => {
                Self::Patches(Patches { dense: linear(size * size, channels, device), size })
            }
        }
    }

    /// `[N, 1, P, P]` to `[N, features]`.
    fn forward(&self, map: Tensor<4>) -> Tensor<2> {
        match self {
            Self::Convolutions(convolutions) => convolutions.forward(map),
            Self::Patches(patches) => patches.forward(map),
        }
    }
}

impl Convolutions {
    fn forward(&self, map: Tensor<4>) -> Tensor<2> {
        let inner = leaky(self.first.forward(map));
        let inner = leaky(self.second.forward(inner));
        let inner = match &self.pool {
            Some(pool) => pool.forward(inner),
            None => inner,
        };
        inner.flatten(1, 3)
    }
}

impl Patches {
    /// Features are ordered by square, row by row, then by channel.
    fn forward(&self, map: Tensor<4>) -> Tensor<2> {
        let [frames, _, points, _] = map.dims();
        let (size, side) = (self.size, points / self.size);
        let squares = map.reshape([frames * side, size, side, size]).swap_dims(1, 2);
        let values = leaky(self.dense.forward(squares.reshape([frames * side * side, size * size])));
        let [_, channels] = values.dims();
        values.reshape([frames, side * side * channels])
    }
}

/// Power of learnt beams, as decibels over the mean of the elements: log(1 + w^H R w), with R the covariance over the mean of
/// its diagonal.
#[derive(Module, Debug)]
pub(super) struct Beams {
    /// Real and imaginary parts of the beams' weights, `[beams, N]`.
    re: Param<Tensor<2>>,
    im: Param<Tensor<2>>,
}

impl Beams {
    fn new(crate::config::Beams { antennas, beams }: crate::config::Beams, device: &Device) -> Self {
        let spread = Distribution::Normal(0.0, (0.5 / antennas as f64).sqrt());
        let draw = || Param::from_tensor(Tensor::random([beams, antennas], spread, device));
        Self { re: draw(), im: draw() }
    }

    /// `[N, antennas^2]` to `[N, beams]`.
    fn forward(&self, covariance: Tensor<2>) -> Tensor<2> {
        let (re, im) = (self.re.val(), self.im.val());
        let [_, antennas] = re.dims();
        let column = |of: &Tensor<2>, n: usize| of.clone().narrow(1, n, 1);
        // Rows of the triangle as the wire has them: diagonal, then re and im of each pair.
        let mut weights: Vec<Tensor<2>> = Vec::with_capacity(antennas * antennas);
        for m in 0..antennas {
            weights.push(column(&re, m).powi_scalar(2) + column(&im, m).powi_scalar(2));
        }
        for m in 0..antennas {
            for n in m + 1..antennas {
                let (mr, mi) = (column(&re, m), column(&im, m));
                let (nr, ni) = (column(&re, n), column(&im, n));
                weights.push((mr.clone() * nr.clone() + mi.clone() * ni.clone()).mul_scalar(2.0));
                weights.push((mi * nr - mr * ni).mul_scalar(2.0));
            }
        }
        let weights = Tensor::cat(weights, 1);
        covariance.matmul(weights.transpose()).clamp_min(0.0).log1p()
    }
}
