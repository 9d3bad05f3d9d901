//! What a body does at rest: it sways and breathes.

use glam::Vec3;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::manner::Ranges;

/// A sine.
#[derive(Debug, Clone, Copy)]
struct Wave {
    amplitude: f32,
    rate_hz: f32,
    phase_rad: f32,
}

impl Wave {
    fn new(amplitude: f32, rate_hz: f32, rng: &mut ChaCha8Rng) -> Self {
        Self { amplitude, rate_hz, phase_rad: rng.random_range(0.0..std::f32::consts::TAU) }
    }

    fn at(&self, time_s: f64) -> f32 {
        let turns = (time_s * f64::from(self.rate_hz)) as f32;
        self.amplitude * libm::sinf(std::f32::consts::TAU * turns + self.phase_rad)
    }
}

/// Sway and breathing of a person.
#[derive(Debug, Clone)]
pub(super) struct Idle {
    /// Of the hips, to the side and forward.
    hips: [[Wave; 2]; 2],
    /// Of the trunk.
    trunk: Wave,
    /// Of hands, forward, left first.
    hands: [Wave; 2],
    breath: Wave,
}

impl Idle {
    pub(super) fn new(ranges: &Ranges, rng: &mut ChaCha8Rng) -> Self {
        let sway = |scale: f32, rng: &mut ChaCha8Rng| {
            let amplitude = scale * rng.random_range(ranges.sway_m.clone());
            let rate_hz = rng.random_range(ranges.sway_hz.clone());
            Wave::new(amplitude, rate_hz, rng)
        };
        let hips = std::array::from_fn(|_| std::array::from_fn(|_| sway(1.0, rng)));
        // A trunk sways by about as much at the shoulders, half a metre above the hips; hands by twice that.
        let (trunk, hands) = (sway(2.0, rng), std::array::from_fn(|_| sway(2.0, rng)));
        let half_m = rng.random_range(ranges.breath_m.clone());
        let breath = Wave::new(half_m, rng.random_range(ranges.breath_hz.clone()), rng);
        Self { hips, trunk, hands, breath }
    }

    /// How far the hips are off, m.
    pub(super) fn hips(&self, time_s: f64) -> Vec3 {
        let [x, y] = self.hips.map(|waves| waves.iter().map(|w| w.at(time_s)).sum());
        Vec3::new(x, y, 0.0)
    }

    /// How far the trunk leans forward, rad.
    pub(super) fn flexion(&self, time_s: f64) -> f32 {
        self.trunk.at(time_s)
    }

    /// How far a hanging hand is off, m.
    pub(super) fn hand(&self, hand: usize, time_s: f64) -> Vec3 {
        Vec3::Y * self.hands[hand].at(time_s)
    }

    /// How far the chest is forward, m.
    pub(super) fn breath_m(&self, time_s: f64) -> f32 {
        self.breath.at(time_s)
    }
}
