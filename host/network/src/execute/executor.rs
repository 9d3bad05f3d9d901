//! The executor.

use std::ops::Range;

use rfhoi_int8::{Kernels, Out};

use super::convolution::{Convolution, max_pool};
use super::dense::{Dense, Input, Norm, Sink};
use super::transformer::{Transformer, Work};
use super::{Between, ExecuteError, leaky};
use crate::config::{Encoder, Fusion, LEAK, NetworkConfig};
use crate::kept::Kept;
use crate::model::{Model, Precision};
use crate::network::token_of_tag;
use crate::positions::positions;
use crate::probability::softmax;
use crate::sample::{Answer, Frame, InputError, Runner};

/// Multiplications of the tags' layers from which on threads share tags: some 50 us of one alone. For less it is not worth waking
/// another.
const SHARED: usize = 1 << 21;
/// Groups of tags for each thread but the one that has the radar's branch: so that whoever is done early takes another.
const GROUPS: usize = 8;

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
    moved: Vec<f32>,
    lanes: Vec<Lane>,
    tags: Vec<f32>,
    named: Vec<f32>,
    evidence: Vec<f32>,
    scores: Vec<f32>,
    between: Between,
}

/// Memory of one share of an answer's work.
#[derive(Debug, Clone, Default)]
struct Lane {
    scratch: Between,
    input: Vec<f32>,
    encoded: Vec<f32>,
    sequence: Vec<f32>,
    temporal: Work,
}

/// A share of an answer's work: what a branch sees over time.
enum Share<'a> {
    Radar { encoder: &'a RadarEncoder, temporal: &'a Transformer, lane: &'a mut Lane, pooled: &'a mut [f32] },
    Tags { branch: &'a TagBranch, tags: Range<usize>, lane: &'a mut Lane, moved: &'a mut [f32] },
}

