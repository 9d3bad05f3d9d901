//! Which hand touches a thing, and when, where nobody says.

use glam::Vec3;

use super::{Recorded, times};
use crate::simulate::Performance;
use crate::simulate::body::{Joint, Side};

/// Heights count so much more than ways over the floor: things lie lower or higher than hands hang, while hands also go to and fro
/// when people turn and walk.
const UPWARDS: f32 = 2.0;

impl Recorded {
    /// The hand that touches something, and when, s: that hand, and the moment, which is farthest both from where the hand began
    /// and from where it ended, as somebody sees it who goes along with the hips. Of a hand that never leaves its place it says
    /// nothing.
    pub fn touch(&self) -> (Side, f64) {
        let duration_s = self.duration_s();
        let seen = |side: Side, time_s: f64| {
            let joints = self.joints(time_s);
            let hips = joints[Joint::HipCentre.index()].with_z(0.0);
            (joints[side.hand().index()] - hips) * Vec3::new(1.0, 1.0, UPWARDS)
        };
        let turned = |(side, time_s): (Side, f64)| {
            let [began, ended] =
                [0.0, duration_s].map(|end_s| seen(side, time_s).distance(seen(side, end_s)));
            began.min(ended)
        };
        let moments = |side| times(duration_s).map(move |time_s| (side, time_s));
        let all = Side::BOTH.into_iter().flat_map(moments);
        all.max_by(|&a, &b| turned(a).total_cmp(&turned(b))).unwrap_or((Side::Right, 0.0))
    }
}
