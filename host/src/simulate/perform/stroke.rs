//! How a movement goes from one value to another: strokes, each with the speed profile of a published law, that add up.
//!
//! Strokes that overlap make a movement through via points without a stop: T. Flash, E. Henis, "Arm trajectory
//! modifications during reaching towards visual targets", J. Cognitive Neuroscience 3 (1991) for minimum jerk, R. Plamondon,
//! "A kinematic theory of rapid human movements", Biological Cybernetics 72 (1995) for lognormal strokes.

use std::ops::{Add, Mul, Range, Sub};

use glam::Vec3;

use crate::simulate::grasp::minimum_jerk;

/// A value that moves.
pub(super) trait Amount:
    Copy + Default + Add<Output = Self> + Sub<Output = Self> + Mul<f32, Output = Self>
{
}

impl Amount for f32 {}
impl Amount for Vec3 {}

/// Speed profile of a stroke.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Law {
    /// The smoothest way from rest to rest ([`minimum_jerk`]), with the stroke's time raised to `skew`: symmetric at 1, fast at
    /// first below, late above.
    MinimumJerk {
        /// Power of time.
        skew: f64,
    },
    /// The speed is lognormal over time, of log-time deviation `sigma`: fast at first, then ever slower.
    Lognormal {
        /// Deviation of the logarithm of time; 0.15 to 0.4 in people.
        sigma: f32,
    },
}

/// A lognormal stroke is called done when its logarithm of time is that many deviations late: 0.13 % are left then.
const DONE: f64 = 3.0;

impl Law {
    /// Share of the way that is done after `u` of the stroke's length.
    pub(super) fn share(self, u: f64) -> f32 {
        if u <= 0.0 {
            return 0.0;
        }
        match self {
            Self::MinimumJerk { skew: 1.0 } => minimum_jerk(u),
            Self::MinimumJerk { skew } => minimum_jerk(libm::pow(u, skew)),
            Self::Lognormal { sigma } => {
                let deviations = libm::log(u) / f64::from(sigma) + DONE;
                (0.5 * libm::erfc(-deviations / std::f64::consts::SQRT_2)) as f32
            }
        }
    }
}

/// A stroke.
#[derive(Debug, Clone, Copy)]
struct Stroke<V> {
    onset_s: f64,
    length_s: f64,
    law: Law,
    shift: V,
    bow: V,
}

/// When a stroke begins, how long it takes, and its speed profile.
#[derive(Debug, Clone, Copy)]
pub(super) struct Timing {
    pub(super) onset_s: f64,
    pub(super) length_s: f64,
    pub(super) law: Law,
}

impl Timing {
    /// A part of the same length of time: from share `from` to share `to` of it.
    pub(super) fn part(&self, from: f64, to: f64) -> Self {
        let onset_s = self.onset_s + from * self.length_s;
        Self { onset_s, length_s: (to - from) * self.length_s, law: self.law }
    }

    /// Its end, s.
    pub(super) fn end_s(&self) -> f64 {
        self.onset_s + self.length_s
    }
}

/// How far a bow is from the straight way where `share` of it is done: 0 at the ends, 1 in the middle, without a kink.
pub(super) fn bow(share: f32) -> f32 {
    let product = share * (1.0 - share);
    16.0 * product * product
}

/// A value over time: where it starts, and strokes.
#[derive(Debug, Clone)]
pub(super) struct Channel<V> {
    start: V,
    strokes: Vec<Stroke<V>>,
}

impl<V: Amount> Channel<V> {
    /// A value that stays at `start` until strokes are added.
    pub(super) fn new(start: V) -> Self {
        Self { start, strokes: Vec::new() }
    }

    /// Moves on to `goal` from where all strokes so far lead to.
    pub(super) fn go_to(&mut self, goal: V, timing: Timing) {
        self.go_by(goal - self.goal(), V::default(), timing);
    }

    /// Moves on by `shift`, and on the way aside by `bow`.
    pub(super) fn go_by(&mut self, shift: V, bow: V, Timing { onset_s, length_s, law }: Timing) {
        self.strokes.push(Stroke { onset_s, length_s, law, shift, bow });
    }

    /// Where all strokes so far lead to.
    pub(super) fn goal(&self) -> V {
        self.strokes.iter().fold(self.start, |sum, stroke| sum + stroke.shift)
    }

    /// From the first stroke's beginning to the last one's end, s.
    pub(super) fn moves_s(&self) -> Range<f64> {
        let ends = |s: &Stroke<V>| (s.onset_s, s.onset_s + s.length_s);
        let join = |a: (f64, f64), b: (f64, f64)| (a.0.min(b.0), a.1.max(b.1));
        let (from, to) = self.strokes.iter().map(ends).reduce(join).unwrap_or_default();
        from..to
    }

    /// The value at `time_s`.
    pub(super) fn at(&self, time_s: f64) -> V {
        self.strokes.iter().fold(self.start, |sum, stroke| {
            let share = stroke.law.share((time_s - stroke.onset_s) / stroke.length_s);
            sum + stroke.shift * share + stroke.bow * bow(share)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Share of the stroke's length at which the speed is highest.
    fn peak(law: Law) -> f64 {
        let speed = |i: &u32| law.share(f64::from(i + 1) / 1e3) - law.share(f64::from(*i) / 1e3);
        f64::from((0..1000).max_by(|a, b| speed(a).total_cmp(&speed(b))).unwrap()) / 1e3
    }

    #[test]
    fn laws_differ_in_where_they_are_fastest() {
        assert!((peak(Law::MinimumJerk { skew: 1.0 }) - 0.5).abs() < 0.01);
        assert!(peak(Law::MinimumJerk { skew: 0.75 }) < 0.42 && peak(Law::MinimumJerk { skew: 1.1 }) > 0.52);
        // The mode of a lognormal: exp(mu - sigma^2), with mu = -3 sigma.
        let sigma: f64 = 0.3;
        let mode = (-DONE * sigma - sigma * sigma).exp();
        assert!((peak(Law::Lognormal { sigma: 0.3 }) - mode).abs() < 0.01, "{mode}");
        for law in [Law::MinimumJerk { skew: 0.75 }, Law::Lognormal { sigma: 0.3 }] {
            assert!(law.share(0.0) == 0.0 && (law.share(1.0) - 1.0).abs() < 2e-3 && law.share(9.0) == 1.0);
        }
    }

    #[test]
    fn strokes_add_up() {
        let mut channel = Channel::new(1.0_f32);
        let timing = Timing { onset_s: 1.0, length_s: 1.0, law: Law::MinimumJerk { skew: 1.0 } };
        channel.go_to(3.0, timing);
        channel.go_to(2.0, Timing { onset_s: 1.5, ..timing });
        assert_eq!((channel.at(0.9), channel.at(9.0), channel.goal()), (1.0, 2.0, 2.0));
        assert!(channel.at(1.7) > 2.0);
    }
}