impl Share<'_> {
    fn run(&mut self, config: &NetworkConfig, kernels: &Kernels, kept: &Kept, frames: &Range<usize>) {
        let part = frames.start - kept.first..frames.end - kept.first;
        match self {
            Self::Radar { encoder, temporal, lane, pooled } => {
                let width = pooled.len();
                let Lane { scratch, input, sequence, temporal: work, .. } = &mut **lane;
                let tokens = &kept.tokens[part.start * width..part.end * width];
                sequence.clear();
                match &encoder.stack {
                    Some(stack) => {
                        input.clear();
                        input.extend_from_slice(tokens);
                        input.resize(tokens.len().next_multiple_of(config.radar.stack * width), 0.0);
                        stack.run(kernels, Input::F32(input), None, scratch, Sink::F32(sequence));
                    }
                    None => sequence.extend_from_slice(tokens),
                }
                let length = sequence.len() / width;
                add_positions(sequence, length, width);
                temporal.run(kernels, sequence, length, work);
                kernels.mean_rows(sequence, width, pooled);
            }
            Self::Tags { branch, tags, lane, moved } => {
                branch.moved(config, kernels, (kept, part), tags.clone(), lane, moved);
            }
        }
    }
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

    /// What both branches see over time: leaves the tags' part in `work.moved`, the radar's is returned.
    fn over_time(&mut self, frames: &Range<usize>) -> Vec<f32> {
        let Self { config, kernels, work, kept, .. } = self;
        let width = config.tags.width;
        let count = kept.tags.unwrap_or(0);
        let mut pooled = vec![0.0; config.radar.width];
        work.moved.resize(count * width, 0.0);
        let branch = self.tags.as_ref().filter(|_| count > 0);
        let multiplications = |temporal: &Transformer, stack: usize, sequences: usize| {
            sequences * frames.len().div_ceil(stack) * temporal.multiplications()
        };
        let of_tags = branch.map_or(0, |tags| multiplications(&tags.temporal, config.tags.stack, count));
        let of_radar = self.radar.as_ref().map_or(0, |radar| multiplications(radar, config.radar.stack, 1));
        let others = kernels.threads() - 1;
        // One thread has the radar's branch. If that is most of the work, threads share its products instead.
        let shared = others > 0 && of_tags >= SHARED && of_radar * others <= of_tags;
        let groups = if shared { (GROUPS * others).min(count) } else { 1 };
        work.lanes.resize_with(groups + 1, Lane::default);
        let mut lanes = work.lanes.iter_mut();
        let mut shares = Vec::with_capacity(groups + 1);
        if let (Some(encoder), Some(temporal), Some(lane)) = (&self.encoder, &self.radar, lanes.next()) {
            shares.push(Share::Radar { encoder, temporal, lane, pooled: &mut pooled });
        }
        if let Some(branch) = branch {
            let mut rest = work.moved.as_mut_slice();
            for (group, lane) in lanes.take(groups).enumerate() {
                let tags = group * count / groups..(group + 1) * count / groups;
                let (moved, after) = rest.split_at_mut(tags.len() * width);
                rest = after;
                shares.push(Share::Tags { branch, tags, lane, moved });
            }
        }
        let run = |share: &mut Share<'_>| share.run(config, kernels, kept, frames);
        if shared {
            kernels.share(&mut shares, run)
        } else {
            shares.iter_mut().for_each(run)
        }
        pooled
    }

    /// Scores before the softmax: of actions, of tags.
    fn scores(&mut self, frames: Range<usize>, names: &[f32]) -> (Vec<f32>, Vec<f32>) {
        let pooled = self.over_time(&frames);
        let Self { config, kernels, work, kept, .. } = self;
        let tag_width = config.tags.width;
        let count = kept.tags.unwrap_or(0);
        work.tags.clear();
        if let Some(branch) = self.tags.as_ref().filter(|_| count > 0) {
            branch.join(config, kernels, kept, frames, names, work);
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

    /// What each of some tags did over a part of the frames that are kept.
    fn moved(
        &self,
        config: &NetworkConfig,
        kernels: &Kernels,
        (kept, part): (&Kept, Range<usize>),
        tags: Range<usize>,
        lane: &mut Lane,
        moved: &mut [f32],
    ) {
        let Lane { scratch, input, encoded, sequence, temporal } = lane;
        let (width, features) = (config.tags.width, config.read_features());
        let length = part.len().div_ceil(config.tags.stack);
        input.resize(tags.len() * length * features, 0.0);
        for (row, out) in input.chunks_exact_mut(features).enumerate() {
            let tag = tags.start + row / length;
            token_of_tag(config, &kept.frames, part.clone(), tag, row % length, out);
        }
        self.encoder.run(kernels, Input::F32(input), None, scratch, Sink::F32(encoded));
        sequence.resize(encoded.len(), 0.0);
        self.norm.run(kernels, encoded, Out::F32(sequence));
        sequence.iter_mut().for_each(|value| *value = leaky(*value, LEAK as f32));
        add_positions(sequence, length, width);
        self.temporal.run(kernels, sequence, length, temporal);
        for (tokens, moved) in sequence.chunks_exact(length * width).zip(moved.chunks_exact_mut(width)) {
            kernels.mean_rows(tokens, width, moved);
        }
    }

    /// Leaves each tag's features in `work.tags`: what it did, its name, its net turns.
    fn join(
        &self,
        config: &NetworkConfig,
        kernels: &Kernels,
        kept: &Kept,
        frames: Range<usize>,
        names: &[f32],
        work: &mut Memory,
    ) {
        let (width, count) = (config.tags.width, kept.tags.unwrap_or(0));
        let part = frames.start - kept.first..frames.end - kept.first;
        let input = Input::F32(names);
        self.names.run(kernels, input, None, &mut work.scratch, Sink::F32(&mut work.named));
        let known = 2 * width + config.turn_features();
        work.evidence.resize(count * known, 0.0);
        for (tag, out) in work.evidence.chunks_exact_mut(known).enumerate() {
            let (moved, rest) = out.split_at_mut(width);
            let (named, turns) = rest.split_at_mut(width);
            moved.copy_from_slice(&work.moved[tag * width..(tag + 1) * width]);
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
