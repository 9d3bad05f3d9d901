//! The ways to break it.

use std::f64::consts::TAU;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rfhoi_shared::config::{ClutterRemoval, RadarConfig};
use rfhoi_shared::units::Seconds;

use super::super::{Case, Measure, Stress, Trial};
use super::rig::{ahead, amplitude, config, frames, square, strongest};
use crate::maps::{Flaw, VelocityGuard};
use crate::receive::RadarFrame;

const SAMPLES: u16 = 64;
const LOOPS: u16 = 32;
/// A wall, dB of full scale.
const WALL_DB: f64 = -20.0;

fn bin_m(config: &RadarConfig) -> f64 {
    config.profile.range_bin().0.into()
}

/// A trial of which the guard is a map's flaw.
fn judged(error: f64, guard: bool, flaw: Option<Flaw>) -> Trial {
    Trial { error, announced: flaw.filter(|_| guard).map(Flaw::reason) }
}

const RANGE: Measure = Measure { label: "Range error of the strongest echo", unit: "bins", tolerance: 1.5 };

/// A hand faster than the Doppler of TDM can tell.
pub(super) struct TdmSpeed;

impl Case for TdmSpeed {
    fn name(&self) -> &'static str {
        "tdm-speed"
    }

    fn about(&self) -> &'static str {
        "Radial speed beyond the span of TDM, where velocity folds and the compensated angle is wrong; the guard compares the \
         range walk from frame to frame with the Doppler."
    }

    fn stress(&self) -> Stress {
        let values = &[0.2, 0.4, 0.6, 0.8, 0.95, 1.05, 1.2, 1.4, 1.6, 1.8, 2.0, 2.2, 2.5];
        Stress { label: "Radial speed", unit: "span", values }
    }

    fn measure(&self) -> Measure {
        Measure { label: "Velocity error of the strongest echo", unit: "m/s", tolerance: 0.5 }
    }

    fn trial(&self, stress: f64, guard: bool, rng: &mut ChaCha8Rng) -> Trial {
        let config = config(SAMPLES, LOOPS, ClutterRemoval::Mean);
        let span = f64::from(config.profile.velocity_span().0);
        let velocity = stress * span * if rng.random() { 1.0 } else { -1.0 };
        // In sight in both frames.
        let walk = velocity * f64::from(config.profile.frame_period().0);
        let range = rng.random_range(1.3..4.0) - walk / 2.0;
        let wall = ahead(rng.random_range(1.0..5.0), 0.0, amplitude(WALL_DB));
        let level = rng.random_range(-40.0..-20.0);
        let frames =
            frames(&config, 2, rng, |_| vec![ahead(range, velocity, amplitude(level)), wall], |_| false);
        let Some((_, column, _)) = frames.last().and_then(strongest) else {
            return Trial { error: f64::INFINITY, announced: None };
        };
        let seen = (column - f64::from(LOOPS / 2)) * f64::from(config.profile.velocity_bin().0);
        let mut velocity_guard = VelocityGuard::new(&config);
        let said = frames.iter().map(|f| velocity_guard.frame(f)).last();
        let announced = said.and_then(|velocity| velocity.reason()).filter(|_| guard);
        Trial { error: (seen - velocity).abs(), announced }
    }
}

/// A person who sways less and less.
pub(super) struct StandingStill;

impl Case for StandingStill {
    fn name(&self) -> &'static str {
        "clutter-standing-still"
    }

    fn about(&self) -> &'static str {
        "A person who stands ever stiller, with the frame's mean taken off; the guard is that of an empty map."
    }

    fn stress(&self) -> Stress {
        let values = &[-10.0, -5.0, -2.0, -1.0, -0.5, -0.2, -0.1, -0.05, -0.02, -0.01, 0.0];
        Stress { label: "Amplitude of the sway, negated", unit: "mm", values }
    }

    fn measure(&self) -> Measure {
        RANGE
    }

    fn trial(&self, stress: f64, guard: bool, rng: &mut ChaCha8Rng) -> Trial {
        /// Postural sway.
        const SWAY_HZ: f64 = 0.4;
        let config = config(SAMPLES, LOOPS, ClutterRemoval::Mean);
        let (sin, cos) = rng.random_range(0.0..TAU).sin_cos();
        let metres = -stress * 1e-3;
        let range = rng.random_range(1.0..4.0) + metres * sin;
        let person = ahead(range, metres * cos * TAU * SWAY_HZ, amplitude(-40.0));
        let wall = ahead(rng.random_range(1.0..5.0), 0.0, amplitude(WALL_DB));
        let frames = frames(&config, 1, rng, |_| vec![person, wall], |_| false);
        range_trial(&config, frames.last(), range, guard)
    }
}

