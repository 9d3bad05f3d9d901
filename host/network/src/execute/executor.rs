//! The executor.

use std::ops::Range;

use rfhoi_int8::{Kernels, Out};

use super::convolution::{Convolution, max_pool};
use super::dense::{Dense, Input, Norm, Sink};
use super::transformer::Transformer;
use super::{Between, ExecuteError, leaky};
use crate::config::{Encoder, Fusion, LEAK, NetworkConfig};
use crate::kept::Kept;
use crate::model::{Model, Precision};
use crate::network::token_of_tag;
use crate::positions::positions;
use crate::probability::softmax;
use crate::sample::{Answer, Frame, InputError, Runner};

/// Runs a model, int8 or, to learn its scales, f32.
#[derive(Debug, Clone)]
pub struct Executor {
    config: NetworkConfig,
    temperature: f32,
    kernels: Kernels,
    encoder: Option<RadarEncoder>,
    radar: Option<Transformer>,
    tags: Option<TagBranch>,
    action: Head,
    target: Head,
    kept: Kept,
    work: Memory,
}

#[derive(Debug, Clone)]
struct RadarEncoder {
    /// Place of each map that is encoded, and its layers.
    maps: Vec<(usize, MapEncoder)>,
    first: Dense,
    /// `[SCALARS][W]`.
    scalars: Vec<f32>,
    first_norm: Norm,
    second: Dense,
    second_norm: Norm,
    stack: Option<Dense>,
}

#[derive(Debug, Clone)]
enum MapEncoder {
    Convolutions { layers: [Convolution; 2], pool: usize },
    Patches { dense: Dense, size: usize },
}

#[derive(Debug, Clone)]
struct TagBranch {
    encoder: Dense,
    norm: Norm,
    temporal: Transformer,
    names: Dense,
    join: Dense,
}

#[derive(Debug, Clone)]
struct Head {
    first: Dense,
    second: Dense,
}

#[derive(Debug, Clone, Default)]
struct Memory {
    input: Between,
    inner: Between,
    outer: Between,
    features: Between,
    scratch: Between,
    shift: Vec<f32>,
    joined: Vec<f32>,
    normed: Vec<f32>,
    token: Vec<f32>,
    sequence: Vec<f32>,
    stacked: Vec<f32>,
    reads: Vec<f32>,
    tags: Vec<f32>,
    named: Vec<f32>,
    evidence: Vec<f32>,
    scores: Vec<f32>,
    between: Between,
}

/// Layers with weights.
pub(super) struct Layers<'a> {
    pub(super) dense: Vec<&'a Dense>,
    pub(super) patches: Vec<&'a Dense>,
    pub(super) convolutions: Vec<&'a [Convolution; 2]>,
}

impl Executor {
    /// An executor of a model with these kernels.
    ///
    /// # Errors
    /// If the model's arrays do not fit its network, or only Burn runs such a network.
    pub fn new(model: &Model, kernels: Kernels) -> Result<Self, ExecuteError> {
        let config = model.description.config.clone();
        if matches!(config.fusion, Fusion::Film | Fusion::Attention) {
            return Err(ExecuteError::Unsupported("FiLM and attention between the branches"));
        }
        if config.beams.is_some() {
            return Err(ExecuteError::Unsupported("learnt beams"));
        }
        let radar = config.fusion.has_radar();
        let encoder = radar.then(|| RadarEncoder::load(model, &config)).transpose()?;
        let temporal = radar.then(|| Transformer::load(model, "radar", &config.radar)).transpose()?;
        let tags = config.fusion.has_tags().then(|| TagBranch::load(model, &config)).transpose()?;
        Ok(Self {
            temperature: model.description.temperature,
            kernels,
            encoder,
            radar: temporal,
            tags,
            action: Head::load(model, "heads.action")?,
            target: Head::load(model, "heads.target")?,
            kept: Kept::default(),
            work: Memory::default(),
            config,
        })
    }

