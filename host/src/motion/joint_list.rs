//! Lists of Kinect's joints (UTKinect-Action3D): a line for each frame.
//!
//! Format: L. Xia, C.-C. Chen, J. K. Aggarwal, "View invariant human action recognition using histograms of 3D joints",
//! CVPR workshops 2012, and the data set's page. 61 numbers a line: the frame's number, then x, y, z of the 20 joints of
//! Kinect v1 in metres (its SDK's order, `NUI_SKELETON_POSITION_INDEX`). The frame's number counts a camera's frames of
//! 1/30 s; where the tracker was slower it has gaps, and where it is repeated the first of the lines is taken.

use super::lines::{Fault, lines, number};
use super::{Joint, Motion};

/// Rate that the numbers of frames count at.
pub const FRAMES_PER_SECOND: f64 = 30.0;

/// Joints in the order of the file, each with the one that it hangs on.
const JOINTS: [(&str, Option<usize>); 20] = [
    ("hip_center", None),
    ("spine", Some(0)),
    ("shoulder_center", Some(1)),
    ("head", Some(2)),
    ("shoulder_left", Some(2)),
    ("elbow_left", Some(4)),
    ("wrist_left", Some(5)),
    ("hand_left", Some(6)),
    ("shoulder_right", Some(2)),
    ("elbow_right", Some(8)),
    ("wrist_right", Some(9)),
    ("hand_right", Some(10)),
    ("hip_left", Some(0)),
    ("knee_left", Some(12)),
    ("ankle_left", Some(13)),
    ("foot_left", Some(14)),
    ("hip_right", Some(0)),
    ("knee_right", Some(16)),
    ("ankle_right", Some(17)),
    ("foot_right", Some(18)),
];
const WORDS: usize = 1 + 3 * JOINTS.len();

/// Whether `line` looks like a frame.
pub(super) fn is_row(line: &str) -> bool {
    let words: Vec<&str> = line.split_whitespace().collect();
    words.len() == WORDS
        && words[0].parse::<u32>().is_ok()
        && words[1..].iter().all(|w| w.parse::<f64>().is_ok())
}

/// Reads a motion.
///
/// # Errors
/// The first line that breaks the format.
pub fn parse(text: &str) -> Result<Motion, Fault> {
    let joints = JOINTS.map(|(name, parent)| Joint { name: name.to_owned(), parent });
    let mut motion = Motion::new(joints.to_vec());
    let mut repeated = 0;
    for (line, words) in lines(text) {
        if words.len() != WORDS {
            return Err(Fault::new(line, format!("need {WORDS} numbers, found {} words", words.len())));
        }
        let frame: u32 = words[0]
            .parse()
            .map_err(|_| Fault::new(line, "the number of the frame is no whole number from 0"))?;
        if motion.numbers().last() == Some(&frame) {
            repeated += 1;
            continue;
        }
        let values: Vec<f64> = words[1..].iter().map(|w| number(line, w)).collect::<Result<_, _>>()?;
        let places: Vec<[f64; 3]> = values.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect();
        let first = motion.numbers().first().copied().unwrap_or(frame);
        let time_s = (f64::from(frame) - f64::from(first)) / FRAMES_PER_SECOND;
        motion.push(frame, time_s, &places).map_err(|reason| Fault::new(line, reason))?;
    }
    if motion.numbers().is_empty() {
        return Err(Fault::new(1, "the motion has no frames"));
    }
    if repeated > 0 {
        motion
            .notes
            .push(format!("{repeated} lines repeat the number of the frame before and were left out"));
    }
    Ok(motion)
}
