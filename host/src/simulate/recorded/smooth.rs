//! Recorded joints as smooth functions of time, whatever the rate, its gaps and the tracker's noise.
//!
//! Local quadratic regression (W. S. Cleveland, S. J. Devlin, "Locally weighted regression", J. American Statistical
//! Association 83, 1988) with tricube weights, in a window of a fixed width; gaps are filled with straight lines first.

use std::ops::RangeInclusive;

use glam::Vec3;

use super::joints::Source;
use super::{LONGEST_GAP_S, RecordedError};
use crate::motion::Motion;
use crate::simulate::body::{Joint, Joints, Side};

/// Least half width of the window, s.
const HALF_WIDTH_S: f64 = 0.08;
/// And in frames.
const HALF_WIDTH_FRAMES: f64 = 6.0;
/// Fewest frames that a motion is made of.
const FEWEST: usize = 6;

/// Joints over time, 0 s at the first frame that was asked for; metres, to the right, forward, up.
pub(super) struct Track {
    times_s: Vec<f64>,
    joints: Vec<Joints>,
    duration_s: f64,
    half_width_s: f64,
}

impl Track {
    pub(super) fn new(
        motion: &Motion,
        sources: &[Source; Joint::COUNT],
        frames: RangeInclusive<u32>,
    ) -> Result<Self, RecordedError> {
        let numbers = motion.numbers();
        let first = numbers.partition_point(|n| n < frames.start());
        let end = numbers.partition_point(|n| n <= frames.end());
        let (start, last) = (*frames.start(), *frames.end());
        if end < first + FEWEST {
            let found = end.saturating_sub(first);
            return Err(RecordedError::TooFew { start, end: last, found, needed: FEWEST });
        }
        let times = &motion.times_s()[first..end];
        let mut steps: Vec<f64> = times.windows(2).map(|t| t[1] - t[0]).collect();
        if let Some(at) = steps.iter().position(|&s| s > LONGEST_GAP_S) {
            return Err(RecordedError::Gap { after: numbers[first + at], gap_s: steps[at] });
        }
        steps.sort_by(f64::total_cmp);
        let step_s = steps[steps.len() / 2];
        let mut track = Self {
            times_s: Vec::new(),
            joints: Vec::new(),
            duration_s: times[times.len() - 1] - times[0],
            half_width_s: HALF_WIDTH_S.max(HALF_WIDTH_FRAMES * step_s),
        };
        // Frames just before and after help at the ends.
        let (zero_s, all_s) = (times[0], motion.times_s());
        let last_s = times[times.len() - 1];
        let from = all_s.partition_point(|&t| t < zero_s - track.half_width_s);
        let to = all_s.partition_point(|&t| t <= last_s + track.half_width_s);
        for (&time_s, frame) in all_s[from..to].iter().zip(motion.frames().skip(from)) {
            let (time_s, joints) = (time_s - zero_s, body_joints(sources, frame));
            if let (Some(&before_s), Some(&before)) = (track.times_s.last(), track.joints.last()) {
                let gap_s = time_s - before_s;
                let missing = (gap_s / step_s).round() as u32;
                for i in 1..missing {
                    let share = f64::from(i) / f64::from(missing);
                    track.times_s.push(before_s + share * gap_s);
                    track.joints.push(std::array::from_fn(|j| before[j].lerp(joints[j], share as f32)));
                }
            }
            track.times_s.push(time_s);
            track.joints.push(joints);
        }
        Ok(track)
    }

    pub(super) fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// Joints at `time_s`; before the beginning and after the end those of there.
    pub(super) fn at(&self, time_s: f64) -> Joints {
        let time_s = time_s.clamp(0.0, self.duration_s);
        let from = self.times_s.partition_point(|&t| t <= time_s - self.half_width_s);
        let to = self.times_s.partition_point(|&t| t < time_s + self.half_width_s);
        // Moments of the weights, and the weights with which values make the regression's value in the middle.
        let window: Vec<(f64, f64)> = self.times_s[from..to]
            .iter()
            .map(|t| {
                let u = (t - time_s) / self.half_width_s;
                let cube = 1.0 - (u * u * u).abs();
                (u, cube * cube * cube)
            })
            .collect();
        let [mut m0, mut m1, mut m2, mut m3, mut m4] = [0.0; 5];
        for &(u, w) in &window {
            let (wu, uu) = (w * u, u * u);
            (m0, m1, m2, m3, m4) = (m0 + w, m1 + wu, m2 + w * uu, m3 + wu * uu, m4 + w * uu * uu);
        }
        // First row of the inverse of the normal matrix, times its determinant.
        let row = [m2 * m4 - m3 * m3, m2 * m3 - m1 * m4, m1 * m3 - m2 * m2];
        let determinant = m0 * row[0] + m1 * row[1] + m2 * row[2];
        let mut joints = [Vec3::ZERO; Joint::COUNT];
        for (&(u, w), frame) in window.iter().zip(&self.joints[from..to]) {
            let weight = (w * (row[0] + u * (row[1] + u * row[2])) / determinant) as f32;
            joints.iter_mut().zip(frame).for_each(|(joint, &place)| *joint += place * weight);
        }
        joints
    }
}

/// Length of a leg, m, in the whole motion: what most frames do not exceed. Trackers take bones that point to the camera
/// for shorter than they are.
pub(super) fn leg(motion: &Motion, sources: &[Source; Joint::COUNT]) -> Result<f32, RecordedError> {
    let length = |frame| -> f32 {
        let joints = body_joints(sources, frame);
        let bones =
            Side::BOTH.into_iter().flat_map(|side| [side.leg()[0..2].to_vec(), side.leg()[1..3].to_vec()]);
        bones.map(|bone| 0.5 * joints[bone[0].index()].distance(joints[bone[1].index()])).sum()
    };
    let mut lengths: Vec<f32> = motion.frames().map(length).collect();
    lengths.sort_by(f32::total_cmp);
    let usual = lengths.get(lengths.len() * 3 / 4).copied().unwrap_or_default();
    if usual > 0.0 { Ok(usual) } else { Err(RecordedError::NoSize) }
}

fn body_joints(sources: &[Source; Joint::COUNT], frame: &[[f32; 3]]) -> Joints {
    let mut joints = [Vec3::ZERO; Joint::COUNT];
    let mut put = |derived: bool| {
        for (j, source) in sources.iter().enumerate() {
            match source {
                Source::Of(all) if !derived => {
                    joints[j] = all.iter().map(|&k| Vec3::from(frame[k])).sum::<Vec3>() / all.len() as f32;
                }
                Source::Between(a, b) if derived => joints[j] = joints[a.index()].midpoint(joints[b.index()]),
                Source::Beyond(a, b, share) if derived => {
                    joints[j] = joints[b.index()] + (joints[b.index()] - joints[a.index()]) * *share;
                }
                _ => {}
            }
        }
    };
    put(false);
    // The waist may lie between joints that are derived themselves, and later in the order.
    put(true);
    put(true);
    joints
}
