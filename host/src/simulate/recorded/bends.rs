//! Where elbows and knees bend to, over time: no faster than people turn them.
//!
//! Trackers err by some centimetres, so the side to which a limb that is nearly straight bends is noise, and would flip from
//! frame to frame with the elbow at ten metres a second.

use glam::{Quat, Vec3};

/// Step of the grid on which bends are known, s.
const STEP_S: f64 = 0.01;
/// How fast a limb turns about the line from its root to its end, rad/s.
const FASTEST_RAD_S: f32 = 6.0;
/// Weight of the usual bend. Where a limb was seen is a unit vector, so its part off the line is the sine of its angle to it: less
/// than 20 degrees is not to be trusted.
const USUAL: f32 = 0.35;

/// Where an elbow or knee is off the line along `out` from its root to its end: to where it was `seen`, and a little to where
/// it usually bends, which decides for straight limbs.
pub(super) fn bent(seen: Vec3, usual: Vec3, out: Vec3) -> Vec3 {
    (seen + USUAL * usual).reject_from_normalized(out).normalize_or(out.any_orthonormal_vector())
}

/// The bends of both arms and both legs from 0 s on.
#[derive(Debug, Clone, Default)]
pub(super) struct Bends {
    keys: Vec<[Vec3; 4]>,
}

impl Bends {
    /// Times at which bends are to be [followed](Self::follow), s.
    pub(super) fn times(duration_s: f64) -> impl Iterator<Item = f64> {
        (0..=(duration_s / STEP_S).ceil() as u32).map(|key| f64::from(key) * STEP_S)
    }

    /// Begins the next time.
    pub(super) fn begin_time(&mut self) {
        self.keys.push(self.keys.last().copied().unwrap_or_default());
    }

    /// Turns the bend of `limb` towards `wanted`, about `out`, as far as it can be by now.
    pub(super) fn follow(&mut self, limb: usize, wanted: Vec3, out: Vec3) -> Vec3 {
        const MOST: f32 = FASTEST_RAD_S * STEP_S as f32;
        let Some(key) = self.keys.last_mut() else { return wanted };
        let now = key[limb].reject_from_normalized(out).normalize_or(wanted);
        let angle = libm::atan2f(out.dot(now.cross(wanted)), now.dot(wanted));
        key[limb] = Quat::from_axis_angle(out, angle.clamp(-MOST, MOST)) * now;
        key[limb]
    }

    /// The bend of `limb` at `time_s`; `wanted` where it is not known.
    pub(super) fn at(&self, limb: usize, time_s: f64, wanted: Vec3, out: Vec3) -> Vec3 {
        let Some(last) = self.keys.len().checked_sub(1) else { return wanted };
        let at = (time_s / STEP_S).clamp(0.0, last as f64);
        let before = at.floor() as usize;
        let [from, to] = [before, (before + 1).min(last)].map(|key| self.keys[key][limb]);
        from.lerp(to, (at - before as f64) as f32).reject_from_normalized(out).normalize_or(wanted)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bends_that_flip_turn_no_faster_than_people_do() {
        let mut bends = Bends::default();
        for (n, time_s) in Bends::times(1.0).enumerate() {
            bends.begin_time();
            // From 0.4 s on it is seen on the other side.
            let wanted = if time_s < 0.4 { Vec3::X } else { Vec3::NEG_X };
            let now = bends.follow(2, wanted, Vec3::Z);
            assert!(now.is_normalized() && now.z.abs() < 1e-6, "{n}");
        }
        let at = |time_s: f64| bends.at(2, time_s, Vec3::Y, Vec3::Z);
        assert!(at(0.3).distance(Vec3::X) < 1e-5 && at(1.0).distance(Vec3::NEG_X) < 1e-5);
        let mut turned = 0.0;
        for n in 0..100 {
            let step = at(f64::from(n) * 0.01).angle_between(at(f64::from(n + 1) * 0.01));
            assert!(step < 1.01 * FASTEST_RAD_S * 0.01, "{step} rad at step {n}");
            turned += step;
        }
        assert!((turned - std::f32::consts::PI).abs() < 0.01, "{turned}");
        assert_eq!(Bends::default().at(0, 0.3, Vec3::Y, Vec3::Z), Vec3::Y);
    }
}
