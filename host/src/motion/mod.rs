//! Recorded human motion: in, files of motion capture; out, a [`Motion`], the positions of joints over time.
//!
//! | kind | told by | see |
//! |---|---|---|
//! | Acclaim motion (HDM05, CMU) | `:FULLY-SPECIFIED` | [`amc`], with the skeleton of [`asf`] beside it |
//! | Acclaim skeleton | `:version` or another section | [`asf`]: its rest pose, as one frame |
//! | Biovision hierarchy | `HIERARCHY` | [`bvh`] |
//! | Kinect joints (UTKinect-Action3D) | lines of 61 numbers | [`joint_list`] |
//!
//! Axes are those of [`rfhoi_shared::wire::Point`]: to the right, forward, up, in metres. The files are right-handed with
//! y up, and all turn the same way: Kinect's x grows to the sensor's left and z away from it; a figure of ASF or BVH at
//! rest looks along z, its left side at positive x. So (x, y, z) becomes (-x, z, y), and a figure at rest looks forward.
//!
//! A file that breaks its format is an error with its line, not repaired by guessing.

pub mod actions;
pub mod amc;
pub mod asf;
pub mod bvh;
pub mod joint_list;
mod lines;
mod rotation;
mod speed;
#[cfg(test)]
mod tests;

use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

pub use lines::Fault;
pub(crate) use speed::percentile;
pub use speed::{JointSpeed, LONGEST_STEP_S};

/// Bytes of the longest file that is read.
pub const MAX_BYTES: u64 = 256 << 20;
/// Joints of the largest skeleton.
pub const MAX_JOINTS: usize = 256;
/// Positions, joints times frames, of the longest motion: 75 minutes of 31 joints at 120 frames per second.
pub const MAX_POSITIONS: usize = 1 << 24;

/// Why a motion cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum MotionError {
    /// The file cannot be read.
    #[error("cannot read the motion of {path}: {source}")]
    Open {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The file is longer than [`MAX_BYTES`].
    #[error("{path} is longer than {MAX_BYTES} bytes: cut it")]
    TooLong {
        /// The file.
        path: PathBuf,
    },
    /// It is none of the kinds.
    #[error(
        "{path} is no recorded motion: neither ASF, AMC nor BVH, and no lines of 61 numbers (Kinect joints)"
    )]
    UnknownKind {
        /// The file.
        path: PathBuf,
    },
    /// The skeleton of an AMC file is not beside it.
    #[error("{path} needs its skeleton, which is not beside it: looked for {}", tried.join(", "))]
    NoSkeleton {
        /// The file.
        path: PathBuf,
        /// Names that were looked for.
        tried: Vec<String>,
    },
    /// A line breaks the format.
    #[error("{path}, line {}: {}", fault.line, fault.reason)]
    Line {
        /// The file.
        path: PathBuf,
        /// The line and what is wrong with it.
        fault: Fault,
    },
}

/// Kinds of file, told by their first lines.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Acclaim skeleton.
    Asf,
    /// Acclaim motion.
    Amc,
    /// Biovision hierarchy.
    Bvh,
    /// Kinect joints.
    JointList,
}

impl Kind {
    /// What a file is that begins with `head`.
    pub fn of(head: &[u8]) -> Option<Self> {
        let mut lines = head.split(|&b| b == b'\n').map(<[u8]>::trim_ascii);
        let first = lines.find(|l| !l.is_empty() && !l.starts_with(b"#"))?;
        let first = std::str::from_utf8(first).ok()?.trim_start_matches('\u{feff}');
        if amc::KEYWORDS.iter().any(|k| first.eq_ignore_ascii_case(k)) {
            Some(Self::Amc)
        } else if first.split_whitespace().next().is_some_and(asf::is_section) {
            Some(Self::Asf)
        } else if first == bvh::HIERARCHY {
            Some(Self::Bvh)
        } else {
            joint_list::is_row(first).then_some(Self::JointList)
        }
    }
}

/// A joint of a skeleton.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Joint {
    /// Its name in the file.
    pub name: String,
    /// Index of the joint that it hangs on; `None` for the root. Parents come before their children.
    pub parent: Option<usize>,
}

/// Metres to the right, forward and up.
pub type Position = [f32; 3];

/// Positions of joints over time.
#[derive(Debug, Clone, PartialEq)]
pub struct Motion {
    joints: Vec<Joint>,
    numbers: Vec<u32>,
    times_s: Vec<f64>,
    positions: Vec<Position>,
    /// What the file does not say and was assumed, or what was left out, for a person.
    pub notes: Vec<String>,
}

impl Motion {
    fn new(joints: Vec<Joint>) -> Self {
        Self { joints, numbers: Vec::new(), times_s: Vec::new(), positions: Vec::new(), notes: Vec::new() }
    }