/// Range error of the strongest echo, and what the maps say.
fn range_trial(config: &RadarConfig, frame: Option<&RadarFrame>, range_m: f64, guard: bool) -> Trial {
    let found = frame.and_then(|f| Some((strongest(f)?, square(config, f)?.1)));
    let Some(((row, _, _), state)) = found else {
        return Trial { error: f64::INFINITY, announced: guard.then_some(Flaw::Missing.reason()) };
    };
    judged((row - range_m / bin_m(config)).abs(), guard, state.range_doppler.flaw)
}

/// A person who stands still for longer than the background's memory.
pub(super) struct BackgroundStill;

impl Case for BackgroundStill {
    fn name(&self) -> &'static str {
        "clutter-background"
    }

    fn about(&self) -> &'static str {
        "A person who stands perfectly still and becomes part of the background; the guard is that of an empty map."
    }

    fn stress(&self) -> Stress {
        let values = &[1.0, 2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 14.0];
        Stress { label: "Time stood still", unit: "time constants", values }
    }

    fn measure(&self) -> Measure {
        RANGE
    }

    fn trial(&self, stress: f64, guard: bool, rng: &mut ChaCha8Rng) -> Trial {
        /// Frames of a time constant, short, so that few frames are many of it.
        const FRAMES: f64 = 2.0;
        let mut config = config(32, 16, ClutterRemoval::Off);
        let time_constant = Seconds(config.profile.frame_period().0 * FRAMES as f32);
        config.processing.clutter = ClutterRemoval::Background { time_constant };
        let range = rng.random_range(1.0..4.0);
        let person = ahead(range, 0.0, amplitude(-40.0));
        let wall = ahead(rng.random_range(1.0..5.0), 0.0, amplitude(WALL_DB));
        let scene = |frame| if frame == 0 { vec![wall] } else { vec![wall, person] };
        let frames = frames(&config, 1 + (stress * FRAMES) as u32, rng, scene, |_| false);
        range_trial(&config, frames.last(), range, guard)
    }
}

/// An echo beyond full scale.
pub(super) struct FullScale;

impl Case for FullScale {
    fn name(&self) -> &'static str {
        "storage-full-scale"
    }

    fn about(&self) -> &'static str {
        "An echo that drives the ADC beyond full scale; the guard counts clipped words and cells at the end of the scale."
    }

    fn stress(&self) -> Stress {
        let values = &[-12.0, -6.0, -4.0, 0.0, 2.0, 4.0, 6.0, 10.0, 20.0];
        Stress { label: "Level", unit: "dB of full scale", values }
    }

    fn measure(&self) -> Measure {
        Measure { label: "Level error of the echo", unit: "dB", tolerance: 1.0 }
    }

    fn trial(&self, stress: f64, guard: bool, rng: &mut ChaCha8Rng) -> Trial {
        // In the middle of its range bin and Doppler bin, where the window takes nothing off.
        let config = config(SAMPLES, LOOPS, ClutterRemoval::Mean);
        let bin: u32 = rng.random_range(10..50);
        let column: u32 = rng.random_range(4..12);
        let velocity = f64::from(column) * f64::from(config.profile.velocity_bin().0);
        let mid_frame =
            config.profile.chirp_period_ns() as f64 * 1e-9 * f64::from(config.profile.chirps_per_frame())
                / 2.0;
        let range = f64::from(bin) * bin_m(&config) - velocity * mid_frame;
        let frames = frames(&config, 1, rng, |_| vec![ahead(range, velocity, amplitude(stress))], |_| false);
        let found = frames.last().and_then(|f| Some((strongest(f)?, square(&config, f)?.1)));
        let Some(((row, _, level), state)) = found else {
            return Trial { error: f64::INFINITY, announced: None };
        };
        let error = if (row - f64::from(bin)).abs() < 1.5 { (level - stress).abs() } else { f64::INFINITY };
        judged(error, guard, state.range_doppler.flaw)
    }
}

/// An echo that vanishes in noise.
pub(super) struct Tiny;

impl Case for Tiny {
    fn name(&self) -> &'static str {
        "storage-tiny"
    }

    fn about(&self) -> &'static str {
        "An echo far below one step of the ADC, in noise of two; the guard is that of an empty map."
    }

    fn stress(&self) -> Stress {
        let values = &[40.0, 60.0, 80.0, 90.0, 96.0, 102.0, 108.0, 114.0, 120.0];
        Stress { label: "Level below full scale", unit: "dB", values }
    }

    fn measure(&self) -> Measure {
        RANGE
    }

    fn trial(&self, stress: f64, guard: bool, rng: &mut ChaCha8Rng) -> Trial {
        let config = config(SAMPLES, LOOPS, ClutterRemoval::Mean);
        let range = rng.random_range(1.0..4.0);
        let echo = ahead(range, rng.random_range(1.0..4.0), amplitude(-stress));
        let frames = frames(&config, 1, rng, |_| vec![echo], |_| false);
        range_trial(&config, frames.last(), range, guard)
    }
}

