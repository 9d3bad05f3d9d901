//! The last frames as the network takes them, and what was measured in them at all.

use std::collections::VecDeque;
use std::ops::Range;

use rfhoi_network::sample::{Frame, READ_CHANNELS, SCALARS, read};

use crate::align::{AlignedFrame, MapInvalid, MapName};

/// One frame.
#[derive(Debug, Clone, Default)]
pub(super) struct Kept {
    maps: Vec<u8>,
    scalars: [f32; SCALARS],
    /// `[tags][antennas][READ_CHANNELS]` of the tags that were known then.
    reads: Vec<f32>,
    covariance: Vec<f32>,
    /// From when to when, s since the first packet.
    pub(super) span_s: [f64; 2],
    /// Whether the radar sent it.
    sent: bool,
    /// What is wrong with its range-Doppler map.
    invalid: Option<MapInvalid>,
}

impl Kept {
    /// Becomes `frame`, in its own memory.
    pub(super) fn set(&mut self, frame: Frame<'_>, aligned: &AlignedFrame, span_s: [f64; 2]) {
        let copy = |own: &mut Vec<f32>, other: &[f32]| {
            own.clear();
            own.extend_from_slice(other);
        };
        self.maps.clear();
        self.maps.extend_from_slice(frame.maps);
        self.scalars.copy_from_slice(frame.scalars);
        copy(&mut self.reads, frame.reads);
        copy(&mut self.covariance, frame.covariance);
        self.span_s = span_s;
        self.sent = aligned.sent;
        self.invalid = aligned.invalid(MapName::RangeDoppler);
    }

    /// It with the reads of `tags` alone, which are put into `reads`.
    pub(super) fn frame<'a>(&'a self, tags: &[usize], antennas: usize, reads: &'a mut Vec<f32>) -> Frame<'a> {
        let of_tag = antennas * READ_CHANNELS;
        reads.clear();
        for &tag in tags {
            match self.reads.get(tag * of_tag..(tag + 1) * of_tag) {
                Some(own) => reads.extend_from_slice(own),
                // It was not known yet.
                None => reads.resize(reads.len() + of_tag, 0.0),
            }
        }
        Frame { maps: &self.maps, scalars: &self.scalars, reads, covariance: &self.covariance }
    }

    /// Whether a tag was read.
    pub(super) fn is_read(&self, tag: usize, antennas: usize) -> bool {
        let of_tag = antennas * READ_CHANNELS;
        self.reads
            .get(tag * of_tag..(tag + 1) * of_tag)
            .is_some_and(|own| own.chunks_exact(READ_CHANNELS).any(|channels| channels[read::READS] > 0.0))
    }
}

/// What was measured in some frames at all, as shares of them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Measured {
    /// Frames in which no tag was read.
    pub(super) unread: f32,
    /// Frames that the radar did not send.
    pub(super) missing: f32,
    /// Of those that it sent, frames whose range-Doppler map cannot be trusted, and why most of them cannot.
    pub(super) invalid: f32,
    pub(super) reason: &'static str,
}

/// The last frames.
#[derive(Debug, Clone)]
pub(super) struct Window {
    frames: VecDeque<Kept>,
    most: usize,
    /// Number of the first.
    first: usize,
}

impl Window {
    /// The last `most` frames, numbered from 0.
    pub(super) fn new(most: usize) -> Self {
        Self { frames: VecDeque::with_capacity(most), most, first: 0 }
    }

    /// Adds a frame at the end, in the memory of the oldest where there are enough.
    pub(super) fn push(&mut self, set: impl FnOnce(&mut Kept)) {
        let mut kept = Kept::default();
        if self.frames.len() == self.most {
            self.first += 1;
            kept = self.frames.pop_front().unwrap_or_default();
        }
        set(&mut kept);
        self.frames.push_back(kept);
    }

    /// Numbers of the frames that are there.
    pub(super) fn numbers(&self) -> Range<usize> {
        self.first..self.first + self.frames.len()
    }

    /// The frames of these numbers, as far as they are there.
    pub(super) fn range(&self, numbers: Range<usize>) -> impl Iterator<Item = &Kept> {
        let count = numbers.len();
        self.frames.iter().skip(numbers.start.saturating_sub(self.first)).take(count)
    }

    /// What was measured of `tags` in the frames of these numbers.
    pub(super) fn measured(&self, numbers: Range<usize>, tags: &[usize], antennas: usize) -> Measured {
        let share = |count: usize, of: usize| if of == 0 { 1.0 } else { count as f32 / of as f32 };
        let all = || self.range(numbers.clone());
        let (count, sent) = (all().count(), all().filter(|kept| kept.sent).count());
        let unread = all().filter(|kept| !tags.iter().any(|&tag| kept.is_read(tag, antennas))).count();
        let reasons = || all().filter(|kept| kept.sent).filter_map(|kept| Some(kept.invalid?.reason()));
        let often = |reason: &&str| reasons().filter(|other| other == reason).count();
        Measured {
            unread: share(unread, count),
            missing: share(count - sent, count),
            invalid: share(reasons().count(), sent),
            reason: reasons().max_by_key(often).unwrap_or("missing"),
        }
    }
}
