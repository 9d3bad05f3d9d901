//! How fast joints move.

use super::{Motion, distance_m};

/// Longest step from frame to frame that a speed is taken from: over a longer gap the path between is unknown.
pub const LONGEST_STEP_S: f64 = 0.2;

/// How a joint moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointSpeed {
    /// Length of its path over the steps up to [`LONGEST_STEP_S`], metres.
    pub path_m: f32,
    /// 95th percentile of the speeds from frame to frame, m/s: what the joint reaches often, whatever a tracker's jumps.
    pub usual_top_m_s: f32,
    /// Highest speed from frame to frame, m/s.
    pub peak_m_s: f32,
}

/// The value that `share` of `values` are below; `None` of no values.
pub(crate) fn percentile(mut values: Vec<f32>, share: f64) -> Option<f32> {
    let last = values.len().checked_sub(1)?;
    let (_, value, _) = values.select_nth_unstable_by((last as f64 * share).round() as usize, f32::total_cmp);
    Some(*value)
}

impl Motion {
    /// How joint `joint` moves; `None` if there are no two frames close enough, or no such joint.
    pub fn speed(&self, joint: usize) -> Option<JointSpeed> {
        self.joints().get(joint)?;
        let (mut path_m, mut speeds) = (0.0, Vec::new());
        let steps = self.times_s().windows(2).map(|t| t[1] - t[0]);
        for (step_s, (before, after)) in steps.zip(self.frames().zip(self.frames().skip(1))) {
            if step_s <= LONGEST_STEP_S {
                let way_m = distance_m(before[joint], after[joint]);
                path_m += way_m;
                speeds.push(way_m / step_s as f32);
            }
        }
        let peak_m_s = speeds.iter().copied().fold(0.0, f32::max);
        Some(JointSpeed { path_m, usual_top_m_s: percentile(speeds, 0.95)?, peak_m_s })
    }

    /// The joint with the highest usual top speed; `None` if there are no two frames close enough.
    pub fn fastest(&self) -> Option<(usize, JointSpeed)> {
        let speeds = (0..self.joints().len()).filter_map(|j| Some((j, self.speed(j)?)));
        speeds.max_by(|(_, a), (_, b)| a.usual_top_m_s.total_cmp(&b.usual_top_m_s))
    }
}