    /// Scores before the softmax: of actions, of tags.
    fn scores(&mut self, frames: Range<usize>, names: &[f32]) -> (Vec<f32>, Vec<f32>) {
        let Self { config, kernels, work, kept, .. } = self;
        let (radar_width, tag_width) = (config.radar.width, config.tags.width);
        let mut pooled = vec![0.0; radar_width];
        if let (Some(encoder), Some(temporal)) = (&mut self.encoder, &mut self.radar) {
            let from = (frames.start - kept.first) * radar_width;
            let to = (frames.end - kept.first) * radar_width;
            work.sequence.clear();
            match &mut encoder.stack {
                Some(stack) => {
                    let group = config.radar.stack * radar_width;
                    work.stacked.clear();
                    work.stacked.extend_from_slice(&kept.tokens[from..to]);
                    work.stacked.resize((to - from).next_multiple_of(group), 0.0);
                    let input = Input::F32(&work.stacked);
                    stack.run(kernels, input, None, &mut work.scratch, Sink::F32(&mut work.sequence));
                }
                None => work.sequence.extend_from_slice(&kept.tokens[from..to]),
            }
            let length = work.sequence.len() / radar_width;
            add_positions(&mut work.sequence, length, radar_width);
            temporal.run(kernels, &mut work.sequence, length);
            kernels.mean_rows(&work.sequence, radar_width, &mut pooled);
        }
        let count = kept.tags.unwrap_or(0);
        if let Some(branch) = &mut self.tags {
            branch.run(config, kernels, kept, frames, names, work);
        }
        let mut targets = Vec::with_capacity(count);
        let tags = config.fusion.has_tags().then_some(work.tags.as_slice());
        if count > 0 {
            work.evidence.clear();
            for tag in 0..count {
                if let Some(tags) = tags {
                    work.evidence.extend_from_slice(&tags[tag * tag_width..(tag + 1) * tag_width]);
                }
                if matches!(config.fusion, Fusion::Concat | Fusion::Radar) {
                    work.evidence.extend_from_slice(&pooled);
                }
            }
            self.target.run(kernels, &work.evidence, &mut work.scratch, &mut work.between, &mut work.scores);
            targets.extend_from_slice(&work.scores);
        }
        work.evidence.clear();
        if config.fusion.has_radar() {
            work.evidence.extend_from_slice(&pooled);
        }
        if let Some(tags) = tags.filter(|_| config.fusion != Fusion::None) {
            let weights = softmax(&targets, 1.0);
            let from = work.evidence.len();
            work.evidence.resize(from + 2 * tag_width, 0.0);
            let (weighed, mean) = work.evidence[from..].split_at_mut(tag_width);
            for (tag, weight) in tags.chunks_exact(tag_width).zip(&weights) {
                for ((weighed, mean), value) in weighed.iter_mut().zip(&mut *mean).zip(tag) {
                    *weighed += value * weight;
                    *mean += value;
                }
            }
            mean.iter_mut().for_each(|value| *value /= count.max(1) as f32);
        }
        self.action.run(kernels, &work.evidence, &mut work.scratch, &mut work.between, &mut work.scores);
        (work.scores.clone(), targets)
    }

    /// All dense layers, those on the maps themselves, and all convolutions, map by map.
    pub(super) fn layers(&self) -> Layers<'_> {
        let (mut dense, mut patches, mut convolutions) = (Vec::new(), Vec::new(), Vec::new());
        if let Some(encoder) = &self.encoder {
            dense.extend([&encoder.first, &encoder.second]);
            dense.extend(&encoder.stack);
            for (_, map) in &encoder.maps {
                match map {
                    MapEncoder::Convolutions { layers, .. } => convolutions.push(layers),
                    MapEncoder::Patches { dense, .. } => patches.push(dense),
                }
            }
        }
        dense.extend(self.radar.iter().flat_map(Transformer::dense));
        if let Some(tags) = &self.tags {
            dense.extend([&tags.encoder, &tags.names, &tags.join]);
            dense.extend(tags.temporal.dense());
        }
        dense.extend([&self.action.first, &self.action.second, &self.target.first, &self.target.second]);
        Layers { dense, patches, convolutions }
    }
}

impl Runner for Executor {
    fn push(&mut self, frame: Frame<'_>) -> Result<(), InputError> {
        let config = &self.config;
        self.kept.take(config, frame)?;
        if let Some(encoder) = &mut self.encoder {
            encoder.run(config, &self.kernels, frame, &mut self.work);
            self.kept.tokens.extend_from_slice(&self.work.token);
        }
        self.kept.forget(if self.encoder.is_some() { config.radar.width } else { 0 });
        Ok(())
    }

    fn answer(&mut self, frames: Range<usize>, names: &[f32]) -> Result<Answer, InputError> {
        self.kept.check(&self.config, &frames, names)?;
        let (actions, targets) = self.scores(frames, names);
        let temperature = self.temperature;
        Ok(Answer { actions: softmax(&actions, temperature), targets: softmax(&targets, temperature) })
    }

    fn clear(&mut self) {
        self.kept.clear();
    }
}

