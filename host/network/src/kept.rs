//! Frames that came and may still be asked about.

use std::ops::Range;

use crate::config::NetworkConfig;
use crate::network::{limit_turns, turns_of_read};
use crate::sample::{
    Frame, Frames, InputError, MAPS, MAX_FRAMES, MAX_TAGS, READ_CHANNELS, SCALARS, TURN_CHANNELS,
};

/// Frames that came.
#[derive(Debug, Clone, Default)]
pub(crate) struct Kept {
    /// Number of the first that is kept.
    pub(crate) first: usize,
    /// Radar tokens, one after the other.
    pub(crate) tokens: Vec<f32>,
    /// `[frames][tags][antennas][TURN_CHANNELS]`: what adds up to net turns.
    turns: Vec<f32>,
    /// Scalars and reads of frames; their maps are in the tokens.
    pub(crate) frames: Frames,
    /// Tags of a frame, once one came.
    pub(crate) tags: Option<usize>,
}

impl Kept {
    pub(crate) fn take(&mut self, config: &NetworkConfig, frame: Frame<'_>) -> Result<(), InputError> {
        let shape = |what, given: usize, wanted: usize| match given == wanted {
            true => Ok(()),
            false => Err(InputError::Shape { what, given, wanted }),
        };
        shape("the maps of a frame", frame.maps.len(), MAPS * config.points * config.points)?;
        shape("a frame's scalars", frame.scalars.len(), SCALARS)?;
        // Features are made for the network's antennas.
        let of_tag = config.antennas * READ_CHANNELS;
        let tags = match self.tags {
            Some(tags) => tags,
            None if frame.reads.len().is_multiple_of(of_tag) => frame.reads.len() / of_tag,
            None => return shape("the reads of a frame", frame.reads.len(), of_tag),
        };
        shape("the reads of a frame", frame.reads.len(), tags * of_tag)?;
        if tags > MAX_TAGS {
            return Err(InputError::TooManyTags(tags));
        }
        if frame.scalars.iter().any(|value| !value.is_finite()) {
            return Err(InputError::NotFinite("a frame's scalars"));
        }
        if frame.reads.iter().any(|value| !value.is_finite()) {
            return Err(InputError::NotFinite("the reads of a frame"));
        }
        self.tags = Some(tags);
        self.frames.tags = tags;
        self.frames.antennas = config.antennas;
        self.frames.scalars.extend_from_slice(frame.scalars);
        self.frames.reads.extend_from_slice(frame.reads);
        self.turns.extend(frame.reads.chunks_exact(READ_CHANNELS).flat_map(turns_of_read));
        Ok(())
    }

    /// Net turn of one tag over frames, `[antennas][TURN_CHANNELS]`.
    pub(crate) fn turns_of_tag(&self, frames: Range<usize>, tag: usize, out: &mut [f32]) {
        let of_frame = self.frames.tags * out.len();
        out.fill(0.0);
        for turns in self.turns[frames.start * of_frame..frames.end * of_frame].chunks_exact(of_frame) {
            let of_tag = &turns[tag * out.len()..];
            out.iter_mut().zip(of_tag).for_each(|(sum, turn)| *sum += turn);
        }
        limit_turns(out);
    }

    /// Frames that are too old go, many at once.
    pub(crate) fn forget(&mut self, width: usize) {
        if self.frames.len() >= 2 * MAX_FRAMES {
            let of_frame = self.frames.reads.len() / self.frames.len();
            self.tokens.drain(..MAX_FRAMES * width);
            self.frames.scalars.drain(..MAX_FRAMES * SCALARS);
            self.frames.reads.drain(..MAX_FRAMES * of_frame);
            self.turns.drain(..MAX_FRAMES * of_frame / READ_CHANNELS * TURN_CHANNELS);
            self.first += MAX_FRAMES;
        }
    }

    pub(crate) fn check(
        &self,
        config: &NetworkConfig,
        frames: &Range<usize>,
        names: &[f32],
    ) -> Result<(), InputError> {
        if frames.is_empty() || frames.len() > MAX_FRAMES {
            return Err(InputError::Frames(frames.len()));
        }
        if frames.start < self.first || frames.end > self.first + self.frames.len() {
            return Err(InputError::NotThere { first: frames.start, last: frames.end });
        }
        let wanted = self.tags.unwrap_or(0) * config.name_dimensions;
        if names.len() != wanted {
            return Err(InputError::Shape { what: "the vectors of names", given: names.len(), wanted });
        }
        match names.iter().all(|value| value.is_finite()) {
            true => Ok(()),
            false => Err(InputError::NotFinite("the vectors of names")),
        }
    }

    pub(crate) fn clear(&mut self) {
        self.first = 0;
        self.tokens.clear();
        self.frames.scalars.clear();
        self.frames.reads.clear();
        self.turns.clear();
        self.tags = None;
    }

    /// Frames without maps.
    pub(crate) fn part(&self, frames: Range<usize>) -> Frames {
        let of = |size: usize| (frames.start - self.first) * size..(frames.end - self.first) * size;
        let of_frame = self.frames.tags * self.frames.antennas * READ_CHANNELS;
        Frames {
            scalars: self.frames.scalars[of(SCALARS)].to_vec(),
            reads: self.frames.reads[of(of_frame)].to_vec(),
            ..Frames::new(0, self.frames.tags, self.frames.antennas)
        }
    }
}
