//! From samples of different lengths and tags to tensors of one shape, with what is there and what is padding.

use std::ops::Range;

use burn::tensor::{Device, Int, Tensor, TensorData};

use crate::config::{Beams, NetworkConfig};
use crate::sample::{Frames, MOST_TURNS, READ_CHANNELS, SCALARS, TURN_CHANNELS, read};

/// Vectors of names, by number.
pub type NameVectors = [Vec<f32>];

/// Samples as tensors. Shapes as in the module's docs.
#[derive(Debug, Clone)]
pub struct Batch {
    pub(crate) frames: FrameTensors,
    /// Which of the N frames is at each of the `B * F` places; N is none.
    pub(crate) frame_index: Tensor<1, Int>,
    /// Frames of a radar token.
    pub(crate) radar_stack: usize,
    /// 1 where a radar token is, `[B, G]`.
    pub(crate) radar_valid: Tensor<2>,
    /// `[B * T, G, stack * antennas * READ_CHANNELS]`.
    pub(crate) reads: Tensor<3>,
    /// 1 where a token of a tag is, `[B * T, G]`.
    pub(crate) read_valid: Tensor<2>,
    /// Net turn of each tag, `[B * T, antennas * TURN_CHANNELS]`.
    pub(crate) turns: Tensor<2>,
    /// `[B, T, E]`.
    pub(crate) names: Tensor<3>,
    /// 1 where a tag is, `[B, T]`.
    pub(crate) tag_valid: Tensor<2>,
}

/// What each frame's radar token is made of.
#[derive(Debug, Clone)]
pub(crate) struct FrameTensors {
    /// `[N, 1, P, P]` from 0 to 1, one for each map that is encoded.
    pub(crate) maps: Vec<Tensor<4>>,
    /// `[N, SCALARS]`.
    pub(crate) scalars: Tensor<2>,
    /// `[N, antennas^2]`, where the network takes it.
    pub(crate) covariance: Option<Tensor<2>>,
}

/// What cannot become a batch.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum BatchError {
    /// Nothing in it.
    #[error("a batch needs samples, and each of them frames")]
    Empty,
    /// Maps of another size.
    #[error("maps have {given} points each way, the network takes {wanted}")]
    Points {
        /// As given.
        given: usize,
        /// As the network has it.
        wanted: usize,
    },
    /// Names without vectors, or of other dimensions.
    #[error("a name's vector has {given} dimensions, the network takes {wanted}")]
    Names {
        /// As given.
        given: usize,
        /// As the network has it.
        wanted: usize,
    },
    /// No covariance where the network learns beams.
    #[error(
        "the network learns beams and needs {wanted} values of covariance for each frame, there are {given}"
    )]
    Covariance {
        /// As given.
        given: usize,
        /// As the network has it.
        wanted: usize,
    },
}

impl Batch {
    /// Frames and, for each of their tags, the name's vector.
    ///
    /// # Errors
    /// If a sample does not fit the network.
    pub fn new(
        config: &NetworkConfig,
        samples: &[(&Frames, Vec<&[f32]>)],
        device: &Device,
    ) -> Result<Self, BatchError> {
        check(config, samples)?;
        let frames = FrameTensors::new(config, samples.iter().map(|&(frames, _)| frames), device);
        Ok(Self { frames, ..Self::without_frames(config, samples, device) })
    }