impl RadarEncoder {
    fn load(model: &Model, config: &NetworkConfig) -> Result<Self, ExecuteError> {
        let maps = config.encoded().enumerate().map(|(number, map)| {
            let name = format!("radar.encoder.maps.{number}");
            Ok((map, MapEncoder::load(model, &name, config.encoder)?))
        });
        let maps: Vec<_> = maps.collect::<Result<_, ExecuteError>>()?;
        let features = maps.len() * config.map_features();
        let name = "radar.encoder.first";
        // An int8 file has the scalars' weights by themselves.
        let (scalars, part) = match model.description.precision {
            Precision::F32 => {
                let weights = model.f32s(&format!("{name}.weight"))?;
                (weights[features * config.radar.width..].to_vec(), Some(0..features))
            }
            Precision::Int8 => (model.f32s(&format!("{name}.scalars"))?.to_vec(), None),
        };
        let stacked = config.radar.stack > 1;
        Ok(Self {
            maps,
            first: Dense::load(model, name, 1.0, part)?,
            scalars,
            first_norm: Norm::load(model, "radar.encoder.first_norm")?,
            second: Dense::load(model, "radar.encoder.second", 1.0, None)?,
            second_norm: Norm::load(model, "radar.encoder.second_norm")?,
            stack: stacked.then(|| Dense::load(model, "radar.stack", 1.0, None)).transpose()?,
        })
    }

    fn run(&mut self, config: &NetworkConfig, kernels: &Kernels, frame: Frame<'_>, work: &mut Memory) {
        let size = config.points * config.points;
        work.features.floats.clear();
        work.features.codes.clear();
        for (map, encoder) in &mut self.maps {
            let codes = &frame.maps[*map * size..(*map + 1) * size];
            encoder.run(kernels, codes, config.points, &self.first, work);
        }
        work.shift.clear();
        work.shift.resize(self.first.outputs, 0.0);
        for (scalar, weights) in frame.scalars.iter().zip(self.scalars.chunks_exact(self.first.outputs)) {
            work.shift.iter_mut().zip(weights).for_each(|(sum, weight)| *sum += scalar * weight);
        }
        let input = Input::Between(&work.features);
        let sink = Sink::F32(&mut work.joined);
        self.first.run(kernels, input, Some(&work.shift), &mut work.scratch, sink);
        work.normed.resize(work.joined.len(), 0.0);
        self.first_norm.run(kernels, &work.joined, Out::F32(&mut work.normed));
        work.normed.iter_mut().for_each(|value| *value = leaky(*value, LEAK as f32));
        let input = Input::F32(&work.normed);
        self.second.run(kernels, input, None, &mut work.scratch, Sink::F32(&mut work.joined));
        work.token.resize(work.joined.len(), 0.0);
        self.second_norm.run(kernels, &work.joined, Out::F32(&mut work.token));
    }
}

impl MapEncoder {
    fn load(model: &Model, name: &str, encoder: Encoder) -> Result<Self, ExecuteError> {
        Ok(match encoder {
            Encoder::Convolutions { strides, pool, .. } => {
                let layer =
                    |part, stride| Convolution::load(model, &format!("{name}.Convolutions.{part}"), stride);
                Self::Convolutions {
                    layers: [layer("first", strides[0])?, layer("second", strides[1])?],
                    pool,
                }
            }
            Encoder::Patches { size, .. } => {
                let dense = Dense::load(model, &format!("{name}.Patches.dense"), LEAK as f32, None)?;
                Self::Patches { dense, size }
            }
        })
    }

    /// Adds the features of a map, `[points][points]`, to `work.features`, as `next` takes them.
    fn run(&mut self, kernels: &Kernels, codes: &[u8], points: usize, next: &Dense, work: &mut Memory) {
        let Memory { input, inner, outer, features, scratch, .. } = work;
        let value = |code: &u8| f32::from(*code) / 255.0;
        match self {
            Self::Convolutions { layers: [first, second], pool } => {
                let float = first.is_float();
                if float {
                    input.floats.clear();
                    input.floats.extend(codes.iter().map(value));
                } else {
                    input.codes.clear();
                    input.codes.extend_from_slice(codes);
                }
                let side = first.run(kernels, input, points, inner);
                let side = second.run(kernels, inner, side, outer);
                max_pool(kernels, float, outer, (second.outputs(), side, *pool), features);
            }
            Self::Patches { dense, size } => {
                input.codes.clear();
                match *size {
                    // As a constant, a row of a square is one move.
                    4 => squares(codes, points, 4, &mut input.codes),
                    size => squares(codes, points, size, &mut input.codes),
                }
                if dense.is_float() {
                    input.floats.clear();
                    input.floats.extend(input.codes.iter().map(value));
                }
                dense.run(kernels, Input::Between(input), None, scratch, Sink::Between(next, outer));
                features.floats.extend_from_slice(&outer.floats);
                features.codes.extend_from_slice(&outer.codes);
            }
        }
    }
}