/// Chirps that the network loses.
pub(super) struct ChirpsLost;

impl Case for ChirpsLost {
    fn name(&self) -> &'static str {
        "frame-holes"
    }

    fn about(&self) -> &'static str {
        "A growing share of a frame's chirps is lost, and side lobes of a strong echo cover a weak one; the guard is the \
         share that was lost."
    }

    fn stress(&self) -> Stress {
        let values = &[0.0, 0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.7, 0.9, 1.0];
        Stress { label: "Chirps lost", unit: "", values }
    }

    fn measure(&self) -> Measure {
        Measure { label: "Level error of the weak echo", unit: "dB", tolerance: 3.0 }
    }

    fn trial(&self, stress: f64, guard: bool, rng: &mut ChaCha8Rng) -> Trial {
        /// The weak echo, below the strong one.
        const BELOW_DB: f64 = 10.0;
        let config = config(SAMPLES, LOOPS, ClutterRemoval::Mean);
        let step = f64::from(config.profile.velocity_bin().0);
        // The same range: only Doppler keeps them apart.
        let bin: u32 = rng.random_range(10..50);
        let range = f64::from(bin) * bin_m(&config);
        let columns = [rng.random_range(4..10), rng.random_range(-10..-4)];
        let [strong, weak] = [(columns[0], 0.0), (columns[1], BELOW_DB)]
            .map(|(c, below)| ahead(range, f64::from(c) * step, amplitude(-20.0 - below)));
        let lost: Vec<bool> =
            (0..config.profile.chirps_per_frame()).map(|_| rng.random_range(0.0..1.0) < stress).collect();
        let frames = frames(&config, 1, rng, |_| vec![strong, weak], |chirp| lost[chirp as usize]);
        let found = frames.last().and_then(|f| Some((f.range_doppler.as_ref()?, square(&config, f)?.1)));
        let Some((map, state)) = found else {
            return Trial { error: f64::INFINITY, announced: guard.then_some(Flaw::Missing.reason()) };
        };
        let column = (i32::from(LOOPS / 2) + columns[1]) as usize;
        let level = f64::from(map.level_db(bin as usize, column));
        judged((level + 20.0 + BELOW_DB).abs(), guard, state.range_doppler.flaw)
    }
}

/// Rows of a map that the network loses.
pub(super) struct RowsLost;

impl Case for RowsLost {
    fn name(&self) -> &'static str {
        "rows-lost"
    }

    fn about(&self) -> &'static str {
        "A growing share of a map's rows is lost; few neighbouring ones are filled, more are the guard's."
    }

    fn stress(&self) -> Stress {
        let values = &[0.0, 0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 0.9, 1.0];
        Stress { label: "Rows lost", unit: "", values }
    }

    fn measure(&self) -> Measure {
        RANGE
    }

    fn trial(&self, stress: f64, guard: bool, rng: &mut ChaCha8Rng) -> Trial {
        let config = config(SAMPLES, LOOPS, ClutterRemoval::Mean);
        let velocity = rng.random_range(0.5..4.0);
        let range = rng.random_range(1.0..4.0);
        let lost: Vec<bool> =
            (0..config.processing.gate.bins).map(|_| rng.random_range(0.0..1.0) < stress).collect();
        let mut frames =
            frames(&config, 1, rng, |_| vec![ahead(range, velocity, amplitude(-30.0))], |_| false);
        let Some(frame) = frames.last_mut() else { return Trial { error: f64::INFINITY, announced: None } };
        if let Some(map) = &mut frame.range_doppler {
            for (row, _) in lost.iter().enumerate().filter(|(_, lost)| **lost) {
                map.arrived[row] = false;
                map.codes[row * map.columns..(row + 1) * map.columns].fill(0);
            }
        }
        let Some((mut squared, state)) = square(&config, frame) else {
            return Trial { error: f64::INFINITY, announced: None };
        };
        if !guard && state.range_doppler.flaw == Some(Flaw::RowsMissing) {
            // Without the guard the rows are as they came: empty.
            let codes = frame.range_doppler.iter().flat_map(|map| &map.codes);
            squared = codes.map(|&code| code.into()).collect();
        }
        let columns = squared.len() / usize::from(config.processing.gate.bins);
        let best = squared.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1));
        let row = best.map_or(f64::INFINITY, |(at, _)| (at / columns) as f64);
        judged((row - range / bin_m(&config)).abs(), guard, state.range_doppler.flaw)
    }
}
