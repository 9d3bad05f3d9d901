//! What the network takes: frames of both radios, by shape and unit, and what is known of them.
//!
//! All tags and antennas of a frame are there, read or not; what is missing is said by channels of its own, never by a value
//! that could be a measurement.

use std::ops::Range;

/// Maps of a frame: range-time, range-Doppler, angle (section 3.2.1 of the paper).
pub const MAPS: usize = 3;
/// Tags of a frame at most.
pub const MAX_TAGS: usize = 64;
/// Reader antennas at most.
pub const MAX_ANTENNAS: usize = 4;
/// Frames that one answer rests on at most: a minute at 10 Hz.
pub const MAX_FRAMES: usize = 600;

/// Values of a frame beside its maps, which each go from 0 to 1 and so no longer tell how strong they are; see [`scalar`].
pub const SCALARS: usize = 6;
/// Places of a frame's scalars.
pub mod scalar {
    /// 1 where the map can be trusted, else 0; the same for the other two maps after it.
    pub const VALID: usize = 0;
    /// Strongest cell of the range-Doppler map over its floor, in units of 60 dB.
    pub const PEAK: usize = 3;
    /// log2(1 + moving cells) / 10.
    pub const CELLS: usize = 4;
    /// 1 where the radar sent the frame, else 0.
    pub const PRESENT: usize = 5;
}

/// Values of a frame for each tag and antenna; see [`read`].
pub const READ_CHANNELS: usize = 6;
/// Places of what the reader tells of one tag at one antenna in one frame.
pub mod read {
    /// Phase difference over the frame in half turns where it is known for sure, else 0.
    pub const DIFFERENCE: usize = 0;
    /// 1 where the phase difference is known for sure, else 0.
    pub const KNOWN: usize = 1;
    /// Sine and, in the next place, cosine of the turn from the last read before the frame to the last one in it, each
    /// corrected for its channel: the paper's nearest-neighbour difference, which a fast tag folds. 0 and 0 without one.
    pub const TURN: usize = 2;
    /// Reads in the frame, in units of 4, at most 1.
    pub const READS: usize = 4;
    /// RSSI over its mean of late, in units of 10 dB, between -2 and 2; 0 without a read.
    pub const RSSI: usize = 5;
}

/// Values of a tag's net turn over a window at each antenna, in half turns: sum of the differences that are known for sure, and
/// sum of the turns between neighbouring reads, which bridges holes and folds where a tag was fast.
pub const TURN_CHANNELS: usize = 2;
/// Net turn at most, half turns: a quarter of a wavelength each, so 0.65 m at 920 MHz.
pub const MOST_TURNS: f32 = 8.0;

/// Frames of both radios, one after the other.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Frames {
    /// Points of a map each way.
    pub points: usize,
    /// Tags.
    pub tags: usize,
    /// Reader antennas.
    pub antennas: usize,
    /// `[frames][MAPS][points][points]`, 0 to 255; rows and columns as an aligned frame has them.
    pub maps: Vec<u8>,
    /// `[frames][SCALARS]`.
    pub scalars: Vec<f32>,
    /// `[frames][tags][antennas][READ_CHANNELS]`.
    pub reads: Vec<f32>,
    /// `[frames][N * N]` of N virtual antennas, for networks that learn their own transform: diagonal and upper triangle
    /// by rows, re and im, as the wire has it, over the mean of the diagonal. Empty where it is not wanted.
    pub covariance: Vec<f32>,
}

/// One frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame<'a> {
    /// `[MAPS][points][points]`.
    pub maps: &'a [u8],
    /// `[SCALARS]`.
    pub scalars: &'a [f32],
    /// `[tags][antennas][READ_CHANNELS]`.
    pub reads: &'a [f32],
    /// `[N * N]`, or empty.
    pub covariance: &'a [f32],
}

impl Frames {
    /// No frames yet.
    pub fn new(points: usize, tags: usize, antennas: usize) -> Self {
        Self { points, tags, antennas, ..Self::default() }
    }

    /// Frames.
    pub fn len(&self) -> usize {
        self.scalars.len() / SCALARS
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.scalars.is_empty()
    }