impl TagBranch {
    fn load(model: &Model, config: &NetworkConfig) -> Result<Self, ExecuteError> {
        Ok(Self {
            encoder: Dense::load(model, "tags.encoder", 1.0, None)?,
            norm: Norm::load(model, "tags.norm")?,
            temporal: Transformer::load(model, "tags", &config.tags)?,
            names: Dense::load(model, "tags.names", 1.0, None)?,
            join: Dense::load(model, "tags.join", LEAK as f32, None)?,
        })
    }

    /// Leaves each tag's features in `work.tags`.
    fn run(
        &mut self,
        config: &NetworkConfig,
        kernels: &Kernels,
        kept: &Kept,
        frames: Range<usize>,
        names: &[f32],
        work: &mut Memory,
    ) {
        let (width, count) = (config.tags.width, kept.tags.unwrap_or(0));
        let length = frames.len().div_ceil(config.tags.stack);
        let features = config.read_features();
        work.tags.clear();
        if count == 0 {
            return;
        }
        work.reads.resize(count * length * features, 0.0);
        let part = (frames.start - kept.first)..(frames.end - kept.first);
        let rows = work.reads.chunks_exact_mut(features).enumerate();
        rows.for_each(|(row, out)| {
            token_of_tag(config, &kept.frames, part.clone(), row / length, row % length, out);
        });
        let input = Input::F32(&work.reads);
        self.encoder.run(kernels, input, None, &mut work.scratch, Sink::F32(&mut work.stacked));
        work.sequence.resize(work.stacked.len(), 0.0);
        self.norm.run(kernels, &work.stacked, Out::F32(&mut work.sequence));
        work.sequence.iter_mut().for_each(|value| *value = leaky(*value, LEAK as f32));
        add_positions(&mut work.sequence, length, width);
        self.temporal.run(kernels, &mut work.sequence, length);
        let input = Input::F32(names);
        self.names.run(kernels, input, None, &mut work.scratch, Sink::F32(&mut work.named));
        let known = 2 * width + config.turn_features();
        work.evidence.resize(count * known, 0.0);
        for (tag, out) in work.evidence.chunks_exact_mut(known).enumerate() {
            let (moved, rest) = out.split_at_mut(width);
            let (named, turns) = rest.split_at_mut(width);
            let tokens = &work.sequence[tag * length * width..(tag + 1) * length * width];
            kernels.mean_rows(tokens, width, moved);
            named.copy_from_slice(&work.named[tag * width..(tag + 1) * width]);
            kept.turns_of_tag(part.clone(), tag, turns);
        }
        let input = Input::F32(&work.evidence);
        self.join.run(kernels, input, None, &mut work.scratch, Sink::F32(&mut work.tags));
    }
}

impl Head {
    fn load(model: &Model, name: &str) -> Result<Self, ExecuteError> {
        Ok(Self {
            first: Dense::load(model, &format!("{name}.first"), LEAK as f32, None)?,
            second: Dense::load(model, &format!("{name}.second"), 1.0, None)?,
        })
    }

    fn run(
        &mut self,
        kernels: &Kernels,
        evidence: &[f32],
        scratch: &mut Between,
        between: &mut Between,
        out: &mut Vec<f32>,
    ) {
        let next = Sink::Between(&self.second, between);
        self.first.run(kernels, Input::F32(evidence), None, scratch, next);
        self.second.run(kernels, Input::Between(between), None, scratch, Sink::F32(out));
    }
}

/// Adds the squares of a map, `[points][points]`, one after the other.
#[inline(always)]
fn squares(codes: &[u8], points: usize, size: usize, out: &mut Vec<u8>) {
    for rows in codes.chunks_exact(size * points) {
        for column in (0..points).step_by(size) {
            rows.chunks_exact(points).for_each(|row| out.extend_from_slice(&row[column..column + size]));
        }
    }
}

/// Adds its position to each token of sequences of `length`.
fn add_positions(tokens: &mut [f32], length: usize, width: usize) {
    let at = positions(length, width);
    for sequence in tokens.chunks_exact_mut(length * width) {
        sequence.iter_mut().zip(at.iter()).for_each(|(value, at)| *value += at);
    }
}