    /// All but what frames' radar tokens are made of, for those who have these tokens; samples that have been checked.
    pub(crate) fn without_frames(
        config: &NetworkConfig,
        samples: &[(&Frames, Vec<&[f32]>)],
        device: &Device,
    ) -> Self {
        let frames: usize = samples.iter().map(|(frames, _)| frames.len()).sum();
        let longest = samples.iter().map(|(frames, _)| frames.len()).max().unwrap_or(0);
        let tags = samples.iter().map(|(frames, _)| frames.tags).max().unwrap_or(0).max(1);
        let tensor = |values: Vec<f32>, shape: &[usize]| TensorData::new(values, shape.to_vec());

        let radar_stack = config.radar.stack;
        let groups = longest.div_ceil(radar_stack);
        let (mut index, mut radar_valid) = (Vec::new(), Vec::new());
        let mut first = 0;
        for (sample, _) in samples {
            let length = sample.len();
            index.extend(
                (0..groups * radar_stack).map(
                    |at| {
                        if at < length { (first + at) as i32 } else { frames as i32 }
                    },
                ),
            );
            radar_valid.extend((0..groups).map(|g| f32::from(u8::from(g * radar_stack < length))));
            first += length;
        }
        let radar_valid = tensor(radar_valid, &[samples.len(), groups]);

        let groups = longest.div_ceil(config.tags.stack);
        let features = config.read_features();
        let mut reads = vec![0.0; samples.len() * tags * groups * features];
        let mut read_valid = vec![0.0; samples.len() * tags * groups];
        let per_tag = config.turn_features();
        let mut turns = vec![0.0; samples.len() * tags * per_tag];
        let mut names = vec![0.0; samples.len() * tags * config.name_dimensions];
        let mut tag_valid = vec![0.0; samples.len() * tags];
        for (place, (sample, vectors)) in samples.iter().enumerate() {
            for (tag, vector) in vectors.iter().enumerate().take(sample.tags) {
                let row = place * tags + tag;
                tag_valid[row] = 1.0;
                let valid = &mut read_valid[row * groups..(row + 1) * groups];
                valid[..sample.len().div_ceil(config.tags.stack)].fill(1.0);
                names[row * config.name_dimensions..(row + 1) * config.name_dimensions]
                    .copy_from_slice(vector);
                let turns = &mut turns[row * per_tag..(row + 1) * per_tag];
                turns_of_tag(config, sample, 0..sample.len(), tag, turns);
                let row = &mut reads[row * groups * features..(row + 1) * groups * features];
                for (token, out) in row.chunks_exact_mut(features).enumerate() {
                    token_of_tag(config, sample, 0..sample.len(), tag, token, out);
                }
            }
        }
        let rows = samples.len() * tags;
        Self {
            frames: FrameTensors {
                maps: Vec::new(),
                scalars: Tensor::zeros([1, SCALARS], device),
                covariance: None,
            },
            frame_index: Tensor::from_data(TensorData::new(index.clone(), [index.len()]), device),
            radar_stack,
            radar_valid: Tensor::from_data(radar_valid, device),
            reads: Tensor::from_data(tensor(reads, &[rows, groups, features]), device),
            read_valid: Tensor::from_data(tensor(read_valid, &[rows, groups]), device),
            turns: Tensor::from_data(tensor(turns, &[rows, per_tag]), device),
            names: Tensor::from_data(tensor(names, &[samples.len(), tags, config.name_dimensions]), device),
            tag_valid: Tensor::from_data(tensor(tag_valid, &[samples.len(), tags]), device),
        }
    }
}

impl FrameTensors {
    /// Of all frames, one after the other; shapes as the network has them.
    pub(crate) fn new<'a>(
        config: &NetworkConfig,
        samples: impl Iterator<Item = &'a Frames> + Clone,
        device: &Device,
    ) -> Self {
        let frames: usize = samples.clone().map(Frames::len).sum();
        let (points, size) = (config.points, config.points * config.points);
        let maps = config.encoded().map(|map| {
            let mut values = Vec::with_capacity(frames * size);
            for sample in samples.clone() {
                for number in 0..sample.len() {
                    let codes = &sample.frame(number).maps[map * size..(map + 1) * size];
                    values.extend(codes.iter().map(|&code| f32::from(code) / 255.0));
                }
            }
            Tensor::from_data(TensorData::new(values, [frames, 1, points, points]), device)
        });
        let maps = maps.collect();
        let scalars: Vec<f32> = samples.clone().flat_map(|s| s.scalars.iter().copied()).collect();
        let covariance = config.beams.map(|Beams { antennas, .. }| {
            let values: Vec<f32> = samples.clone().flat_map(|s| s.covariance.iter().copied()).collect();
            Tensor::from_data(TensorData::new(values, [frames, antennas * antennas]), device)
        });
        Self {
            maps,
            scalars: Tensor::from_data(TensorData::new(scalars, [frames, SCALARS]), device),
            covariance,
        }
    }
}