    /// Adds one at the end.
    pub fn push(&mut self, frame: Frame<'_>) {
        self.maps.extend_from_slice(frame.maps);
        self.scalars.extend_from_slice(frame.scalars);
        self.reads.extend_from_slice(frame.reads);
        self.covariance.extend_from_slice(frame.covariance);
    }

    /// One of them.
    ///
    /// # Panics
    /// If it is not there.
    pub fn frame(&self, number: usize) -> Frame<'_> {
        let of = |size: usize| number * size..(number + 1) * size;
        let covariance = self.covariance.len() / self.len().max(1);
        Frame {
            maps: &self.maps[of(MAPS * self.points * self.points)],
            scalars: &self.scalars[of(SCALARS)],
            reads: &self.reads[of(self.tags * self.antennas * READ_CHANNELS)],
            covariance: &self.covariance[of(covariance)],
        }
    }

    /// Some of them.
    ///
    /// # Panics
    /// If they are not there.
    pub fn part(&self, range: Range<usize>) -> Self {
        let mut part = Self::new(self.points, self.tags, self.antennas);
        range.for_each(|number| part.push(self.frame(number)));
        part
    }
}

/// A labelled sample.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Sample {
    /// What was measured.
    pub frames: Frames,
    /// Number of each tag's object in the set's list of names.
    pub objects: Vec<usize>,
    /// Number of the action; `None` is no interaction.
    pub action: Option<usize>,
    /// Number of the target's tag.
    pub target: Option<usize>,
    /// Where the person is, if it was written down.
    pub pose: Option<Pose>,
    /// Which of the frames one who looks for movement would cut out, if that is known.
    pub window: Option<Range<usize>>,
}

/// Where a person is and looks, as seen from the radar.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Pose {
    /// From the radar, m.
    pub distance_m: f32,
    /// To the right of the radar's boresight, degrees.
    pub bearing_deg: f32,
    /// Where the person looks, degrees; 0 is towards the radar.
    pub facing_deg: f32,
}

/// What the network says of some frames.
#[derive(Debug, Clone, PartialEq)]
pub struct Answer {
    /// Probability of each action, and last that of none.
    pub actions: Vec<f32>,
    /// Probability of each tag to be the target, given that there is one; empty without tags.
    pub targets: Vec<f32>,
}

impl Answer {
    /// Place and value of the largest; the first of equals.
    pub fn best(values: &[f32]) -> Option<(usize, f32)> {
        let mut best: Option<(usize, f32)> = None;
        for (place, &value) in values.iter().enumerate() {
            if best.is_none_or(|(_, largest)| value > largest) {
                best = Some((place, value));
            }
        }
        best
    }
}

/// What the network cannot take.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum InputError {
    /// A slice of another length than the network's shape.
    #[error("{what} has {given} values, the network takes {wanted}")]
    Shape {
        /// Which.
        what: &'static str,
        /// Values given.
        given: usize,
        /// Values wanted.
        wanted: usize,
    },
    /// More tags than [`MAX_TAGS`].
    #[error("{0} tags, {MAX_TAGS} at most")]
    TooManyTags(usize),
    /// More frames than [`MAX_FRAMES`], or none.
    #[error("{0} frames asked for, 1 to {MAX_FRAMES} make an answer")]
    Frames(usize),
    /// Frames that were not pushed, or are no longer kept.
    #[error("frames {first} to {last} are not there")]
    NotThere {
        /// First asked for.
        first: usize,
        /// Past the last.
        last: usize,
    },
    /// A value that is no number.
    #[error("{0} holds a value that is no number")]
    NotFinite(&'static str),
}

/// A network that runs: takes frames as they arrive, and answers for any run of late ones. What belongs to one frame alone is
/// computed once, when it arrives.
pub trait Runner {
    /// Takes the next frame. Frames are numbered from 0 since [`Self::clear`]; the last [`MAX_FRAMES`] are kept.
    ///
    /// # Errors
    /// If the frame has another shape than the network, or another number of tags than the frames before.
    fn push(&mut self, frame: Frame<'_>) -> Result<(), InputError>;

    /// Answers for `frames`, with the vectors of the tags' names, `[tags][dimensions]`.
    ///
    /// # Errors
    /// If frames or names are not what was pushed.
    fn answer(&mut self, frames: Range<usize>, names: &[f32]) -> Result<Answer, InputError>;

    /// Forgets all frames.
    fn clear(&mut self);
}