    /// Adds a frame with y up, in metres; says what is wrong if it is not later than the last one or one too many.
    fn push(&mut self, number: u32, time_s: f64, y_up: &[[f64; 3]]) -> Result<(), String> {
        if self.times_s.last().is_some_and(|&last| last >= time_s) {
            return Err(format!("frame {number} is not later than the one before it"));
        }
        if self.positions.len() + y_up.len() > MAX_POSITIONS {
            return Err(format!("more than {MAX_POSITIONS} positions of joints: cut the motion"));
        }
        self.numbers.push(number);
        self.times_s.push(time_s);
        self.positions.extend(y_up.iter().map(|&[x, y, z]| [-x as f32, z as f32, y as f32]));
        Ok(())
    }

    /// Reads the motion at `path`, whichever kind it is; of an ASF file the rest pose.
    ///
    /// # Errors
    /// Any [`MotionError`].
    pub fn open(path: impl AsRef<Path>) -> Result<(Kind, Self), MotionError> {
        let path = path.as_ref();
        let text = read(path)?;
        let at = |fault| MotionError::Line { path: path.to_path_buf(), fault };
        let kind =
            Kind::of(text.as_bytes()).ok_or_else(|| MotionError::UnknownKind { path: path.to_path_buf() })?;
        let motion = match kind {
            Kind::Asf => asf::parse(&text).and_then(|skeleton| skeleton.rest()),
            Kind::Amc => {
                let beside = amc::skeleton_beside(path)?;
                let skeleton = asf::parse(&read(&beside)?)
                    .map_err(|fault| MotionError::Line { path: beside.clone(), fault })?;
                amc::parse(&text, &skeleton)
            }
            Kind::Bvh => bvh::parse(&text),
            Kind::JointList => joint_list::parse(&text),
        };
        Ok((kind, motion.map_err(at)?))
    }

    /// The joints, parents before children.
    pub fn joints(&self) -> &[Joint] {
        &self.joints
    }

    /// Numbers of the frames in the file, which labels refer to; rising.
    pub fn numbers(&self) -> &[u32] {
        &self.numbers
    }

    /// Times of the frames in seconds from the first one; rising, in some files with gaps.
    pub fn times_s(&self) -> &[f64] {
        &self.times_s
    }

    /// Positions of all joints, frame by frame.
    pub fn frames(&self) -> impl ExactSizeIterator<Item = &[Position]> {
        self.positions.chunks_exact(self.joints.len().max(1))
    }

    /// Seconds from the first frame to the last.
    pub fn duration_s(&self) -> f64 {
        self.times_s.last().copied().unwrap_or(0.0)
    }

    /// Distance from joint `joint` to its parent in each frame, metres; `None` for the root.
    pub fn bone_lengths_m(&self, joint: usize) -> Option<impl Iterator<Item = f32>> {
        let parent = self.joints.get(joint)?.parent?;
        Some(self.frames().map(move |frame| distance_m(frame[joint], frame[parent])))
    }

    /// How tall the figure stands: from the lowest joint to the highest one of the head (without one, of all), metres.
    /// Of all frames the 95th percentile, as it may stoop in most and a camera errs in some. `None` without frames.
    pub fn height_m(&self) -> Option<f32> {
        let mut head: Vec<usize> = (0..self.joints.len())
            .filter(|&j| self.joints[j].name.to_ascii_lowercase().contains("head"))
            .collect();
        if head.is_empty() {
            head = (0..self.joints.len()).collect();
        }
        let up = |p: Position| p[2];
        let heights = self.frames().map(|frame| {
            let top = head.iter().map(|&j| up(frame[j])).fold(f32::NEG_INFINITY, f32::max);
            top - frame.iter().map(|&p| up(p)).fold(f32::INFINITY, f32::min)
        });
        percentile(heights.collect(), 0.95)
    }
}

fn distance_m(a: Position, b: Position) -> f32 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f32>().sqrt()
}

/// The text of a file. Comments in AMC files may be in any encoding; what is no UTF-8 is replaced.
fn read(path: &Path) -> Result<String, MotionError> {
    let mut bytes = Vec::new();
    File::open(path)
        .and_then(|file| file.take(MAX_BYTES + 1).read_to_end(&mut bytes))
        .map_err(|source| MotionError::Open { path: path.to_path_buf(), source })?;
    if bytes.len() as u64 > MAX_BYTES {
        return Err(MotionError::TooLong { path: path.to_path_buf() });
    }
    Ok(String::from_utf8(bytes)
        .unwrap_or_else(|error| String::from_utf8_lossy(error.as_bytes()).into_owned()))
}