/// What the reader tells of one tag in one token of the frames in `part`: `[stack][antennas][READ_CHANNELS]`, zeros past the
/// end and for antennas that are not there.
pub(crate) fn token_of_tag(
    config: &NetworkConfig,
    frames: &Frames,
    part: Range<usize>,
    tag: usize,
    token: usize,
    out: &mut [f32],
) {
    let wanted = config.antennas * READ_CHANNELS;
    let (of_tag, of_frame) = (frames.antennas * READ_CHANNELS, frames.tags * frames.antennas * READ_CHANNELS);
    let taken = wanted.min(of_tag);
    out.fill(0.0);
    for (slot, out) in out.chunks_exact_mut(wanted).enumerate() {
        let number = part.start + token * config.tags.stack + slot;
        if number < part.end {
            let from = number * of_frame + tag * of_tag;
            out[..taken].copy_from_slice(&frames.reads[from..from + taken]);
        }
    }
}

/// Net turn of one tag over the frames in `part`: `[antennas][TURN_CHANNELS]`.
pub(crate) fn turns_of_tag(
    config: &NetworkConfig,
    frames: &Frames,
    part: Range<usize>,
    tag: usize,
    out: &mut [f32],
) {
    out.fill(0.0);
    let (of_tag, of_frame) = (frames.antennas * READ_CHANNELS, frames.tags * frames.antennas * READ_CHANNELS);
    let of_tag = part.map(|number| &frames.reads[number * of_frame + tag * of_tag..][..of_tag]);
    for reads in of_tag {
        let antennas = reads.chunks_exact(READ_CHANNELS).take(config.antennas);
        for (values, sums) in antennas.zip(out.chunks_exact_mut(TURN_CHANNELS)) {
            sums.iter_mut().zip(turns_of_read(values)).for_each(|(sum, turn)| *sum += turn);
        }
    }
    limit_turns(out);
}

/// What one tag at one antenna in one frame adds to its net turn, half turns.
pub(crate) fn turns_of_read(values: &[f32]) -> [f32; TURN_CHANNELS] {
    let turn = values[read::TURN].atan2(values[read::TURN + 1]) / core::f32::consts::PI;
    [values[read::DIFFERENCE], turn]
}

/// Net turns within what the network knows.
pub(crate) fn limit_turns(turns: &mut [f32]) {
    turns.iter_mut().for_each(|turn| *turn = turn.clamp(-MOST_TURNS, MOST_TURNS));
}

fn check(config: &NetworkConfig, samples: &[(&Frames, Vec<&[f32]>)]) -> Result<(), BatchError> {
    if samples.is_empty() || samples.iter().any(|(frames, _)| frames.is_empty()) {
        return Err(BatchError::Empty);
    }
    for (frames, vectors) in samples {
        if frames.points != config.points {
            return Err(BatchError::Points { given: frames.points, wanted: config.points });
        }
        let wanted = config.name_dimensions;
        if let Some(other) = vectors.iter().find(|vector| vector.len() != wanted) {
            return Err(BatchError::Names { given: other.len(), wanted });
        }
        if vectors.len() < frames.tags {
            return Err(BatchError::Names { given: 0, wanted });
        }
        if let Some(Beams { antennas, .. }) = config.beams {
            let (given, wanted) = (frames.covariance.len() / frames.len(), antennas * antennas);
            if given != wanted {
                return Err(BatchError::Covariance { given, wanted });
            }
        }
    }
    Ok(())
}
