//! What the phase pipeline rests on.

use std::f64::consts::PI;

use rfhoi_shared::scene::Scene;
use rfhoi_shared::units::{ChannelIndex, Kilohertz};

use super::ChannelPlan;
use super::calibration::LearningRule;

/// Middle of the FCC's band, and what stands for a channel that is not in the plan; the edges differ by 1.4 %.
const MIDDLE: Kilohertz = Kilohertz(915_000);

/// What the pipeline rests on.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// The scene; its fastest tag limits how long a step may take where nothing is known of the tag's speed.
    pub scene: Scene,
    /// The reader's channels.
    pub channels: ChannelPlan,
    /// When offsets are learnt.
    pub learning: LearningRule,
    /// How near to pi a step must be to look like a flip of the carrier's sign, radians.
    pub flip_tolerance: f64,
    /// Standard deviation of a handled tag's acceleration, m/s^2.
    pub acceleration: f64,
    /// Phase noise of a read before it has been measured, standard deviation, radians.
    pub noise: f64,
    /// Measured phase noise past which steps are [too noisy](super::Invalid::TooNoisy), radians.
    pub largest_noise: f64,
    /// Longest time that a read holds for a frame's border while the tag rests, us. While it does not rest, that is the
    /// scene's longest read interval.
    pub hold_us: u64,
    /// How much later than others a read may come and still be put in its place, us.
    pub reorder_us: u64,
    /// How much earlier than its packet a read may be, us.
    pub latest_us: u64,
    /// How much later than its packet a read may be, us: rounding and the mapping of clocks.
    pub lead_us: u64,
    /// How much later than at their quickest reads may come for a second, us, before their clock counts as wrong.
    pub lag_us: u64,
}

impl Default for Settings {
    fn default() -> Self {
        // Three standard deviations of the difference of two reads with noise of 0.1 rad each.
        const FLIP_TOLERANCE: f64 = 0.42;
        Self {
            scene: Scene::default(),
            channels: ChannelPlan::default(),
            learning: LearningRule::default(),
            flip_tolerance: FLIP_TOLERANCE,
            // With GATE that admits 25 m/s^2. A reach of 0.4 m in 0.8 s takes 3.6, in 0.4 s 14.4 (minimum jerk,
            // 5.77 D / T^2).
            acceleration: 5.5,
            noise: 0.1,
            largest_noise: 0.3,
            hold_us: 500_000,
            // Three times the bridge's patience with reads.
            reorder_us: 30_000,
            latest_us: 500_000,
            lead_us: 10_000,
            lag_us: 25_000,
        }
    }
}

impl Settings {
    /// Half-width of what is plausible, in standard deviations: noise is beyond in 1 of 150,000 steps.
    pub(super) const GATE: f64 = 4.5;
    /// The same of hops, which are fewer and err more often, and of looks at rest: 1 of 370.
    pub(super) const HOP_GATE: f64 = 3.0;

    /// How far the phase turns by one metre of the tag's distance on `channel`, radians.
    pub(super) fn radians_per_metre(&self, channel: ChannelIndex) -> f64 {
        let wavelength = self.channels.frequency(channel).unwrap_or(MIDDLE).wavelength();
        4.0 * PI / f64::from(wavelength.0)
    }

    /// How much more than in the band's middle the phase turns on `channel`, as a share.
    pub(super) fn dispersion(&self, channel: ChannelIndex) -> f64 {
        self.channels.frequency(channel).map_or(0.0, |f| f64::from(f.0) / f64::from(MIDDLE.0) - 1.0)
    }

    /// Longest time between reads whose difference has one meaning for the scene's fastest tag, us.
    pub(super) fn longest_us(&self, channel: ChannelIndex) -> f64 {
        f64::from(self.scene.longest_read_interval(self.channels.frequency(channel)).0) * 1e6
    }
}
