//! How a thing comes into a hand, is carried, and is left.

use glam::{Quat, Vec3};

use super::stage::Pose;

/// Fingers close on a thing, or open, within this time, s.
pub(crate) const GRASP_S: f64 = 0.12;

/// The smoothest way from rest to rest, share of it after `u` of the time: 10 u^3 - 15 u^4 + 6 u^5 (T. Flash, N. Hogan,
/// "The coordination of arm movements", J. Neuroscience 5, 1985).
pub(crate) fn minimum_jerk(u: f64) -> f32 {
    let u = u.clamp(0.0, 1.0) as f32;
    u * u * u * (10.0 + u * (6.0 * u - 15.0))
}

/// A thing that lies, is taken, carried and left, or a part of that.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Grasp {
    /// Where it lies.
    pub(crate) rest: Pose,
    /// Where the middle of the grip is, on the thing, m.
    pub(crate) grip: Vec3,
    /// When the hand begins to take it and to leave it, s; infinite for never, negative for before the beginning.
    pub(crate) taken_s: f64,
    pub(crate) left_s: f64,
}

impl Grasp {
    /// Where the thing is when the hand is at `hand` and has turned it by `tilt`.
    pub(crate) fn pose(&self, hand: Vec3, tilt: Quat, time_s: f64) -> Pose {
        let eased = |since: f64| minimum_jerk((time_s - since) / GRASP_S);
        let turn = tilt * self.rest.turn;
        let in_hand = Pose { at: hand - turn * self.grip, turn };
        self.rest.towards(&in_hand, eased(self.taken_s) * (1.0 - eased(self.left_s)))
    }
}
