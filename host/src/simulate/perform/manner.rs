//! Manners of moving: a law of speed, and the ranges that timing, paths, posture and sway are drawn from.
//!
//! With different laws and ranges, so that what is trained on one manner is not tested on the same.

use std::ops::Range;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::stroke::Law;

/// A manner of moving.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Manner {
    /// Minimum-jerk strokes: symmetric speed, nearly straight paths, upright people. Of the domain `train`.
    MinimumJerk,
    /// Minimum-jerk strokes, each skewed in time, of people who differ in all that ranges are known for. Of the domain `train`
    /// in rooms that are drawn.
    Varied,
    /// Sigma-lognormal strokes: fast at first, corrected late; more curved paths, more sway, other timing. Of the domain
    /// `site`.
    SigmaLognormal,
}

/// What the variables of a motion are drawn from, evenly.
#[derive(Debug, Clone)]
pub(super) struct Ranges {
    /// Deviation of lognormal strokes; none for minimum jerk.
    pub(super) sigma: Option<Range<f32>>,
    /// Skew of strokes of minimum jerk.
    pub(super) skew: Range<f64>,
    /// Length of all strokes relative to the usual.
    pub(super) tempo: Range<f32>,
    /// How likely a person hesitates on the way.
    pub(super) hesitation: f64,
    /// How long, s.
    pub(super) pause_s: Range<f64>,
    /// How long hands stay to grasp or let go, s.
    pub(super) dwell_s: Range<f64>,
    /// At rest before and after, s.
    pub(super) before_s: Range<f64>,
    pub(super) after_s: Range<f64>,
    /// How far paths of the hand bow, as a share of their length.
    pub(super) bow: Range<f32>,
    /// How far the arm is stretched when it grasps, as a share of its length.
    pub(super) stretch: Range<f32>,
    /// Turn of the elbow outwards, rad.
    pub(super) swivel: Range<f32>,
    /// Trunk forward at rest, rad.
    pub(super) stoop: Range<f32>,
    /// Ankle to the point below the hip, m.
    pub(super) stance_m: Range<f32>,
    /// Toes outward, rad.
    pub(super) toes_out: Range<f32>,
    /// Amplitude of the hips' sway, m.
    pub(super) sway_m: Range<f32>,
    /// Rates of sway, Hz.
    pub(super) sway_hz: Range<f32>,
    /// Half the chest's way when breathing, m, and the rate, Hz.
    pub(super) breath_m: Range<f32>,
    pub(super) breath_hz: Range<f32>,
    /// How likely the left hand acts.
    pub(super) left: f64,
}

const MINIMUM_JERK: Ranges = Ranges {
    sigma: None,
    skew: 1.0..1.0,
    tempo: 0.8..1.3,
    hesitation: 0.2,
    pause_s: 0.15..0.45,
    dwell_s: 0.16..0.35,
    before_s: 0.25..0.7,
    after_s: 0.25..0.8,
    bow: 0.04..0.16,
    stretch: 0.80..0.92,
    swivel: 0.2..0.6,
    stoop: 0.02..0.07,
    stance_m: 0.01..0.05,
    toes_out: 0.0..0.2,
    sway_m: 0.001..0.003,
    sway_hz: 0.15..0.5,
    breath_m: 0.002..0.004,
    breath_hz: 0.2..0.3,
    left: 0.2,
};

const VARIED: Ranges = Ranges {
    sigma: None,
    skew: 0.72..1.1,
    tempo: 0.75..1.4,
    hesitation: 0.35,
    pause_s: 0.1..0.5,
    dwell_s: 0.14..0.4,
    before_s: 0.15..0.8,
    after_s: 0.15..0.8,
    bow: 0.02..0.36,
    stretch: 0.74..0.93,
    swivel: 0.1..0.9,
    stoop: 0.02..0.10,
    stance_m: 0.01..0.07,
    toes_out: 0.0..0.4,
    sway_m: 0.001..0.007,
    sway_hz: 0.1..0.8,
    breath_m: 0.001..0.006,
    breath_hz: 0.15..0.4,
    left: 0.4,
};

const SIGMA_LOGNORMAL: Ranges = Ranges {
    sigma: Some(0.18..0.32),
    skew: 1.0..1.0,
    tempo: 0.95..1.25,
    hesitation: 0.4,
    pause_s: 0.1..0.5,
    dwell_s: 0.15..0.4,
    before_s: 0.15..0.8,
    after_s: 0.15..0.8,
    bow: 0.12..0.35,
    stretch: 0.74..0.93,
    swivel: 0.1..0.9,
    stoop: 0.03..0.10,
    stance_m: 0.02..0.07,
    toes_out: 0.05..0.4,
    sway_m: 0.002..0.007,
    sway_hz: 0.1..0.8,
    breath_m: 0.001..0.006,
    breath_hz: 0.15..0.4,
    left: 0.35,
};

impl Manner {
    /// All.
    pub const ALL: [Self; 3] = [Self::MinimumJerk, Self::Varied, Self::SigmaLognormal];

    pub(super) const fn ranges(self) -> &'static Ranges {
        match self {
            Self::MinimumJerk => &MINIMUM_JERK,
            Self::Varied => &VARIED,
            Self::SigmaLognormal => &SIGMA_LOGNORMAL,
        }
    }
}

impl Ranges {
    /// The law of the next stroke.
    pub(super) fn law(&self, rng: &mut ChaCha8Rng) -> Law {
        match &self.sigma {
            None if self.skew.is_empty() => Law::MinimumJerk { skew: 1.0 },
            None => Law::MinimumJerk { skew: rng.random_range(self.skew.clone()) },
            Some(sigma) => Law::Lognormal { sigma: rng.random_range(sigma.clone()) },
        }
    }
}
